"""Prices at which parts that are planned apart keep limits on their sums.

A limit on a sum over parts, as of the squared torques of all legs of a cycle, makes one large
problem of them. Its Lagrangian is a sum again: with a price on what is limited each part is a
problem of its own. The prices p are such that nothing is used too much, and that only what is used
up has a price: excess e (p) <= 0, p >= 0, pᵀe = 0. Whatever the prices are, the parts' least costs
bound the least of the whole from below.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from deltaopt.curves.piecewise import Array

_FARTHEST = 4.0
"""Factor by which a price that is not zero changes at most in a step."""


def next_prices(prices: Array, excess: Array, slopes: Array) -> Array:
    """Newton's step to the prices, (n,), at which nothing is in excess.

    ``excess``: at these prices, (n,). ``slopes``: its derivatives by the prices, (n, n). Where a
    price is 0 it may be that less is used than would be allowed.
    """
    everything = range(len(prices))
    choices = [free for n in range(len(prices) + 1) for free in combinations(everything, n)]
    steps = [_step(prices, excess, slopes, list(free)) for free in choices]
    found = prices + min(steps, key=lambda step: _violation(step, prices, excess, slopes))
    moved = np.clip(found, prices / _FARTHEST, np.where(prices > 0, _FARTHEST * prices, np.inf))
    return np.asarray(np.maximum(moved, 0.0))


def broyden(slopes: Array, step: Array, change: Array) -> Array:
    """The derivatives nearest to ``slopes``, (n, n), with which a step of the prices, (n,), changes
    the excess as it was seen to, (n,)."""
    length = float(step @ step)
    return slopes if length == 0 else slopes + np.outer(change - slopes @ step, step) / length


def _step(prices: Array, excess: Array, slopes: Array, free: list[int]) -> Array:
    """The step after which nothing ``free`` is in excess, and the other prices are 0."""
    step = -prices
    step[free] = 0.0
    if free:
        own = slopes[np.ix_(free, free)]
        step[free] = np.linalg.lstsq(own, -(excess + slopes @ step)[free], rcond=None)[0]
    return np.asarray(step)


def _violation(step: Array, prices: Array, excess: Array, slopes: Array) -> float:
    """By how much a step misses what prices are to fulfil."""
    after, above = prices + step, excess + slopes @ step
    scale = np.maximum(np.abs(prices), np.abs(prices).max(initial=1e-12))
    return float(
        np.maximum(-after / scale, 0).sum()
        + np.where(after <= 0, np.maximum(above, 0), np.abs(above)).sum()
    )
