"""All kinds of attempts."""

from __future__ import annotations

from studies.attack.additions import own_limits, own_terms
from studies.attack.attempts import Kind
from studies.attack.exports import exports
from studies.attack.motions import damaged, extremes, motions, strays, triples

COSTLY = (own_limits, own_terms)
"""Of which there are fewer attempts."""
KINDS: dict[str, Kind] = {
    kind.__name__: kind for kind in (motions, damaged, strays, triples, extremes, exports, *COSTLY)
}
