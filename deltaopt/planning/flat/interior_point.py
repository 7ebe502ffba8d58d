"""An interior-point method for time-optimal motions, in machine code.

What makes it fast is what a general solver cannot know: the motion between two knots is a
polynomial there, so nothing is left to be continuous; torques are functions of the motion, so
no equation is left either; four points are evaluated at once, in the lanes of a vector; and
the KKT system is block tridiagonal with a narrow border. See ``interior_point.c``.

What happens at a point (equations of motion, limits) is a `PointProblem`; a motion is a list of
`Phase` values between `Boundary` values.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from importlib.resources import files

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.codegen.compile import library
from deltaopt.codegen.simd_c import LANES, VECTOR, c_function
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


class Sides(Enum):
    """Which limits a constraint row has: at +1 (upper), at -1 (lower), or at both."""

    BOTH = (True, True)
    UPPER = (True, False)
    LOWER = (False, True)


Entries = dict[tuple[int, int], str]
"""The nonzeros of a sparse matrix: their C text, by row and column."""


@dataclass(frozen=True)
class PointFunctions:
    """``prepare``: p -> q, parameters and what depends on them alone. ``values``: (y, q) -> rows,
    T (integrands - 1), and e: tau and the inverse of -∂force/∂tau by columns. ``second``:
    (y, e, w, q) -> the nonzeros of the matrices that follow, by columns; w: weights of rows and
    integrands.

    Matrices: derivatives of the equations of motion by y; of rows and integrands by y and by tau;
    of the weighted sum with the equations' adjoint by y twice (the upper triangle), by tau and y,
    and by tau twice; y and tau being independent.
    """

    prepare: ca.Function
    values: ca.Function
    second: ca.Function
    force_by_y: Entries
    rows_by_y: Entries
    rows_by_tau: Entries
    twice_by_y: Entries
    by_tau_and_y: Entries
    twice_by_tau: Entries


@dataclass(frozen=True, eq=False)
class PointProblem:
    """Equations of motion, constraint rows and integrands at a point, as symbolic expressions.

    ``y``: X, V, A (and J), ``coordinates`` each, then T, the duration of the phase: position and
    its derivatives by time in units of T, (coordinates * (derivatives + 1) + 1,).
    ``derivatives``: unknowns of each coordinate at a knot: 2 for cubics between knots, 3 for
    quintics, whose acceleration is continuous.
    ``tau``: what the equations ``force`` = 0, as many and affine in them, determine; it is
    eliminated from all rows and from their derivatives.
    ``rows``: at most 1 or at least -1 or both, as ``sides`` says; they may be nonlinear in tau.
    ``integrands``: their mean over the whole motion is at most 1.
    ``p``: parameters, which may differ from phase to phase.
    """

    coordinates: int
    derivatives: int
    y: ca.SX
    tau: ca.SX
    p: ca.SX
    force: ca.SX
    rows: ca.SX
    sides: tuple[Sides, ...]
    integrands: ca.SX = field(default_factory=lambda: ca.SX(0, 1))

    def __post_init__(self) -> None:
        """Raises ValueError where sizes do not agree or the equations are not affine in tau."""
        if self.derivatives not in (2, 3):
            raise ValueError(f"knots carry 2 or 3 derivatives, not {self.derivatives}")
        if self.y.numel() != self.coordinates * (self.derivatives + 1) + 1:
            raise ValueError(f"y has {self.y.numel()} components")
        if self.force.numel() != self.tau.numel():
            raise ValueError(f"{self.force.numel()} equations for {self.tau.numel()} unknowns")
        if len(self.sides) != self.rows.numel():
            raise ValueError(f"sides of {len(self.sides)} rows, there are {self.rows.numel()}")
        if self.tau.numel() and any(ca.which_depends(self.force, self.tau, 2, True)):
            raise ValueError("the equations of motion are not affine in tau")

    @property
    def unknowns(self) -> int:
        """Unknowns at a knot."""
        return self.coordinates * self.derivatives

    @cached_property
    def functions(self) -> PointFunctions:
        """The expressions and their derivatives as functions of numbers.

        What depends on parameters alone is found once in a phase instead of at every point.
        """
        inverse = _inverse(-ca.jacobian(self.force, self.tau))
        tau = inverse @ ca.substitute(self.force, self.tau, ca.SX.zeros(self.tau.numel()))
        results = ca.substitute([self.rows, self._integrals], [self.tau], [tau])
        results.append(ca.vertcat(tau, ca.vec(inverse)))
        arguments, matrices = self._partial_derivatives()
        nonzeros = [matrix.nz[:] for matrix in matrices]
        reduced, symbols, parametric = ca.extract_parametric([*results, *nonzeros], self.p)
        q = ca.vertcat(self.p, *symbols)
        return PointFunctions(
            _function("prepare", [self.p], [ca.vertcat(self.p, *parametric)]),
            _function("values", [self.y, q], reduced[: len(results)]),
            _function("second_by_parts", [*arguments, q], reduced[len(results) :]),
            *(_entries(f"m{k}", matrix) for k, matrix in enumerate(matrices)),
        )

    def _partial_derivatives(self) -> tuple[list[ca.SX], list[ca.SX]]:
        """y, e, w; and the matrices of `PointFunctions`."""
        y, tau = self.y, self.tau
        inverse = ca.SX.sym("inverse", tau.numel(), tau.numel())
        nu = ca.SX.sym("nu", tau.numel())
        w = ca.SX.sym("w", self.rows.numel() + self.integrands.numel())
        c = ca.vertcat(self.rows, self._integrals)
        adjoint = inverse.T @ ca.gradient(ca.dot(w, c), tau)
        lagrangian = ca.dot(w, c) + ca.dot(nu, self.force)
        by_tau = ca.gradient(lagrangian, tau)
        matrices = [
            ca.jacobian(self.force, y),
            ca.jacobian(c, y),
            ca.jacobian(c, tau),
            ca.triu(ca.hessian(lagrangian, y)[0]),
            ca.jacobian(by_tau, y),
            ca.jacobian(by_tau, tau),
        ]
        matrices = [ca.sparsify(ca.substitute(matrix, nu, adjoint)) for matrix in matrices]
        return [y, ca.vertcat(tau, ca.vec(inverse)), w], matrices

    @property
    def _integrals(self) -> ca.SX:
        """Their integral over phases is nonpositive where the mean is at most 1."""
        return self.y[-1] * (self.integrands - 1)


def _function(name: str, arguments: list[ca.SX], results: list[ca.SX]) -> ca.Function:
    return ca.Function(name, arguments, [ca.densify(each) for each in results], {"cse": True})


def _inverse(B: ca.SX) -> ca.SX:
    """Of a matrix of expressions; by cofactors up to 3 x 3, with a single division."""
    if B.shape[0] > 3 or B.shape[0] == 0:
        return ca.inv(B) if B.shape[0] else ca.SX(0, 0)
    adjugate = ca.adj(B) if B.shape[0] > 1 else ca.SX(1)
    return adjugate * (1 / (B[0, :] @ adjugate[:, 0]))


def _entries(name: str, matrix: ca.SX) -> Entries:
    """Of a C array of a matrix's nonzeros by columns; ones as such."""
    nonzeros = matrix.nz[:]
    places = zip(*matrix.sparsity().get_triplet(), strict=True)
    return {
        place: "1" if nonzeros[k].is_one() else f"{name}[{k}]" for k, place in enumerate(places)
    }


# C text
#
# Products of sparse matrices are written out: rows depend on few components of y, and a compiler
# makes more of one long sum than of CasADi's single operations.


def source(problem: PointProblem, points: int) -> str:
    """C text of the method for a problem with that many points in an interval."""
    functions = problem.functions
    C, H, second = _with_torques_eliminated(problem)
    sides = [side.value for side in problem.sides]
    sizes = {
        "NM": problem.coordinates,
        "NR": problem.derivatives,
        "NY": problem.y.numel(),
        "NC": len(sides),
        "NI": problem.integrands.numel(),
        "NP": problem.p.numel(),
        "NQ": functions.prepare.numel_out(0),
        "NZ": len(C),
        "NH": len(H),
        "NE": functions.values.numel_out(2),
        "NG": points // LANES,
        "SIDES": sum(map(sum, sides)),
    }
    method = files("deltaopt.planning.flat").joinpath("interior_point.c").read_text()
    return "\n".join(
        [
            VECTOR,
            *(f"#define {name} {size}" for name, size in sizes.items()),
            _present("UPPER", [upper for upper, _ in sides]),
            _present("LOWER", [lower for _, lower in sides]),
            c_function(functions.prepare, "prepare"),
            c_function(functions.values, "values"),
            c_function(functions.second, "second_by_parts"),
            second,
            *_products_with_rows(C, H, problem.y.numel()),
            method,
        ]
    )


def _present(name: str, sides: Sequence[bool]) -> str:
    """A macro that says whether a row has that limit; a constant where all agree."""
    if len(set(sides)) < 2:
        return f"#define {name}(r) {int(any(sides))}"
    table = ", ".join(str(int(side)) for side in sides)
    return f"static const char {name}_TABLE[] = {{{table}}};\n#define {name}(r) ({name}_TABLE[r])"


def _with_torques_eliminated(problem: PointProblem) -> tuple[Entries, Entries, str]:
    """Derivatives of the rows, C, and of the weighted sum, H, by y, tau being a function of y; and
    the C function ``second`` that finds them and the derivatives of the integrands.

    With N the inverse of -∂force/∂tau, tau' = N ∂force/∂y, and the equations' multipliers chosen
    so that the sum does not change with tau:

        C = c_y + c_tau tau',   H = L_yy + tau'^T L_tauy + L_ytau tau' + tau'^T L_tautau tau'
    """
    partial, nt, ny = problem.functions, problem.tau.numel(), problem.y.numel()
    nc = len(problem.sides)
    N = {(k, j): f"e[{nt + nt * j + k}]" for k in range(nt) for j in range(nt)}
    lines = [
        f"V m{k}[{max(partial.second.size1_out(k), 1)}];" for k in range(partial.second.n_out())
    ]
    arrays = ", ".join(f"m{k}" for k in range(partial.second.n_out()))
    lines.append(f"second_by_parts(y, e, w, q, {arrays});")
    slope = _assign("slope", _product(N, partial.force_by_y), lines)
    bent = _add(partial.by_tau_and_y, _product(partial.twice_by_tau, slope))
    bent_entries = _assign("bent", bent, lines)
    rows = _add(partial.rows_by_y, _product(partial.rows_by_tau, slope))
    C = {place: f"C[{k}]" for k, place in enumerate(sorted(p for p in rows if p[0] < nc))}
    lines += [f"{C[place]} = {_sum(rows[place])};" for place in C]
    for k in range(problem.integrands.numel()):
        for a in range(ny):
            terms = rows.get((nc + k, a), [])
            lines.append(f"C[{len(C) + ny * k + a}] = {_sum(terms)};")
    by_tau = _product(_transposed(slope), bent_entries)
    mixed = _product(_transposed(partial.by_tau_and_y), slope)
    twice = _add(_add(partial.twice_by_y, by_tau), mixed)
    upper = sorted(place for place in twice if place[0] <= place[1])
    H = {place: f"H[{k}]" for k, place in enumerate(upper)}
    lines += [f"{H[place]} = {_sum(twice[place])};" for place in H]
    head = "second(const V *y, const V *e, const V *w, const V *q, V *C, V *H)"
    return C, H, _text(head, lines)


def _products_with_rows(C: Entries, H: Entries, ny: int) -> Iterator[str]:
    """The products with the derivatives of the rows by y that interior_point.c asks for."""
    depend = [sorted(r for r, a in C if a == b) for b in range(ny)]
    lines = [f"{entry} *= s[{r}];" for (r, _), entry in C.items()]
    yield _text("scale_rows(V *C, const double *s)", lines)
    lines = [f"dc[{r}] += {entry} * dy[{a}];" for (r, a), entry in C.items()]
    yield _text("along_rows(const V *C, const V *dy, V *dc)", lines)
    lines = [f"m[{a}] = {_sum([f'{C[r, a]} * q[{r}]' for r in depend[a]])};" for a in range(ny)]
    yield _text("across_rows(const V *C, const V *q, V *m)", lines)
    lines = ["V q[NC];"]
    for b in range(ny):
        lines += [f"q[{r}] = s[{r}] * {C[r, b]};" for r in depend[b]]
        for a in range(b + 1):
            terms = [H[a, b]] if (a, b) in H else []
            terms += [f"q[{r}] * {C[r, a]}" for r in depend[b] if r in depend[a]]
            twin = f"S[{b}][{a}] = " if a < b else ""
            lines.append(f"{twin}S[{a}][{b}] = {_sum(terms)};")
    yield _text("curvature_of_rows(const V *C, const V *H, const V *s, V (*S)[NY])", lines)


Terms = dict[tuple[int, int], list[str]]
"""The nonzeros of a matrix as sums of C texts."""


def _product(A: Entries, B: Entries) -> Terms:
    product: Terms = {}
    for (i, k), a in A.items():
        for (other, j), b in B.items():
            if other == k:
                factors = [factor for factor in (a, b) if factor != "1"]
                product.setdefault((i, j), []).append(" * ".join(factors) or "ALL(1.0)")
    return product


def _add(A: Entries | Terms, B: Terms) -> Terms:
    total = {place: [a] if isinstance(a, str) else list(a) for place, a in A.items()}
    for place, terms in B.items():
        total.setdefault(place, []).extend(terms)
    return total


def _assign(name: str, matrix: Terms, lines: list[str]) -> Entries:
    """Add lines that store a matrix in an array of that name."""
    entries = {place: f"{name}[{k}]" for k, place in enumerate(matrix)}
    lines.append(f"V {name}[{max(len(matrix), 1)}];")
    lines += [f"{entry} = {_sum(matrix[place])};" for place, entry in entries.items()]
    return entries


def _transposed(A: Entries) -> Entries:
    return {(j, i): entry for (i, j), entry in A.items()}


def _sum(terms: Sequence[str]) -> str:
    return " + ".join("ALL(1.0)" if term == "1" else term for term in terms) or "ALL(0.0)"


def _text(head: str, lines: Sequence[str]) -> str:
    body = "\n".join(f"  {line}" for line in lines)
    return f"static void {head} {{\n{body}\n}}\n"


# A motion


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


@dataclass(frozen=True)
class Boundary:
    """What is known of the state where a phase begins or ends: each component fixed or free.

    ``state``: position, velocity (and acceleration for quintics), (derivatives, coordinates), in
    constant units; what is free there is of no account. ``free``: which components are, the same
    shape; where two phases meet they are continuous. ``drift``: velocity of a position that
    moves, (coordinates,); ``state`` then has the position at the time 0 of the whole motion.
    """

    state: Array
    free: NDArray[np.bool_]
    drift: Array

    @classmethod
    def at_rest(cls, position: Array, derivatives: int = 2) -> Boundary:
        """A position with all rates zero."""
        state = np.zeros((derivatives, len(position)))
        state[0] = position
        return cls(state, np.zeros(state.shape, dtype=bool), np.zeros(len(position)))

    @classmethod
    def passed(cls, position: Array, derivatives: int = 2) -> Boundary:
        """A position, passed at any velocity (and acceleration)."""
        rest = cls.at_rest(position, derivatives)
        free = np.ones(rest.state.shape, dtype=bool)
        free[0] = False
        return cls(rest.state, free, rest.drift)

    @classmethod
    def met(cls, position: Array, drift: Array, derivatives: int = 2) -> Boundary:
        """A point that moves from a position at a constant velocity, met at its velocity."""
        rest = cls.at_rest(position, derivatives)
        state = rest.state
        state[1] = drift
        return cls(state, rest.free, np.asarray(drift))


@dataclass(frozen=True)
class Phase:
    """A part of a motion, with a guess of its knots and duration.

    ``mesh``: intervals as fractions of the phase's duration, (N,). ``p``: parameters of the point
    problem. ``share``: of the rows' limits that may be used, (N, rows); infinite: this row has no
    limit there. ``knots``: X, V (and A) in units of the phase's duration, (N + 1, unknowns).
    ``duration_is_given``: it stays as in the guess.
    """

    mesh: Array
    p: Array
    share: Array
    knots: Array
    duration: float
    duration_is_given: bool = False


@dataclass(frozen=True)
class PhaseSolution:
    """``knots``: X, V (and A) at every knot in units of the phase's duration, (N + 1, unknowns).
    ``multipliers``: of the rows at every point, (N, points, rows), duration per share of a limit,
    positive at an upper limit and negative at a lower."""

    knots: Array
    duration: float
    multipliers: Array


@dataclass(frozen=True)
class InteriorPointSolution:
    """Where the method ended. ``integral_multipliers``: one for each integrand, nonnegative.
    ``left``: by what fraction of the duration Newton's next step would change it."""

    phases: tuple[PhaseSolution, ...]
    integral_multipliers: Array
    left: float
    status: str
    iterations: int
    factorisations: int
    spent: Spent

    @property
    def solved(self) -> bool:
        return self.status == STATUS[0]


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


class _Workspace(threading.local):
    """Memory of a thread for the method: the largest so far, kept from call to call, since fresh
    pages cost more than the solution. A call lets other threads run, so each has its own."""

    memory: Array = np.empty(0)

    def at_least(self, size: int) -> Array:
        if size > self.memory.nbytes:
            self.memory = np.empty(-(-size // 8))
        return self.memory


_WORKSPACE = _Workspace()


@dataclass(frozen=True)
class InteriorPoint:
    """The method for one point problem; limits hold at ``points``, fractions of an interval."""

    code: ctypes.CDLL
    problem: PointProblem = field(repr=False)
    points: tuple[float, ...]

    def solve(
        self, phases: Sequence[Phase], boundaries: Sequence[Boundary], settings: Settings
    ) -> InteriorPointSolution:
        """The fastest motion through phases in their order, from their guesses.

        ``boundaries``: the start, where each phase but the last meets the next, and the goal.
        """
        counts = [len(phase.mesh) for phase in phases]
        flags = np.array(
            [
                *counts,
                *(phase.duration_is_given for phase in phases),
                *(free for boundary in boundaries for free in boundary.free.ravel().tolist()),
            ],
            dtype=np.int64,
        )
        numbers = np.concatenate(
            [
                *(phase.mesh for phase in phases),
                *(phase.share.ravel() for phase in phases),
                *(phase.p for phase in phases),
                *(boundary.state.ravel() for boundary in boundaries),
                *(boundary.drift for boundary in boundaries),
            ]
        )
        motion = np.concatenate(
            [*(phase.knots.ravel() for phase in phases), [phase.duration for phase in phases]]
        )
        n = sum(counts)
        rows = n * len(self.points) * len(self.problem.sides)
        multipliers = np.empty(rows + self._integrals)
        size = self.code.workspace(ctypes.c_int64(n), ctypes.c_int64(len(counts)))
        report = _Report()
        status = self.code.solve(
            ctypes.c_int64(len(counts)),
            _pointer(flags),
            _pointer(self._rule),
            _pointer(numbers),
            _pointer(motion),
            _pointer(multipliers),
            ctypes.byref(_Settings(*vars(settings).values())),
            ctypes.byref(report),
            _pointer(_WORKSPACE.at_least(size)),
        )
        return InteriorPointSolution(
            self._by_phase(counts, motion, multipliers[:rows]),
            multipliers[rows:],
            report.dual,
            STATUS[status],
            report.iterations,
            report.factorisations,
            Spent(report.evaluating, report.solving),
        )

    @cached_property
    def _integrals(self) -> int:
        return int(self.problem.integrands.numel())

    @cached_property
    def _rule(self) -> Array:
        """The points of an interval, and the weights that integrate their polynomial."""
        points = np.array(self.points)
        order = np.arange(len(points))
        weights = np.linalg.solve(points ** order[:, None], 1 / (order + 1))
        return np.concatenate([points, weights])

    def _by_phase(
        self, counts: Sequence[int], motion: Array, multipliers: Array
    ) -> tuple[PhaseSolution, ...]:
        knots = motion[: -len(counts)].reshape(-1, self.problem.unknowns)
        durations = motion[-len(counts) :].tolist()
        rows = multipliers.reshape(sum(counts), len(self.points), len(self.problem.sides))
        solutions, first = [], 0
        for q, (count, duration) in enumerate(zip(counts, durations, strict=True)):
            own = knots[first + q : first + q + count + 1]
            solutions.append(PhaseSolution(own, duration, rows[first : first + count]))
            first += count
        return tuple(solutions)


def _pointer(array: NDArray[np.generic]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def interior_point(problem: PointProblem, points: tuple[float, ...]) -> InteriorPoint | None:
    """The method for a point problem, if there is machine code for it here."""
    if len(points) % LANES:
        return None
    built = library(source(problem, len(points)))
    if built is None:
        return None
    code = ctypes.CDLL(str(built))
    code.workspace.restype = ctypes.c_int64
    return InteriorPoint(code, problem, points)
