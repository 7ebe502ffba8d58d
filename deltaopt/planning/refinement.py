"""Mesh refinement: finer meshes until the optimality gap is within a tolerance.

Each mesh is solved from the solution on the mesh before. For small tolerances the switching
structure is then detected on a mesh and the instants of switching are resolved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import inf, isfinite
from typing import TYPE_CHECKING

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import ENDS_AN_ATTEMPT, NotConverged
from deltaopt.motion.certificate import Certificate
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.first_motions.order_of_merit import CrossesSingularity, crosses_singularity
from deltaopt.planning.journal import Progress
from deltaopt.planning.mesh.constraint_tightening import first_tightening
from deltaopt.planning.mesh.edges import first_phases, next_phases
from deltaopt.planning.mesh.error_estimate import (
    joined_estimate,
    longest_tightened,
    refined,
    shortest_intervals,
    split,
    with_knots_at,
)
from deltaopt.planning.mesh.gap import record_of, with_gap
from deltaopt.planning.mesh.kept_limits import tightest
from deltaopt.planning.mesh.mesh_solution import MeshSolution, solve_on_mesh
from deltaopt.planning.mesh.next_scaling import next_scaling
from deltaopt.planning.nlp.phases import FacePhases, joined
from deltaopt.planning.nlp.problem import Formulated, Guess
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.nlp.softening import Softening

if TYPE_CHECKING:  # it is loaded where a tolerance asks for it, so that other plans start faster
    from deltaopt.planning.switching.resolution import ResolvedMotion
    from deltaopt.planning.switching.resolver import SwitchResolver


_DETECTABLE_GAP, _MOST_DETECTIONS = 2e-3, 3
"""Gap below which a mesh solution shows which limit is active when, and from how many such meshes
the switching structure is detected. More attempts hardly ever succeed, and each costs as much as
solving a mesh."""
_SHARP_GAP = 1e-5
"""Gap below which switches are sharp on a mesh, so that one more detection is worth its time."""
_REDUCTION, _REDUCTION_AFTER_DETECTION = 32.0, 16.0
"""By what factor the gap is to fall from one mesh to the next, and after a detection that failed.
A larger factor saves meshes, but splits all intervals of a coarse mesh, whether they need it or
not."""
_TARGET_SHARE = 0.4
"""Share of the tolerance that the last mesh is refined for. The rest is for slowing, for what the
solver leaves, and for the safety factor; a larger share takes more meshes, a smaller one finer."""
_LARGEST_TARGET = 1e-3
"""Largest relative time loss that a mesh is refined for, even if the gap is infinite because the
motion cannot be slowed to its limits. Meshes that are refined for more have hardly more intervals
than the ones before, which tells nothing: loose tolerances were missed, though tighter ones were
met in less time."""
_SOLVER_MARGIN, _LOOSEST_TOLERANCE = 300.0, 1e-4
"""The solver's relative tolerance on a mesh: the gap of the mesh before divided by the first, at
most the second; a third of the plan's tolerance if that is looser, and half as much, a third as
much, … on a mesh that is solved again, for what the solver left may be why. A tighter one costs
iterations, a looser one hides the error of the mesh behind the solver's."""
_SMALLEST_TARGET = 3e-7
"""Smallest relative time loss that a mesh is refined for. Below it the loss cannot be
distinguished from what the solver leaves."""
_MOST_MESHES, _MOST_REPEATS, _MOST_FAILURES = 17, 4, 2
"""Largest numbers of meshes, of solves in a row on the same mesh with limits tightened further, and
of solves in a row that do not converge. They bound the time of a plan that makes no progress."""

_MOST_EDGES = 3
"""From how many meshes phases past the edges that they touch are tried."""
_HOPELESS_GAP, _MOST_CROSSINGS = 0.1, 2
"""Gap above which a mesh solution is looked at for a parallel singularity between its points, and
how many in a row may pass through one. The first may, on a coarse mesh, and later ones turn back;
hardly any turns back after two, and each costs as much as a plan."""


_ASIDE, _MOST_ASIDE = 1e-4 * np.array([0.0, np.cos(np.pi / 12), np.sin(np.pi / 12)]), 2
"""How far guesses for the first meshes are led aside, a share of their extent: out of every plane
in which a Delta robot is symmetrical; and for how many meshes. A motion in such a plane is
stationary, so that the solver stays there, and may be no minimum: of 800 motions of an industrial
robot between places of such a plane 13 took up to 6e-4 longer than others beside it, and were told
gaps of a tenth of that. Where a guess is barely possible, three times as much made it useless."""

_HOPEFUL = 2.0
"""How many times the estimated gap a motion may gain by finer meshes, when it is compared with one
that is known. A smaller factor gives up more ways past bodies on coarse meshes, whose estimates may
be too small."""


class Slower(NotConverged):
    """A motion that is given up because a faster one is known; ``duration``: about, s."""

    @property
    def duration(self) -> float:
        assert isinstance(self.iterate, Trajectory)
        return self.iterate.duration


@dataclass
class Refinement:
    """Refines the mesh of a problem, for one scene.

    ``tolerance``: relative optimality gap to reach. ``resolver``: resolves the instants of
    switching; None if they are not to be resolved. ``report``: is called with a line of text after
    every mesh. ``most``: duration (s) of a motion that is known; where no estimate lets hope for
    less, refinement ends. ``leads_past``: whether a motion leads through no body, though it may cut
    corners. ``meshes``: the solutions so far.
    """

    program: Formulated
    scaling: Scaling
    tolerance: float
    resolver: SwitchResolver | None
    report: Progress
    most: float = inf
    leads_past: Callable[[Trajectory], bool] = lambda _: True
    meshes: list[MeshSolution] = field(default_factory=list, init=False)
    _coarse_left: int = field(default=_MOST_DETECTIONS, init=False)
    _fine_left: int = field(default=1, init=False)
    _edges_left: int = field(default=_MOST_EDGES, init=False)
    _repeats: int = field(default=0, init=False)
    _failures: int = field(default=0, init=False)
    _crossings: int = field(default=0, init=False)

    def from_guess(self, first: Guess, mesh: Array) -> ResolvedMotion | None:
        """Refine from a first guess and a first mesh, its intervals as fractions of the duration.

        Returns the motion with resolved switches; None if they were not resolved: then the
        best of ``meshes`` is the result. Raises NotConverged if the first mesh is not solved,
        CrossesSingularity if solutions keep passing through a parallel singularity, and Slower if
        the motion will take longer than ``most``.
        """
        scaling, own = first_phases(self.program(mesh), self.scaling, first)
        try:
            self._solve(own, first, first_tightening(scaling, first.trajectory, own))
        except ENDS_AN_ATTEMPT:
            if scaling.faces is None or self.meshes:
                raise
            self._solve(mesh, first, first_tightening(self.scaling, first.trajectory, mesh))
        while not self._done:
            last = self.meshes[-1]
            gap = last.gap
            wanted = _TARGET_SHARE * self.tolerance
            target = max(min(max(wanted, gap / _REDUCTION), _LARGEST_TARGET), _SMALLEST_TARGET)
            resolve = self._next_resolution(last)
            if resolve:
                resolved = resolve(last)
                if resolved:
                    return resolved
                target = max(target, gap / _REDUCTION_AFTER_DETECTION)
            mesh = self._finer(last, target / 3**self._failures)
            faces = self._faces(last)
            mesh = mesh if faces is None else faces.on(mesh, self.scaling.problem.together)
            scaling = next_scaling(last, mesh, faces)
            if self._is_repetition(last, mesh, scaling):
                self.report(f"{len(last.mesh)} intervals: no finer mesh is known to be worth it")
                break
            looser = tightest(self.tolerance, faces) / (1 + self._repeats)
            accuracy = max(looser, min(gap / _SOLVER_MARGIN, _LOOSEST_TOLERANCE))
            try:
                self._solve(mesh, Guess(last.trajectory, near=True, tolerance=accuracy), scaling)
                self._failures = 0
            except (CrossesSingularity, Slower):
                raise
            except ENDS_AN_ATTEMPT as error:  # the meshes before remain
                self.report(f"{len(mesh)} intervals: {error}")
                self._failures += 1
                self._edges_left -= faces is not None
        last = self.meshes[-1]
        if self.resolver is None or last.gap >= _DETECTABLE_GAP or last.faces is not None:
            return None  # nor do arcs hold limits at edges
        return self.resolver.from_last(last)

    def certificate(self, chosen: MeshSolution) -> Certificate | None:
        """The certificate of a mesh solution; None if it has none."""
        if self.resolver is None or chosen.faces is not None:
            return None
        return self.resolver.certificate(chosen)

    @property
    def _done(self) -> bool:
        spent = len(self.meshes) >= _MOST_MESHES or self._failures > _MOST_FAILURES
        return self._within_tolerance or spent

    @property
    def _within_tolerance(self) -> bool:
        """Whether the gap is small enough, after two meshes at least: the error estimate is
        corrected by comparing two; and no limit of position is exceeded."""
        last = self.meshes[-1]
        small = len(self.meshes) > 1 and last.gap <= self.tolerance
        return small and isfinite(last.safe_duration)

    def _softening(self, guess: Guess) -> Softening | None:
        """How much softer friction is on the next mesh."""
        problem = self.scaling.problem
        if not self.meshes:
            first = Softening.of(problem, guess.trajectory, self.tolerance)
            return first and replace(first, covers=guess.near)
        last = self.meshes[-1]
        known = last.scaling.softening
        return known and known.after(problem, last.lost_to_friction, self.tolerance, self._failures)

    def _solve(self, mesh: Array, guess: Guess, scaling: Scaling) -> None:
        if len(self.meshes) < _MOST_ASIDE and not guess.on_its_mesh:
            way = guess.trajectory.extent * _ASIDE
            guess = replace(guess, trajectory=guess.trajectory.beside(way))
        scaling = replace(scaling, softening=self._softening(guess))
        found = solve_on_mesh(self.program(mesh), scaling, guess)
        if not (found.needed.keeps_places or self.leads_past(found.trajectory)):
            raise NotConverged(
                f"on {len(mesh)} intervals it leads through a body",
                found.status,
                found.trajectory,
            )
        self.meshes.append(with_gap(found, self.meshes))
        if self._within_tolerance and self.scaling.problem.may_be_slowed:
            # So far limits were checked at samples: now at all instants.
            self.meshes[-1] = with_gap(self.meshes[-1].exact(), self.meshes[:-1])
        self.report(str(record_of(self.meshes[-1])))
        self._require_one_side()
        self._require_fast()

    def _require_fast(self) -> None:
        """Raise Slower where even twice the gap below its duration the motion is too slow."""
        last = self.meshes[-1]
        if last.trajectory.duration > (1 + _HOPEFUL * last.gap) * self.most:
            raise Slower("a faster motion is known", last.status, last.trajectory)

    def _require_one_side(self) -> None:
        """Raise CrossesSingularity where solutions pass through a parallel singularity."""
        last = self.meshes[-1]
        if last.gap <= _HOPELESS_GAP:
            return  # torques that grow without bound would have raised the gap
        crosses = crosses_singularity(last.problem, last.trajectory)
        self._crossings = self._crossings + 1 if crosses else 0
        if self._crossings >= _MOST_CROSSINGS:
            raise CrossesSingularity(
                "solutions pass through a parallel singularity, which no torques allow",
                last.status,
                last.trajectory,
            )

    def _finer(self, last: MeshSolution, target: float) -> Array:
        """The next mesh, (N,), for a relative time loss of ``target``.

        It is the same mesh if limits that are exceeded between its points are all that is left,
        for tightening the limits there cures that.
        """
        lost, unused = last.lost, last.gap - last.exceeding
        if unused < self.tolerance / 2 and last.gap < _SHARP_GAP and not self._failures:
            lost = replace(lost, unused=np.zeros_like(lost.unused))
        together, before = self.scaling.problem.together, last.mesh
        if together > 1:
            before, lost = joined(before, together), joined_estimate(lost, together)
        shortest = shortest_intervals(last.trajectory, together)
        tightened = longest_tightened(self.scaling.problem, last.trajectory, before)
        mesh = refined(before, lost, target, shortest, tightened)
        mesh = mesh if together * len(mesh) <= last.program.finest else before
        contacts = last.contacts
        mesh = with_knots_at(mesh, contacts) if len(contacts) else mesh
        return mesh if together == 1 else split(mesh, together)

    def _faces(self, last: MeshSolution) -> FacePhases | None:
        """The phases of the next mesh past edges; None without."""
        known = last.faces
        if self._failures:
            return known
        found = None
        if self._edges_left > 0:
            found = next_phases(last.program, last.scaling, last.trajectory, last.solution)
        if known is None:
            return found
        if found is None or last.presses_beside_bodies(self.tolerance):
            self._edges_left -= 1
            return None
        return known if found.is_like(known) else found

    def _is_repetition(self, last: MeshSolution, mesh: Array, scaling: Scaling) -> bool:
        """Whether the next solve would repeat the last; counts solves on the same mesh."""
        N = len(mesh)
        self._repeats = self._repeats + 1 if len(last.mesh) == N else 0
        same = self._repeats and np.array_equal(scaling.shares(N), last.scaling.shares(N))
        return bool(same) or self._repeats > _MOST_REPEATS

    def _next_resolution(
        self, last: MeshSolution
    ) -> Callable[[MeshSolution], ResolvedMotion | None] | None:
        """The way to resolve the switches of the last mesh; None if that is not worth trying.

        Each mesh is tried once at most.
        """
        if self.resolver is None or self._failures or self._repeats or last.gap >= _DETECTABLE_GAP:
            return None
        if last.scaling.softening is not None or last.faces is not None:
            return None
        if last.gap < _SHARP_GAP and self._fine_left:
            self._fine_left -= 1
            return self.resolver.from_fine
        if not self._coarse_left:
            return None
        self._coarse_left -= 1
        return self.resolver.from_coarse
