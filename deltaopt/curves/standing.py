"""Where a curve all but stands still with its parameter."""

from __future__ import annotations

import numpy as np

from deltaopt.curves.piecewise import PiecewisePolynomial

_LOOKED_AT = np.arange(8) / 8
"""Fractions of every piece."""


def slowest_onwards(curve: PiecewisePolynomial) -> tuple[float, float]:
    """The parameter at which a curve moves least with it and goes on in about the same direction,
    and how much, as a share of its largest rate.

    At its ends its rate may vanish where its second derivative, as a share of the largest of these,
    does not: so does that of a motion from rest by its time. Where it turns back it must stop.
    """
    pieces, since = curve.everywhere(_LOOKED_AT)
    s = np.append(curve.knots[pieces] + since, curve.knots[-1])
    rate = curve.at(s, 1)
    speed, bend = (np.linalg.norm(each, axis=1) for each in (rate, curve.at(s, 2)))
    least = np.finfo(float).tiny  # of a curve of one point
    share = speed / max(float(speed.max()), least)
    share[[0, -1]] += bend[[0, -1]] / max(float(bend.max()), least)
    share[1:-1][(rate[:-2] * rate[2:]).sum(axis=1) <= 0] = 1.0
    nearer_an_end = (speed[1:-1] > speed[:-2]) | (speed[1:-1] > speed[2:])
    share[1:-1][nearer_an_end] = 1.0
    slowest = int(share.argmin())
    return float(s[slowest]), float(share[slowest])
