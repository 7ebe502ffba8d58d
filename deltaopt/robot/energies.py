"""What bounds and units follow from, of a Delta: its energies, and what its parameters are."""

from __future__ import annotations

import casadi as ca
import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.dynamics.mechanism import Mechanism
from deltaopt.mechanisms.delta.mechanism import AZIMUTHS, DeltaParameters
from deltaopt.robot.machine import Energies

_LENGTH, _MASS, _INERTIA = (1, 0, 0), (0, 1, 0), (2, 1, 0)
_ACCELERATION = (1, 0, -2)

DIMENSIONS: dict[str, tuple[int, int, int]] = {
    **dict.fromkeys(("a1", "a2", "a3", "a4", "b1", "b2"), _LENGTH),
    **dict.fromkeys(("tool_x", "tool_y", "tool_z"), _LENGTH),
    **dict.fromkeys(("m1", "m2", "m3", "m4"), _MASS),
    **dict.fromkeys(("I33", "I41", "I42", "I43"), _INERTIA),
    **dict.fromkeys(("g", "g_y", "g_z"), _ACCELERATION),
}
"""Of each parameter of a Delta but those of loads, by its name: powers of length, mass and time."""


def delta_energies(mechanism: Mechanism, p: DeltaParameters) -> Energies | None:
    """Of a Delta with parameters ``p``, numbers, and its mechanism; None where a term of the model
    may act without bound, or where the mechanism has more than arms, bars, platform and payload,
    and what acts on the arms."""
    most = _most_load(mechanism, p)
    if not np.isfinite(most).all():
        return None
    pushing, braking, viscous = most.tolist()
    gravity = np.array([each or 0.0 for each in (p.g, p.g_y, p.g_z)], dtype=float)
    along, across = p.a2 if p.b1 is None else p.b1, p.b2 or 0.0
    centre, mass = float(np.hypot(along, across)), float(p.m1) + float(p.m2)
    moment = float(p.m3) * centre + float(p.m4) * float(p.a2)
    return Energies(
        arm_inertia=float(p.I33) + float(p.m3) * centre**2,
        arm=2 * float(p.a2),
        mass=mass,
        same=float(p.m4) / 4,
        # The energy of the bars' rotation is at least I |u - w|² / (2 (2 a₃)²), with I the lesser
        # transverse moment.
        opposite=min(float(p.I41), float(p.I43)) / (2 * float(p.a3)) ** 2,
        bars=3 * float(p.m4),
        gravity=moment * _in_planes_of_arms(gravity),
        pushing=pushing,
        braking=braking,
        viscous=viscous,
    )


def _most_load(mechanism: Mechanism, p: DeltaParameters) -> Array:
    """What can push an arm and brake it beside its motor and gravity, N·m, and brake it with its
    speed, N·m·s/rad, (3,): infinite where a term of the model does not say it, or where the
    mechanism has more than arms, bars, platform and payload, and what acts on the arms."""
    mass = sum((ca.SX(body.mass) for body in mechanism.bodies), ca.SX(0))
    most = (effort.most for effort in mechanism.efforts)
    each = ca.horzcat(*(ca.vertcat(of.pushing, of.braking, of.by_speed) for of in most))
    function = ca.Function("acting", [mechanism.parameters], [mass, each])
    moved, acting = (np.array(found) for found in function(p.values()))
    expected = p.m1 + p.m2 + 3 * (p.m3 + p.m4)
    on_arms = acting.shape[1] == len(AZIMUTHS) and mechanism.potential.is_zero()
    known = on_arms and np.isclose(moved.item(), expected, rtol=1e-9)
    return np.asarray(acting.max(axis=1) if known else np.full(3, np.inf))


def _in_planes_of_arms(gravity: Array) -> Array:
    """The component of gravity in the plane that each arm turns in, (3,), m/s²."""
    sideways = np.array([[0.0, -np.sin(azimuth), np.cos(azimuth)] for azimuth in AZIMUTHS])
    return np.asarray(np.sqrt(np.maximum(gravity @ gravity - (sideways @ gravity) ** 2, 0.0)))
