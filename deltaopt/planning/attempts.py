"""Attempts to plan: what is attempted, in which order, what came of it, and what is done then.

An attempt is an optimisation from one first motion on one first mesh. What goes wrong in it ends
it alone. Sources propose attempts one after the other, and see what came of those before.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf

from deltaopt.curves.piecewise import Array
from deltaopt.errors import DeltaOptError, NotConverged
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.first_motions.initial_motion import Proposal
from deltaopt.planning.first_motions.moving_ends import intervals_after_waiting
from deltaopt.planning.first_motions.multistart import distinct
from deltaopt.planning.first_motions.order_of_merit import (
    intervals_for,
    intervals_in_tube,
    is_slow,
    rounds,
)
from deltaopt.planning.nlp.phases import first_mesh, own_mesh
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.plan import Optimum, Plan, quicker
from deltaopt.problem.of_scene import problem_of
from deltaopt.problem.problem import Problem
from deltaopt.scene.objective import Time
from deltaopt.scene.parallel_singularity import distance_from_parallel
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import distance

_KEPT_VOLUME = 0.01
"""Distance from the parallel singularity that plans are then kept at, unless an end is nearer: more
costs time where the best motion comes close, less brings torques that peak between points."""
_KEPT_AWAY = 2
"""From how many of the first motions, of each round if there are several, it is tried again at that
distance where nothing else succeeded: iterates may lose their way in the singularity, whatever the
first motion."""
_NEARLY = 1e-2
"""Gap below which a plan that misses its tolerance is near an optimum: then finer meshes may bring
it there, and paths over a grid, which take long, will not."""
_FINER, _TRIED_FINER = (2, 4), 3
"""How many times finer first meshes are tried where nothing else succeeded, and from how many of
the best first motions. Of motions in phases or with moving ends the first of these from all of
them, and the second from legs past bodies alone: where no such motion is it would take minutes."""
_LONG, _LABORIOUS = 4.0, 400
"""A plan that takes more than so many times the lower bound, or took more iterations than this, may
be a poor local minimum. Hardly any random move is the first, and one in a hundred the second:
usual are thirty iterations. Fewer would make more plans take three times as long in vain."""


@dataclass(frozen=True)
class Attempt:
    """What an attempt to plan begins with.

    ``scene``: the scene, perhaps with more limits than were asked for. ``motion``: the first
    motion. ``intervals``: of the first mesh. ``proposal``: what the first motion is, in words.
    ``is_near``: whether the first motion is the best one on another mesh. ``on_twice_its_mesh``:
    whether the first mesh has the knots of the motion and the middles between them, in place of as
    many equal intervals as are given. ``most``: the duration of a plan that is known, s; the
    attempt ends where it will not undercut it.
    """

    scene: Scene
    motion: Trajectory
    intervals: int
    proposal: str = "a first motion"
    is_near: bool = False
    on_twice_its_mesh: bool = False
    most: float = inf

    @cached_property
    def mesh(self) -> Array:
        """The intervals of the first mesh as fractions of the duration, (N,)."""
        if self.on_twice_its_mesh:
            return own_mesh(self.motion, 2, self.problem.together)
        return first_mesh(self.problem, self.motion, self.intervals)

    @cached_property
    def problem(self) -> Problem:
        """The problem that its scene states."""
        return problem_of(self.scene)

    def __str__(self) -> str:
        """Its settings in words, without the proposal."""
        parts = [f"{self.motion.duration:.4g} s", f"{self.intervals} intervals"]
        given = self.scene.given("parallel_singularity")
        if given:
            parts.append(f"at a distance of {given:.2g} from the parallel singularity")
        return ", ".join(parts)

    def scaling(self, motion: Trajectory, time: float) -> Scaling:
        """The units of its variables from a motion: of time ``time`` (s); of length how far the
        motion goes where an end moves or there are phases, otherwise the distance of the ends."""
        problem = self.problem
        extent = None if problem.is_at_rest and not problem.gates else motion.extent
        return Scaling(problem, time, extent=extent)

    @property
    def away(self) -> Attempt | None:
        """The attempt with motions kept at a distance from the parallel singularity; None if they
        are already."""
        if self.scene.given("parallel_singularity"):
            return None
        margin = min(_KEPT_VOLUME, distance_from_parallel(self.scene) / 2)
        limits = self.scene.limits
        given = {} if limits is None else limits.model_dump(exclude_none=True)
        limited = {"limits": {"parallel_singularity": margin, **given}}
        return replace(self, scene=self.scene.model_copy(update=limited))


def on_few_intervals(scene: Scene, motion: Trajectory, coarsest: int) -> Attempt:
    """The attempt that begins with a motion that is near the best, on twice as many intervals as
    the coarsest mesh has: there a solution gets away from where the motion begins."""
    return Attempt(scene, motion, 2 * coarsest, "a motion nearby", is_near=True)


def on_twice_its_mesh(scene: Scene, motion: Trajectory) -> Attempt:
    """The attempt that begins with a motion that is near the best, on the mesh of its knots, each
    interval in two: on its very mesh a motion that touches bodies has no room to begin in."""
    return Attempt(
        scene,
        motion,
        2 * (len(motion.knots) - 1),
        "that motion, on twice its mesh",
        is_near=True,
        on_twice_its_mesh=True,
    )


@dataclass(frozen=True)
class Search:
    """A search for better plans than the usual one: from how many other first motions at ``most``,
    for how many ``seconds``, and the ``seed`` of random ones."""

    most: int
    seconds: float = inf
    seed: int = 1


@dataclass
class Outcomes:
    """What came of attempts to plan a scene.

    ``enough``: the gap at which a plan is good enough. ``plans``: what attempts led to.
    ``failures``: why others led to none.
    """

    scene: Scene
    enough: float
    plans: list[Plan] = field(default_factory=list)
    failures: list[DeltaOptError] = field(default_factory=list)

    def add(self, outcome: Plan | DeltaOptError) -> None:
        """An attempt led to a plan or failed."""
        if isinstance(outcome, Plan):
            self.plans.append(replace(outcome, scene=self.scene))
        else:
            self.failures.append(outcome)

    @property
    def tried(self) -> int:
        """How many attempts were made."""
        return len(self.plans) + len(self.failures)

    @property
    def is_good(self) -> bool:
        """Whether a plan is good enough that is the best, or hardly dearer."""
        return self._is_within(self.enough)

    @property
    def is_near(self) -> bool:
        """Whether a plan is near an optimum that is the best, or hardly dearer."""
        return self._is_within(_NEARLY)

    def _is_within(self, gap: float) -> bool:
        """Whether a plan is within a gap, and by no more than that dearer than the best: what is
        dearer is near another optimum."""
        most = (1 + gap) * min((plan.cost for plan in self.plans), default=inf)
        return any(plan.gap <= gap and plan.cost <= most for plan in self.plans)

    @property
    def is_doubtful(self) -> bool:
        """Whether the best plan may be a poor local minimum."""
        task = self.scene.task
        in_one = task.is_at_rest and not task.gates and isinstance(self.scene.objective, Time)
        if not in_one or self.scene.tube is not None:
            return False  # in a tube there is hardly another
        best = self.best()
        creeps = problem_of(self.scene).rates_peak  # to where arms turn back, whatever the motion
        is_laborious = best.iterations > _LABORIOUS and not creeps
        return is_laborious or is_slow(self.scene, best.duration, _LONG)

    def best(self) -> Plan:
        """The plan of least cost, with all distinct optima where several attempts were made.

        Raises the first failure if there is none, NotConverged if nothing was attempted.
        """
        if self.plans:
            found = min(self.plans, key=lambda plan: plan.cost)
            return found if self.tried == 1 else replace(found, optima=self._optima())
        if self.failures:
            raise self.failures[0]
        raise NotConverged("no mesh keeps any first motion in the workspace", "No_Start", None)

    def best_known(self) -> Plan:
        """The best plan. Where it misses its tolerance, another that is hardly longer may know
        better how near it is to the optimum."""
        best = self.best()
        if best.within_tolerance:
            return best
        return replace(best, gap=min(quicker(best, each).gap for each in self.plans))

    def _optima(self) -> tuple[Optimum, ...]:
        """The distinct local minima that were found, best first."""
        if not self.scene.task.is_at_rest:
            return ()
        found = [(each.trajectory, each.cost, each.gap) for each in self.plans]
        return tuple(distinct(found, distance(self.scene.task)))


def by_merit(so_far: Outcomes, coarsest: int) -> Iterator[Attempt]:
    """What to attempt next from rest to rest. ``coarsest``: number of intervals of the first meshes
    at least.

    First every motion on the coarsest mesh on which it stays in the workspace, lines and curves
    before paths over a grid, then the best of them on finer meshes. Raises Unreachable if there is
    no first motion.
    """
    possible: list[Attempt] = []
    for proposals in rounds(so_far.scene):
        if so_far.is_near:
            break
        begun = len(possible)
        for proposal in proposals:
            if intervals_for(proposal.motion, coarsest):  # a mesh keeps it in the workspace
                possible.append(from_motion(so_far.scene, proposal, coarsest))
                yield possible[-1]
        if not so_far.plans:
            yield from _away(possible[begun:])
    possible.sort(key=lambda attempt: attempt.motion.duration)
    for factor in _FINER:
        yield from finer(possible[:_TRIED_FINER], factor)


def _away(attempts: Sequence[Attempt]) -> Iterator[Attempt]:
    """Some of these attempts again, away from the parallel singularity."""
    return filter(None, (attempt.away for attempt in attempts[:_KEPT_AWAY]))


def in_phases(so_far: Outcomes, coarsest: int, proposals: Iterator[Proposal]) -> Iterator[Attempt]:
    """What to attempt next in phases or where an end moves.

    First all first motions on the coarsest mesh on which they stay in the workspace, until one is
    near an optimum; that then on a finer mesh. Where none led to a plan, some away from the
    parallel singularity, all on finer meshes, and legs past bodies on finer ones still. A motion
    that two sources propose, as a quintic to rest and a stop, is attempted once.
    """
    tried = list[Attempt]()
    for proposal in proposals:
        if any(proposal.motion.position == attempt.motion.position for attempt in tried):
            continue
        tried.append(from_motion(so_far.scene, proposal, coarsest))
        yield tried[-1]
        if so_far.is_near:
            break
    if not so_far.plans:
        yield from _away(tried)
    yield from finer(tried[-1:] if so_far.is_near else tried, _FINER[0])
    if not so_far.plans:  # between the points of coarser meshes there may be a thin body
        yield from finer([attempt for attempt in tried if attempt.is_near], _FINER[1])


def from_motion(scene: Scene, proposal: Proposal, coarsest: int) -> Attempt:
    """The attempt from a first motion on the coarsest mesh, of at least so many intervals, that
    keeps it in the workspace and in a tube; if none does the former, on the coarsest."""
    motion = proposal.motion
    intervals = intervals_after_waiting(motion, coarsest * max(1, proposal.legs))
    intervals = intervals_for(motion, intervals) or intervals
    if scene.tube is not None:
        intervals = intervals_in_tube(scene, motion, intervals)
    return Attempt(scene, motion, intervals, proposal.name, is_near=proposal.legs > 0)


def finer(attempts: Iterable[Attempt], factor: int) -> Iterator[Attempt]:
    """Attempts on finer first meshes."""
    for attempt in attempts:
        yield replace(attempt, intervals=factor * attempt.intervals)


def what_came_of(tried: int, led: int, best: Plan, usual: Plan | None) -> str:
    """In words, what so many other first motions, ``led`` of them to plans, gained beside the
    ``usual`` plan, which is None if these led to the only ones."""
    begin = f"{tried} more first motion{' was' if tried == 1 else 's were'} tried"
    if usual is None:
        result = f"the usual ones led to no plan, {led} of these did"
    elif led == 0:
        result = "none led to a plan"
    else:
        saved, is_time = 1 - best.cost / usual.cost, isinstance(best.scene.objective, Time)
        if saved > usual.tolerance:
            by = f"{100 * saved:.2g} %"
            result = f"the best is {by} faster" if is_time else f"the best costs {by} less"
        else:
            better = "faster" if is_time else "better"
            result = f"none is {better} by more than the tolerance"
        result = result if led == tried else f"{led} led to a plan, {result}"
    return f"{begin}, other ways and random ones: {result}; any others were not looked at"
