"""Forces in the single bars of a Delta's parallelograms, which twelve coordinates do not have.

There each pair of bars is one body and the platform keeps level by itself. In truth the two bars of
chain k, a distance 2 w apart along the axis s_k of the elbow, keep it level by unequal forces: with
u_k along the bars, p_k from the platform's centre to the middle of the pair's end, S_k the sum of
both bars' forces and D_k their difference, the platform's balance is

    forces   Σ S_k u_k                               = m (a - g) - Σ t_k
    moments  Σ (S_k p_k × u_k + w D_k s_k × u_k)      = c × m (a - g) - Σ p_k × t_k

with t_k, across the bars, what their own inertia and weight hand to the platform. The first is
singular in the parallel singularity, the second where the normals s_k × u_k lie in one plane: there
the platform tilts and no bar holds it. Bars are slender and uniform, and two point masses
make the platform: itself at its centre, tool and payload at the tool's point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deltaopt.compare.dynamics.tasks import Array
from deltaopt.mechanisms.delta.mechanism import AZIMUTHS
from deltaopt.robot.model import DeltaModel

HALF_WIDTH = 0.1
"""Half the distance w between the bars of a pair, as a share of their length, as in
``deltaopt export mjcf``: robot files do not give it. Differences of forces grow as 1/w."""


@dataclass(frozen=True)
class _Chain:
    """At N instants: radial and sideways directions, 3; unit vectors along the bars and
    accelerations of the elbow, N × 3."""

    radial: Array
    sideways: Array
    bar: Array
    elbow: Array


def bar_forces(model: DeltaModel, x: Array, v: Array, a: Array) -> Array:
    """Return the forces with which the two bars of each chain push the platform along them,
    N × 3 × 2, N, for positions, velocities and accelerations of the tool's point, N × 3 each.

    Raises ValueError for bars that are not slender.
    """
    robot = model.robot
    if robot.forearm.inertia is not None:
        raise ValueError("the forces in bars are known for slender bars only")
    chains = _chains(model, x, v, a)
    gravity, bars = np.array(robot.gravity_vector), robot.forearm.mass / 2
    own = robot.platform.mass + 3 * (robot.platform.pins or 0.0)
    carried = ((robot.tool and robot.tool.mass) or 0.0) + (model.payload or 0.0)
    force, moment = (own + carried) * (a - gravity), np.zeros_like(a)
    moment += np.cross(robot.tool_offset, carried * (a - gravity))
    for chain in chains:
        load = chain.elbow / 6 + a / 3 - gravity / 2
        across = load - np.sum(load * chain.bar, axis=1, keepdims=True) * chain.bar
        force += 2 * bars * across
        moment += np.cross(robot.platform_radius * chain.radial, 2 * bars * across)
    sums = _solved([chain.bar for chain in chains], force)
    for chain, total in zip(chains, sums.T, strict=True):
        pushed = total[:, None] * chain.bar
        moment -= np.cross(robot.platform_radius * chain.radial, pushed)
    arm = HALF_WIDTH * robot.forearm.length
    differences = _solved([arm * np.cross(chain.sideways, chain.bar) for chain in chains], moment)
    return np.stack([sums + differences, sums - differences], axis=2) / 2


def _chains(model: DeltaModel, x: Array, v: Array, a: Array) -> list[_Chain]:
    robot = model.robot
    q, dq, ddq = model.motion(x, v, a)
    found = []
    for k, azimuth in enumerate(AZIMUTHS):
        theta, rate, acceleration = (each[:, 3 + 3 * k, None] for each in (q, dq, ddq))
        down = np.array([1.0, 0.0, 0.0])
        radial = np.array([0.0, np.cos(azimuth), np.sin(azimuth)])
        sideways = np.array([0.0, -np.sin(azimuth), np.cos(azimuth)])
        along = np.cos(theta) * radial - np.sin(theta) * down
        across = -np.sin(theta) * radial - np.cos(theta) * down
        length = robot.upper_arm.length
        elbow = robot.base_radius * radial + length * along
        corner = x - robot.tool_offset + robot.platform_radius * radial
        found.append(
            _Chain(
                radial,
                sideways,
                (corner - elbow) / robot.forearm.length,
                length * (acceleration * across - rate**2 * along),
            )
        )
    return found


def _solved(columns: list[Array], right: Array) -> Array:
    """Return the solution (N, 3) of N systems with these columns, N × 3 each."""
    return np.asarray(np.linalg.solve(np.stack(columns, axis=2), right[:, :, None])[:, :, 0])
