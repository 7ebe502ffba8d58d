"""Curves between samples: tops, means and roots that are known, and what cannot be resolved."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from deltaopt.verify.resolved_curves import Cells, ResolvedCurves, TooRough


def resolved(curves, pieces=1, tolerance=1e-11):
    def everywhere(values):
        return np.full((len(values), values.shape[2]), tolerance)

    return ResolvedCurves.of(curves, Cells.even(pieces, 1), everywhere)


def test_tops_between_samples():
    """Known maxima of smooth functions, one hill at the very edge."""
    tops = np.array([0.512345, 1.987654, 0.001, 2.999])

    def curves(pieces, fractions):
        t = (pieces + fractions)[:, None]
        return np.cos(2 * pi * (t - tops) / 7) * np.array([1.0, 2.0, 3.0, 4.0])

    highest = resolved(curves, pieces=3).highest(4)
    np.testing.assert_allclose(highest.values, [1, 2, 3, 4], rtol=1e-14)
    np.testing.assert_allclose(highest.pieces + highest.fractions, tops, atol=1e-7)


@pytest.mark.parametrize("width", [1e-2, 1e-4, 1e-6])
def test_a_peak_that_samples_miss(width):
    """Between them its sides differ: the curve is the slope of a smoothed corner."""

    def curves(pieces, fractions):
        away = (fractions - 0.61803) / width
        return np.stack([1 / (1 + away**2), np.arctan(away)], axis=1)

    highest = resolved(curves).highest(2)
    assert highest.values[0] == pytest.approx(1, abs=1e-11)
    assert highest.fractions[0] == pytest.approx(0.61803, abs=1e-5 * width)


def test_means_and_roots():
    def curves(pieces, fractions):
        t = pieces + fractions
        return np.stack([np.exp(t), np.cos(3 * t), 1e-14 * np.cos(40 * t)], axis=1)

    found = resolved(curves, pieces=2)
    cells = found.cells
    integral = (cells.end - cells.begin) @ found.means()[:, 0]
    assert integral == pytest.approx(np.exp(2) - 1, rel=1e-14)
    pieces, fractions = found.roots(1, 1e-9)
    np.testing.assert_allclose(np.sort(pieces + fractions), [pi / 6, pi / 2], rtol=1e-10)
    assert not len(found.roots(2, 1e-9)[0])
    cut = cells.cut(pieces, fractions)
    assert len(cut) == len(cells) + 2
    assert (cut.end - cut.begin).sum() == pytest.approx(2, rel=1e-15)
    assert set(fractions) <= set(cut.begin)


def test_a_jump_is_left_and_noise_is_refused():
    def jump(pieces, fractions):
        return np.where(fractions < 1 / 3, 1.0, 2.0)[:, None]

    assert resolved(jump).highest(1).values[0] == 2.0
    rng = np.random.default_rng(1)

    def noise(pieces, fractions):
        return rng.normal(size=(len(fractions), 1))

    with pytest.raises(TooRough, match="too fast to be measured"):
        resolved(noise)
