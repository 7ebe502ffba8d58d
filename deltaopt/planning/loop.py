"""The loop of planning: attempts from first motions, with the remedies that may help after each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice
from math import inf

from deltaopt.errors import (
    ENDS_AN_ATTEMPT,
    NO_PLAN,
    RULED_OUT,
    DeltaOptError,
    Infeasible,
    NotConverged,
    if_possible,
)
from deltaopt.files.validated_record import vector3
from deltaopt.motion.time_scaling import safe_factor
from deltaopt.motion.trajectory import Trajectory, off_its_ends
from deltaopt.planning.attempts import (
    Attempt,
    Outcomes,
    by_merit,
    in_phases,
    on_few_intervals,
    on_twice_its_mesh,
)
from deltaopt.planning.effort_planning import LONGEST
from deltaopt.planning.first_motions.around_bodies import is_clear, with_stops
from deltaopt.planning.first_motions.bands import sampled, without_bodies
from deltaopt.planning.first_motions.belt import not_found
from deltaopt.planning.first_motions.initial_motion import Proposal, has_time_to_wait
from deltaopt.planning.first_motions.moving_ends import first_moving_motions
from deltaopt.planning.first_motions.order_of_merit import (
    CrossesSingularity,
    crosses_singularity,
    first_motion,
    require_axis,
)
from deltaopt.planning.first_motions.passages import paths_of_lines
from deltaopt.planning.first_motions.through_gates import simple_motions
from deltaopt.planning.journal import Journal
from deltaopt.planning.mesh.kept_limits import KEPT
from deltaopt.planning.plan import Plan, plan_as_it_is, quicker
from deltaopt.planning.trajectory_optimiser import TrajectoryOptimiser, safe
from deltaopt.problem.boundary import Boundary
from deltaopt.problem.of_scene import problem_of
from deltaopt.problem.problem import Problem
from deltaopt.scene.feasibility import require_links_clear, require_state, room_at_rest
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.objective import Time
from deltaopt.scene.parallel_singularity import require_ends_on_one_side
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import OnPath

USUAL, _ANOTHER_WAY_ABOVE = 1e-3, 3e-3
"""Tolerances of at least the first are to be met, or planning starts again from another first
motion. Where a tighter one is missed, or rates of torques peak, it does so above the second:
smaller gaps are not the first motion's fault, and planning again seldom changes them."""
_SECOND_LOOKS = 2
"""How many plans more are made where one that is good enough may be a poor local minimum. More of
them find little for what they cost."""
NEAR_BEST = 1e-2
"""Gap up to which what a motion near the best leads to is taken."""
_FEW = 2
"""Simple motions that are tried to a place beside one to which a motion is known."""
_IMPROVED, _SHORTER = 4, 1e-4
"""How many plans of a kind at most begin with the motion found, each with that of the one before;
and by what share each must be shorter, or else tell a smaller gap."""
_TOLD = 3
"""Of how many motions at most it is said what is in their way: those in whose way is least, of each
name one."""
_DIGITS = 9
"""Decimals of places in words, m."""
_MAY_HELP = (
    "another number of intervals, a looser tolerance or more starts may lead to one, for no search "
    "is complete"
)
_RETRY_HALVES = 3
"""A plan that misses a tolerance below ``RESOLVED_BELOW`` is made once more from a first mesh of
3/2 as many intervals. Which switching structure is detected and which intervals are split depends
on the first mesh, so another one may succeed; it costs as much time again."""
_KEPT_SHARE = 0.9
"""Share of the limits that motions whose end moves take at samples: between them they may take
more."""
_SLOW_PATHS = 2
"""How many paths of straight lines past bodies are driven."""
_ROUNDING = 1e-9
"""What the ends of a motion may be off those asked for, of how far it goes, and of that in its
duration."""


Outcome = Plan | DeltaOptError
"""What came of an attempt."""


@dataclass(frozen=True)
class Loop:
    """Makes attempts to plan.

    ``optimiser``: what plans from one first motion. ``journal``: what was attempted so far, in
    words, and ``attempts``: the attempts themselves.
    """

    optimiser: TrajectoryOptimiser
    journal: Journal
    attempts: list[Attempt] = field(default_factory=list)

    def make(self, attempts: Iterator[Attempt], so_far: Outcomes) -> None:
        """Make the attempts of a source, which sees what came of those before, until a plan is good
        enough; where that may be a poor local minimum, some of those that follow too."""
        wanted = inf
        for attempt in attempts:
            so_far.add(self.remedied(attempt))
            if self.journal.is_spent:
                self.journal.note(f"no more attempts after {self.journal.solves} meshes")
                return
            if wanted == inf and so_far.is_good:
                wanted = len(so_far.plans) + (_SECOND_LOOKS if so_far.is_doubtful else 0)
            if len(so_far.plans) >= wanted:
                return

    def remedied(self, attempt: Attempt) -> Plan | DeltaOptError:
        """What comes of an attempt and of the remedies that may help after it: the best plan, or
        the first error."""
        first = outcome = self.made(attempt)
        for remedy in _REMEDIES:
            changed = remedy(self.optimiser, attempt, outcome)
            if changed is not None:
                attempt, outcome = changed, better(outcome, self.made(changed))
        return outcome if isinstance(outcome, Plan) else first

    def made(self, attempt: Attempt) -> Plan | DeltaOptError:
        """What comes of an attempt alone."""
        self.attempts.append(attempt)
        self.journal.begin(attempt.proposal, str(attempt))
        try:
            found = self.optimiser.plan(attempt, self.journal.mesh)
        except ENDS_AN_ATTEMPT as error:
            self.journal.end(str(error))
            if isinstance(error, NotConverged):
                return error
            # What rules an iterate of the solver out says nothing of the scene.
            return NotConverged(str(error), "Ruled_Out", attempt.motion)
        self.journal.end(f"{found.duration:.6g} s, gap {found.gap:.1e}", found.duration)
        return found

    def on_first_mesh(self, attempt: Attempt) -> Trajectory:
        """The motion that is best on the first mesh of an attempt. Raises what ends an attempt."""
        self.journal.begin(attempt.proposal, f"{attempt}, the first mesh alone")
        try:
            found = self.optimiser.on_first_mesh(attempt)
        except ENDS_AN_ATTEMPT as error:
            self.journal.end(str(error))
            raise
        self.journal.mesh(f"{found.duration:.6g} s")
        self.journal.end(f"about {found.duration:.4g} s", found.duration)
        return found

    def roughly(self, scene: Scene) -> float:
        """The duration of the motion on the first mesh of a scene from rest to rest, as if there
        were neither bodies nor via points, s; 0 where none is found, or it ends where it begins."""
        if scene.task.start == scene.task.goal:
            return 0.0
        scene = without_bodies(scene).model_copy(update={"via": None})

        def on_first_mesh() -> float:
            attempt = Attempt(scene, first_motion(scene), self.optimiser.intervals)
            return self.on_first_mesh(attempt).duration

        return if_possible(NO_PLAN, on_first_mesh) or 0.0

    def good_gap(self, scene: Scene) -> float:
        """Gap up to which a plan is good enough; above it planning starts again from another first
        motion."""
        tolerance = self.optimiser.tolerance
        is_usual = tolerance >= USUAL and not problem_of(scene).rates_peak
        return tolerance if is_usual else max(tolerance, _ANOTHER_WAY_ABOVE)

    def by_merit(self, scene: Scene) -> Plan:
        """From first motions in order of merit. Raises Unreachable if there is none, NotConverged
        if none leads to a plan."""
        so_far = Outcomes(scene, inf if has_time_to_wait(scene) else self.good_gap(scene))
        self.make(by_merit(so_far, self.optimiser.intervals), so_far)
        return so_far.best_known()

    def until_good(self, scene: Scene, proposals: Iterator[Proposal]) -> Plan | DeltaOptError:
        """From first motions in phases or where an end moves: the best plan, or the first error."""
        so_far = Outcomes(scene, self.good_gap(scene))
        self.make(in_phases(so_far, self.optimiser.intervals, proposals), so_far)
        if so_far.tried:
            return or_error(so_far.best_known)
        free = scene.model_copy(update={"approach": None})
        for name, column in zip(("start", "goal"), scene.columns, strict=False):
            top = Boundary((column.level, column.y, column.z))
            try:
                require_state(free, f"approach.{name}, the top of the cylinder", top, orders=1)
            except RULED_OUT as error:
                return Infeasible(str(error))
        columns = " and along the cylinders of approach" if scene.approach else ""
        return Infeasible(f"no simple motion through all given points{columns} stays within reach")

    def only_from(self, attempt: Attempt) -> Plan:
        """From one attempt. Raises what ends it."""
        return or_raise(self.remedied(attempt))

    def nearby(self, scene: Scene, near: Trajectory) -> Plan | None:
        """The plan that a motion near the best leads to; None where it leads to none, and on a
        given path."""
        if isinstance(scene.task, OnPath):
            return None
        found = self.made(on_few_intervals(scene, near, self.optimiser.intervals))
        if not isinstance(found, Plan) or found.gap > NEAR_BEST:
            return None
        return found if is_clear(scene, found.trajectory) else None

    def to_a_place(self, scene: Scene, near: Trajectory) -> Plan | None:
        """The plan to a place beside one to which a motion is known, from that motion or else from
        simple ones; None where these lead to none."""
        found = self.nearby(scene, near)
        if found is not None:
            return found
        few = islice(simple_motions(scene), _FEW)
        simple = if_possible(RULED_OUT, self.until_good, scene, few)
        return simple if isinstance(simple, Plan) and is_clear(scene, simple.trajectory) else None

    def at_worst(self, scene: Scene, planned: Callable[[Scene], Plan]) -> Plan:
        """The plan that ``planned`` makes of a scene. Where that raises that there is none, the
        fastest of the motions that attempts began with, and of slow ones, that keep all limits,
        slowed as far as need be, to a given duration too, and then improved.

        Raises what rules a motion out, and NotConverged with what keeps the platform from places of
        these motions.
        """
        try:
            return planned(scene)
        except NO_PLAN as error:
            begun = [a for a in self.attempts if a.scene.task.gates == scene.task.gates]
            names = {a.motion: a.proposal for a in begun}
            names |= {one.motion: one.name for one in slow_motions(scene)}
            kept = [if_possible(NO_PLAN, _kept, scene, motion) for motion in names]
            best = min((one for one in kept if one), key=lambda one: one.duration, default=None)
            best = best and _in_given_time(scene, best)
            if best is None:
                if scene.tube is not None:
                    require_axis(scene)  # raises what rules it out, if that is known
                if not isinstance(error, NotConverged):
                    raise
                ruled_out = sorted((_in_the_way(scene, *each), each[1]) for each in names.items())
                of_each = {name: why for why, name in ruled_out if why[1]}  # where least is
                reasons = [reason for _, reason in sorted(of_each.values(), reverse=True)][:_TOLD]
                told = [not_found(scene, len(self.attempts)), *reasons, _MAY_HELP]
                raise NotConverged("; ".join(told), error.status, error.iterate) from error
            self.journal.note(f"of these the fastest that keeps all limits: {best.duration:.6g} s")
            name, tolerance = self.optimiser.problem_formulation.name, self.optimiser.tolerance
            found = plan_as_it_is(scene, best, tolerance, name)
            return self.improved(scene, found)

    def improved(self, scene: Scene, found: Plan) -> Plan:
        """A plan that begins with the motion of another, or the other one where that is good enough
        or this is not better: on few intervals, and then on twice the mesh of the better, each as
        often as this improves it. A mesh whose knots are where bodies are passed closely does not
        lead through them."""
        few = partial(on_few_intervals, scene, coarsest=self.optimiser.intervals)
        for attempt_from in (few, partial(on_twice_its_mesh, scene)):
            for _ in range(_IMPROVED):
                if found.gap <= self.good_gap(scene):
                    return found
                known, made = found, self.remedied(attempt_from(found.trajectory))
                if isinstance(made, Plan) and is_clear(scene, made.trajectory):
                    found = quicker(known, made)
                if found.cost > (1 - _SHORTER) * known.cost and found.gap >= known.gap:
                    break
        return found


def _kept_away(_: TrajectoryOptimiser, attempt: Attempt, outcome: Outcome) -> Attempt | None:
    if not isinstance(outcome, CrossesSingularity):
        return None
    require_ends_on_one_side(attempt.scene)
    return attempt.away


def _from_another_mesh(
    optimiser: TrajectoryOptimiser, attempt: Attempt, outcome: Outcome
) -> Attempt | None:
    """Where a motion from rest to rest that is not in phases is found and misses a tolerance to
    which switches are resolved."""
    task, is_tight = attempt.scene.task, optimiser.tolerance < optimiser.resolved_below
    in_one = task.is_at_rest and not task.gates and isinstance(attempt.scene.objective, Time)
    is_missed = isinstance(outcome, Plan) and not outcome.within_tolerance
    if not (in_one and is_tight and is_missed):
        return None
    return replace(attempt, intervals=_RETRY_HALVES * attempt.intervals // 2)


_REMEDIES = (_kept_away, _from_another_mesh)
"""In this order, each after what came of those before."""


def better(one: Outcome, other: Outcome) -> Outcome:
    """The shorter of two plans, the only one, or the later error."""
    if isinstance(one, Plan) and isinstance(other, Plan):
        return quicker(one, other)
    return one if isinstance(one, Plan) else other


def _kept(scene: Scene, motion: Trajectory) -> Trajectory | None:
    """A motion between the ends of a scene, slowed until it keeps all limits where that changes no
    end; None if it does not keep them. Raises NotConverged or what rules it out."""
    problem = problem_of(scene)
    is_right = _ends_as_asked(problem, motion) and is_clear(scene, motion)
    if not is_right or crosses_singularity(problem, motion):
        return None
    factor = safe_factor(problem, motion)
    if problem.is_at_rest:
        return safe(scene, motion, factor, "As_It_Is")
    is_kept = factor <= 1 + KEPT and motion.duration >= scene.least_duration
    return motion if is_kept else None


def _ends_as_asked(problem: Problem, motion: Trajectory) -> bool:
    return off_its_ends(problem, motion) < _ROUNDING * motion.extent


def _in_given_time(scene: Scene, motion: Trajectory) -> Trajectory | None:
    """A motion that keeps all limits, slowed to the duration that is given, if one is; None where
    it takes longer, would rest for all but nothing of it, or does not keep them, as where an end
    moves, and where a share of the fastest motion's duration is asked for, which is not known
    here."""
    given = scene.objective.given_duration
    if given is None:
        return None if scene.objective.is_share else motion
    is_possible = motion.duration <= given <= LONGEST * motion.duration
    if not (is_possible and problem_of(scene).is_at_rest):
        return None
    slowed = motion.slowed(given / motion.duration)
    return slowed if safe_factor(problem_of(scene), slowed) <= 1 + KEPT else None


def _in_the_way(scene: Scene, motion: Trajectory, name: str) -> tuple[float, str]:
    """The least room to be at rest at places of a motion, and in words, with its ``name``, what it
    exceeds there or as it moves: empty where that is not known."""
    free = scene.model_copy(update={"approach": None})  # which is for a part of the motion alone
    places, problem = sampled(motion), problem_of(scene)
    room = room_at_rest(free, places)
    least, worst = float(room.min()), Boundary(vector3(places[room.argmin()].round(_DIGITS)))
    try:
        if free.planned_links:
            require_links_clear(free, name, worst.position)
        require_state(free, name, worst, is_given=False)
    except RULED_OUT as error:
        return least, str(error)
    if crosses_singularity(problem, motion):
        return least, f"{name} leads through a parallel singularity"
    # A way past bodies may be one from rest to rest: of it nothing more is known.
    is_asked_for = not problem.is_at_rest and _ends_as_asked(problem, motion)
    factor = if_possible(NO_PLAN, safe_factor, problem, motion) if is_asked_for else None
    if factor is None or factor == inf or factor <= 1 + KEPT:
        return least, ""
    return least, f"{name} would have to take {factor:.3g} times as long, but its ends move"


def or_error(planned: Callable[..., Plan], *given: object) -> Outcome:
    """What is ``planned`` from what is given, or why there is no plan."""
    try:
        return planned(*given)
    except NO_PLAN as error:
        return error


def or_raise(found: Plan | DeltaOptError) -> Plan:
    """The plan that is found; raises the error that is found instead of one."""
    if isinstance(found, Plan):
        return found
    raise found


def slow_motions(scene: Scene) -> Iterator[Proposal]:
    """Motions that nothing is attempted from, since others lead to better plans: they are slow, and
    keep limits where those may not. Where an end moves its first motions, well within the limits;
    past bodies motions from rest to rest along paths of straight lines, with a stop at each of
    their corners."""
    if scene.task.gates:
        return
    if scene.moves_at_ends:
        well_within = if_possible(RULED_OUT, list, first_moving_motions(scene, None, _KEPT_SHARE))
        yield from well_within or ()
    elif limits_of(scene).constraints.has_convex and scene.tube is None:
        for corners in islice(paths_of_lines(scene), _SLOW_PATHS):
            motion = with_stops(scene, corners)
            if motion is not None:
                yield Proposal("straight lines with a stop at each corner", motion)
