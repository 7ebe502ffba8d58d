"""All kinds of attempts."""

from __future__ import annotations

from studies.attack import additions, commands, data_files, motions, python_calls, scene_files
from studies.attack.attempts import Kind

KINDS: dict[str, Kind] = {
    **scene_files.KINDS,
    **data_files.KINDS,
    **commands.KINDS,
    **python_calls.KINDS,
    **motions.KINDS,
    **additions.KINDS,
}
COSTLY = frozenset({"own_limits", "own_terms", "caches"})
"""Kinds of which there are fewer attempts."""
