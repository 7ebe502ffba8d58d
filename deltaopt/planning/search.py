"""The search for a plan: what is attempted, in which order, and what came of it.

An attempt is an optimisation from one first motion on one first mesh. What goes wrong in it ends
it alone. The number of attempts is bounded, and so are the iterations of each.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from math import inf
from typing import Generic, Protocol, TypeVar

from deltaopt.curves.piecewise import Array
from deltaopt.errors import DeltaOptError, NotConverged
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.first_motions.order_of_merit import (
    CrossesSingularity,
    intervals_for,
    intervals_in_tube,
    is_slow,
    rounds,
)
from deltaopt.planning.nlp.phases import first_mesh
from deltaopt.scene.feasibility import (
    distance_from_parallel,
    limit_room_at_ends,
    require_ends_on_one_side,
)
from deltaopt.scene.objective import Time
from deltaopt.scene.scene import Scene

_KEPT_VOLUME = 0.01
"""Distance from the parallel singularity that plans are then kept at, unless an end is nearer: more
costs time where the best motion comes close, less brings torques that peak between points."""
_KEPT_AWAY = 2
"""From how many of the first motions of a round it is tried again at that distance where nothing
else succeeded: iterates may lose their way in the singularity, whatever the first motion."""
_TORQUE_KEPT = (3e-4, 1e-3, 1e-2)
"""Parts of the torque limits that meshes leave unused where gravity takes almost all of them
somewhere, so that slowing cannot make up for what is exceeded between points; at most half of what
gravity leaves at start and goal. The gap counts what it costs."""
_NEARLY = 1e-2
"""Gap below which a plan that misses its tolerance is near an optimum: then finer meshes may bring
it there, and paths over a grid, which take long, will not."""
FINER, _TRIED_FINER = (2, 4), 3
"""How many times finer first meshes are tried where nothing else succeeded, and from how many of
the best first motions."""
_LONG, _LABORIOUS = 4.0, 400
"""A plan that takes more than so many times the lower bound, or took more iterations than this, may
be a poor local minimum. Hardly any random move is the first, and one in a hundred the second:
usual are thirty iterations. Fewer would make more plans take three times as long in vain."""
_SECOND_LOOKS = 2
"""How many attempts more are then made. More of them find little for what they cost."""


class HeldByMotion(NotConverged):
    """Somewhere the motion found needs its speed to keep a limit that is exceeded at rest."""


@dataclass(frozen=True)
class Attempt:
    """What an attempt to plan begins with.

    ``scene``: the scene, perhaps with more limits than were asked for. ``motion``: the first
    motion. ``intervals``: of the first mesh. ``accuracy``: relative tolerance of the solver there.
    ``torque_share``: the part of torque limits that meshes may use, so that what is exceeded
    between their points stays below the whole. ``is_near``: whether the first motion is the best
    one on another mesh. ``on_its_mesh``: whether the first mesh has the knots of the motion, in
    place of as many equal intervals as are given. ``softer``: scenes of the first meshes, as of
    ``Refinement``. ``most``: the duration of a plan that is known, s; the attempt ends where it
    will not undercut it.
    """

    scene: Scene
    motion: Trajectory
    intervals: int
    accuracy: float
    torque_share: float = 1.0
    is_near: bool = False
    on_its_mesh: bool = False
    softer: tuple[Scene, ...] = ()
    most: float = inf

    @property
    def mesh(self) -> Array:
        """The intervals of the first mesh as fractions of the duration, (N,)."""
        if self.on_its_mesh:
            return self.motion.shares
        return first_mesh(self.scene.task, self.motion, self.intervals)

    def __str__(self) -> str:
        parts = [f"{self.intervals} intervals"]
        given = self.scene.given("parallel_singularity")
        if given:
            parts.append(f"at a distance of {given:.2g} from the parallel singularity")
        if self.torque_share < 1:
            parts.append(f"with {self.torque_share:.2%} of the torques")
        return f"from a first motion of {self.motion.duration:.4g} s, " + ", ".join(parts)

    @property
    def away(self) -> Attempt | None:
        """The same attempt with motions kept at a distance from the parallel singularity; None if
        they are already."""
        if self.scene.given("parallel_singularity"):
            return None
        margin = min(_KEPT_VOLUME, distance_from_parallel(self.scene) / 2)
        limits = self.scene.limits
        given = {} if limits is None else limits.model_dump(exclude_none=True)
        limited = {"limits": {"parallel_singularity": margin, **given}}
        return replace(self, scene=self.scene.model_copy(update=limited))


class Found(Protocol):
    """A plan, as far as a search asks for it."""

    @property
    def gap(self) -> float: ...
    @property
    def duration(self) -> float: ...
    @property
    def iterations(self) -> int: ...
    @property
    def cost(self) -> float: ...


P = TypeVar("P", bound=Found)
"""The kind of plan that a search is for."""


@dataclass
class Search(Generic[P]):
    """Attempts to plan a scene, and what came of them.

    ``intervals``: of the coarsest first mesh. ``accuracy``: relative tolerance of the solver on
    first meshes. ``tolerance``: optimality gap at which the search ends. ``tried``: how many
    attempts were made. ``plans``: what they led to.
    """

    scene: Scene
    intervals: int
    accuracy: float
    tolerance: float
    tried: int = field(default=0, init=False)
    plans: list[P] = field(default_factory=list, init=False)
    _failures: list[DeltaOptError] = field(default_factory=list, init=False)
    _last: P | DeltaOptError | None = field(default=None, init=False)

    def attempts(self) -> Iterator[Attempt]:
        """What to attempt next, until a plan is good enough; after each, ``found`` or ``failed``
        must be told.

        First every motion on the coarsest mesh on which it stays in the workspace, lines and curves
        before paths over a grid, then the best of them on finer meshes. Where a plan that is good
        enough may be a poor local minimum, some of those that follow are tried too. Raises
        Unreachable if there is no first motion.
        """
        more: int | None = None
        for attempt in self._in_order():
            yield from self.with_remedies(attempt)
            if more is None and self._done:
                more = _SECOND_LOOKS if self._is_doubtful else 0
            elif more:
                more -= 1
            if more == 0:
                return

    def from_motion(self, motion: Trajectory) -> Attempt | None:
        """An attempt from a first motion; None if no mesh keeps it in the workspace."""
        intervals = intervals_for(motion, self.intervals)
        if intervals and self.scene.tube is not None:
            intervals = intervals_in_tube(self.scene, motion, intervals)
        return Attempt(self.scene, motion, intervals, self.accuracy) if intervals else None

    def with_remedies(self, attempt: Attempt) -> Iterator[Attempt]:
        """An attempt, and what may cure the way in which it fails.

        Raises Infeasible where every path leads through a parallel singularity.
        """
        yield attempt
        if isinstance(self._last, CrossesSingularity):
            require_ends_on_one_side(self.scene)
        if isinstance(self._last, CrossesSingularity) and attempt.away:
            yield from self.with_remedies(attempt.away)
        elif isinstance(self._last, HeldByMotion):
            room = limit_room_at_ends(self.scene) / 2
            for kept in _TORQUE_KEPT:
                if isinstance(self._last, HeldByMotion):
                    yield replace(attempt, torque_share=1 - min(kept, room))

    def _in_order(self) -> Iterator[Attempt]:
        possible: list[Attempt] = []
        for motions in rounds(self.scene):
            if self._is_near:
                break
            begun = len(possible)
            for motion in motions:
                attempt = self.from_motion(motion)
                if attempt:
                    possible.append(attempt)
                    yield attempt
            if not self.plans:
                away = (attempt.away for attempt in possible[begun : begun + _KEPT_AWAY])
                yield from (attempt for attempt in away if attempt)
        possible.sort(key=lambda attempt: attempt.motion.duration)
        for factor in FINER:
            for attempt in possible[:_TRIED_FINER]:
                yield replace(attempt, intervals=factor * attempt.intervals)

    def found(self, plan: P) -> None:
        """An attempt led to a plan."""
        self.tried += 1
        self._last = plan
        self.plans.append(plan)

    def failed(self, error: DeltaOptError) -> None:
        """An attempt failed."""
        self.tried += 1
        self._last = error
        self._failures.append(error)

    def best(self) -> P:
        """The plan of least cost. Raises NotConverged if there is none."""
        if self.plans:
            return min(self.plans, key=lambda plan: plan.cost)
        first = self._failures[0] if self._failures else None
        if self.tried == 1 and first is not None:
            raise first
        status, iterate = getattr(first, "status", "No_Start"), getattr(first, "iterate", None)
        raise NotConverged(
            f"none of {self.tried} attempts led to a plan, from a straight line of the platform, "
            "one in the motor angles, curves, and paths over a grid, as far as these are possible; "
            f"of the first: {first}",
            status,
            iterate,
        )

    @property
    def _done(self) -> bool:
        return any(plan.gap <= self.tolerance for plan in self.plans)

    @property
    def _is_doubtful(self) -> bool:
        """Whether the best plan may be a poor local minimum."""
        if not isinstance(self.scene.objective, Time) or self.scene.tube is not None:
            return False  # in a tube there is one first motion
        best = self.best()
        return best.iterations > _LABORIOUS or is_slow(self.scene, best.duration, _LONG)

    @property
    def _is_near(self) -> bool:
        return any(plan.gap <= _NEARLY for plan in self.plans)
