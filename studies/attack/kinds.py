"""All kinds of attempts."""

from __future__ import annotations

from studies.attack import additions, exports, motions
from studies.attack.attempts import Kind

KINDS: dict[str, Kind] = {
    **motions.KINDS,
    **exports.KINDS,
    **additions.KINDS,
}
COSTLY = frozenset({"own_limits", "own_terms"})
"""Kinds of which there are fewer attempts."""
