"""What a solution gives away: no more and no less than its multipliers and rows say."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt.planning.mesh.error_estimate import FRACTIONS, ErrorEstimate, error_estimate, refined

N, POINTS = 3, 4
EVEN = np.full(N, 1 / N)
STILL = np.ones(N)
"""No interval asks the motion to be slowed."""
CONTROL, STATE = np.ones(3, dtype=bool), np.zeros(3, dtype=bool)


def loads(value: float, rows: int = 3) -> np.ndarray:
    return np.full((N, len(FRACTIONS), rows), value)


def multiplier(value: float, interval: int = 1, point: int = 2, row: int = 0, rows: int = 3):
    """One multiplier at one point; the others zero."""
    multipliers = np.zeros((N, POINTS, rows))
    multipliers[interval, point, row] = value
    return multipliers


@pytest.mark.parametrize("sign", [1, -1])
def test_unused_control_costs_its_multiplier(sign):
    """As much in all, by a density that falls to zero in the middles of the intervals beside."""
    lost = error_estimate(EVEN, multiplier(sign * 0.5), loads(sign * 0.9), CONTROL, STILL)
    np.testing.assert_allclose(lost.unused, np.array([1, 6, 1]) / 8 * 0.5 * 0.1)


def test_density_is_linear_on_an_uneven_mesh():
    """Multipliers of a density 2 t, of a control that is not used at all: all that is below it."""
    mesh = np.array([0.2, 0.5, 0.3])
    middles = np.cumsum(mesh) - mesh / 2
    multipliers = np.zeros((N, POINTS, 1))
    multipliers[:, 1, 0] = 2 * middles * mesh
    lost = error_estimate(mesh, multipliers, loads(0.0, rows=1), CONTROL[:1], STILL)
    np.testing.assert_allclose(lost.unused[1], 2 * middles[1] * mesh[1])


@pytest.mark.parametrize("used", [0.0, 0.3, -0.6])
def test_a_control_at_neither_limit_costs_time_where_its_multiplier_crosses_zero(used):
    """Its multipliers vanish in the second interval, for the motion is at neither limit there. The
    density is linear, from d/2 at one of its ends to -d/2: ∫|λ| is d/4 times its length."""
    d = 0.8
    multipliers = multiplier(d / 3, interval=0) - multiplier(d / 3, interval=2)
    torque = loads(used)
    torque[0], torque[2] = 1, -1
    lost = error_estimate(EVEN, multipliers, torque, CONTROL, STILL)
    np.testing.assert_allclose(lost.unused, [0, d / 4 / 3, 0], atol=1e-15)


@pytest.mark.parametrize(("kind", "lost"), [(CONTROL, 0.5 * 3 / 4), (STATE, 0.5 * 0.5)])
def test_what_a_ramp_loses(kind, lost):
    """A control that switches linearly loses half of the density in its interval; a state that
    leaves its limit what it loses in the half of the interval next to it."""
    torque = loads(1.0)
    torque[1, :, 0] = 1 - 2 * FRACTIONS
    found = error_estimate(EVEN, multiplier(0.5), torque, kind, STILL)
    assert found.total == pytest.approx(lost)


MESH = np.array([0.5, 0.2, 0.3])
SHORTEST, TIGHTENED = np.full((2, 3), [[5e-5], [4e-3]])


def lost(*unused: float, exceeded: tuple[float, ...] = (0, 0, 0)) -> ErrorEstimate:
    return ErrorEstimate(np.array(unused), np.array(exceeded, dtype=float))


def test_loss_falls_with_the_square_of_the_length():
    """Four times an interval's share: two halves, each a quarter of the loss."""
    share = 1e-3 / 3
    finer = refined(MESH, lost(4 * share, 0, 0.9 * share), 1e-3, SHORTEST, TIGHTENED)
    np.testing.assert_allclose(finer, [0.25, 0.25, 0.2, 0.3])


def test_intervals_at_a_body_and_beside_it_are_split():
    """In proportion to what is lost there: beside a sharp edge that falls with the length."""
    at_bodies = ErrorEstimate(np.zeros(3), np.zeros(3), np.array([0.0, 0.0, 1e-3]))
    finer = refined(MESH, at_bodies, 1e-3, SHORTEST, TIGHTENED)
    np.testing.assert_allclose(finer, [0.5, *3 * [0.2 / 3], *3 * [0.1]])
