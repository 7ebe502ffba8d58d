"""Motions with points between, or with an end that moves, past bodies and without: leg by leg.

Each leg is planned from rest to rest, past bodies with all ways that this knows, and the legs are
joined; a start that moves comes to rest first, and a goal that is passed at a velocity has a
run-up. Such a motion is far from the best but on its side of every body: a first motion, and the
plan where none leads to another: `Loop.at_worst`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import reduce
from itertools import pairwise

from deltaopt.errors import NO_PLAN, RULED_OUT, Infeasible, in_words
from deltaopt.files.validated_record import Vector3
from deltaopt.motion.trajectory import Trajectory, end_of, start_of
from deltaopt.planning.first_motions.initial_motion import Proposal
from deltaopt.planning.first_motions.moving_ends import run_up_to, stopping
from deltaopt.planning.first_motions.through_gates import places_of_gates
from deltaopt.planning.journal import Progress
from deltaopt.planning.plan import Plan
from deltaopt.problem.boundary import REST
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.moving_ends import Start
from deltaopt.scene.objective import Time
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import given_points

_NAME = "motions from rest to rest"
_PROMISING = 1.2
"""How much slower than the best way of a leg another one may be."""
_ALONE = dict.fromkeys(("via", "approach", "rotation")) | {"objective": Time()}
"""What a leg does not have."""


@dataclass
class Legs:
    """The plans of legs, each made once.

    ``planned``: plans a leg; raises that there is no plan. ``tell``: is called with why there is
    none. ``refused``: why there is no way from rest to rest, of legs. ``known``: what came of legs.
    """

    planned: Callable[[Scene], Plan]
    tell: Progress
    refused: dict[Scene, Infeasible] = field(default_factory=dict)
    known: dict[Scene, Plan | None] = field(default_factory=dict)

    def __call__(self, scene: Scene) -> Plan | None:
        """The plan of a leg; None where none is found."""
        if scene not in self.known:
            self.known[scene] = self._found(scene)
        return self.known[scene]

    def _found(self, scene: Scene) -> Plan | None:
        try:
            if scene.task.is_at_rest:
                check_feasible(scene)
        except RULED_OUT as error:  # a stop or a run-up leads into a body; others may not
            self.tell(str(error))
            return None
        try:
            return self.planned(scene)
        except NO_PLAN as error:
            if isinstance(error, Infeasible) and scene.task.is_at_rest:
                ends = " and ".join(in_words(point) for point in given_points(scene.task))
                self.refused[scene] = Infeasible(f"from rest to rest between {ends} m: {error}")
            else:
                self.tell(str(error))
        return None


def ways_in_legs(scene: Scene, planned: Legs) -> list[Proposal]:
    """Motions in legs, through some places of the points between, the shortest first: along the
    best way of each leg, and with one leg along another of its ways, for what is best of a leg from
    rest to rest may not be best of the whole."""
    found = list[Trajectory]()
    for legs in _in_legs(scene, planned):
        best = [leg.trajectory for leg in legs]
        found.append(reduce(Trajectory.then, best))
        for k, leg in enumerate(legs):
            others = (
                way.motion for way in leg.ways[1:] if way.duration <= _PROMISING * leg.duration
            )
            found += [reduce(Trajectory.then, [*best[:k], each, *best[k + 1 :]]) for each in others]
    found.sort(key=lambda motion: motion.duration)
    return [Proposal(_NAME, motion) for motion in found]


def proposed_in_legs(scene: Scene, planned: Legs, slower: float) -> Iterator[Proposal]:
    """Motions in legs through some places of the points between, legs from rest to rest slowed by a
    factor: a method that begins at the limits hardly moves."""
    for legs in _in_legs(scene, planned):
        parts = [
            leg.trajectory.slowed(slower if problem_of(leg.scene).is_at_rest else 1.0)
            for leg in legs
        ]
        joined = reduce(Trajectory.then, parts)
        yield Proposal(_NAME, joined, len(parts))


def _in_legs(scene: Scene, planned: Legs) -> Iterator[list[Plan]]:
    """The plans of all legs, through some places of the points between."""
    goal = scene.task.goal
    if not goal.is_given or scene.tube is not None:
        return
    stop, is_passed = stopping(scene), goal.velocity != REST
    run_up = run_up_to(scene, goal) if is_passed else None
    if is_passed and run_up is None:
        return
    first: list[Start] = [scene.start] if stop is None else [scene.start, end_of(stop.position)]
    last = [scene.goal] if run_up is None else [start_of(run_up.position), scene.goal]
    for places in places_of_gates(scene):
        between: list[Vector3] = [(x, y, z) for x, y, z in places.tolist()]
        legs = list[Plan]()
        for start, end in pairwise([*first, *between, *last]):
            if start == end:
                continue
            leg = planned(scene.model_copy(update={**_ALONE, "start": start, "goal": end}))
            if leg is None:
                break
            legs.append(leg)
        else:
            yield legs
