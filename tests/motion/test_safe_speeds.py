"""The largest safe speed, against dense grids and sets of safe speeds that are no intervals."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt.motion.safe_speeds import largest_safe_speed


def of(*coefficients):
    """Excesses over 1 of polynomials of the speed with these ascending coefficients."""
    columns = np.array([np.pad(each, (0, 5 - len(each))) for each in coefficients]).T
    return lambda speeds: np.vander(speeds, 5, increasing=True) @ columns - 1


BETWEEN = [0.1, 4.5, -4.5]
"""Holds at rest and at full speed, and fails between: at half the speed it is 1.225."""


def test_a_safe_speed_below_unsafe_ones():
    """The lesser root of 4.5 s² - 4.5 s + 0.9 = 0."""
    expected = 0.5 - np.sqrt(0.25 - 0.2)
    assert largest_safe_speed(of(BETWEEN), 0.5) == pytest.approx(expected, rel=1e-12)


def test_sets_of_safe_speeds_are_intersected():
    """One asks for no more than 0.9, which the other forbids down to its lesser root."""
    expected = 0.5 - np.sqrt(0.25 - 0.2)
    assert of(BETWEEN)(np.array([0.9]))[0, 0] < 0  # 0.505
    assert largest_safe_speed(of(BETWEEN, [0.0, 1 / 0.7]), 1.0) == pytest.approx(
        expected, rel=1e-12
    )
    assert largest_safe_speed(of(BETWEEN, [0.0, 1 / 0.9]), 1.0) == pytest.approx(0.9, rel=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_random_polynomials_against_a_dense_grid(seed):
    rng = np.random.default_rng(seed)
    excesses = of(*(rng.normal(size=5) * [0.5, 3, 3, 3, 3] for _ in range(4)))
    speeds = np.linspace(0, 1, 200_001)[1:]
    safe = speeds[(excesses(speeds) <= 0).all(axis=1)]
    found = largest_safe_speed(excesses, 1.0)
    if len(safe):
        assert found == pytest.approx(safe.max(), abs=1e-5)
        assert found >= safe.max() - 1e-12
    if found is not None:
        assert (excesses(np.array([found])) <= 1e-12).all()


@pytest.mark.parametrize("seed", range(10))
def test_friction_that_saturates_against_a_dense_grid(seed):
    """Of c₀ + c₁ s² + c₂ tanh(s / w): no polynomial."""
    rng = np.random.default_rng(seed)
    c, w = rng.normal(size=(3, 4)), rng.uniform(0.02, 0.5, 4)

    def excesses(speeds):
        s = np.asarray(speeds)[:, None]
        return 0.3 * c[0] + 2 * c[1] * s**2 + 0.8 * c[2] * np.tanh(s / w) - 1

    speeds = np.linspace(0, 1, 100_001)[1:]
    safe = speeds[(excesses(speeds) <= 0).all(axis=1)]
    found = largest_safe_speed(excesses, 1.0)
    assert (found is None) == (len(safe) == 0)
    if found is not None:
        assert found == pytest.approx(safe.max(), abs=2e-5)
