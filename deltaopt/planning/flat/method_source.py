"""C text of the interior-point method for a point problem.

Products of sparse matrices are written out: rows depend on few components of y, and a compiler
makes more of one long sum than of CasADi's single operations.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files

import casadi as ca

from deltaopt.codegen.simd_c import LANES, VECTOR, c_function, c_text
from deltaopt.codegen.vectorised import dense_function
from deltaopt.limits.constraints import Alike
from deltaopt.planning.flat.point_problem import Entries, PointProblem

PARTS = ("problem", "knots_and_points", "rows", "kkt_system", "interior_point")
"""The files of the method's own text, in the order in which they are compiled."""


def source(problem: PointProblem, points: int) -> str:
    """C text of the method for a problem with that many points in an interval."""
    functions = problem.functions
    loops = _loops(problem)
    C, H, second = _with_torques_eliminated(problem, loops)
    sides = problem.sides
    # What a row of speeds depends on: X, V and, as v = V / T, the duration.
    state = {*range(2 * problem.coordinates), problem.y.numel() - 1}
    are_of_state = [all(a in state for other, a in C if other == r) for r in range(len(sides))]
    sizes = {
        "NM": problem.coordinates,
        "NR": problem.derivatives,
        "NY": problem.y.numel(),
        "NC": len(sides),
        "NL": problem.running.numel(),
        "NP": problem.p.numel(),
        "NO": problem.own.numel(),
        "OWN": problem.place_of_own,
        "NQ": loops[-1].end if loops else functions.prepare.numel_out(0),
        "NZ": len(C),
        "NH": len(H),
        "NE": functions.values.numel_out(2),
        "NG": points // LANES,
        "SIDES": sum(map(sum, sides)),
        "ALIKE": sum(len(loop.alike.rows) for loop in loops),
    }
    prepare = (
        loop.calls(0, f"p, p + {loop.alike.numbers.start} + {loop.alike.own.numel()} * k, OWN")
        for loop in loops
    )
    values = (loop.calls(1, "y, OWN, c + r", "if (s[r])") for loop in loops)
    here = files("deltaopt.planning.flat")
    return "\n".join(
        [
            "#include <string.h>",
            VECTOR,
            *(f"#define {name} {size}" for name, size in sizes.items()),
            _present("UPPER", [upper for upper, _ in sides]),
            _present("LOWER", [lower for _, lower in sides]),
            _components(C, len(sides), 2 * problem.coordinates),
            _present("STATE", are_of_state),
            c_function(functions.prepare, "prepare_others"),
            c_function(functions.values, "values_of_others"),
            c_function(functions.second, "second_by_parts"),
            *(
                c_function(function, function.name(), shared_reciprocals=True)
                for loop in loops
                for function in loop.functions
            ),
            c_text("prepare(const V *p, V *q)", ["prepare_others(p, q);", *prepare]),
            c_text(
                "values(const V *y, const V *q, const double *s, V *c, V *g, V *e)",
                ["values_of_others(y, q, c, g, e);", *values],
            ),
            second,
            *_products_with_rows(C, H, problem.y.numel()),
            *(here.joinpath(f"{part}.c").read_text() for part in PARTS),
        ]
    )


@dataclass(frozen=True)
class _Loop:
    """C text of a loop over rows that are alike.

    ``functions``: (p, numbers of a row) -> q, what depends on these alone; (X, q) -> the row; (X,
    q) -> its derivatives by X. ``at``: where in the method's q those of the rows begin.
    """

    alike: Alike
    functions: tuple[ca.Function, ...]
    at: int

    @property
    def end(self) -> int:
        """Where in the method's q those of the rows end."""
        return self.at + self.functions[0].numel_out(0) * len(self.alike.rows)

    def calls(self, which: int, arguments: str, before: str = "") -> str:
        """Calls of a function for each row r, the k-th of them, with its q in place of OWN."""
        rows, own = self.alike.rows, f"q + {self.at} + {self.functions[0].numel_out(0)} * k"
        call = f"{self.functions[which].name()}({arguments.replace('OWN', own)});"
        begin = f"for (int k = 0, r = {rows.start}; k < {len(rows)}; k++, r++)"
        return f"{begin} {{ {before} {call} }}"

    def slopes(self, C: Entries, width: int) -> str:
        """Its part of the derivatives ``C``; ``width``: of X."""
        begin = f"V *slopes = &{C[self.alike.rows.start, 0]} + {width} * k;"
        none = f"if (!s[r]) {{ memset(slopes, 0, {width} * sizeof(V)); continue; }}"
        return self.calls(2, "y, OWN, slopes", f"{begin} {none}")


def _loops(problem: PointProblem) -> list[_Loop]:
    """Over the rows of each kind that are alike."""
    X, loops = problem.y[: problem.coordinates], list[_Loop]()
    at = problem.functions.prepare.numel_out(0)
    for alike in problem.alike:
        results, known = [alike.row, ca.gradient(alike.row, X)], [problem.p, alike.own]
        reduced, symbols, parametric = ca.extract_parametric(results, ca.vertcat(*known))
        needed = [s for s in ca.symvar(ca.vertcat(*reduced)) if not ca.depends_on(X, s)]
        q = ca.vertcat(*needed)
        functions = (
            dense_function(f"prepare_{at}", known, ca.substitute([q], symbols, parametric)),
            dense_function(f"value_{at}", [X, q], reduced[:1]),
            dense_function(f"slope_{at}", [X, q], reduced[1:]),
        )
        loops.append(_Loop(alike, functions, at))
        at = loops[-1].end
    return loops


def _components(C: Entries, rows: int, width: int) -> str:
    """A macro that says whether a row depends on a component of position or velocity."""
    masks = [sum(1 << a for a in range(width) if (r, a) in C) for r in range(rows)]
    table = ", ".join(map(str, masks))
    return (
        f"static const int DEPENDS_TABLE[] = {{{table}}};\n"
        "#define DEPENDS(r, a) (DEPENDS_TABLE[r] >> (a) & 1)"
    )


def _present(name: str, sides: Sequence[bool]) -> str:
    """A macro that says whether a row has that limit; a constant where all agree."""
    if len(set(sides)) < 2:
        return f"#define {name}(r) {int(any(sides))}"
    table = ", ".join(str(int(side)) for side in sides)
    return f"static const char {name}_TABLE[] = {{{table}}};\n#define {name}(r) ({name}_TABLE[r])"


def _with_torques_eliminated(
    problem: PointProblem, loops: Sequence[_Loop]
) -> tuple[Entries, Entries, str]:
    """Derivatives of the rows, C, and of the weighted sum, H, by y, tau being a function of y; and
    the C function ``second`` that finds them and the derivatives of the running cost.

    With N the inverse of -∂force/∂tau, tau' = N ∂force/∂y, and the equations' multipliers chosen
    so that the sum does not change with tau:

        C = c_y + c_tau tau',   H = L_yy + tau'^T L_tauy + L_ytau tau' + tau'^T L_tautau tau'
    """
    partial, nt, ny = problem.functions, problem.tau.numel(), problem.y.numel()
    nc = len(problem.sides)
    N = {(k, j): f"e[{nt + nt * j + k}]" for k in range(nt) for j in range(nt)}
    lines = [
        f"V m{k}[{max(partial.second.numel_out(k), 1)}];" for k in range(partial.second.n_out())
    ]
    arrays = ", ".join(f"m{k}" for k in range(partial.second.n_out()))
    lines.append(f"second_by_parts(y, e, w, q, {arrays});")
    slope = _assign("slope", _product(N, partial.force_by_y), lines)
    bent = _add(partial.by_tau_and_y, _product(partial.twice_by_tau, slope))
    bent_entries = _assign("bent", bent, lines)
    rows = _add(partial.rows_by_y, _product(partial.rows_by_tau, slope))
    X = range(problem.coordinates)
    rows |= {(row, a): [] for loop in loops for row in loop.alike.rows for a in X}
    C = {place: f"C[{k}]" for k, place in enumerate(sorted(p for p in rows if p[0] < nc))}
    lines += [f"{C[place]} = {_sum(rows[place])};" for place in C if rows[place]]
    for k in range(problem.running.numel()):
        for a in range(ny):
            terms = rows.get((nc + k, a), [])
            lines.append(f"C[{len(C) + ny * k + a}] = {_sum(terms)};")
    twice = _add(partial.twice_by_y, {})
    for k in range(nt):
        mixed = _product(_transposed(_row(k, partial.by_tau_and_y)), slope)
        both = _add(mixed, _product(_transposed(_row(k, slope)), bent_entries))
        twice = _add(twice, {place: [f"({_sum(terms)})"] for place, terms in both.items()})
    upper = sorted(place for place in twice if place[0] <= place[1])
    H = {place: f"H[{k}]" for k, place in enumerate(upper)}
    lines += [f"{H[place]} = {_sum(twice[place])};" for place in H]
    lines += [loop.slopes(C, problem.coordinates) for loop in loops]
    head = "second(const V *y, const V *e, const V *w, const V *q, const double *s, V *C, V *H)"
    return C, H, c_text(head, lines)


def _products_with_rows(C: Entries, H: Entries, ny: int) -> Iterator[str]:
    """C functions of products with the derivatives of the rows by y: see ``problem.c``."""
    depend = [sorted(r for r, a in C if a == b) for b in range(ny)]
    lines = [f"{entry} *= s[{r}];" for (r, _), entry in C.items()]
    yield c_text("scale_rows(V *C, const double *s)", lines)
    lines = [f"dc[{r}] += {entry} * dy[{a}];" for (r, a), entry in C.items()]
    yield c_text("along_rows(const V *C, const V *dy, V *dc)", lines)
    lines = [f"m[{a}] = {_sum([f'{C[r, a]} * q[{r}]' for r in depend[a]])};" for a in range(ny)]
    yield c_text("across_rows(const V *C, const V *q, V *m)", lines)
    lines = ["V q[NC];"]
    for b in range(ny):
        lines += [f"q[{r}] = s[{r}] * {C[r, b]};" for r in depend[b]]
        for a in range(b + 1):
            terms = [H[a, b]] if (a, b) in H else []
            terms += [f"q[{r}] * {C[r, a]}" for r in depend[b] if r in depend[a]]
            twin = f"S[{b}][{a}] = " if a < b else ""
            lines.append(f"{twin}S[{a}][{b}] = {_sum(terms)};")
    yield c_text("curvature_of_rows(const V *C, const V *H, const V *s, V (*S)[NY])", lines)


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


def _row(i: int, A: Entries) -> Entries:
    return {place: entry for place, entry in A.items() if place[0] == i}


def _transposed(A: Entries) -> Entries:
    return {(j, i): entry for (i, j), entry in A.items()}


def _sum(terms: Sequence[str]) -> str:
    return " + ".join("ALL(1.0)" if term == "1" else term for term in terms) or "ALL(0.0)"
