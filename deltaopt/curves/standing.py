"""Where a curve all but stands still with its parameter."""

from __future__ import annotations

import numpy as np

from deltaopt.curves.piecewise import PiecewisePolynomial

_LOOKED_AT = np.arange(64) / 64
"""Fractions of every piece: where the rate has a dip like a square to a thousandth of what it is
elsewhere in the piece, this is a sixteenth of it wide."""
_ONWARDS = 0.9
"""Cosine of the angle between the directions before and after a place, from which on it goes on."""


def slowest_onwards(curve: PiecewisePolynomial) -> tuple[float, float]:
    """The parameter at which a curve moves least with it, and how much, as a share of its largest
    rate: of dips between its ends at which it goes on in about the same direction.

    Where it turns it may have to stop.
    """
    pieces, since = curve.everywhere(_LOOKED_AT)
    s = np.append(curve.knots[pieces] + since, curve.knots[-1])
    rate = curve.at(s, 1)
    speed = np.linalg.norm(rate, axis=1)
    before, here, after = speed[:-2], speed[1:-1], speed[2:]
    goes_on = (rate[:-2] * rate[2:]).sum(axis=1) > _ONWARDS * before * after
    is_dip = (here <= before) & (here <= after)
    largest = max(float(speed.max()), np.finfo(float).tiny)  # none of a curve of one point
    share = np.where(goes_on & is_dip, here / largest, 1.0)
    slowest = int(share.argmin())
    return float(s[slowest + 1]), float(share[slowest])
