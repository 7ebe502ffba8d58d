"""The models that are compared, each written out as one function per task, and these tasks.

K (virtual work; Kane with u = q̇) and L_E with each constraint matrix C, and L_I with its
one big linear system solved in several ways; L_E and L_I also with the paper's printed
M, Q̂* and Q instead of those that CasADi derives. Written out in scalars with common
subexpressions shared, but where L_I calls a linear solver at run time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from deltaopt.compare.dynamics.printed import PAPER, as_printed
from deltaopt.curves.piecewise import Array
from deltaopt.dynamics.constraint_matrix import ClosedForm, ConstraintMatrix, NullSpace
from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.kane import Kane
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.linear import solve_scalars
from deltaopt.dynamics.mechanism import SX, Mechanism
from deltaopt.dynamics.virtual_work import VirtualWork
from deltaopt.mechanisms.delta.mechanism import MOTOR_ANGLES


@dataclass(frozen=True)
class StateSamples:
    """N states with accelerations and torques that go with them, rounded once.

    ``q``, ``dq``, ``ddq``: N × n; ``tau``: N × m; ``parameters``: those of the mechanism.
    """

    q: Array
    dq: Array
    ddq: Array
    tau: Array
    parameters: Array


@dataclass(frozen=True)
class Computation:
    """A computation whose cost and error are measured, such as inverse dynamics.

    ``given``: the last of its inputs after time and state, ``sought``: what should come out, as
    `StateSamples` names them.
    """

    name: str
    given: str
    sought: str

    def function(self, formulation: Formulation, mechanism: Mechanism) -> ca.Function:
        """A formulation's own, of a mechanism; its first result counts."""
        found: ca.Function = getattr(formulation, f"{self.name}_dynamics")(mechanism)
        return found

    def big_system(self, mechanism: Mechanism) -> tuple[list[SX], SX, SX]:
        """Inputs, A and b of model L_I's linear system, the unknowns sought first."""
        found: tuple[list[SX], SX, SX] = getattr(Multiplier(), f"{self.name}_system")(mechanism)
        return found

    def inputs(self, samples: StateSamples) -> list[Array]:
        """All inputs but the parameters, (N, size) each."""
        given: Array = getattr(samples, self.given)
        return [np.zeros((len(samples.q), 1)), samples.q, samples.dq, given]

    def truth(self, samples: StateSamples) -> Array:
        """What should come out, (N, size)."""
        return np.asarray(getattr(samples, self.sought))


INVERSE = Computation("inverse", given="ddq", sought="tau")
"""Torques from the motion: q, q̇, q̈ → τ."""
FORWARD = Computation("forward", given="tau", sought="ddq")
"""Accelerations from torques: q, q̇, τ → q̈."""
TASKS = INVERSE, FORWARD


@dataclass(frozen=True)
class DynamicsModel:
    """A way to compute a task.

    ``name``: the paper's. ``variant``: the constraint matrix, or the linear solver.
    ``build``: its function, whose first result counts. ``sizes``: of the linear systems it
    solves, in words with ``{n}`` coordinates, ``{gamma}`` constraints, ``{nu}`` degrees of freedom
    and ``{all}`` unknowns of the big system. ``compilable``: whether CasADi can write it in C.
    """

    name: str
    variant: str
    build: Callable[[Mechanism, Computation], ca.Function]
    sizes: str = "{all}×{all}"
    compilable: bool = True

    def systems(self, mechanism: Mechanism, task: Computation) -> str:
        """The linear systems it solves, in words."""
        (gamma, n), unknowns = mechanism.J.shape, task.big_system(mechanism)[1].shape[1]
        return self.sizes.format(n=n, gamma=gamma, nu=n - gamma, all=unknowns)


def models() -> list[DynamicsModel]:
    """Return all models that are compared, for the paper's Delta."""
    matrices: list[tuple[str, ConstraintMatrix, str]] = [
        ("closed form", ClosedForm(), "3 of 3×3, {nu}×{nu}"),
        ("partition", MOTOR_ANGLES, "{gamma}×{gamma}, {nu}×{nu}"),
        ("null space", NullSpace(), "QR {n}×{gamma}, {nu}×{nu}"),
    ]
    kinds: list[tuple[str, Callable[[ConstraintMatrix], Formulation]]] = [
        ("K, virtual work", VirtualWork),
        ("K, Kane", Kane),
        ("L_E", Explicit),
    ]
    projected = [
        DynamicsModel(name, variant, written_out(kind(C)), sizes)
        for name, kind in kinds
        for variant, C, sizes in matrices
    ]
    multiplier = [
        DynamicsModel("L_I", "written out", _big_system_written_out),
        DynamicsModel("L_I", "sparse QR", _solved_by("qr")),
        DynamicsModel("L_I", "LAPACK LU", _solved_by("lapacklu"), compilable=False),
    ]
    lagrange = [*(model for model in projected if model.name == "L_E"), *multiplier]
    return [*projected, *multiplier, *map(_printed, lagrange)]


def _printed(model: DynamicsModel) -> DynamicsModel:
    """A model with M, Q̂* and Q as the paper prints them."""
    return replace(
        model,
        name=f"{model.name}, printed",
        build=lambda mechanism, task: model.build(as_printed(mechanism, PAPER), task),
    )


def written_out(formulation: Formulation) -> Callable[[Mechanism, Computation], ca.Function]:
    """Return what writes a formulation without multipliers as one function in scalars."""

    def build(mechanism: Mechanism, task: Computation) -> ca.Function:
        function = task.function(formulation, mechanism)
        x = function.mx_in()
        scalars = ca.Function("scalars", x, [function(*x)[0]]).expand()
        inputs = scalars.sx_in()
        return ca.Function("model", inputs, [ca.densify(ca.cse(scalars(*inputs)))])

    return build


def _big_system_written_out(mechanism: Mechanism, task: Computation) -> ca.Function:
    inputs, A, b = task.big_system(mechanism)
    sought = solve_scalars(A, b)[: _sought(mechanism, task)]
    return ca.Function("model", inputs, [ca.densify(ca.cse(sought))])


def _solved_by(solver: str) -> Callable[[Mechanism, Computation], ca.Function]:
    """One of CasADi's linear solvers, called at run time."""

    def build(mechanism: Mechanism, task: Computation) -> ca.Function:
        inputs, A, b = task.big_system(mechanism)
        system = ca.Function("system", inputs, ca.cse([A, b]))
        x = system.mx_in()
        A_of_x, b_of_x = system(*x)
        solution = ca.solve(A_of_x, b_of_x, solver)
        return ca.Function("model", x, [solution[: _sought(mechanism, task)]])

    return build


def _sought(mechanism: Mechanism, task: Computation) -> int:
    """How many of the big system's unknowns are asked for; the others are multipliers."""
    return task.big_system(mechanism)[1].shape[1] - mechanism.lam.numel()
