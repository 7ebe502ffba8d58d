"""A02, N four-bars: N windows side by side that swing through a singularity of N ranks.

In natural coordinates: the joints on top of the cranks. A thin rod of mass m moves as m/6 at each
end and 2 m/3 at its middle, so that the inertia matrix is constant and no angle is needed.
"""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np

from deltaopt.compare.dynamics.tasks import Array
from deltaopt.dynamics.mechanism import SX, Body, Mechanism


def n_four_bar(windows: int = 2) -> Mechanism:
    """Return A02: ``windows`` squares side by side, cranks on the ground, unit links of 1 kg.

    Coordinates: x and y of the joints B₀ … B_N on top of the cranks, m. One degree of
    freedom, but N + 1 whenever all links lie in one line.
    """
    n = windows + 1
    q, dq = SX.sym("q", 2 * n), SX.sym("dq", 2 * n)
    tops = [ca.vertcat(q[2 * i : 2 * i + 2], 0) for i in range(n)]
    cranks = [(SX([i, 0, 0]), top) for i, top in enumerate(tops)]
    rods = [*cranks, *pairwise(tops)]
    return Mechanism(
        name=f"{windows}-four-bar",
        q=q,
        dq=dq,
        bodies=thin_rods(rods),
        holonomic=ca.vertcat(*(unit_length(end - start) for start, end in rods)),
        gravity=SX([0, -9.81, 0]),
    )


def n_four_bar_start(windows: int = 2) -> tuple[Array, Array]:
    """Return q, q̇: cranks upright, 1 m/s to the right."""
    q = np.ravel([(i, 1.0) for i in range(windows + 1)])
    return q, np.tile([1.0, 0.0], windows + 1)


def as_pendulum(times: Array, windows: int = 2, speed: float = 1.0) -> Array:
    """Return x and y of B₀ at the times (N × 2, m): all cranks turn alike, from ``speed``, m/s.

    N + 1 cranks and N couplers: ((N + 1)/3 + N) θ̈ = ((N + 1)/2 + N) g sin θ, θ from upright, by
    CVODES to 13 digits. Nothing of it is singular.
    """
    cranks, couplers = windows + 1, windows
    x = SX.sym("x", 2)
    torque, inertia = (cranks / 2 + couplers) * 9.81, cranks / 3 + couplers
    ode = {"x": x, "ode": ca.vertcat(x[1], torque / inertia * ca.sin(x[0]))}
    later = [float(t) for t in times if t > 0]
    flow = ca.integrator("angle", "cvodes", ode, 0.0, later, {"reltol": 1e-13, "abstol": 1e-13})
    theta = np.concatenate([[0.0], flow(x0=[0.0, speed])["xf"].full()[0]])[-len(times) :]
    return np.column_stack([np.sin(theta), np.cos(theta)])


def unit_length(vector: SX) -> SX:
    """Return what is zero if the vector has length 1."""
    return (ca.sumsqr(vector) - 1) / 2


def thin_rods(rods: list[tuple[SX, SX]]) -> tuple[Body, ...]:
    """Return rods of 1 kg between two points each, as particles."""
    return tuple(
        Body(f"rod {i}", mass, place)
        for i, (start, end) in enumerate(rods)
        for mass, place in ((1 / 6, start), (2 / 3, (start + end) / 2), (1 / 6, end))
    )
