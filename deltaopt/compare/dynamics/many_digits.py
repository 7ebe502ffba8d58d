"""CasADi's scalar functions evaluated with as many digits as one likes.

A scalar (SX) function is a list of elementary operations; each has its twin in mpmath.
Numbers inside the function, such as cos(2π/3), are taken as the double they are, so that
what comes out is the exact value of what double precision tries to compute.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cached_property
from typing import Any

import casadi as ca

from deltaopt.errors import installed

mpmath = installed("mpmath", "compare")

Number = Any
"""An mpmath number (mpmath has no types)."""
Matrix = Any
"""An mpmath matrix."""


_CODES = {name[3:].lower(): code for name, code in vars(ca).items() if name.startswith("OP_")}
"""CasADi's operations by their names: many have the same in mpmath, such as "sin"."""


class ManyDigits:
    """Arithmetic with ``digits`` decimal digits."""

    def __init__(self, digits: int = 50) -> None:
        self.digits = digits
        self.context = mpmath.mp.clone()
        self.context.dps = digits

    def matrix(self, values: Iterable[Any]) -> Matrix:
        """Return a column of numbers, or a matrix from rows of them, doubles taken exactly."""
        numbers = [each.tolist() if hasattr(each, "tolist") else each for each in values]
        return self.context.matrix(numbers)

    def solve(self, A: Matrix, b: Matrix) -> Matrix:
        """Return x with A x = b, by LU with pivoting. Raises ZeroDivisionError if A is singular."""
        return self.context.lu_solve(A, b)

    def evaluate(self, function: ca.Function, *arguments: Matrix) -> list[Matrix]:
        """Evaluate a scalar function and return all its results, dense matrices.

        ``arguments``: matrices, or sequences for columns, of the function's shapes.
        """
        if not function.is_a("SXFunction"):
            raise TypeError(f"{function.name()} is not written in scalars; expand it first")
        given = [self._nonzeros(function.sparsity_in(i), a) for i, a in enumerate(arguments)]
        results = [[self.context.zero] * function.nnz_out(i) for i in range(function.n_out())]
        work = [self.context.zero] * function.sz_w()
        for k in range(function.n_instructions()):
            operation, out = function.instruction_id(k), function.instruction_output(k)
            operands = function.instruction_input(k)
            if operation == ca.OP_CONST:
                work[out[0]] = self.context.mpf(function.instruction_constant(k))
            elif operation == ca.OP_INPUT:
                work[out[0]] = given[operands[0]][operands[1]]
            elif operation == ca.OP_OUTPUT:
                results[out[0]][out[1]] = work[operands[0]]
            else:
                values = [work[i] for i in operands]
                work[out[0]] = self._operations[operation](*values)
        return [self._dense(function.sparsity_out(i), r) for i, r in enumerate(results)]

    def _nonzeros(self, sparsity: ca.Sparsity, argument: Iterable[Any]) -> list[Number]:
        """The entries CasADi stores, column by column."""
        dense: Matrix = argument if hasattr(argument, "rows") else self.matrix(argument)
        rows, columns = sparsity.get_triplet()
        return [dense[i, j] for i, j in zip(rows, columns, strict=True)]

    def _dense(self, sparsity: ca.Sparsity, nonzeros: list[Number]) -> Matrix:
        dense = self.context.matrix(*sparsity.shape)
        for i, j, value in zip(*sparsity.get_triplet(), nonzeros, strict=True):
            dense[i, j] = value
        return dense

    @cached_property
    def _operations(self) -> dict[int, Callable[..., Number]]:
        """CasADi's elementary operations, as far as equations of mechanisms have them."""
        c, one = self.context, self.context.one
        return {
            **{code: getattr(c, name) for name, code in _CODES.items() if hasattr(c, name)},
            ca.OP_ASSIGN: lambda x: x,
            ca.OP_ADD: lambda x, y: x + y,
            ca.OP_SUB: lambda x, y: x - y,
            ca.OP_MUL: lambda x, y: x * y,
            ca.OP_DIV: lambda x, y: x / y,
            ca.OP_NEG: lambda x: -x,
            ca.OP_INV: lambda x: one / x,
            ca.OP_SQ: lambda x: x * x,
            ca.OP_TWICE: lambda x: x + x,
            ca.OP_POW: c.power,
            ca.OP_CONSTPOW: c.power,
            ca.OP_IF_ELSE_ZERO: lambda x, y: y if x != 0 else c.zero,
            ca.OP_LT: lambda x, y: one * (x < y),
            ca.OP_NOT: lambda x: one * (x == 0),
        }
