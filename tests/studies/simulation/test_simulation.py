"""Simulated motions against reference motions, analytic ones and their own invariants."""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import pairwise
from math import pi
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from deltaopt.dynamics.consistency import EuclideanMetric, Residuals
from deltaopt.dynamics.constraint_matrix import NullSpace, Partition
from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.kane import Kane
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.mechanism import SX, Body, Effort, Mechanism, none
from deltaopt.dynamics.virtual_work import VirtualWork
from deltaopt.errors import Inconsistent, IntegrationFailed
from deltaopt.mechanisms.delta.mechanism import DeltaParameters, delta
from studies.simulation.simulation import Motion, simulate
from studies.simulation.stabilisation import (
    Baumgarte,
    NoStabilisation,
    Projection,
    Stabilisation,
)
from studies.spherical_pendulum import spherical_pendulum

DATA = Path(__file__).parents[2] / "data"


@dataclass(frozen=True)
class Reference:
    """A motion of the paper's Delta under constant torques, SI units."""

    mechanism: Mechanism
    parameters: np.ndarray
    times: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    torques: np.ndarray

    @classmethod
    def load(cls, name: str) -> Reference:
        with np.load(DATA / f"{name}.npz") as file:
            rows = dict(file)
        p = json.loads(str(rows["params"]))
        a2, a3, m3, m4 = (p[name] for name in ("a2", "a3", "m3", "m4"))
        values = DeltaParameters(
            **{name: p[name] for name in ("a1", "a2", "a3", "a4", "m1", "m2", "m3", "m4")},
            I33=m3 * a2**2 / 3,
            I41=m4 * a3**2 / 3,
            I43=m4 * a3**2 / 3,
            g=p["g"] or None,
        )
        parameters = np.asarray(ca.DM(values.vector())).ravel()
        return cls(delta(values), parameters, rows["t"], rows["q"], rows["qd"], rows["tau_applied"])

    def simulate(
        self,
        formulation: Formulation | None = None,
        stabilisation: Stabilisation | None = None,
        tolerance: float = 1e-12,
    ) -> Motion:
        return simulate(
            self.mechanism,
            formulation or Multiplier(),
            self.q[0],
            self.dq[0],
            self.times,
            controls=self.torques,
            parameters=self.parameters,
            stabilisation=stabilisation,
            tolerance=tolerance,
        )


@pytest.fixture(scope="module")
def driven() -> Reference:
    return Reference.load("forward_torque")


@pytest.fixture(scope="module")
def free() -> Reference:
    return Reference.load("forward_free")


@pytest.mark.parametrize("name", ["forward_torque", "forward_free"])
@pytest.mark.parametrize("formulation", [Explicit(), Multiplier()])
@pytest.mark.parametrize("stabilisation", [NoStabilisation(), Baumgarte(), Projection()])
def test_follows_the_reference(
    name: str, formulation: Formulation, stabilisation: Stabilisation
) -> None:
    reference = Reference.load(name)
    motion = reference.simulate(formulation, stabilisation)
    np.testing.assert_allclose(motion.q, reference.q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(motion.dq, reference.dq, rtol=0, atol=1e-8)


def test_energy_is_constant_without_torque(free: Reference) -> None:
    assert np.ptp(free.simulate().energy) < 1e-9


def test_energy_grows_by_the_work_of_the_motors(driven: Reference) -> None:
    motion = driven.simulate()
    work = motion.q[:, [3, 6, 9]] @ driven.torques
    assert np.ptp(motion.energy - work) < 1e-9
    assert np.ptp(motion.energy) > 0.1


@pytest.mark.parametrize("stabilisation", [Projection(), Projection(EuclideanMetric())])
def test_projection_holds_the_constraints(driven: Reference, stabilisation: Projection) -> None:
    motion = driven.simulate(stabilisation=stabilisation, tolerance=1e-7)
    assert np.abs(motion.position_drift).max() <= 1e-12
    assert np.abs(motion.velocity_drift).max() <= 1e-12


def test_drift_grows_without_stabilisation_and_is_bounded_by_baumgarte() -> None:
    """A particle swings on a rod for 40 s, f = its distance from the circle, m."""
    drift, bound, none_left = (
        np.abs(swing(stabilisation, 40.0).position_drift[:, 0])
        for stabilisation in (NoStabilisation(), Baumgarte(), Projection())
    )
    middle = len(drift) // 2
    assert drift[middle:].max() > 1.8 * drift[:middle].max()
    assert bound.max() < drift.max() / 50
    assert bound[middle:].max() < 2 * bound[:middle].max()
    assert none_left.max() < 1e-15


def test_baumgarte_feeds_violations_back() -> None:
    """J q̈ + J̇ q̇ + μ̇ = -ω² f - 2 ζ ω (J q̇ + μ), here with f = |q| - 1."""
    fed = Baumgarte(frequency=20.0, damping=0.7).mechanism(rod())
    q, dq = np.array([0.0, -1.25]), np.array([0.0, -0.5])
    ddq, _ = Multiplier().forward_dynamics(fed)(0, q, dq, [], [])
    assert -float(ddq[1]) == pytest.approx(-(20.0**2) * 0.25 - 2 * 0.7 * 20.0 * 0.5)


def test_error_falls_with_the_tolerance(driven: Reference) -> None:
    errors = [
        np.abs(driven.simulate(tolerance=tolerance).q - driven.q).max()
        for tolerance in (1e-6, 1e-8, 1e-10, 1e-12)
    ]
    assert all(finer < coarser / 20 for coarser, finer in pairwise(errors))


def test_slightly_inconsistent_start_is_projected(driven: Reference) -> None:
    off = np.random.default_rng(1).uniform(-1, 1, 12) * 1e-4
    motion = simulate(
        driven.mechanism,
        Multiplier(),
        driven.q[0] + off,
        driven.dq[0] + off,
        [0.0, 0.01],
        parameters=driven.parameters,
    )
    assert np.abs(motion.position_drift[0]).max() < 1e-15
    assert np.abs(motion.velocity_drift[0]).max() < 1e-15
    assert np.abs(motion.q[0] - driven.q[0]).max() < 1e-3


@pytest.mark.parametrize(
    ("dx", "dv", "sentence"),
    [
        (0.1, 0.0, r"positions given for the delta violate constraint \d by 0.1 m"),
        (0.0, 0.1, r"velocities given for the delta violate constraint \d by 0.1 m/s"),
        (np.nan, 0.0, "by nan"),
    ],
)
def test_inconsistent_start_is_refused(
    driven: Reference, dx: float, dv: float, sentence: str
) -> None:
    x = np.eye(12)[2]
    with pytest.raises(Inconsistent, match=sentence):
        simulate(
            driven.mechanism,
            Multiplier(),
            driven.q[0] + dx * x,
            driven.dq[0] + dv * x,
            [0.0, 0.01],
            parameters=driven.parameters,
        )


@pytest.mark.parametrize("stabilisation", [NoStabilisation(), Projection()])
def test_a_motion_that_cannot_go_on_says_where(stabilisation: Stabilisation) -> None:
    slider = slider_with_motor()
    force = 1 / (0.55 - slider.time) ** 2
    with pytest.raises(IntegrationFailed, match=r"could not be followed .* 0\.6 s") as caught:
        simulate(
            slider,
            Multiplier(),
            [0.0],
            [0.0],
            np.linspace(0, 0.6, 7),
            controls=force,
            stabilisation=stabilisation,
        )
    assert caught.value.__suppress_context__


def test_controls_may_depend_on_time_and_state() -> None:
    slider, times = slider_with_motor(), np.linspace(0.3, 2.0, 9)
    forced = simulate(
        slider, Multiplier(), [0.0], [-1.0], times, controls=ca.sin(slider.time), tolerance=1e-12
    )
    expected = -np.sin(times) + np.sin(0.3) + (np.cos(0.3) - 1) * (times - 0.3)
    np.testing.assert_allclose(forced.q[:, 0], expected, atol=1e-10)
    spring = simulate(slider, Multiplier(), [1.0], [0.0], times, controls=-4 * slider.q)
    np.testing.assert_allclose(spring.q[:, 0], np.cos(2 * (times - 0.3)), atol=1e-8)


def test_without_controls_nothing_pushes() -> None:
    motion = simulate(slider_with_motor(), Multiplier(), [0.0], [1.0], [0.0, 1.0])
    assert motion.q[-1, 0] == pytest.approx(1.0)


def test_wrong_number_of_controls() -> None:
    with pytest.raises(ValueError, match="2 controls given, the mechanism has 1"):
        simulate(slider_with_motor(), Multiplier(), [0.0], [1.0], [0.0, 1.0], controls=[1.0, 2.0])


def test_only_the_closed_form_stops_at_a_serial_singularity(driven: Reference) -> None:
    """20 N·m on each motor throws the arms in line with their bars at 0.08 s.

    J keeps its rank there, so that L_I and a null-space basis go through and agree; J⁽ᵏ⁾ is
    singular, so that eq. (55) has no C.
    """

    def thrown(formulation: Formulation) -> Motion:
        return simulate(
            driven.mechanism,
            formulation,
            driven.q[0],
            driven.dq[0],
            np.linspace(0, 0.3, 31),
            controls=[20.0, 20.0, 20.0],
            parameters=driven.parameters,
            tolerance=1e-12,
        )

    multiplier, null_space = thrown(Multiplier()), thrown(Explicit(NullSpace()))
    arm, bars = multiplier.q[:, 3], multiplier.q[:, 4]
    assert np.ptp(np.sign(np.sin(arm - bars))) == 2
    np.testing.assert_allclose(null_space.q, multiplier.q, rtol=0, atol=1e-8)
    with pytest.raises(IntegrationFailed, match=r"between t = 0\.07 s and 0\.08 s"):
        thrown(Explicit())


@pytest.mark.parametrize("stabilisation", [NoStabilisation(), Baumgarte(), Projection()])
def test_constraints_that_move(stabilisation: Stabilisation) -> None:
    """A bead carried round on a turning circle keeps to it: no controls, f depends on time."""
    turn = 2 * pi
    bead = particle("bead")
    bead = Mechanism(
        **{
            **bead,
            "holonomic": ca.vertcat(
                bead["q"][0] - ca.cos(turn * bead["time"]),
                bead["q"][1] - ca.sin(turn * bead["time"]),
            ),
        }
    )
    times = np.linspace(0, 1, 11)
    motion = simulate(
        bead,
        Multiplier(),
        [1.0, 0.0],
        [0.0, turn],
        times,
        stabilisation=stabilisation,
        tolerance=1e-12,
    )
    np.testing.assert_allclose(motion.q[:, 0], np.cos(turn * times), atol=1e-10)
    np.testing.assert_allclose(motion.q[:, 1], np.sin(turn * times), atol=1e-10)
    assert motion.position_drift.shape == (11, 2)


@pytest.mark.parametrize("stabilisation", [NoStabilisation(), Baumgarte(), Projection()])
def test_nonholonomic_constraints_are_kept_as_velocities(stabilisation: Stabilisation) -> None:
    """A skate that turns at a constant rate glides round a circle at constant speed."""
    speed, turn, times = 1.5, 2.0, np.linspace(0, 3, 13)
    motion = simulate(
        skate(),
        Multiplier(),
        [0.0, 0.0, 0.0],
        [speed, 0.0, turn],
        times,
        stabilisation=stabilisation,
        tolerance=1e-12,
    )
    circle = speed / turn * np.column_stack([np.sin(turn * times), 1 - np.cos(turn * times)])
    np.testing.assert_allclose(motion.q[:, :2], circle, atol=1e-9)
    assert motion.position_drift.shape == (13, 0)
    assert np.abs(motion.velocity_drift).max() < 1e-10


LENGTH, GRAVITY = 0.7, 9.81


def shaken(t: SX) -> SX:
    """ζ(t), m."""
    return 0.1 * ca.sin(6 * t)


def pendulum_in_two_coordinates(state: np.ndarray, times: np.ndarray) -> np.ndarray:
    """θ, φ, θ̇, φ̇ at ``times`` (N × 4) by Lagrange's equations in θ and φ alone.

    I θ̈ = I sin θ cos θ φ̇² - m (g - ζ̈) l/2 sin θ and d/dt (I sin² θ φ̇) = 0 with I = m l²/3
    about the base; by the classical Runge-Kutta method, 20 000 steps.
    """
    x, t = SX.sym("x", 4), SX.sym("t")
    theta, _, dtheta, dphi = ca.vertsplit(x)
    weight = GRAVITY - ca.jacobian(ca.jacobian(shaken(t), t), t)
    ddtheta = ca.sin(theta) * (ca.cos(theta) * dphi**2 - 1.5 * weight / LENGTH)
    ddphi = -2 * dtheta * dphi / ca.tan(theta)
    ode = {"t": t, "x": x, "ode": ca.vertcat(dtheta, dphi, ddtheta, ddphi)}
    steps = {"number_of_finite_elements": 20_000}
    flow = ca.integrator("minimal", "rk", ode, times[0], list(times[1:]), steps)
    return np.vstack([state, np.asarray(flow(x0=state)["xf"]).T])


@pytest.mark.parametrize(
    "formulation",
    [Multiplier(), Explicit(), VirtualWork(NullSpace()), Kane(Partition((3, 4)))],
)
def test_pendulum_on_a_moving_base_moves_as_in_two_coordinates(formulation: Formulation) -> None:
    start, times = np.array([0.8, 0.3, 0.5, 2.5]), np.linspace(0, 5, 26)
    minimal = pendulum_in_two_coordinates(start, times)
    pendulum = spherical_pendulum(LENGTH, 1.3, GRAVITY, shaken)
    motion = simulate(
        pendulum,
        formulation,
        *pendulum_state(pendulum, start),
        times,
        tolerance=1e-13,
    )
    np.testing.assert_allclose(motion.q[:, 3:], minimal[:, :2], rtol=0, atol=1e-9)
    np.testing.assert_allclose(motion.dq[:, 3:], minimal[:, 2:], rtol=0, atol=1e-8)
    assert np.abs(motion.position_drift).max() < 1e-12
    assert np.ptp(motion.energy) > 0.1  # the base does work


def pendulum_state(pendulum: Mechanism, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """q, q̇ at t = 0 with the tip where the angles put it."""
    q, dq = (np.concatenate([np.zeros(3), part]) for part in np.split(angles, 2))
    residuals = Residuals(pendulum)
    q[:3] -= residuals(0, q, dq, np.empty(0))[0]
    dq[:3] -= residuals(0, q, dq, np.empty(0))[1]
    return q, dq


def particle(name: str) -> dict[str, object]:
    """What a particle of 1 kg in a plane has, for ``Mechanism``."""
    q, dq = SX.sym("q", 2), SX.sym("dq", 2)
    return {
        "name": name,
        "q": q,
        "dq": dq,
        "bodies": (Body(name, 1.0, ca.vertcat(q, 0)),),
        "efforts": (),
        "controls": none(),
        "holonomic": none(),
        "nonholonomic": none(),
        "gravity": None,
        "potential": SX(0),
        "parameters": none(),
        "time": SX.sym("t"),
    }


def rod() -> Mechanism:
    """A particle on a massless rod of 1 m, hanging along -y."""
    hanging = particle("rod")
    hanging |= {"holonomic": ca.norm_2(hanging["q"]) - 1, "gravity": ca.vertcat(0, -9.81, 0)}
    return Mechanism(**hanging)


def swing(stabilisation: Stabilisation, duration: float) -> Motion:
    """The rod let go at the horizontal."""
    times = np.linspace(0, duration, 81)
    return simulate(
        rod(),
        Multiplier(),
        [1.0, 0.0],
        [0.0, 0.0],
        times,
        stabilisation=stabilisation,
        tolerance=1e-7,
    )


def slider_with_motor() -> Mechanism:
    """1 kg on a line, pushed by one force."""
    q, dq, force = SX.sym("q"), SX.sym("dq"), SX.sym("F")
    line = particle("slider") | {"q": q, "dq": dq, "controls": force}
    body = Body("slider", 1.0, ca.vertcat(q, 0, 0))
    return Mechanism(**line | {"bodies": (body,), "efforts": (Effort(force, dq),)})


def skate() -> Mechanism:
    """1 kg with 0.1 kg·m² on a blade: x, y, heading; no sideways velocity."""
    q, dq = SX.sym("q", 3), SX.sym("dq", 3)
    body = Body("skate", 1.0, ca.vertcat(q[:2], 0), ca.vertcat(0, 0, 0.1), ca.vertcat(0, 0, dq[2]))
    sideways = -ca.sin(q[2]) * dq[0] + ca.cos(q[2]) * dq[1]
    plane = particle("skate") | {"q": q, "dq": dq, "nonholonomic": sideways}
    return Mechanism(**plane | {"bodies": (body,)})
