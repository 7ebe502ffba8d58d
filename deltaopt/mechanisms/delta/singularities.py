"""How far the Delta is from its singular positions, as margins that vanish there."""

from __future__ import annotations

from math import cos, sin

import casadi as ca

from deltaopt.dynamics.mechanism import SX
from deltaopt.mechanisms.delta.mechanism import AZIMUTHS


def sideways_margins(q: SX) -> SX:
    """cos q_{k,3}, 3: zero where the bars of a chain lie across it, a serial singularity."""
    return ca.cos(ca.vertcat(q[5], q[8], q[11]))


def alignment_margins(q: SX) -> SX:
    """sin (q_{k,1} - q_{k,2}), 3: zero where arm and bars are in line, a serial singularity."""
    return ca.sin(ca.vertcat(*(q[i] - q[i + 1] for i in (3, 6, 9))))


def parallel_margin(q: SX) -> SX:
    """Volume of the box that unit vectors along the three bars span; zero if they lie in a
    plane: no torque balances a force across it, a parallel singularity."""
    return ca.det(ca.horzcat(*(_bar(azimuth, q[i : i + 2]) for azimuth, i in _BARS)))


_BARS = tuple(zip(AZIMUTHS, (4, 7, 10), strict=True))


def _bar(azimuth: float, angles: SX) -> SX:
    """Unit vector from elbow to platform in the base frame, of q_{k,2} and q_{k,3}."""
    c, s = ca.cos(angles), ca.sin(angles)
    outward, sideways = c[0] * c[1], s[1]
    return ca.vertcat(
        -s[0] * c[1],
        cos(azimuth) * outward - sin(azimuth) * sideways,
        sin(azimuth) * outward + cos(azimuth) * sideways,
    )
