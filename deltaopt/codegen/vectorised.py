"""Vectorised evaluation: functions of many points at once, as machine code where possible."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from deltaopt.codegen.compile import library
from deltaopt.codegen.simd_c import LANES, VECTOR, c_function
from deltaopt.curves.piecewise import Array, Truths
from deltaopt.settings import holds_numbers

Checked = tuple[tuple[Array, ...], Truths | None]
"""Results, and at which points a guard fails, (N,); None for nowhere."""


@dataclass(frozen=True)
class RowFunction:
    """A function (x₀, …, p) -> (r₀, …) of one point, evaluated at N points at once.

    ``function``: of scalar expressions; one of matrix expressions is interpreted. A call with
    arrays (N, i) for each x and the parameters p returns an array (N, o) for each r. A single point
    (i,) among arrays serves all points; if all are single, so are the results, (o,). Raises
    ValueError for arrays of other shapes. Threads may call it at the same time.

    ``guarded``: whether the last result are guards, numbers that are not negative where the other
    results can be relied on. A call leaves them out; ``with_failures`` tells where they fail.

    ``times``: how often it is evaluated at every point, each time with the next of so many equal
    parts of p; each result then has the numbers of all times, one after the other. Not of one that
    is guarded.
    """

    function: ca.Function
    guarded: bool = False
    times: int = 1

    @classmethod
    def of(cls, name: str, inputs: list[ca.SX], results: list[ca.SX]) -> RowFunction:
        """One of expressions, without guards."""
        return cls(dense_function(name, inputs, results))

    def __call__(self, *arguments: ArrayLike, parameters: Array) -> tuple[Array, ...]:
        return self.with_failures(*arguments, parameters=parameters)[0]

    def with_failures(self, *arguments: ArrayLike, parameters: Array) -> Checked:
        """The results, and at which points a guard is negative or NaN."""
        rows = [_numbers(a) for a in arguments]
        shapes = [r.shape for r in rows]
        number = _number(shapes, self._single)
        if self._code is None:
            return self._interpreted(rows, parameters)
        rows = [np.ascontiguousarray(r) for r in rows]
        lengths = () if shapes == self._single else (number,)
        results = [np.empty((*lengths, size)) for size in self._sizes]
        parameters, failed = np.ascontiguousarray(parameters), np.empty(number, dtype=bool)
        strides = [r.shape[1] if r.ndim == 2 else 0 for r in rows]
        arrays = [*rows, parameters, *results, failed]
        numbers = [number, *strides, *[array.ctypes.data for array in arrays]]
        call = (ctypes.c_int64 * len(numbers))(*numbers)
        failures = self._code(ctypes.addressof(call))
        return tuple(results), failed if failures else None

    def _interpreted(self, rows: list[Array], parameters: Array) -> Checked:
        each = [
            evaluate_rows(self.function, *rows, parameters=own)
            for own in np.split(np.asarray(parameters), self.times)
        ]
        results = tuple(np.concatenate(found, axis=-1) for found in zip(*each, strict=True))
        if not self.guarded:
            return results, None
        *others, guards = results
        failed: Truths = ~np.all(np.atleast_2d(guards) >= 0, axis=1)
        return tuple(others), failed if failed.any() else None

    @cached_property
    def address(self) -> int | None:
        """Where the function of ``source`` is, for other compiled code; None without a
        compiler."""
        return None if self._code is None else ctypes.cast(self._code, ctypes.c_void_p).value

    @cached_property
    def _single(self) -> list[tuple[int, ...]]:
        """Shapes of the arguments of a single point."""
        return [(self.function.size1_in(i),) for i in range(self.function.n_in() - 1)]

    @cached_property
    def _sizes(self) -> tuple[int, ...]:
        """Sizes of the results of a point, without the guards."""
        return tuple(
            self.times * self.function.size1_out(i)
            for i in range(self.function.n_out() - self.guarded)
        )

    @cached_property
    def _code(self) -> Any:
        """The compiled function of one address; None without a compiler."""
        if not self.function.is_a("SXFunction"):
            return None
        built = library(source(self.function, guarded=self.guarded, times=self.times))
        if built is None:
            return None
        code = ctypes.CDLL(str(built)).rows
        code.argtypes, code.restype = [ctypes.c_void_p], ctypes.c_int64
        return code


def dense_function(name: str, inputs: list[ca.SX], results: list[ca.SX]) -> ca.Function:
    """A function whose results have no structural zeros, and that finds once what they share."""
    return ca.Function(name, inputs, [ca.densify(each) for each in results], {"cse": True})


def _number(shapes: Sequence[Any], single: list[tuple[int, ...]]) -> int:
    """N of arguments with these shapes; ``single``: their shapes for a single point."""
    if shapes == single:
        return 1
    if [shape[-1:] for shape in shapes] != single or max(map(len, shapes), default=1) > 2:
        wanted = ", ".join(f"(N, {size})" for (size,) in single)
        found = ", ".join(map(str, shapes))
        raise ValueError(f"arrays of shape {wanted} are needed, not {found}")
    lengths = {shape[0] for shape in shapes if len(shape) == 2}
    if len(lengths) > 1:
        raise ValueError(f"arrays of one length are needed, not of {sorted(lengths)}")
    return lengths.pop() if lengths else 1


def _numbers(argument: ArrayLike) -> Array:
    """An argument as an array of floats. Raises TypeError where that would make other numbers of
    it, as of a mask."""
    if not holds_numbers(argument):
        raise TypeError("arrays of real numbers are needed, not a mask, masked or complex ones")
    return np.asarray(argument, dtype=float)


def evaluate_rows(
    function: ca.Function, *arguments: ArrayLike, parameters: Array
) -> tuple[Array, ...]:
    """Evaluate a CasADi function of one point and p at N points, by CasADi's interpreter.

    Arrays (N, i) give arrays (N, o), single points (i,) single results (o,); both can be mixed.
    Raises ValueError for arrays of other shapes.
    """
    rows = [_numbers(a) for a in arguments]
    n = _number([r.shape for r in rows], [(function.size1_in(i),) for i in range(len(rows))])
    if n == 0:
        return tuple(np.zeros((0, function.size1_out(i))) for i in range(function.n_out()))
    columns = [np.broadcast_to(np.atleast_2d(r), (n, r.shape[-1])).T for r in rows]
    results = [
        np.asarray(r.full()).T
        for r in function.call([ca.DM(c) for c in columns] + [ca.DM(parameters)])
    ]
    single = all(r.ndim == 1 for r in rows)
    return tuple(r[0] if single else r for r in results)


def source(function: ca.Function, *, guarded: bool = False, times: int = 1) -> str:
    """C source of ``rows``, which evaluates a function at n points, four at a time.

    Its argument are integers: n; for each x how many numbers lie between two points, 0 if one point
    serves all; the addresses of each x, p and r; the address of n bytes, which become 1 where a
    guard fails. It returns how many of them do; without guards no byte is written. If fewer than
    four points are left, the last point fills the remaining lanes. ``times``: as of `RowFunction`.
    """
    *varying, last = (function.size1_in(i) for i in range(function.n_in()))
    each = [function.size1_out(i) for i in range(function.n_out())]
    k, part, last = len(varying), last, times * last
    outputs = [times * size for size in each]
    results = outputs[:-1] if guarded else outputs
    names = [*(f"X{i}" for i in range(k + 1)), *(f"R{i}" for i in range(len(outputs)))]
    sizes, steps = [*varying, last, *outputs], [*[0] * k, part, *each]
    places = [
        f"{name} + {step} * i" if step else name for name, step in zip(names, steps, strict=True)
    ]
    declared = ", ".join(f"{name}[{size}]" for name, size in zip(names, sizes, strict=True))
    addresses = [("const double *", f"x{i}") for i in range(k + 1)]
    addresses += [("double *", f"r{i}") for i in range(len(results))]
    addresses.append(("unsigned char *", "failed"))
    lines = [
        "#include <stdint.h>",
        VECTOR,
        c_function(function, "four", shared_reciprocals=guarded),
        "int64_t rows(const int64_t *call) {",
        "  const int64_t n = call[0];",
        *(f"  const int64_t s{i} = call[{1 + i}];" for i in range(k)),
        *(
            f"  {kind}{name} = ({kind})call[{1 + k + i}];"
            for i, (kind, name) in enumerate(addresses)
        ),
        "  int64_t failures = 0;",
        f"  V {declared};",
        f"  for (int a = 0; a < {last}; a++) X{k}[a] = ALL(x{k}[a]);",
        f"  for (int64_t j = 0; j < n; j += {LANES}) {{",
        f"    for (int64_t l = 0; l < {LANES}; l++) {{",
        "      const int64_t k = j + l < n ? j + l : n - 1;",
        *(
            f"      for (int a = 0; a < {size}; a++) X{i}[a][l] = x{i}[s{i} * k + a];"
            for i, size in enumerate(varying)
        ),
        "    }",
        f"    for (int i = 0; i < {times}; i++)",
        f"      four({', '.join(places)});",
        f"    for (int64_t l = 0; l < {LANES} && j + l < n; l++) {{",
        *(
            f"      for (int a = 0; a < {size}; a++) r{i}[{size} * (j + l) + a] = R{i}[a][l];"
            for i, size in enumerate(results)
        ),
        *(_count_failures(len(results), outputs[-1]) if guarded else []),
        "    }",
        "  }",
        "  return failures;",
        "}",
    ]
    return "\n".join(lines) + "\n"


def _count_failures(result: int, guards: int) -> list[str]:
    return [
        "      int fine = 1;",
        f"      for (int a = 0; a < {guards}; a++) fine &= R{result}[a][l] >= 0;",
        "      failed[j + l] = !fine;",
        "      failures += !fine;",
    ]
