"""The models that are compared, each written out as one function per task.

K (virtual work; Kane with u = q̇) and L_E with each constraint matrix C, and L_I with its
one big linear system solved in several ways; L_E and L_I also with the paper's printed
M, Q̂* and Q instead of those that CasADi derives. Written out in scalars with common
subexpressions shared, but where L_I calls a linear solver at run time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca

from deltaopt.compare.dynamics.printed import as_printed
from deltaopt.compare.dynamics.tasks import Task
from deltaopt.dynamics.constraint_matrix import (
    ClosedForm,
    ConstraintMatrix,
    NullSpace,
    Partition,
)
from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.kane import Kane
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.dynamics.linear import solve_scalars
from deltaopt.dynamics.mechanism import Mechanism
from deltaopt.dynamics.virtual_work import VirtualWork
from deltaopt.mechanisms.delta.mechanism import DeltaParameters


@dataclass(frozen=True)
class Model:
    """A way to compute a task.

    ``name``: the paper's. ``variant``: the constraint matrix, or the linear solver.
    ``build``: its function, whose first result counts. ``systems``: the linear systems it
    solves, in words. ``compilable``: whether CasADi can write it in C.
    """

    name: str
    variant: str
    build: Callable[[Mechanism, Task], ca.Function]
    systems: Callable[[Mechanism, Task], str]
    compilable: bool = True


def models(partition: Partition, terms: DeltaParameters) -> list[Model]:
    """Return all models that are compared, for a Delta that has these terms.

    The paper's printed expressions are among them where it has all of these terms.
    """
    matrices: list[tuple[str, ConstraintMatrix, str]] = [
        ("closed form", ClosedForm(), "3 of 3×3"),
        ("partition", partition, "{gamma}×{gamma}"),
        ("null space", NullSpace(), "QR {n}×{gamma}"),
    ]
    kinds: list[tuple[str, Callable[[ConstraintMatrix], Formulation]]] = [
        ("K, virtual work", VirtualWork),
        ("K, Kane", Kane),
        ("L_E", Explicit),
    ]
    projected = [
        Model(name, variant, written_out(kind(C)), _small_systems(sizes))
        for name, kind in kinds
        for variant, C, sizes in matrices
    ]
    multiplier = [
        Model("L_I", "written out", _big_system_written_out, _big_system_size),
        Model("L_I", "sparse QR", _solved_by("qr"), _big_system_size),
        Model("L_I", "LAPACK LU", _solved_by("lapacklu"), _big_system_size, compilable=False),
    ]
    lagrange = [*(model for model in projected if model.name == "L_E"), *multiplier]
    printed = [] if terms.beyond_the_paper else [_printed(model, terms) for model in lagrange]
    return [*projected, *multiplier, *printed]


def _printed(model: Model, terms: DeltaParameters) -> Model:
    """A model with M, Q̂* and Q as the paper prints them."""

    def build(mechanism: Mechanism, task: Task) -> ca.Function:
        return model.build(as_printed(mechanism, terms), task)

    return replace(model, name=f"{model.name}, printed", build=build)


def written_out(formulation: Formulation) -> Callable[[Mechanism, Task], ca.Function]:
    """Return what writes a formulation without multipliers as one function in scalars."""

    def build(mechanism: Mechanism, task: Task) -> ca.Function:
        function = task.function(formulation, mechanism)
        x = function.mx_in()
        scalars = ca.Function("scalars", x, [function(*x)[0]]).expand()
        inputs = scalars.sx_in()
        return ca.Function("model", inputs, [ca.densify(ca.cse(scalars(*inputs)))])

    return build


def _big_system_written_out(mechanism: Mechanism, task: Task) -> ca.Function:
    inputs, A, b = task.big_system(mechanism)
    sought = solve_scalars(A, b)[: _sought(mechanism, task)]
    return ca.Function("model", inputs, [ca.densify(ca.cse(sought))])


def _solved_by(solver: str) -> Callable[[Mechanism, Task], ca.Function]:
    """One of CasADi's linear solvers, called at run time."""

    def build(mechanism: Mechanism, task: Task) -> ca.Function:
        inputs, A, b = task.big_system(mechanism)
        system = ca.Function("system", inputs, ca.cse([A, b]))
        x = system.mx_in()
        A_of_x, b_of_x = system(*x)
        solution = ca.solve(A_of_x, b_of_x, solver)
        return ca.Function("model", x, [solution[: _sought(mechanism, task)]])

    return build


def _sought(mechanism: Mechanism, task: Task) -> int:
    """How many of the big system's unknowns are asked for; the others are multipliers."""
    return task.big_system(mechanism)[1].shape[1] - mechanism.lam.numel()


def _small_systems(of_C: str) -> Callable[[Mechanism, Task], str]:
    def systems(mechanism: Mechanism, task: Task) -> str:
        gamma, n = mechanism.J.shape
        nu = n - gamma
        return f"{of_C.format(gamma=gamma, n=n)}, {nu}×{nu}"

    return systems


def _big_system_size(mechanism: Mechanism, task: Task) -> str:
    rows, columns = task.big_system(mechanism)[1].shape
    return f"{rows}×{columns}"
