"""Integrators against exact motions, each other and what they must keep."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from deltaopt.dynamics import (
    Explicit,
    Multiplier,
    Partition,
)
from deltaopt.dynamics.mechanism import SX, Body, Mechanism
from deltaopt.errors import IntegrationFailed
from studies.benchmarks import governor, pendulum
from studies.simulation import (
    BDF,
    Adams,
    Gauss,
    NoStabilisation,
    StabilisedDAE,
    simulate,
)
from studies.simulation.integrators import Integrator

TIMES = np.linspace(0, 2, 5)


def swing(integrator: Integrator, tolerance: float, times: np.ndarray = TIMES):
    return simulate(
        pendulum.pendulum(),
        Multiplier(),
        *pendulum.start(),
        times,
        stabilisation=NoStabilisation(),
        integrator=integrator,
        tolerance=tolerance,
    )


@pytest.mark.parametrize(
    ("integrator", "tolerance", "bound"),
    [
        (Adams(), 1e-11, 1e-8),
        (BDF(), 1e-10, 1e-6),
        (StabilisedDAE(), 1e-8, 1e-5),
        (Gauss(0.01), 1e-13, 1e-10),
    ],
    ids=lambda value: type(value).__name__ if not isinstance(value, float) else "",
)
def test_the_pendulum_by_elliptic_functions(integrator, tolerance, bound):
    motion = swing(integrator, tolerance)
    np.testing.assert_allclose(motion.q, pendulum.exact(TIMES), atol=bound)
    assert motion.work.steps > 10
    assert motion.work.evaluations >= motion.work.steps
    assert (motion.work.factorizations > 0) == (not isinstance(integrator, Adams))


def test_elliptic_functions_keep_energy_and_length():
    times = np.linspace(0, 10, 41)
    x, y = pendulum.exact(times).T
    np.testing.assert_allclose(x**2 + y**2, 1, atol=1e-15)
    rate2 = -2 * pendulum.G * y  # of the angle, squared, from rest at the horizontal
    swept = np.gradient(np.unwrap(np.arctan2(y, x)), times)
    assert np.abs(swept**2 - rate2)[1:-1].max() < 0.2 * rate2.max()


@pytest.mark.parametrize("stages", [1, 2, 3])
def test_order_of_gauss(stages):
    steps = np.array([0.05, 0.025])
    exact = pendulum.exact(TIMES)
    errors = [np.abs(swing(Gauss(h, stages), 1e-14).q - exact).max() for h in steps]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * stages, abs=0.35)


def test_gauss_keeps_quadratic_invariants():
    """J q̇ = 0 is one, at a step that follows the motion to a thousandth only; f = 0 is none."""
    motion = swing(Gauss(0.25, 2), 1e-13)
    assert np.abs(motion.velocity_drift).max() < 1e-12
    assert np.abs(motion.position_drift).max() > 1e-4
    assert np.abs(motion.q - pendulum.exact(TIMES)).max() > 1e-3


def test_the_dae_keeps_both_levels():
    motion = swing(StabilisedDAE(), 1e-6)
    assert np.abs(motion.position_drift).max() < 1e-6
    assert np.abs(motion.velocity_drift).max() < 1e-5
    drifting = swing(BDF(), 1e-6)
    assert np.abs(drifting.position_drift).max() > 5e-5


def test_the_dae_with_moving_and_nonholonomic_constraints():
    """A knife edge that is carried along x: q̇ across the edge is zero, x = t."""
    q, dq = SX.sym("q", 3), SX.sym("dq", 3)
    t = SX.sym("t")
    edge = Mechanism(
        name="knife edge",
        q=q,
        dq=dq,
        bodies=(Body("edge", 2.0, ca.vertcat(q[:2], 0), SX([0, 0, 0.3]), ca.vertcat(0, 0, dq[2])),),
        holonomic=q[0] - t,
        nonholonomic=ca.sin(q[2]) * dq[0] - ca.cos(q[2]) * dq[1],
        time=t,
    )
    times = np.linspace(0, 1, 3)
    start = [0, 0, 0], [1, 0, 0.5]
    motion = simulate(
        edge,
        Multiplier(),
        *start,
        times,
        stabilisation=NoStabilisation(),
        integrator=StabilisedDAE(),
        tolerance=1e-8,
    )
    np.testing.assert_allclose(motion.q[:, 2], 0.5 * times, atol=1e-6)
    np.testing.assert_allclose(motion.q[:, 1], -2 * np.log(np.cos(0.5 * times)), atol=1e-6)


def test_stiff_couplers_need_newton():
    """The governor's dampers settle in 1e-4 s: BDF takes a twentieth of Adams' evaluations."""
    given = (governor.governor(), Explicit(), *governor.start(), np.array([0, 0.5]))
    work = {
        kind: simulate(
            *given, stabilisation=NoStabilisation(), integrator=kind(), tolerance=1e-6
        ).work
        for kind in (Adams, BDF)
    }
    assert work[Adams].evaluations > 20 * work[BDF].evaluations


def test_work_is_the_same_in_every_run():
    for integrator in (Adams(), BDF(), StabilisedDAE(), Gauss(0.05)):
        assert swing(integrator, 1e-7).work == swing(integrator, 1e-7).work


@pytest.mark.parametrize("integrator", [StabilisedDAE(), BDF(), Gauss(0.02)])
def test_failure_is_said(integrator):
    """The point reaches the end of its world: x² = 1 − t has no solution after t = 1."""
    q, dq, t = SX.sym("q", 2), SX.sym("dq", 2), SX.sym("t")
    m = Mechanism(
        name="shrinking",
        q=q,
        dq=dq,
        bodies=(Body("point", 1.0, ca.vertcat(q, 0)),),
        holonomic=(ca.sumsqr(q) - (1 - t)) / 2,
        time=t,
    )
    with pytest.raises(IntegrationFailed, match="could not be followed between t = 0"):
        simulate(
            m,
            Explicit(Partition((1,))),
            [1.0, 0.0],
            [-0.5, 0.0],
            [0, 2],
            stabilisation=NoStabilisation(),
            integrator=integrator,
            tolerance=1e-7,
        )
