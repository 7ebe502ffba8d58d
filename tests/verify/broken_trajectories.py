"""Trajectories that are broken in every way that an object of Python can be."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.motion.trajectory import Trajectory

NUMBERS = (np.nan, np.inf, -np.inf, 1e300, -1e150, 1e30, 5e-324, 0.0, -1.0)


def broken_arrays(good: np.ndarray, rng: np.random.Generator) -> Iterator[tuple[str, Any]]:
    """What may stand where an array does, each with its name."""
    for number in NUMBERS:
        one = good.copy()
        one.flat[rng.integers(1, good.size)] = number
        yield f"one number {number}", one
        yield f"all numbers {number}", np.full_like(good, number)
    for kind in (complex, object, str, bool, int, np.float32, np.longdouble, "datetime64[s]"):
        yield f"of {kind}", good.astype(kind)
    yield "of complex numbers", good + 1j
    yield "of None", np.full_like(good, None, dtype=object)
    yield "masked", np.ma.masked_array(good)
    for factor in (1e300, 1e150, 1e20, 1e-20, 1e-150, 1e-300, 1e-320):
        with np.errstate(over="ignore"):
            yield f"times {factor}", good * factor
    for value in (None, 3.0, "x", [], {}, good.tolist(), np.array(None), np.zeros((0, 0, 0))):
        yield f"{type(value).__name__}", value
    parts = (good[..., None], good[None], good.ravel(), good[..., :0], good[..., :1], good.T)
    for part in (*parts, good[:0], good[:1], good[:2], good[:-1], good[1:], good[::-1]):
        yield f"of shape {part.shape}", part
    yield "twice", np.repeat(good, 2, axis=0)


def same(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two arrays are the same, but for numbers that are none of a motion."""
    return (
        one.dtype == other.dtype
        and one.shape == other.shape
        and np.allclose(one, other, rtol=0, atol=1e-300)
    )


def broken(good: Trajectory, seed: int) -> Iterator[tuple[str, Trajectory]]:
    """A good motion with everything that it is made of broken in turn."""
    rng, position = np.random.default_rng(seed), good.position
    q, dq, ddq = good.coordinates_inside([0.0])
    own = PiecewisePolynomial(position.knots, np.stack([q, dq, ddq / 2], axis=1))
    for name, polynomials in (("position", position), ("coordinates", own)):
        for field in ("knots", "coefficients"):
            whole = getattr(polynomials, field)
            for what, array in broken_arrays(whole, rng):
                if type(array) is np.ndarray and same(array, whole):
                    continue
                changed = replace(polynomials, **{field: array})
                yield f"{field} of {name} {what}", replace(good, **{name: changed})
    for value in (None, 3, "x", [], np.zeros(3), ((0.0, 0.0), (0.0, np.nan, 0.0)), good):
        for name in ("position", "coordinates", "model", "end_velocities"):
            if not (name == "coordinates" and value is None):
                yield f"{name} a {type(value).__name__}", replace(good, **{name: value})
