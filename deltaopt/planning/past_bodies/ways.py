"""Which way past keep-out bodies is the fastest: promising ways are planned, the best one is kept.

First motions on different sides of bodies (``around_bodies``) are solved on a coarse mesh each;
what is fast there is planned.

Each body is a row at every point of a mesh, and most are far away. So motions are planned past the
bodies that are near, and are then known to be clear of the others, or planned again.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import dist, inf

import numpy as np

from deltaopt.curves.piecewise import PiecewisePolynomial, Truths
from deltaopt.errors import ENDS_AN_ATTEMPT, DeltaOptError, Infeasible, if_possible
from deltaopt.motion.loads import idle_share
from deltaopt.motion.sure_bounds import rows_not_kept, signed_distances
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.attempts import Attempt
from deltaopt.planning.first_motions.around_bodies import (
    Way,
    driven,
    leads_past,
    name_of_way,
    no_way,
    ways_around,
)
from deltaopt.planning.first_motions.bands import least_distances, sampled
from deltaopt.planning.first_motions.moving_ends import end_of, from_state_to_state, start_of
from deltaopt.planning.plan import Plan, TakenWay, quicker
from deltaopt.planning.refinement import Slower
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.objective import Time
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import MovingPoint

_MOST_WAYS, _PROMISING = 12, 1.06
"""How many ways past bodies are solved on the first mesh, those that can be driven fastest, and how
much slower than the fastest of them there a way may be that is planned too. A mesh of 16 intervals
tells three durations in four to 4 %; with 3 % one fastest way more in fifty was missed."""
_CLOSE = 1.02
"""How much slower than the fastest plan a way may be on a mesh of twice as many intervals."""
_NOTHING_TO_GAIN = 1.002
"""Of the duration of the fastest motion without bodies: a way that takes no longer on the first
mesh, or as it is planned, is the last that is looked at. With 1 % on the first mesh a neighbouring
problem had another way, and a duration that was longer by as much."""
_LITTLE_TO_GAIN = 1.12
"""Of that duration: where a plan takes no longer, bands are not looked for beside bows. Of 200
scenes, 51 of which took longer, 7 had faster ways along bands, by 3 % to 14 %. With 1.06 one more
of 201 scenes was as fast as the best, and plans over walls took three times as long."""
_SLOWER = 1.5
"""By what factor the motion of a way is slowed; to a belt it takes as long as the straight line: a
belt has left where a way ends that takes longer. It is then taken as one near the best: a method
that moves away from all bounds first, as from a motion that may be anywhere, leaves the side of a
thin body; at the bounds it hardly moves. Of 204 ways of 40 scenes 93 % were planned so, 83 %
without, in half the time."""
_FINER = (1, 2, 4)
"""By what factors the first mesh is made finer until a way is solved on it, and until a plan past
bodies succeeds: between the points of a coarse mesh a motion may lead through a thin body. A way on
which none is solved is not known to be slow: it is planned too. Without that, two of fifty scenes
missed a way that is faster by 5 % and 8 %."""
NEARLY = 1e-2
"""Gap above which a plan from rest to rest that misses its tolerance is far from an optimum, so
that another one is made from a finer first mesh."""
_SAME_MOTION, _COMPARED = 0.02, 33
"""Of the way: motions on the first mesh that are nowhere farther apart at the same share of their
durations, at so many instants, are the same motion, to what a first mesh is solved to."""
_IDLE = 0.15
"""Share of intervals without a limit reached from which on a motion is far from the best. Of 950
first meshes past obstacles 21 led to such; from their paths 15 became faster by 2 % or more."""


Planning = Callable[[Attempt], Plan]
"""Plans from an attempt. Raises an error that ends an attempt."""
_NEAR, _SAMPLES = 0.05, 65
"""Of the way from start to goal: motions are planned past bodies that a first motion comes nearer
to, at so many places. A smaller share leaves more to plan again, a larger one slows meshes."""


def fastest_way(
    attempt: Attempt,
    free: Trajectory | None,
    planned: Planning,
    on_first_mesh: Callable[[Attempt], Trajectory],
    enough: float,
) -> tuple[Plan, tuple[TakenWay, ...]]:
    """The best plan of all ways past the bodies of a scene, and the ways, first the one taken.

    ``attempt``: from a motion from rest to rest that may run into bodies. ``free``: the fastest
    motion without them, None where that is not known. ``on_first_mesh``: the motion that is best on
    the first mesh of an attempt; it may raise an error that ends an attempt, as may ``planned``.
    ``enough``: above this gap a plan is made again from a finer mesh. Raises Infeasible where there
    is no way, and such an error where none leads to a plan.
    """
    resting = at_rest(attempt.scene, attempt.motion)
    ways, search = list[Way](), _Search(attempt, free, planned, on_first_mesh, enough)
    for source in ways_around(resting, attempt.motion, free):
        ways += source[:_MOST_WAYS]
        search.look_at(source[:_MOST_WAYS])
        if search.is_good and search.gains_little:
            break
    if not ways and resting.planned_links:  # a solver may move links out of bodies
        ways = [Way(attempt.motion, ())]
        search.look_at(ways)
    if not ways:
        raise Infeasible(no_way(resting))
    led = [search] if search.plans else []
    for factor in _FINER[1:]:
        if len(led) > 1 or any(each.is_good for each in led):
            break
        on_finer = replace(attempt, intervals=factor * attempt.intervals)
        finer = _Search(on_finer, free, planned, on_first_mesh, enough)
        finer.look_at(ways)
        led += [finer] if finer.plans else []
    if not led:
        raise search.failures[0]
    return min((each.best for each in led), key=lambda one: one[0].cost)


def at_rest(scene: Scene, motion: Trajectory | None) -> Scene:
    """The scene itself where it is from rest to rest, otherwise that from rest to rest between the
    ends of a motion, or of a quintic where none is known: ways then begin and end as a solver is
    asked to change it, but pass bodies. Raises Infeasible where no quintic stays within reach."""
    if scene.task.is_at_rest:
        return scene
    motion = motion or from_state_to_state(scene)
    if motion is None:
        raise Infeasible("no simple motion between start and goal stays within reach")
    ends = {"start": start_of(motion.position), "goal": end_of(motion.position)}
    return scene.model_copy(update=ends)


@dataclass
class _Search:
    """Ways past the bodies of a scene that are looked at on one first mesh, those of one source
    after the other; those that are fast there are planned.

    ``attempt``, ``free``, ``planned``, ``on_first_mesh``, ``enough``: as of ``fastest_way``.
    ``trials``: of all ways. ``durations``: how long they take, as far as that is known, s, and
    ``plans``: of some of them, each by the number of its trial. ``failures``: of others.
    """

    attempt: Attempt
    free: Trajectory | None
    planned: Planning
    on_first_mesh: Callable[[Attempt], Trajectory]
    enough: float
    trials: list[_Trial] = field(default_factory=list)
    durations: dict[int, float] = field(default_factory=dict)
    plans: dict[int, Plan] = field(default_factory=dict)
    failures: list[DeltaOptError] = field(default_factory=list)

    def look_at(self, ways: list[Way]) -> None:
        """Plan those of some more ways that promise to be faster than all before."""
        first = len(self.trials)
        for way in ways:
            trial = _Trial.along(way, self.attempt, self._hit)
            if len(ways) > 1 or self.trials:
                trial = self._solved(trial, way)
            self.trials.append(trial)
            if trial.is_solved:
                self.durations[len(self.trials) - 1] = trial.motion.duration
                if trial.motion.duration <= _NOTHING_TO_GAIN * self._least:
                    break
        order = _distinct(self.trials)
        for which in order:
            if which >= first:
                self._plan(which, self.trials[order[0]].motion.duration)

    def _solved(self, trial: _Trial, way: Way) -> _Trial:
        """The trial of a way on the first mesh; where that motion is idle, also from its path."""
        scene, solve = self.attempt.scene, self.on_first_mesh
        found = trial.solved(scene, solve)
        if not found.is_solved or idle_share(found.attempt.problem, found.motion) < _IDLE:
            return found
        motion = driven(at_rest(scene, found.motion), sampled(found.motion))
        if motion is None:
            return found
        again = _Trial.along(replace(way, motion=motion), self.attempt, self._hit)
        again = again.solved(scene, solve)
        is_faster = again.is_solved and again.motion.duration < found.motion.duration
        return again if is_faster else found

    def _plan(self, which: int, fastest: float) -> None:
        """Plan a way, unless it seems slower than those that are planned; ``fastest``: how long the
        fastest of all takes on the first mesh, s."""
        scene, trial, known = self.attempt.scene, self.trials[which], inf
        if self.plans:
            if self.shortest <= _NOTHING_TO_GAIN * self._least:
                return
            if not trial.is_solved or trial.motion.duration > _PROMISING * fastest:
                return
            trial = trial.on_twice_the_mesh.solved(scene, self.on_first_mesh)
            self.durations[which] = trial.motion.duration
            if trial.motion.duration > _CLOSE * self.shortest:
                return
            if any(_is_same(trial.motion, plan.trajectory) for plan in self.plans.values()):
                del self.durations[which]
                return
            known = self.shortest if isinstance(scene.objective, Time) else inf
        for beginning in trial.beginnings:
            try:
                found = _past_all(scene, replace(beginning, most=known), self.planned)
                self.plans[which] = quicker(self.plans.get(which, found), found)
                if found.gap <= self.enough:
                    break
            except Slower as error:
                self.durations[which] = error.duration
                break
            except ENDS_AN_ATTEMPT as error:
                self.failures.append(error)

    @cached_property
    def _hit(self) -> frozenset[int]:
        """The bodies that the fastest motion without bodies runs into."""
        return those_hit(self.attempt.scene, self.free.position) if self.free else frozenset()

    @property
    def _least(self) -> float:
        """The duration of the fastest motion without bodies, s; 0 where that is not known."""
        return self.free.duration if self.free else 0.0

    @property
    def shortest(self) -> float:
        """The least duration of a plan, s."""
        return min(plan.duration for plan in self.plans.values())

    @property
    def is_good(self) -> bool:
        """Whether the best plan is good enough."""
        best = min(self.plans.values(), key=lambda plan: plan.cost, default=None)
        return best is not None and (best.within_tolerance or best.gap <= self.enough)

    @property
    def gains_little(self) -> bool:
        """Whether other ways would gain little, as far as the motion without bodies tells."""
        return self.shortest <= _LITTLE_TO_GAIN * self._least

    @property
    def best(self) -> tuple[Plan, tuple[TakenWay, ...]]:
        """The best plan, and all ways, its own first."""
        plans, durations = self.plans, dict(self.durations)
        chosen = min(plans, key=lambda which: plans[which].cost)
        durations |= {i: plan.duration for i, plan in plans.items()}
        taken = dict[frozenset[str], TakenWay]()  # both sides of a passage come in either order
        for i in sorted(durations, key=lambda i: (i != chosen, durations[i])):
            motion = plans[i].trajectory if i in plans else self.trials[i].motion
            name = name_of_way(self.attempt.scene, motion)
            taken.setdefault(frozenset(name.split(", ")), TakenWay(name, durations[i], i in plans))
        return plans[chosen], tuple(taken.values())


@dataclass(frozen=True)
class _Trial:
    """A way that is looked at.

    ``attempt``: from its motion. ``longest``: how long that takes as it was found, s. ``motion``:
    the best known on this side, on a first mesh if it ``is_solved`` there: then it tells about how
    fast the way is.
    """

    attempt: Attempt
    longest: float
    motion: Trajectory
    is_solved: bool = False

    @classmethod
    def along(cls, way: Way, attempt: Attempt, hit: frozenset[int]) -> _Trial:
        """The trial of a way, past the bodies that this comes near, and those that are ``hit`` by
        the fastest motion without bodies: without these most ways lead to that."""
        bodies = near(attempt.scene, way.motion.position) | hit
        scene, name = past_these(attempt.scene, bodies), f"the way {way.name}"
        slower = _SLOWER
        if isinstance(scene.task.goal, MovingPoint):  # it is not where the way ends for long
            slower = attempt.motion.duration / way.motion.duration
        motion = way.motion.slowed(slower)
        begin = replace(attempt, scene=scene, motion=motion, is_near=True, proposal=name)
        return cls(begin, way.motion.duration, way.motion)

    @property
    def on_twice_the_mesh(self) -> _Trial:
        """From the best motion that is known, with twice as many intervals."""
        begin = self.beginnings[0]
        return replace(self, attempt=replace(begin, intervals=2 * begin.intervals))

    @property
    def beginnings(self) -> list[Attempt]:
        """What to plan from until that leads to a good plan: the motion on the first mesh, if that
        is known, and the way's, as one near the best and as one that may be anywhere."""
        known = replace(self.attempt, motion=self.motion, is_near=True)
        anywhere = replace(self.attempt, is_near=False)
        return [*([known] if self.is_solved else []), self.attempt, anywhere]

    def solved(self, scene: Scene, on_first_mesh: Callable[[Attempt], Trajectory]) -> _Trial:
        """This with the motion that is best on the coarsest mesh on which it leads past bodies,
        where there is one; ``scene``: with all bodies. One that leads through a thin body between
        two points tells nothing about its way, nor does one that is slower than that was found.
        """
        attempt = self.attempt
        for factor in _FINER:
            attempt = replace(attempt, intervals=factor * self.attempt.intervals)
            attempt, motion = _on_mesh(scene, attempt, on_first_mesh)
            if motion is None or motion.duration > self.longest:
                continue
            if leads_past(attempt.scene, motion):
                return replace(self, attempt=attempt, motion=motion, is_solved=True)
        return replace(self, attempt=replace(self.attempt, scene=attempt.scene))


def _on_mesh(
    scene: Scene, attempt: Attempt, on_first_mesh: Callable[[Attempt], Trajectory]
) -> tuple[Attempt, Trajectory | None]:
    """An attempt past all bodies that the motion on its first mesh runs into at points of that, and
    this motion, None where there is none; ``scene``: with all bodies."""
    while True:
        motion = if_possible(ENDS_AN_ATTEMPT, on_first_mesh, attempt)
        if motion is None:
            return attempt, None
        more = with_those_hit(scene, attempt.scene, motion.position)
        if more is None:
            return attempt, motion
        attempt = replace(attempt, scene=more)


def _past_all(scene: Scene, attempt: Attempt, planned: Planning) -> Plan:
    """A plan from an attempt, past all bodies that it runs into; ``scene``: with all bodies."""
    found = planned(attempt)
    while (more := with_those_hit(scene, attempt.scene, found.trajectory.position)) is not None:
        attempt = replace(attempt, scene=more)
        found = planned(attempt)
    return found


def _distinct(trials: list[_Trial]) -> list[int]:
    """Which ways to plan, the fastest motion first: of those whose first mesh led to the
    same motion one alone, for all would lead to the same plan."""
    found = list[int]()
    for i in sorted(range(len(trials)), key=lambda i: trials[i].motion.duration):
        if not any(_is_same(trials[i].motion, trials[other].motion) for other in found):
            found.append(i)
    return found


def _is_same(one: Trajectory, other: Trajectory) -> bool:
    """Whether two motions are nowhere far apart at the same share of their durations."""
    shares = np.linspace(0.0, 1.0, _COMPARED)
    first, second = (
        motion.position.at(motion.knots[0] + motion.duration * shares) for motion in (one, other)
    )
    way = dist(first[-1], first[0])
    return float(np.abs(first - second).max()) < _SAME_MOTION * way


def near(scene: Scene, position: PiecewisePolynomial) -> frozenset[int]:
    """The bodies that a motion comes near, by samples."""
    x = position.at(np.linspace(position.knots[0], position.knots[-1], _SAMPLES))
    distances, _ = signed_distances(problem_of(scene), x)
    way = float(np.linalg.norm(x[-1] - x[0]))
    kept = least_distances(scene) + _NEAR * way
    return _of_rows(scene, np.asarray((distances <= kept).any(axis=0)))


def with_those_hit(scene: Scene, part: Scene, position: PiecewisePolynomial) -> Scene | None:
    """A scene with some of the bodies of another and with those besides that a motion runs into;
    None if there are none to add."""
    kept, every = part.keep_out or (), scene.keep_out or ()
    if len(kept) == len(every):
        return None
    absent = [i for i, body in enumerate(every) if not any(body is each for each in kept)]
    hit = {absent[i] for i in those_hit(past_these(scene, absent), position)}
    present = set(range(len(every))) - set(absent)
    return past_these(scene, present | hit) if hit else None


def those_hit(scene: Scene, position: PiecewisePolynomial) -> frozenset[int]:
    """The bodies that a motion runs into."""
    return _of_rows(scene, rows_not_kept(problem_of(scene), position))


def past_these(scene: Scene, bodies: Collection[int]) -> Scene:
    """A scene with some of its bodies alone; itself if these are all, or links of the robot are
    planned to keep clear of bodies, by their indices."""
    every = scene.keep_out or ()
    if len(bodies) == len(every) or scene.planned_links:
        return scene
    chosen = [every[index] for index in sorted(bodies)]
    return scene.model_copy(update={"keep_out": chosen or None})


def _of_rows(scene: Scene, rows: Truths) -> frozenset[int]:
    """The bodies of some rows, (rows,)."""
    used = rows[np.isfinite(least_distances(scene))]
    return frozenset(
        index for (index, _), chosen in zip(scene.obstacles, used, strict=True) if chosen
    )
