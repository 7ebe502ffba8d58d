"""Machine code of many points against CasADi's interpreter, whatever the arguments look like."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest

from deltaopt.codegen import compile as compiling
from deltaopt.codegen.vectorised import RowFunction, evaluate_rows

P = np.array([2.0, 3.0])
SIZES = (0, 1, 2, 3, 4, 5, 64, 1001)


def functions() -> tuple[RowFunction, ca.Function]:
    """x (3), v (2) -> two results; guarded where x₀ is negative or NaN. And without the guards."""
    x, v, p = ca.SX.sym("x", 3), ca.SX.sym("v", 2), ca.SX.sym("p", 2)
    results = [p[0] * x / (1 + v[0] ** 2), ca.vertcat(ca.sqrt(x[0]) / p[1], v[1] / p[1])]
    guarded = ca.Function("guarded", [x, v, p], [*results, ca.vertcat(x[0], 1)])
    return RowFunction(guarded, guarded=True), ca.Function("plain", [x, v, p], results)


def arrays(number: int):
    rng = np.random.default_rng(number)
    return rng.uniform(0, 1, (number, 3)), rng.normal(size=(number, 2))


@pytest.fixture(params=["compiled", "interpreted"])
def rows(request, monkeypatch):
    function, plain = functions()
    if request.param == "interpreted":
        monkeypatch.setattr(compiling, "compilers", list)
    assert (function._code is None) == (not compiling.compilers())
    return function, plain


def agree(found, expected):
    for one, other in zip(found, expected, strict=True):
        assert one.shape == other.shape
        np.testing.assert_allclose(one, other, rtol=1e-15)


@pytest.mark.parametrize("number", SIZES)
def test_numbers_of_points(rows, number):
    function, plain = rows
    x, v = arrays(number)
    results, failed = function.with_failures(x, v, parameters=P)
    agree(results, evaluate_rows(plain, x, v, parameters=P))
    assert failed is None


@pytest.mark.parametrize("guarded", [False, True])
def test_long_functions(guarded):
    """Some 4000 operations, in which a number is divided by, and used, long after it is known."""
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p", 2)
    first, value, results = 2 + ca.sin(x[0]), x[1], []
    for k in range(600):
        value = ca.sin(value * p[k % 2] / 9 + x[2] / first) + value / (3 + first)
        results += [value / first] if k % 100 == 0 else []
    outputs = [ca.vertcat(*results, value)]
    plain = ca.Function("plain", [x, p], outputs)
    function = RowFunction(
        ca.Function("long", [x, p], [*outputs, x[0]] if guarded else outputs), guarded
    )
    points = arrays(5)[0]
    expected = evaluate_rows(plain, points, parameters=P)
    for found, known in zip(function(points, parameters=P), expected, strict=True):
        np.testing.assert_allclose(found, known, rtol=1e-12)


@pytest.mark.parametrize("compiler", ["compiled", "interpreted"])
def test_several_times_at_every_point(compiler, monkeypatch):
    """Each time with its part of the parameters, results of all times one after the other."""
    if compiler == "interpreted":
        monkeypatch.setattr(compiling, "compilers", list)
    _, plain = functions()
    function, parts = RowFunction(plain, times=3), np.random.default_rng(1).uniform(1, 2, (3, 2))
    for number in (0, 1, 5, 65):
        x, v = arrays(number)
        each = [evaluate_rows(plain, x, v, parameters=own) for own in parts]
        expected = [np.hstack(results) for results in zip(*each, strict=True)]
        agree(function(x, v, parameters=parts.ravel()), expected)
    agree(
        function(x[0], v[0], parameters=parts.ravel()),
        [one[0] for one in function(x[:1], v[:1], parameters=parts.ravel())],
    )


def test_single_points_serve_all(rows):
    function, plain = rows
    for number in (1, 5, 65):
        x, v = arrays(number)
        agree(function(x, v[0], parameters=P), evaluate_rows(plain, x, v[0], parameters=P))
        agree(function(x[0], v, parameters=P), evaluate_rows(plain, x[0], v, parameters=P))
    agree(function(x[0], v[0], parameters=P), evaluate_rows(plain, x[0], v[0], parameters=P))


def test_lists_integers_and_strides(rows):
    function, plain = rows
    for number in (5, 65):
        x, v = arrays(2 * number)
        agree(
            function(x[::2], v[::2][:, ::-1], parameters=P),
            evaluate_rows(plain, x[::2], v[::2][:, ::-1], parameters=P),
        )
    expected = evaluate_rows(plain, [1.0, 2.0, 3.0], [4.0, 5.0], parameters=P)
    agree(function([1, 2, 3], (4, 5), parameters=P), expected)
    agree(function(np.array([1, 2, 3]), np.float32([4, 5]), parameters=P), expected)


@pytest.mark.parametrize("number", [1, 6, 66])
def test_points_whose_guards_fail(rows, number):
    function, _ = rows
    x, v = arrays(number)
    x[number // 2, 0], x[-1, 0] = -1.0, np.nan
    (first, second), failed = function.with_failures(x, v, parameters=P)
    assert np.flatnonzero(failed).tolist() == sorted({number // 2, number - 1})
    assert np.isnan(second[failed, 0]).all()
    assert np.isfinite(first[~failed]).all()
    assert function.with_failures(x[-1], v[-1], parameters=P)[1].tolist() == [True]


def test_wrong_shapes(rows):
    function, _ = rows
    x, v = arrays(5)
    for wrong in ((x[:, :2], v), (x, v[0, 0]), (x[None], v), (x,), (x, v, v)):
        with pytest.raises(ValueError, match=r"\(N, 3\), \(N, 2\) are needed"):
            function(*wrong, parameters=P)
    with pytest.raises(ValueError, match=r"one length are needed, not of \[4, 5\]"):
        function(x, v[:4], parameters=P)


def test_threads_do_not_meet():
    function, plain = functions()
    x, v = arrays(200)
    expected = evaluate_rows(plain, x, v, parameters=P)

    def own(i: int) -> bool:
        few = function(x[i : i + 3], v[i : i + 3], parameters=P)
        single = function(x[i], v[i], parameters=P)
        return all(
            np.allclose(a, e[i : i + 3], rtol=1e-15) and np.allclose(b, e[i], rtol=1e-15)
            for a, b, e in zip(few, single, expected, strict=True)
        )

    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(own, list(range(197)) * 10))
