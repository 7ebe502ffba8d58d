"""A slider-crank with crank and rod of one length: its branches meet where the crank is upright.

There the slider is above the crank's axis, J loses a rank, and the mechanism may go on as a
slider-crank or turn as one bar. Uniform rods of 1 m and 1 kg, slider without mass.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from deltaopt.compare.dynamics.tasks import Array
from deltaopt.dynamics.mechanism import SX, Mechanism
from studies.benchmarks.four_bars import thin_rods, unit_length

SPEED = 4.0
"""Of the slider at the start, towards the crank's axis, m/s."""


def slider_crank() -> Mechanism:
    """Return it in the joint's x and y and the slider's x, m; two constraints."""
    q, dq = SX.sym("q", 3), SX.sym("dq", 3)
    axis, joint, slider = SX([0, 0, 0]), ca.vertcat(q[:2], 0), ca.vertcat(q[2], 0, 0)
    return Mechanism(
        name="slider-crank",
        q=q,
        dq=dq,
        bodies=thin_rods([(axis, joint), (joint, slider)]),
        holonomic=ca.vertcat(unit_length(joint), unit_length(slider - joint)),
        gravity=SX([0, -9.81, 0]),
    )


def start() -> tuple[Array, Array]:
    """Return q, q̇: crank at 45°, the slider at 4 m/s towards the axis."""
    x, y = np.cos(np.pi / 4), np.sin(np.pi / 4)
    rate = SPEED / (2 * y)  # ẋ of the slider is −2 sin θ θ̇
    return np.array([x, y, 2 * x]), np.array([-y * rate, x * rate, -SPEED])


def on_its_branch(times: Array, speed: float = SPEED) -> Array:
    """Return x and y of the joint and x of the slider (N × 3, m), as a slider-crank throughout.

    x = 2 cos θ on this branch, and both rods move with θ alone: one equation for θ, by CVODES to 13
    digits.
    """
    theta, rate = SX.sym("theta"), SX.sym("rate")
    # crank: θ̇²/6; rod: its middle at (1.5 cos θ, 0.5 sin θ), and θ̇²/24 about it
    inertia = 1 / 3 + 2.25 * ca.sin(theta) ** 2 + 0.25 * ca.cos(theta) ** 2 + 1 / 12
    gravity = 9.81 * ca.cos(theta)  # of V = 9.81 (0.5 + 0.5) sin θ
    change = ca.jacobian(inertia, theta) * rate**2 / 2
    x = ca.vertcat(theta, rate)
    ode = {"x": x, "ode": ca.vertcat(rate, (-gravity - change) / inertia)}
    later = [float(t) for t in times if t > 0]
    flow = ca.integrator("angle", "cvodes", ode, 0.0, later, {"reltol": 1e-13, "abstol": 1e-13})
    first = [np.pi / 4, speed / (2 * np.sin(np.pi / 4))]
    angle = np.concatenate([[first[0]], flow(x0=first)["xf"].full()[0]])[-len(times) :]
    return np.column_stack([np.cos(angle), np.sin(angle), 2 * np.cos(angle)])
