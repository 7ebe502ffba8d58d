"""SIMD C: CasADi's scalar functions as C source, for four points at once.

The C type ``V`` of the source is a vector of four doubles (a vector extension of GCC and Clang)
whose lanes are four points: a processor with AVX evaluates four points in the time of one.
"""

from __future__ import annotations

import casadi as ca

from deltaopt.codegen.vector_math import VECTOR_MATH
from deltaopt.errors import DeltaOptError

LANES = 4

VECTOR = (
    """\
#include <math.h>
typedef double V __attribute__((vector_size(32)));
static inline V all_lanes(double a) { return (V){a, a, a, a}; }
/* As fmax and fmin of the C library, without a call in the midst of vectors. */
static inline double FMAX(double a, double b) { return a > b || b != b ? a : b; }
static inline double FMIN(double a, double b) { return a < b || b != b ? a : b; }
#define EACH(f, a) ((V){f((a)[0]), f((a)[1]), f((a)[2]), f((a)[3])})
#define EACH2(f, a, b) \\
  ((V){f((a)[0], (b)[0]), f((a)[1], (b)[1]), f((a)[2], (b)[2]), f((a)[3], (b)[3])})
#define ALL(a) all_lanes(a)
#ifdef __clang__
#define SHUFFLE(a, b, i, j, k, l) __builtin_shufflevector(a, b, i, j, k, l)
#else
typedef long long LANES __attribute__((vector_size(32)));
#define SHUFFLE(a, b, i, j, k, l) __builtin_shuffle(a, b, (LANES){i, j, k, l})
#endif
"""
    + VECTOR_MATH
)
"""C definitions with which the type V is four points. The compiler makes one instruction of
EACH(sqrt, …)."""

_C = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "{0} / {1}",
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "{0} + {0}",
    ca.OP_INV: "1 / {0}",
    ca.OP_SQRT: "EACH(sqrt, {0})",
    ca.OP_SIN: "SIN({0})",
    ca.OP_COS: "COS({0})",
    ca.OP_ASIN: "ASIN({0})",
    ca.OP_TANH: "TANH({0})",
    ca.OP_LT: "LESS({0}, {1})",
    ca.OP_NOT: "NOT({0})",
    ca.OP_IF_ELSE_ZERO: "WHERE({0}, {1})",
    ca.OP_FABS: "EACH(fabs, {0})",
    ca.OP_SIGN: "EACH2(copysign, ALL(1.0), {0})",
    ca.OP_POW: "EACH2(pow, {0}, {1})",
    ca.OP_CONSTPOW: "EACH2(pow, {0}, {1})",
    ca.OP_ATAN2: "ATAN2({0}, {1})",
    ca.OP_FMAX: "EACH2(FMAX, {0}, {1})",
    ca.OP_FMIN: "EACH2(FMIN, {0}, {1})",
}


def c_function(function: ca.Function, name: str, *, shared_reciprocals: bool = False) -> str:
    """C source of ``static void name(const V *x0, …, V *r0, …)`` for a CasADi function.

    ``shared_reciprocals``: whether what divides several expressions is inverted once, and these are
    multiplied by its reciprocal. A division takes as long as eight multiplications; a result may
    differ in its last digit. Raises DeltaOptError for an operation that has no C text here.
    """
    arguments = [f"const V *x{i}" for i in range(function.n_in())]
    arguments += [f"V *r{i}" for i in range(function.n_out())]
    reciprocals = _shared_divisors(function) if shared_reciprocals else {}
    lines = []
    for k in range(function.n_instructions()):
        if k in reciprocals:
            lines += _divided(function, k, reciprocals[k])
        else:
            lines.append(_instruction(function, k))
    body = "\n".join(lines)
    work = f"  V w[{max(function.sz_w(), 1)}];"
    return f"static void {name}({', '.join(arguments)}) {{\n{work}\n{body}\n}}\n"


def _shared_divisors(function: ca.Function) -> dict[int, int]:
    """For each division by what divides something else too: the first division by the same."""
    divisions: dict[tuple[int, int], list[int]] = {}
    written: dict[int, int] = {}  # the instruction that last wrote to a place of w
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        if operation == ca.OP_DIV:
            divisor = function.instruction_input(k)[1]
            divisions.setdefault((divisor, written[divisor]), []).append(k)
        if operation != ca.OP_OUTPUT:
            written[function.instruction_output(k)[0]] = k
    return {k: same[0] for same in divisions.values() if len(same) > 1 for k in same}


def _divided(function: ca.Function, k: int, first: int) -> list[str]:
    """C text of a division by a divisor whose ``first`` division is known."""
    (to,), (dividend, divisor) = function.instruction_output(k), function.instruction_input(k)
    inverted = [f"  const V i{k} = 1 / w[{divisor}];"] if k == first else []
    return [*inverted, f"  w[{to}] = w[{dividend}] * i{first};"]


def _instruction(function: ca.Function, k: int) -> str:
    operation = function.instruction_id(k)
    to, by = function.instruction_output(k), function.instruction_input(k)
    if operation == ca.OP_INPUT:
        return f"  w[{to[0]}] = x{by[0]}[{by[1]}];"
    if operation == ca.OP_OUTPUT:
        return f"  r{to[0]}[{to[1]}] = w[{by[0]}];"
    if operation == ca.OP_CONST:
        return f"  w[{to[0]}] = ALL({function.instruction_constant(k)!r});"
    if operation not in _C:
        raise DeltaOptError(f"operation {operation} of {function.name()} has no C text")
    return f"  w[{to[0]}] = {_C[operation].format(*(f'w[{i}]' for i in by))};"
