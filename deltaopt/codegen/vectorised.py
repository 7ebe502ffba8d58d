"""Vectorised evaluation: functions of many points at once, as machine code where possible."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from deltaopt.codegen.compile import library
from deltaopt.codegen.simd_c import LANES, VECTOR, c_function

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RowFunction:
    """A function (x₀, …, p) -> (r₀, …) of one point, evaluated at N points at once.

    ``function``: of scalar expressions. A call with an array (N, i) for each x and the parameters p
    returns an array (N, o) for each r.
    """

    function: ca.Function

    def __call__(self, *arguments: Array, parameters: Array) -> tuple[Array, ...]:
        if self._code is None:
            return evaluate_rows(self.function, *arguments, parameters=parameters)
        rows = [np.ascontiguousarray(a) for a in arguments]
        number = len(rows[0])
        results = tuple(np.empty((number, size)) for size in self._sizes)
        pointers = [_pointer(a) for a in (*rows, np.ascontiguousarray(parameters), *results)]
        self._code(ctypes.c_int64(number), *pointers)
        return results

    @cached_property
    def _sizes(self) -> tuple[int, ...]:
        return tuple(self.function.size1_out(i) for i in range(self.function.n_out()))

    @cached_property
    def _code(self) -> Any:
        """The compiled function of N and of pointers to inputs and outputs; None without a
        compiler."""
        built = library(source(self.function))
        return None if built is None else ctypes.CDLL(str(built)).rows


def evaluate_rows(
    function: ca.Function, *arguments: ArrayLike, parameters: Array
) -> tuple[Array, ...]:
    """Evaluate a CasADi function of one point and p at N points, by CasADi's interpreter.

    Arrays (N, i) give arrays (N, o), single points (i,) single results (o,); both can be mixed.
    Raises ValueError for arrays of other shapes.
    """
    rows = [np.asarray(a, dtype=float) for a in arguments]
    if any(r.ndim not in (1, 2) or r.shape[-1] != function.size1_in(i) for i, r in enumerate(rows)):
        wanted = ", ".join(f"(N, {function.size1_in(i)})" for i in range(len(rows)))
        found = ", ".join(str(r.shape) for r in rows)
        raise ValueError(f"arrays of shape {wanted} are needed, not {found}")
    lengths = {r.shape[0] for r in rows if r.ndim == 2}
    if len(lengths) > 1:
        raise ValueError(f"arrays of one length are needed, not of {sorted(lengths)}")
    n = lengths.pop() if lengths else 1
    if n == 0:
        return tuple(np.zeros((0, function.size1_out(i))) for i in range(function.n_out()))
    columns = [np.broadcast_to(np.atleast_2d(r), (n, r.shape[-1])).T for r in rows]
    results = [
        np.asarray(r.full()).T
        for r in function.call([ca.DM(c) for c in columns] + [ca.DM(parameters)])
    ]
    single = all(r.ndim == 1 for r in rows)
    return tuple(r[0] if single else r for r in results)


def source(function: ca.Function) -> str:
    """C source of ``rows``, which evaluates a function at n points, four at a time.

    If fewer than four are left, the last point fills the remaining lanes.
    """
    inputs = [function.size1_in(i) for i in range(function.n_in())]
    outputs = [function.size1_out(i) for i in range(function.n_out())]
    pointers = [f"const double *x{i}" for i in range(len(inputs))]
    pointers += [f"double *r{i}" for i in range(len(outputs))]
    names = [f"X{i}" for i in range(len(inputs))] + [f"R{i}" for i in range(len(outputs))]
    declared = ", ".join(f"{n}[{s}]" for n, s in zip(names, inputs + outputs, strict=True))
    *varying, last = inputs
    gather = [
        f"      for (int a = 0; a < {size}; a++) X{i}[a][l] = x{i}[{size} * k + a];"
        for i, size in enumerate(varying)
    ]
    scatter = [
        f"      for (int a = 0; a < {size}; a++) r{i}[{size} * (j + l) + a] = R{i}[a][l];"
        for i, size in enumerate(outputs)
    ]
    lines = [
        "#include <stdint.h>",
        VECTOR,
        c_function(function, "four"),
        f"void rows(int64_t n, {', '.join(pointers)}) {{",
        f"  V {declared};",
        f"  for (int a = 0; a < {last}; a++) X{len(varying)}[a] = ALL(x{len(varying)}[a]);",
        f"  for (int64_t j = 0; j < n; j += {LANES}) {{",
        f"    for (int64_t l = 0; l < {LANES}; l++) {{",
        "      const int64_t k = j + l < n ? j + l : n - 1;",
        *gather,
        "    }",
        f"    four({', '.join(names)});",
        f"    for (int64_t l = 0; l < {LANES} && j + l < n; l++) {{",
        *scatter,
        "    }",
        "  }",
        "}",
    ]
    return "\n".join(lines) + "\n"


def _pointer(array: Array) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
