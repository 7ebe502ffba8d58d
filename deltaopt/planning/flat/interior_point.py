"""The flat problem by an interior-point method of its own, in machine code.

What makes it fast is what a general solver cannot know: the motion between two knots is a
cubic in X and V there, so nothing is left to be continuous; torques are functions of the
motion, so no equation is left either; four points are evaluated at once, in the lanes of a
vector; and Newton's equations are a band of 6 × 6 blocks. See ``interior_point.c``.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib.resources import files

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.codegen.compile import library
from deltaopt.codegen.simd_c import LANES, VECTOR, c_function
from deltaopt.planning.flat.equations import PointEquations
from deltaopt.planning.nlp.program import Spent

Array = NDArray[np.float64]

STATUS = (
    "Solve_Succeeded",
    "Maximum_Iterations_Exceeded",
    "No_Progress",
    "Singular",
    "Invalid_Number_Detected",
)
"""By the number that ``solve`` returns; Ipopt's words where it has them."""


@dataclass(frozen=True)
class Settings:
    """``tolerance``: of complementarity and duration as fractions of the latter, and of rows.

    ``barrier``: complementarity at first, the same fraction. ``closest``: to a limit that a
    row may begin, as a fraction. ``iterations``: at most.
    """

    tolerance: float = 1e-5
    barrier: float = 0.2
    closest: float = 0.3
    iterations: int = 60


class _Settings(ctypes.Structure):
    _fields_ = (
        ("tolerance", ctypes.c_double),
        ("barrier", ctypes.c_double),
        ("closest", ctypes.c_double),
        ("iterations", ctypes.c_int64),
    )


class _Report(ctypes.Structure):
    _fields_ = (
        ("complementarity", ctypes.c_double),
        ("dual", ctypes.c_double),
        ("primal", ctypes.c_double),
        ("evaluating", ctypes.c_double),
        ("solving", ctypes.c_double),
        ("iterations", ctypes.c_int64),
        ("factorisations", ctypes.c_int64),
        ("evaluations", ctypes.c_int64),
    )


@dataclass(frozen=True)
class Interior:
    """Where the method ended. ``knots``: X, V at every knot, (N + 1, 6); ``T``; ``prices`` of
    torques, openings and speeds at every point, (N, 4, 6 or 9), positive at an upper limit.
    ``left``: by what fraction of T Newton's next step would shorten the motion."""

    knots: Array
    T: float
    prices: Array
    left: float
    status: str
    iterations: int
    spent: Spent

    @property
    def solved(self) -> bool:
        return self.status == STATUS[0]


@dataclass(frozen=True)
class CompiledMethod:
    """The method for one point function: three torques, three openings, speeds if limited."""

    code: ctypes.CDLL
    rows: int
    points: tuple[float, ...]

    def solve(
        self, mesh: Array, p: Array, share: Array, knots: Array, T: float, settings: Settings
    ) -> Interior:
        """From a guess, (N + 1, 6) and T, whose ends stay. ``p``: the point function's.
        ``share``: of the rows' limits that may be used, (N, rows)."""
        N = len(mesh)
        mesh, p, share = (np.ascontiguousarray(each) for each in (mesh, p, share))  # kept till done
        z = np.append(knots, T)
        prices, report = np.empty((N, LANES, self.rows)), _Report()
        status = self.code.solve(
            ctypes.c_int64(N),
            _pointer(mesh),
            self._fractions.ctypes.data_as(ctypes.c_void_p),
            _pointer(share),
            _pointer(p),
            _pointer(z),
            _pointer(prices),
            ctypes.byref(_Settings(*vars(settings).values())),
            ctypes.byref(report),
            self._memory(N),
        )
        knots, T = z[:-1].reshape(N + 1, 6), float(z[-1])
        spent = Spent(report.evaluating, report.solving)
        return Interior(knots, T, prices, report.dual, STATUS[status], report.iterations, spent)

    @cached_property
    def _fractions(self) -> Array:
        return np.array(self.points)

    def _memory(self, N: int) -> ctypes.c_void_p:
        """The largest so far, kept from call to call: fresh pages cost more than the solution."""
        size = -(-self.code.workspace(ctypes.c_int64(N)) // 8)
        if size > len(self._kept[0]):
            self._kept[0] = np.zeros(size)
        return _pointer(self._kept[0])

    @cached_property
    def _kept(self) -> list[Array]:
        return [np.empty(0)]


def _pointer(array: Array) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


@lru_cache(maxsize=16)
def interior_point(equations: PointEquations, points: tuple[float, ...]) -> CompiledMethod | None:
    """The method for the flat problem's equations, if there is machine code for it here."""
    if len(points) != LANES:
        return None
    built = library(source(equations))
    if built is None:
        return None
    code = ctypes.CDLL(str(built))
    code.workspace.restype = ctypes.c_int64
    return CompiledMethod(code, equations.constraints.number, points)


def source(equations: PointEquations) -> str:
    """C text: the rows at a point and their derivatives, then the method."""
    values, second = _functions(equations)
    rows, parameters = equations.constraints.number, equations.parameters.vector.numel()
    sizes = f"enum {{ NC = {rows}, NP = {parameters} }};"
    method = files("deltaopt.planning.flat").joinpath("interior_point.c").read_text()
    parts = [VECTOR, sizes, c_function(values, "values"), c_function(second, "second"), method]
    return "\n".join(parts)


def _functions(equations: PointEquations) -> tuple[ca.Function, ca.Function]:
    """``values`` and ``second`` as interior_point.c wants them, y = (X, V, A, T), then τ.

    Rows 1 to 3 are zero for the right τ, the rest within ±1.
    """
    y, tau = ca.SX.sym("y", 10), ca.SX.sym("tau", 3)
    p = ca.SX.sym("p", equations.parameters.vector.numel())
    r = equations.point_function.function(ca.vertcat(y[:9], tau, y[9]), p)
    lam = ca.SX.sym("lam", r.numel())
    B, r_0 = ca.jacobian(r[:3], tau), ca.substitute(r, tau, ca.SX.zeros(3))
    J, H = ca.jacobian(r, y), ca.hessian(ca.dot(lam, r), y)[0]
    H_tau = ca.jacobian(ca.gradient(ca.dot(lam, r), y), tau)
    upper = ca.vertcat(*(H[a, b] for b in range(10) for a in range(b + 1)))
    first = [r_0[:3], _by_rows(B), r_0[3:]]
    second = [_by_rows(J[:3, :]), _by_rows(J[3:, :]), upper, _by_rows(H_tau)]
    return (
        ca.Function("values", [y, p], [ca.densify(e) for e in first], {"cse": True}),
        ca.Function(
            "second",
            [ca.vertcat(y, tau), lam, p],
            [ca.densify(e) for e in second],
            {"cse": True},
        ),
    )


def _by_rows(matrix: ca.SX) -> ca.SX:
    return ca.vec(matrix.T)
