"""SIMD C: CasADi's scalar functions as C source, for four points at once.

The C type ``V`` of the source is a vector of four doubles (a vector extension of GCC and Clang)
whose lanes are four points: a processor with AVX evaluates four points in the time of one. Its
functions are in ``four_points.c``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import NamedTuple

import casadi as ca

from deltaopt.errors import DeltaOptError

LANES = 4

VECTOR = (files("deltaopt.codegen") / "four_points.c").read_text()
"""C definitions with which the type V is four points."""

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

PART = 500
"""Operations of a part of a function. A compiler looks at all values of a function at once for each
register that it lacks: in parts the longest functions compile in a quarter of the time."""


def c_function(function: ca.Function, name: str, *, shared_reciprocals: bool = False) -> str:
    """C source of ``static void name(const V *x0, …, V *r0, …)`` for a CasADi function.

    ``shared_reciprocals``: whether what divides several expressions is inverted once, and these are
    multiplied by its reciprocal. A division takes as long as eight multiplications; a result may
    differ in its last digit. Raises DeltaOptError for an operation that has no C text here.
    """
    arguments = {f"x{i}": "const V *" for i in range(function.n_in())}
    arguments |= {f"r{i}": "V *" for i in range(function.n_out())}
    instructions = _instructions(function)
    number = len(instructions)
    parts = [range(k, min(k + PART, number)) for k in range(0, number, PART)]
    used_later = (
        j for part in parts for k in part for j in instructions[k].operands if j < part.start
    )
    kept = {j: f"w[{place}]" for place, j in enumerate(dict.fromkeys(used_later))}
    bodies = []
    for part in parts:
        reciprocals = _shared_divisors(instructions, part) if shared_reciprocals else {}
        lines = []
        for k in part:
            values = [f"v{j}" if j in part else kept[j] for j in instructions[k].operands]
            lines += _c_lines(function, k, instructions[k], values, reciprocals.get(k))
            lines += [f"{kept[k]} = v{k};"] if k in kept else []
        bodies.append(lines)
    if len(bodies) == 1:
        return c_text(_head(name, arguments), bodies[0])
    texts, calls = [], [f"V w[{max(len(kept), 1)}];"]
    for i, lines in enumerate(bodies):
        body = "\n".join(lines)
        used = {k: v for k, v in {**arguments, "w": "V *"}.items() if f"{k}[" in body}
        texts.append(c_text(_head(f"{name}_part_{i}", used), lines))
        calls.append(f"{name}_part_{i}({', '.join(used)});")
    return "".join(texts) + c_text(_head(name, arguments), calls)


def c_text(head: str, lines: Sequence[str]) -> str:
    """C source of ``static void head`` with these lines."""
    body = "\n".join(f"  {line}" for line in lines)
    return f"static void {head} {{\n{body}\n}}\n"


def _head(name: str, arguments: Mapping[str, str]) -> str:
    return f"{name}({', '.join(kind + argument for argument, kind in arguments.items())})"


class _Instruction(NamedTuple):
    """One operation of a CasADi function.

    ``to``, ``by``: the places of its result and of what it takes, as CasADi counts them.
    ``operands``: the instructions whose results it takes.
    """

    operation: int
    to: Sequence[int]
    by: Sequence[int]
    operands: tuple[int, ...]


def _instructions(function: ca.Function) -> list[_Instruction]:
    """The operations of a function, each asked for once: to ask takes longer than to write."""
    found, last = list[_Instruction](), dict[int, int]()  # last: which wrote to a place
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        to, by = function.instruction_output(k), function.instruction_input(k)
        given = operation in (ca.OP_INPUT, ca.OP_CONST)
        operands = () if given else tuple([last[i] for i in by])
        found.append(_Instruction(operation, to, by, operands))
        if operation != ca.OP_OUTPUT:
            last[to[0]] = k
    return found


def _shared_divisors(instructions: Sequence[_Instruction], part: range) -> dict[int, int]:
    """For each division of a part by what divides something else there too: the first division by
    the same."""
    divisions: dict[int, list[int]] = {}
    for k in part:
        if instructions[k].operation == ca.OP_DIV:
            divisions.setdefault(instructions[k].operands[1], []).append(k)
    return {k: same[0] for same in divisions.values() if len(same) > 1 for k in same}


def _c_lines(
    function: ca.Function, k: int, own: _Instruction, values: list[str], first: int | None
) -> list[str]:
    """C text of the k-th instruction of a function; ``first``: the first division by the same
    divisor, which is inverted there."""
    if own.operation == ca.OP_INPUT:
        return [f"const V v{k} = x{own.by[0]}[{own.by[1]}];"]
    if own.operation == ca.OP_OUTPUT:
        return [f"r{own.to[0]}[{own.to[1]}] = {values[0]};"]
    if own.operation == ca.OP_CONST:
        return [f"const V v{k} = ALL({function.instruction_constant(k)!r});"]
    if first is not None:
        inverted = [f"const V i{k} = 1 / {values[1]};"] if k == first else []
        return [*inverted, f"const V v{k} = {values[0]} * i{first};"]
    if own.operation not in _C:
        raise DeltaOptError(f"operation {own.operation} of {function.name()} has no C text")
    return [f"const V v{k} = {_C[own.operation].format(*values)};"]
