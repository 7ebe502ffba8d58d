"""Whether the coordinates and torques that a motion reports are those of the scene's robot."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from deltaopt.codegen.vectorised import evaluate_rows
from deltaopt.curves.piecewise import Array
from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.errors import Unreachable
from deltaopt.mechanisms.functions import Functions
from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.model import model_of
from deltaopt.scene.scene import Scene
from deltaopt.verify.bounds import DYNAMIC_ERROR
from deltaopt.verify.resolved_curves import DEGREE, POINTS, WEIGHTS
from deltaopt.verify.units import Units, way_of


def model_errors(scene: Scene, trajectory: Trajectory) -> dict[str, float]:
    """E_K and E_D of the reported q, q̇, q̈ and τ, by the scene's mechanism."""
    units = Units(scene, trajectory)
    own = trajectory.coordinates
    degree = 0 if own is None else own.coefficients.shape[1] - 1
    parts = max(1, -(-2 * degree // DEGREE))  # twice as many nodes as determine the polynomials
    fractions = ((np.arange(parts)[:, None] + POINTS) / parts).ravel()
    weights = np.tile(WEIGHTS, parts) / parts  # in a mean over a piece
    q, dq, ddq = trajectory.coordinates_inside(fractions)
    tau = trajectory.model.inverse_dynamics(*trajectory.path_inside(fractions))
    model = model_of(scene.robot, scene.payload)
    functions = model.functions
    lengths = units.coordinates(functions)
    motion = [rows * units.time**k / lengths for k, rows in enumerate((q, dq, ddq))]
    arguments, parameters = [*motion, tau / units.torque(functions)], units.parameters(model)
    by = _residuals(functions, Explicit())
    kinematic, dynamic = evaluate_rows(by, *arguments, parameters=parameters)
    doubtful = np.logical_not(np.linalg.norm(dynamic, axis=1) <= DYNAMIC_ERROR)
    if doubtful.any():
        try:
            _, dynamic[doubtful] = evaluate_rows(
                _residuals(functions, Multiplier()),
                *(rows[doubtful] for rows in arguments),
                parameters=parameters,
            )
        except RuntimeError:  # what CasADi raises where a matrix is singular
            raise Unreachable(
                "its coordinates have no solution of the equations of motion"
            ) from None
    mean_speed = way_of(scene, trajectory) / trajectory.duration * units.time / units.length
    kinematic[:, functions.mechanism.holonomic.numel() :] /= mean_speed

    def mean(rows: Array) -> float:
        """(1/T) ∫ ‖row‖ dt of samples of every piece, (K · n, m)."""
        sizes = np.linalg.norm(rows, axis=1).reshape(-1, len(weights))
        return float(sizes @ weights @ np.diff(trajectory.knots)) / trajectory.duration

    return {"kinematic_error": mean(kinematic), "dynamic_error": mean(dynamic)}


@lru_cache(maxsize=16)
def _residuals(functions: Functions, formulation: Formulation) -> ca.Function:
    """(q, q̇, q̈, τ, p) -> (f, J q̇ + μ), q̈ - q̈(q, q̇, τ). By eq. (37) it is slower than by eq.
    (39) and accurate near serial singularities too, where eq. (39) is exact to rounding over the
    squared distance alone."""
    m = functions.mechanism
    closure = ca.Function("closure", [m.q, m.dq, m.parameters], [m.holonomic, m.constraint_rate])
    q, dq, ddq = (ca.MX.sym(name, m.q.numel()) for name in ("q", "dq", "ddq"))
    tau, p = ca.MX.sym("tau", 3), ca.MX.sym("p", functions.symbols().numel())
    modelled, _ = formulation.forward_dynamics(m)(0, q, dq, tau, p)
    kinematic = ca.vertcat(*closure(q, dq, p))
    found = ca.Function("residuals", [q, dq, ddq, tau, p], [kinematic, ddq - modelled])
    return found.expand() if formulation == Explicit() else found
