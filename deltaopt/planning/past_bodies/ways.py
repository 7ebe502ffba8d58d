"""Which way past keep-out bodies is the fastest: promising ways are planned, the best one is kept.

First motions on different sides of bodies (``around_bodies``) are solved on a coarse mesh each;
what is fast there is solved on a finer one, and what is fast on that is planned.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import dist, inf

import numpy as np

from deltaopt.errors import ENDS_AN_ATTEMPT, DeltaOptError, Infeasible, if_possible
from deltaopt.motion.running_cost import cost as cost_of
from deltaopt.motion.trajectory import Trajectory, end_of, start_of
from deltaopt.planning.attempts import Attempt
from deltaopt.planning.first_motions.around_bodies import (
    CLEAR,
    leads_past,
    name_of_way,
    no_way,
    ways_around,
    ways_beside,
)
from deltaopt.planning.first_motions.initial_motion import Proposal
from deltaopt.planning.first_motions.moving_ends import from_state_to_state
from deltaopt.planning.loop import Loop
from deltaopt.planning.past_bodies.near_bodies import near, past_these, those_hit, with_those_hit
from deltaopt.planning.plan import Plan, TakenWay, quicker
from deltaopt.planning.refinement import Slower
from deltaopt.scene.objective import Time
from deltaopt.scene.scene import Scene

_MOST_WAYS = 12
"""How many ways past bodies are solved on the first mesh, those that can be driven fastest."""
_FINE, _MOST_FINE, _PROMISING, _CLOSE = 4, 6, 1.2, 1.02
"""How many times finer a mesh is on which the fastest of them are solved again, how many at most,
and how much slower on the first mesh than the fastest on the finer one such a way may be; and how
much slower on that than a plan a way may be that is planned too. Of 500 scenes past obstacles 10
are longer by 0.2 % than the best known, 16 where none is solved again, 12 with three at most."""
_CLOSE_OTHERWISE = 1.1
"""The same where plans are not the fastest: a way on which the fastest motion takes 2 % longer than
on another was 6 % cheaper in effort, in 1.4 times that duration."""
_NOTHING_TO_GAIN = 1.002
"""Of the cost of the best motion without bodies: a way that costs no more as it is planned, or on
the first mesh where the fastest motion is sought, is the last that is looked at. With 1 % on the
first mesh a neighbouring problem had another way, and a duration that was longer by as much."""
_LITTLE_TO_GAIN = 1.12
"""Of that cost: where a plan costs no more, bands are not looked for beside bows. Of 200
scenes, 51 of which took longer, 7 had faster ways along bands, by 3 % to 14 %. With 1.06 one more
of 201 scenes was as fast as the best, and plans over walls took three times as long."""
_SLOWER = 1.5
"""By what factor the motion of a way is slowed; to a belt it takes as long as the straight line: a
belt has left where a way ends that takes longer. It is then taken as one near the best: a method
that moves away from all bounds first, as from a motion that may be anywhere, leaves the side of a
thin body; at the bounds it hardly moves. Of 204 ways of 40 scenes 93 % were planned so, 83 %
without, in half the time."""
_LONGER_ASIDE = 3.0
"""How many times longer the best on a first mesh may take than the fastest motion without bodies,
from that motion led aside: what takes longer has lost its way."""
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


def ways_past(attempt: Attempt, free: Trajectory | None) -> Iterator[list[Proposal]]:
    """The ways past the bodies of a scene, those of one source after the other; ``attempt`` and
    ``free`` as of ``fastest_way``. Raises Infeasible where there is none."""
    resting, found = at_rest(attempt.scene, attempt.motion), False
    moves = attempt.scene.task.moves_at_ends
    beside = ways_beside(attempt.scene, free) if free and moves else []
    for source in ways_around(resting, attempt.motion, free):
        source, beside = beside + source, []
        found = found or bool(source)
        yield source
    if found:
        return
    if not resting.planned_links:
        raise Infeasible(no_way(resting))
    yield [Proposal(f"the way {CLEAR}", attempt.motion)]  # a solver may move links out of bodies


def fastest_way(
    loop: Loop, attempt: Attempt, sources: Iterator[list[Proposal]], free: Trajectory | None
) -> tuple[Plan, tuple[TakenWay, ...]]:
    """The best plan of all ways past the bodies of a scene, and the ways, first the one taken.

    ``loop``: makes attempts. ``attempt``: from a motion that may run into bodies. ``sources``:
    ways, those of one source after the other. ``free``: the fastest motion without bodies, None
    where that is not known. Raises what sources raise, and what ends an attempt where no way leads
    to a plan.
    """
    ways, search = list[Proposal](), _SearchOfWays(loop, attempt, free)
    for source in sources:
        ways += source[:_MOST_WAYS]
        search.look_at(source[:_MOST_WAYS])
        if search.is_good and search.gains_little:
            break
    led = [search] if search.plans else []
    for factor in _FINER[1:]:
        if len(led) > 1 or any(each.is_good for each in led):
            break
        on_finer = replace(attempt, intervals=factor * attempt.intervals)
        finer = _SearchOfWays(loop, on_finer, free)
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
class _SearchOfWays:
    """Ways past the bodies of a scene that are looked at on one first mesh, those of one source
    after the other; those that are fast there are planned.

    ``loop``, ``attempt``, ``free``: as of ``fastest_way``.
    ``trials``: of all ways. ``durations``: how long they take, as far as that is known, s, and
    ``plans``: of some of them, each by the number of its trial. ``failures``: of others.
    """

    loop: Loop
    attempt: Attempt
    free: Trajectory | None
    trials: list[_Trial] = field(default_factory=list)
    durations: dict[int, float] = field(default_factory=dict)
    plans: dict[int, Plan] = field(default_factory=dict)
    failures: list[DeltaOptError] = field(default_factory=list)

    def look_at(self, ways: list[Proposal]) -> None:
        """Plan those of some more ways that promise to be faster than all before."""
        first, others = len(self.trials), not all(way.is_aside for way in ways)
        for way in ways:
            trial = self._solved(self._along(way))
            if others and way.is_aside and not trial.is_solved:
                continue  # it leads to nothing as it is
            self.trials.append(trial)
            if trial.is_solved:
                self.durations[len(self.trials) - 1] = trial.motion.duration
                least = _NOTHING_TO_GAIN * self._least
                if self._is_fastest and trial.motion.duration <= least:
                    break
        new = [which for which in _distinct(self.trials) if which >= first]
        if len(new) > 1 or self.plans:
            self._refine(new)
        for which in sorted(new, key=lambda which: self.trials[which].finest.duration):
            self._plan(which)

    def _refine(self, new: list[int]) -> None:
        """Solve new ways on a finer mesh, the fastest first, until one is not solved there, or the
        next does not promise to be faster than all that are."""
        least = inf
        for which in [k for k in new if self.trials[k].is_solved][:_MOST_FINE]:
            trial = self.trials[which]
            if trial.motion.duration > _PROMISING * least:
                return
            found = self._on_mesh(trial, trial.near(trial.motion, _FINE))
            if not found.is_solved:
                return
            fine = found.motion
            self.trials[which], self.durations[which] = replace(trial, fine=fine), fine.duration
            least = min(least, fine.duration)

    def _plan(self, which: int) -> None:
        """Plan a way, unless it seems slower than those that are planned."""
        scene, trial, known = self.attempt.scene, self.trials[which], inf
        if self.plans:
            if self._cost <= _NOTHING_TO_GAIN * self._least:
                return
            close = _CLOSE if self._is_fastest else _CLOSE_OTHERWISE
            if not trial.is_solved or trial.finest.duration > close * self.shortest:
                return
            if any(_is_same(trial.finest, plan.trajectory) for plan in self.plans.values()):
                del self.durations[which]
                return
            known = self.shortest if self._is_fastest else inf
        for beginning in trial.beginnings:
            try:
                found = self._past_all(replace(beginning, most=known))
                self.plans[which] = quicker(self.plans.get(which, found), found)
                if found.gap <= self.loop.good_gap(scene):
                    break
            except Slower as error:
                self.durations[which] = error.duration
                break
            except ENDS_AN_ATTEMPT as error:
                self.failures.append(error)

    def _past_all(self, attempt: Attempt) -> Plan:
        """A plan from an attempt, past all bodies that it runs into."""
        found = self.loop.only_from(attempt)
        while more := with_those_hit(self.attempt.scene, attempt.scene, found.trajectory.position):
            attempt = replace(attempt, scene=more)
            found = self.loop.only_from(attempt)
        return found

    def _along(self, way: Proposal) -> _Trial:
        """The trial of a way, past the bodies that this comes near, and those that the fastest
        motion without bodies runs into: without these most ways lead to that."""
        bodies = near(self.attempt.scene, way.motion.position) | self._hit
        scene = past_these(self.attempt.scene, bodies)
        slower, longest = _SLOWER, way.motion.duration
        if way.is_aside:
            slower, longest = 1.0, _LONGER_ASIDE * longest
        elif scene.task.goal.moves:  # it is not where the way ends for long
            slower = self.attempt.motion.duration / way.motion.duration
        motion = way.motion.slowed(slower)
        begin = replace(self.attempt, scene=scene, motion=motion, is_near=True, proposal=way.name)
        return _Trial(begin, longest, way.motion)

    def _solved(self, trial: _Trial) -> _Trial:
        """A trial with the motion that is best on the coarsest mesh on which it leads past bodies,
        where there is one. One that leads through a thin body between two points tells nothing
        about its way, nor does one that is slower than that was found; a finer mesh is solved from
        the first of these, which is mostly beside a place to pass, and then from the way.
        """
        found, way = trial, trial.attempt.motion
        for factor in _FINER:
            begin = replace(found.attempt, intervals=factor * trial.attempt.intervals)
            found = self._on_mesh(trial, begin)
            if not found.is_solved and begin.motion is not way:
                found = self._on_mesh(trial, replace(begin, motion=way))
            if found.is_solved:
                return found
        return replace(trial, attempt=replace(trial.attempt, scene=found.attempt.scene))

    def _on_mesh(self, trial: _Trial, attempt: Attempt) -> _Trial:
        """A trial from an attempt on its first mesh, past all bodies that the motion there runs
        into at points of that. It is solved again past these from where it is, which is mostly near
        the best motion past them; where that is not solved, from the way. Where it leads through a
        body between points the attempt of the trial is from there."""
        motion, way = if_possible(ENDS_AN_ATTEMPT, self.loop.on_first_mesh, attempt), trial.attempt
        while motion:
            more = with_those_hit(self.attempt.scene, attempt.scene, motion.position)
            if more is None:
                break
            attempt = replace(attempt, scene=more)
            begins = (replace(attempt, motion=each) for each in (motion, way.motion))
            solved = (if_possible(ENDS_AN_ATTEMPT, self.loop.on_first_mesh, one) for one in begins)
            motion = next((each for each in solved if each), None)
        from_way = replace(attempt, motion=way.motion)
        if motion is None or motion.duration > trial.longest:
            return replace(trial, attempt=from_way)
        if leads_past(attempt.scene, motion):
            return replace(trial, attempt=from_way, motion=motion, is_solved=True)
        return replace(trial, attempt=replace(attempt, motion=motion))

    @cached_property
    def _hit(self) -> frozenset[int]:
        """The bodies that the fastest motion without bodies runs into."""
        return those_hit(self.attempt.scene, self.free.position) if self.free else frozenset()

    @property
    def _is_fastest(self) -> bool:
        """Whether plans are the fastest motions: others are told apart by how fast their ways are,
        for what is dear in a given time takes long at full torque."""
        return isinstance(self.attempt.scene.objective, Time)

    @cached_property
    def _least(self) -> float:
        """The cost of the best motion without bodies; 0 where that is not known."""
        return cost_of(self.attempt.problem, self.free) if self.free else 0.0

    @property
    def _cost(self) -> float:
        """That of the best plan."""
        return min(plan.cost for plan in self.plans.values())

    @property
    def shortest(self) -> float:
        """The least duration of a plan, s, or of the fastest motion along its way."""
        if self._is_fastest:
            return self._cost
        return min(self.trials[which].finest.duration for which in self.plans)

    @property
    def is_good(self) -> bool:
        """Whether the best plan is good enough."""
        best = min(self.plans.values(), key=lambda plan: plan.cost, default=None)
        enough = self.loop.good_gap(self.attempt.scene)
        return best is not None and (best.within_tolerance or best.gap <= enough)

    @property
    def gains_little(self) -> bool:
        """Whether other ways would gain little, as far as the motion without bodies tells."""
        return self._cost <= _LITTLE_TO_GAIN * self._least

    @property
    def best(self) -> tuple[Plan, tuple[TakenWay, ...]]:
        """The best plan, and all ways, its own first."""
        plans, durations = self.plans, dict(self.durations)
        chosen = min(plans, key=lambda which: plans[which].cost)
        durations |= {i: plan.duration for i, plan in plans.items()}
        taken = dict[frozenset[str], TakenWay]()  # both sides of a passage come in either order
        for i in sorted(durations, key=lambda i: (i != chosen, durations[i])):
            motion = plans[i].trajectory if i in plans else self.trials[i].finest
            name = name_of_way(self.attempt.scene, motion)
            way = TakenWay(name, durations[i], i in plans, motion)
            taken.setdefault(frozenset(name.split(", ")), way)
        return plans[chosen], tuple(taken.values())


@dataclass(frozen=True)
class _Trial:
    """A way that is looked at.

    ``attempt``: from its motion. ``longest``: how long that takes as it was found, s. ``motion``:
    the best known on this side, on a first mesh if it ``is_solved`` there: then it tells about how
    fast the way is. ``fine``: the same on a finer mesh, if that was looked at.
    """

    attempt: Attempt
    longest: float
    motion: Trajectory
    is_solved: bool = False
    fine: Trajectory | None = None

    @property
    def finest(self) -> Trajectory:
        """The motion on the finest mesh that was looked at."""
        return self.fine or self.motion

    @property
    def beginnings(self) -> list[Attempt]:
        """What to plan from until that leads to a good plan: the motion on the finest mesh, if
        there is one, and the way's, as one near the best and as one that may be anywhere."""
        finer = _FINE if self.fine else 1
        found = [self.near(self.finest, finer)] if self.is_solved else []
        return [*found, self.attempt, replace(self.attempt, is_near=False)]

    def near(self, motion: Trajectory, finer: int) -> Attempt:
        """The attempt from a motion that is near the best, on so much finer a first mesh."""
        intervals = finer * self.attempt.intervals
        return replace(self.attempt, motion=motion, intervals=intervals, is_near=True)


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
