"""A Gough–Stewart platform: six legs with a universal joint, a drive and a ball joint each.

24 coordinates: the platform's place (m) and its Cardan angles, and of each leg its two angles at
the base and its length. 18 constraints say where the legs meet the platform; six drives push along
the legs. Legs have mass: a cylinder that turns about the base joint, a rod that moves along it.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from deltaopt.compare.dynamics.tasks import Array
from deltaopt.dynamics import Explicit, Multiplier, NullSpace, Partition, VirtualWork
from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.mechanism import SX, Body, Effort, Mechanism


@dataclass(frozen=True)
class Stewart:
    """Radii of the joints' circles (m), half the angle between the joints of a pair (rad), masses
    (kg), distances of the legs' centres of mass from their ends (m), moments of inertia (kg·m²)."""

    base: float = 1.0
    platform: float = 0.6
    base_half: float = 0.2
    platform_half: float = 0.8
    mass: float = 20.0
    inertia: tuple[float, float, float] = (1.2, 1.2, 2.2)
    cylinder: float = 3.0
    rod: float = 1.5
    cylinder_centre: float = 0.35
    rod_centre: float = 0.35
    cylinder_inertia: float = 0.12
    rod_inertia: float = 0.06

    def joints(self) -> list[tuple[Array, Array]]:
        """Return the joints on the base and, in its axes, on the platform, 3 each, m."""
        pairs = []
        for k in range(6):
            middle, side = 2 * np.pi / 3 * (k // 2), 1 if k % 2 else -1
            on = (middle + side * self.base_half, middle + side * self.platform_half)
            pairs.append(
                (
                    self.base * np.array([np.cos(on[0]), np.sin(on[0]), 0]),
                    self.platform * np.array([np.cos(on[1]), np.sin(on[1]), 0]),
                )
            )
        return pairs


def gough_stewart(p: Stewart) -> Mechanism:
    """Return the mechanism with these parameters; z points up, controls are the drives' forces."""
    q, dq, force = SX.sym("q", 24), SX.sym("dq", 24), SX.sym("force", 6)
    place, R = q[:3], rotation(q[3:6])
    bodies = [Body("platform", p.mass, place, SX(p.inertia), _spin(R, q, dq))]
    efforts, closures = [], []
    for k, (base, joint) in enumerate(p.joints()):
        angles, length = q[6 + 3 * k : 8 + 3 * k], q[8 + 3 * k]
        leg_axes = rotation(ca.vertcat(angles, 0))
        along, omega = leg_axes[:, 2], _spin(leg_axes, q, dq)
        cylinder, rod = SX([1, 1, 0]) * p.cylinder_inertia, SX([1, 1, 0]) * p.rod_inertia
        foot = SX(base)
        end = foot + length * along
        bodies += [
            Body(f"cylinder {k}", p.cylinder, foot + p.cylinder_centre * along, cylinder, omega),
            Body(f"rod {k}", p.rod, end - p.rod_centre * along, rod, omega),
        ]
        efforts.append(Effort(force[k], dq[8 + 3 * k]))
        closures.append(place + R @ joint - end)
    return Mechanism(
        name="Gough-Stewart platform",
        q=q,
        dq=dq,
        bodies=tuple(bodies),
        efforts=tuple(efforts),
        controls=force,
        holonomic=ca.vertcat(*closures),
        gravity=SX([0, 0, -9.81]),
    )


def legs(p: Stewart, pose: Array) -> Array:
    """Return all 24 coordinates of a platform at place and angles ``pose``, 6."""
    R = ca.DM(ca.evalf(rotation(ca.SX(pose[3:])))).full()
    found = [np.asarray(pose, dtype=float)]
    for base, joint in p.joints():
        x, y, z = leg = pose[:3] + R @ joint - base
        found.append(np.array([np.arctan2(-y, z), np.arctan2(x, np.hypot(y, z)), 0]))
        found[-1][2] = np.linalg.norm(leg)
    return np.concatenate(found)


def rotation(angles: SX) -> SX:
    """Return the rotation by Cardan angles about x, then y, then z, 3 × 3."""
    (cx, cy, cz), (sx, sy, sz) = (ca.vertsplit(f(angles)) for f in (ca.cos, ca.sin))
    about_x = ca.blockcat([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = ca.blockcat([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = ca.blockcat([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return about_x @ about_y @ about_z


def _spin(R: SX, q: SX, dq: SX) -> SX:
    """Angular velocity in the turned axes, from Rᵀ Ṙ."""
    rate = R.T @ ca.reshape(ca.jtimes(ca.vec(R), q, dq), 3, 3)
    return ca.vertcat(rate[2, 1], rate[0, 2], rate[1, 0])


@dataclass(frozen=True)
class Agreement:
    """How well ways to the drives' forces agree, relative to the largest force, in the worst of
    some random poses and motions; and the powers of drives and weights against the change of
    kinetic energy, relative."""

    forces: float
    power: float


def agreement(poses: int, seed: int = 1) -> Agreement:
    """Compare L_I, L_E by null space and by platform coordinates, and virtual work."""
    p = Stewart()
    m, random = gough_stewart(p), np.random.default_rng(seed)
    partition = Partition(tuple(range(6)))
    ways: list[Formulation] = [
        Multiplier(),
        Explicit(NullSpace()),
        Explicit(partition),
        VirtualWork(partition),
    ]
    inverses = [way.inverse_dynamics(m) for way in ways]
    forward = Explicit(NullSpace()).forward_dynamics(m)
    velocity = partition.function(m)
    rates = ca.Function("rates", [m.q, m.dq, m.ddq, m.controls], _powers(m))
    forces, power = 0.0, 0.0
    for _ in range(poses):
        pose = np.array([0, 0, 0.9, 0, 0, 0]) + random.uniform(-0.1, 0.1, 6)
        q = legs(p, pose)
        C, _ = velocity(0, q, [])
        dq = (C @ random.uniform(-1, 1, 6)).full().ravel()
        ddq, _ = forward(0, q, dq, random.uniform(-100, 300, 6), [])
        found = [inverse(0, q, dq, ddq, [])[0].full().ravel() for inverse in inverses]
        scale = np.abs(found[0]).max()
        forces = max(forces, *(np.abs(f - found[0]).max() / scale for f in found[1:]))
        done, stored = (float(x) for x in rates(q, dq, ddq, found[0]))
        power = max(power, abs(done - stored) / scale)
    return Agreement(forces, power)


def _powers(m: Mechanism) -> list[SX]:
    """Power of the drives, and the change of kinetic and potential energy."""
    return [
        sum((e.value * e.rate for e in m.efforts), SX(0)),
        ca.jtimes(m.T + m.V, ca.vertcat(m.q, m.dq), ca.vertcat(m.dq, m.ddq)),
    ]
