"""Switch resolution: from a detected switching structure to an optimal motion with exact switches.

Newton's method finds the stationary motion of a structure. Arcs that vanish are left out; where the
motion exceeds a limit, or a multiplier has the wrong sign, the active set is updated; where
polynomials are not fine enough, they are refined. This is repeated until nothing is wrong, or given
up after so many attempts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from deltaopt.errors import NotConverged
from deltaopt.motion.certificate import Certificate, spread
from deltaopt.motion.time_scaling import safe_factor
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.flat.constraint_rows import ConstraintRows
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.switching.active_set import ActiveSetUpdate
from deltaopt.planning.switching.arc_mesh import ArcMesh
from deltaopt.planning.switching.conditions import EndValue, OptimalityConditions
from deltaopt.planning.switching.kkt_system import KKTSystem
from deltaopt.planning.switching.newton import NewtonFailed, StationaryPoint, solve_conditions
from deltaopt.planning.switching.residuals import OptimalityResiduals
from deltaopt.planning.switching.structure import SwitchingStructure, changed

_DEGREE = 8
"""Degree of the acceleration in an interval: a lower one asks for more intervals, a higher one for
more nodes; the size of the condensed system depends on intervals alone."""
_ATTEMPTS = 10
"""Most structures and meshes tried from one detected structure: few that need more converge."""
_MOST_INTERVALS, _MOST_MODES, _MORE_MODES = 48, 24, 3
"""Most intervals and Legendre coefficients, beyond which a finer mesh takes longer than other
structures, and by how many the coefficients are increased at once."""
CERTIFIED = 1e-5
"""Largest spread of the Hamiltonian and multiplier of the wrong sign of a resolved motion. Wrong
structures exceed it by orders of magnitude, right ones fall short of it by as much."""
_GROSS, _FAR_BEYOND = 1e-3, 0.05
"""Multiplier of the wrong sign, and excess of a row, that no finer polynomials mend: beyond them
the active set is updated first, below them the mesh is refined first."""
_SINGULAR_MULTIPLIER = 1e-4
"""Largest multiplier of a singular control, relative to the largest: looser than ``CERTIFIED``
because such a control is a polynomial, which is no better at its ends."""


class Unresolved(NotConverged):
    """No optimal motion was found whose structure is near the detected one."""


@dataclass(frozen=True)
class ResolvedMotion:
    """A motion with resolved switches, not yet slowed down to its limits.

    ``safe_factor``: by which it has to be slowed. ``gap``: what slowing costs, and what is lost
    between nodes, as a fraction of the duration. ``iterations``: of Newton's method.
    """

    conditions: OptimalityConditions
    trajectory: Trajectory
    safe_factor: float
    gap: float
    certificate: Certificate
    iterations: int
    status: ClassVar[str] = "Solve_Succeeded"  # as a solver of programs would report it

    @property
    def name(self) -> str:
        """A description of the transcription."""
        mesh = self.conditions.mesh
        return f"{mesh.arcs} arcs, acceleration of degree {mesh.polynomials.degree}"


@dataclass(frozen=True)
class _Candidate:
    """A structure and a mesh to solve for. ``more_modes``: how many more Legendre coefficients of
    singular controls than at first."""

    structure: SwitchingStructure
    mesh: ArcMesh
    more_modes: int = 0
    end_values: tuple[EndValue, ...] = ()

    @classmethod
    def of(cls, structure: SwitchingStructure, more_modes: int = 0) -> _Candidate:
        """A candidate with a mesh for its structure."""
        return cls(structure, ArcMesh.of(structure, _DEGREE, more_modes), more_modes)

    def with_lengths_of(self, found: StationaryPoint) -> _Candidate:
        """This candidate with the lengths that were found, zero where an arc is vanishing."""
        lengths = np.where(found.vanishing, 0.0, found.point.lengths / found.point.duration)
        return replace(self, structure=replace(self.structure, lengths=lengths))


_Outcome = tuple[Trajectory, int, ResolvedMotion | None, _Candidate | None]
"""What Newton's method made of a candidate: the motion, in how many iterations, the result if it is
one, otherwise the candidate for the next solve, if one is better."""


@dataclass(frozen=True)
class SwitchResolution:
    """What is the same for all structures. ``barrier``: as of ``OptimalityConditions``."""

    rows: ConstraintRows
    scaling: Scaling
    tolerance: float
    barrier: float = 0.0

    def from_structure(self, structure: SwitchingStructure, guess: Trajectory) -> ResolvedMotion:
        """The optimal motion whose structure is near the given one, with a gap within the
        tolerance. ``guess``: a motion of about this structure.

        Raises Unresolved if no such motion is found.
        """
        candidate, seen, iterations = _Candidate.of(structure), {structure.limits}, 0
        for _ in range(_ATTEMPTS):
            try:
                motion, steps, resolved, better = self._outcome(candidate, guess)
            except NewtonFailed as error:
                raise Unresolved(str(error), "Stuck", guess) from None
            iterations += steps
            if resolved:
                return replace(resolved, iterations=iterations)
            others = seen - {candidate.structure.limits}
            if better is None or better.structure.limits in others:
                message = "no other structure is known to be better"
                raise Unresolved(message, "Cycle", motion)
            seen.add(better.structure.limits)
            candidate, guess = better, motion
        raise Unresolved(f"no structure is right after {_ATTEMPTS}", "Too_Many", guess)

    def _outcome(self, candidate: _Candidate, guess: Trajectory) -> _Outcome:
        """Solves for a candidate and examines what is found. Raises NewtonFailed."""
        model = self.scaling.problem.model
        conditions = OptimalityConditions(
            self.rows,
            candidate.structure,
            candidate.mesh,
            self.scaling.at_goal,
            self.scaling.parameters,
            candidate.end_values,
            self.barrier,
        )
        found = solve_conditions(conditions, guess, self.scaling)
        candidate = candidate.with_lengths_of(found)
        trajectory = Trajectory(conditions.polynomial(found.point, self.scaling), model)
        if candidate.structure.lengths.min() <= 0:
            reordered = _Candidate.of(changed(candidate.structure, []), candidate.more_modes)
            return trajectory, found.iterations, None, reordered
        conditions = replace(conditions, structure=candidate.structure)
        residuals = OptimalityResiduals(conditions, found.point, self.tolerance / 2)
        resolved = self._resolved(residuals, trajectory, found.iterations)
        better = None if resolved else _better(candidate, residuals, self.tolerance)
        return trajectory, found.iterations, resolved, better

    def _resolved(
        self, residuals: OptimalityResiduals, trajectory: Trajectory, iterations: int
    ) -> ResolvedMotion | None:
        """The result, if no residual says that it is none."""
        sign_violation, multiplier = residuals.sign_violation, residuals.singular_multiplier
        if sign_violation > CERTIFIED or multiplier > _SINGULAR_MULTIPLIER:
            return None
        lost, excess = residuals.to_be_gained, residuals.excess
        if max(excess, lost, residuals.unused) > self.tolerance:
            return None
        factor = safe_factor(self.scaling.problem, trajectory)
        gap = factor - 1 + residuals.unused + lost
        uneven = spread(KKTSystem(residuals.conditions, residuals.point).hamiltonian)
        if gap > self.tolerance or uneven > CERTIFIED:
            return None
        if any(each.has_wrong_sign.any() for each in residuals.state_multipliers):
            return None
        falls = (float(each.falls.max()) for each in residuals.state_multipliers)
        certificate = Certificate(uneven, max(sign_violation, multiplier, *falls))
        return ResolvedMotion(
            residuals.conditions, trajectory, factor, gap, certificate, iterations
        )


def _better(
    candidate: _Candidate, residuals: OptimalityResiduals, tolerance: float
) -> _Candidate | None:
    """The candidate for the next solve: a finer discretisation of the same structure, or else
    another structure; the other way round where residuals are gross."""
    if residuals.sign_violation > _GROSS or residuals.excess > _FAR_BEYOND:
        better = _restructured(candidate, residuals) or _finer(candidate, residuals, tolerance)
    else:
        better = _finer(candidate, residuals, tolerance) or _restructured(candidate, residuals)
    return better or _with_more_modes(candidate, residuals)


def _finer(
    candidate: _Candidate, residuals: OptimalityResiduals, tolerance: float
) -> _Candidate | None:
    """The candidate with more intervals, Legendre coefficients or end values, if it needs them."""
    finest, strays, mesh = residuals.finest, residuals.strays, candidate.mesh
    if strays.max() > finest and mesh.intervals < _MOST_INTERVALS:
        finer = np.ceil((strays / finest).clip(1) ** (1 / (_DEGREE + 1)))
        return replace(candidate, mesh=replace(mesh, parts=mesh.parts * finer.astype(np.intp)))
    multiplier, wrong = residuals.singular_multiplier, residuals.sign_violation
    coarse = multiplier > _SINGULAR_MULTIPLIER or residuals.to_be_gained > tolerance
    coarse = coarse or CERTIFIED < wrong < 10 * multiplier
    if coarse and (more := _with_more_modes(candidate, residuals)):
        return more
    new = tuple(end for end in residuals.end_values() if end not in candidate.end_values)
    return replace(candidate, end_values=candidate.end_values + new) if new else None


def _with_more_modes(candidate: _Candidate, residuals: OptimalityResiduals) -> _Candidate | None:
    """The candidate with more Legendre coefficients of singular controls, where there are such
    controls and more coefficients are worth their time."""
    mesh, more = candidate.mesh, candidate.more_modes + _MORE_MODES
    if not residuals.conditions.active.singular or mesh.most_modes >= _MOST_MODES:
        return None
    finer = replace(mesh, modes=mesh.modes + _MORE_MODES)
    return replace(candidate, mesh=finer, more_modes=more)


def _restructured(candidate: _Candidate, residuals: OptimalityResiduals) -> _Candidate | None:
    """The candidate with all changes of the active set, if these give another structure."""
    structure = changed(candidate.structure, ActiveSetUpdate(residuals).changes)
    if structure.limits == candidate.structure.limits:
        return None
    return _Candidate.of(structure, candidate.more_modes)
