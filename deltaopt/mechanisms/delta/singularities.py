"""Distances of the Delta from its singular positions: margins without unit that vanish there."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

from deltaopt.dynamics.mechanism import SX
from deltaopt.mechanisms.delta.mechanism import AZIMUTHS, in_base
from deltaopt.mechanisms.functions import SingularityDistance


def sideways_margins(q: SX) -> SX:
    """cos q_{k,3}, 3: zero where the bars of a chain lie sideways, a serial singularity."""
    return ca.cos(ca.vertcat(q[5], q[8], q[11]))


def alignment_margins(q: SX) -> SX:
    """sin (q_{k,1} - q_{k,2}), 3: zero where arm and bars are in line, a serial singularity."""
    return ca.sin(ca.vertcat(*(q[i] - q[i + 1] for i in (3, 6, 9))))


def parallel_margin(q: SX) -> SX:
    """Volume of the parallelepiped that unit vectors along the three bars span.

    It is zero if they lie in one plane, a parallel singularity: no motor torques balance a force
    normal to that plane.
    """
    return ca.det(ca.horzcat(*(_bar(azimuth, q[i : i + 2]) for azimuth, i in _BARS)))


def margins(q: SX) -> SX:
    """Signed distances from singularities, 7: cos q_{k,3} and sin (q_{k,1} - q_{k,2}) of the three
    chains, then the volume spanned by the bars' directions."""
    return ca.vertcat(sideways_margins(q), alignment_margins(q), parallel_margin(q))


def tilt_margin(q: SX) -> SX:
    """Volume of the parallelepiped that the unit normals of the three parallelograms span.

    It is positive in the industrial assembly mode, and zero if the normals lie in one plane: then
    the platform can tilt about the axis normal to that plane. The twelve coordinates do not show
    this, for their platform only translates.
    """
    return -ca.det(ca.horzcat(*(_normal(azimuth, q[i]) for azimuth, i in _BARS)))


_BARS = tuple(zip(AZIMUTHS, (4, 7, 10), strict=True))


def _bar(azimuth: float, angles: SX) -> SX:
    """Unit vector from elbow to platform in the base frame, of q_{k,2} and q_{k,3}."""
    c, s = ca.cos(angles), ca.sin(angles)
    return in_base(azimuth, -s[0] * c[1], c[0] * c[1], s[1])


def _normal(azimuth: float, angle: SX) -> SX:
    """Unit normal of a parallelogram, across its bars and its axis at the elbow, of q_{k,2}."""
    return in_base(azimuth, ca.cos(angle), ca.sin(angle), SX(0))


def _squared(margins: Callable[[SX], SX]) -> Callable[[SX], SX]:
    return lambda q: margins(q) ** 2


DISTANCES = (
    SingularityDistance(
        "serial singularity, arm and bars in line",
        "sin² (q_k1 - q_k2)",
        True,
        _squared(alignment_margins),
    ),
    SingularityDistance(
        "serial singularity, bars sideways", "cos² q_k3", True, _squared(sideways_margins)
    ),
    SingularityDistance(
        "parallel singularity", "volume of the bars' directions", False, parallel_margin
    ),
    SingularityDistance(
        "tilt of the platform", "volume of the parallelograms' normals", False, tilt_margin
    ),
)
"""The distances from all kinds of singular positions of the Delta. The volumes have a sign: below
zero the robot has passed the singularity into another assembly mode."""
