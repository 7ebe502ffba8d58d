"""Motions that nothing is attempted from, since others lead to better plans: they are slow, and
keep limits where those may not. Where every attempt fails they are what is left."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from deltaopt.errors import RULED_OUT, if_possible
from deltaopt.planning.first_motions.around_bodies import with_stops
from deltaopt.planning.first_motions.moving_ends import first_moving_motions
from deltaopt.planning.first_motions.passages import paths_of_lines
from deltaopt.planning.first_motions.proposal import Proposal
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.scene import Scene

_KEPT = 0.9
"""Share of the limits that motions whose end moves take at samples: between them they may take
more."""
_PATHS = 2
"""How many paths of straight lines past bodies are driven."""


def slow_motions(scene: Scene) -> Iterator[Proposal]:
    """Where an end moves its first motions, well within the limits; past bodies motions from rest
    to rest along paths of straight lines, with a stop at each of their corners."""
    if scene.task.gates:
        return
    if scene.moves_at_ends:
        well_within = if_possible(RULED_OUT, list, first_moving_motions(scene, None, _KEPT))
        yield from well_within or ()
    elif limits_of(scene).constraints.has_convex and scene.tube is None:
        for corners in islice(paths_of_lines(scene), _PATHS):
            motion = with_stops(scene, corners)
            if motion is not None:
                yield Proposal("straight lines with a stop at each corner", motion)
