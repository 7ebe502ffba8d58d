"""Motions that nothing is attempted from, since others lead to better plans: they are slow, and
keep limits where those may not. Where every attempt fails they are what is left."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from deltaopt.errors import RULED_OUT, if_possible
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.first_motions.around_bodies import with_stops
from deltaopt.planning.first_motions.moving_ends import from_state_to_state
from deltaopt.planning.first_motions.passages import paths_of_lines
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.scene import Scene

_KEPT = 0.9
"""Share of the limits that a quintic whose end moves takes at samples: between them it may take
more."""
_PATHS = 2
"""How many paths of straight lines past bodies are driven."""


def slow_motions(scene: Scene) -> Iterator[Trajectory]:
    """A quintic that keeps limits where an end moves; past bodies motions from rest to rest along
    paths of straight lines, with a stop at each of their corners."""
    if scene.task.gates:
        return
    found: Iterator[Trajectory | None] = iter(())
    if scene.moves_at_ends:
        found = iter([if_possible(RULED_OUT, from_state_to_state, scene, _KEPT)])
    elif limits_of(scene).constraints.has_convex and scene.tube is None:
        found = (with_stops(scene, corners) for corners in islice(paths_of_lines(scene), _PATHS))
    yield from (each for each in found if each)
