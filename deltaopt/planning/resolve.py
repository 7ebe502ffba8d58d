"""From a solution on a mesh to one whose switches are resolved, with its certificate."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from deltaopt.errors import NotConverged
from deltaopt.limits import safe_factor
from deltaopt.model import DeltaModel
from deltaopt.planning.arcs import ArcProblem
from deltaopt.planning.certificate import Certificate, certify
from deltaopt.planning.flat import ScaledEquations
from deltaopt.planning.nlp import Solution
from deltaopt.planning.scales import Scales
from deltaopt.planning.structure import Structure, changed
from deltaopt.trajectory import Trajectory

Array = NDArray[np.float64]

DEGREES = (5, 8, 11, 14)
"""Of the acceleration in an interval: the error falls by about 1e-2 from one to the next."""
CERTIFIED = 1e-5
"""Residual of Pontryagin's condition at most: wrong structures miss it by orders."""


@dataclass(frozen=True)
class Resolved:
    """A motion whose switches are resolved, not yet slowed.

    ``gap``: what slowing costs, and by how much two degrees differ, as a fraction.
    """

    problem: ArcProblem
    solution: Solution
    trajectory: Trajectory
    safe_factor: float
    gap: float
    certificate: Certificate


class Unsettled(NotConverged):
    """The structure read from the mesh is not that of an optimal motion."""


def resolve(
    equations: ScaledEquations,
    model: DeltaModel,
    structure: Structure,
    guess: Trajectory,
    scales: Scales,
    tolerance: float,
) -> Resolved:
    """Solve for the switches of a structure, with degrees until the gap is within a tolerance.

    Raises Unsettled where the program has no solution of this structure, or one that does not
    meet Pontryagin's condition.
    """
    p = np.concatenate([scales.vector(), model.parameters])
    coarser = _solve(equations, model, structure, guess, scales, p, DEGREES[0], None)
    structure, guess = _without_vanished(coarser), coarser.trajectory
    for degree in DEGREES[1:]:
        finer = _solve(equations, model, structure, guess, scales, p, degree, coarser)
        if finer.gap <= tolerance:
            break
        coarser = finer
    if not finer.certificate.residual <= CERTIFIED:
        raise Unsettled(
            f"Pontryagin's condition is missed by {finer.certificate.residual:.1e}",
            finer.solution.status,
            finer.solution.z,
        )
    return finer


def _without_vanished(found: Resolved) -> Structure:
    """The structure with the lengths that were found, less the arcs that have none."""
    lengths = (
        found.problem.lengths(found.solution.z) / found.problem.lengths(found.solution.z).sum()
    )
    return changed(replace(found.problem.structure, lengths=lengths), [])


def _solve(
    equations: ScaledEquations,
    model: DeltaModel,
    structure: Structure,
    guess: Trajectory,
    scales: Scales,
    p: Array,
    degree: int,
    coarser: Resolved | None,
) -> Resolved:
    """One degree; its gap is what it differs from the coarser one by, if there is one."""
    problem = ArcProblem(equations, structure, degree)
    try:
        solution = problem.program.solve(problem.pack(guess, scales), *problem.bounds(scales), p)
    except NotConverged as error:
        raise Unsettled(str(error), error.status, error.iterate) from None
    trajectory = Trajectory(problem.unpack(solution.z, scales), model)
    factor = safe_factor(scales.scene, trajectory)
    differ = abs(trajectory.duration / coarser.trajectory.duration - 1) if coarser else np.inf
    certificate = certify(problem, solution, p)
    return Resolved(problem, solution, trajectory, factor, factor - 1 + differ, certificate)
