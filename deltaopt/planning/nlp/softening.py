"""Softer friction on meshes: Coulomb friction that changes its sign as slowly as a mesh resolves.

Friction c · tanh (θ̇ / w) changes its sign while an arm's speed goes from -w to w, at a reversal:
within a thousandth of a motion as a rule. So do the torques that a motion may use. Where the points
of a mesh are farther apart, every place that a reversal has among them is a local optimum; the
solver is caught in one, or hardly converges, for between two points a reversal is free of charge:
torques exceed their limits there by up to 2 c. So in each interval, and for each arm, friction
changes its sign over about as many rad/s as the speed changes in that interval.

That is not the friction that was asked for. To be safe, the torque is moreover kept from its limit
by as much as the two may differ: by c (1 - tanh²) (1 - (w / width)²), which covers it. Then the
limits hold with friction as it is, wherever reversals come to lie, and what they lose is known from
their multipliers, as what a mesh loses is: intervals in which arms turn back are split until that
is little, and no other. The first mesh is not covered: there it would cost more than the
reversals of the best motion gain, and other motions would be found.

Where rates of torques are limited, an arm turns back with a torque that hardly changes while
friction does, so that its acceleration falls by what friction has changed. With friction that is
ten times as soft motions find that on coarse meshes; from mesh to mesh it is then less soft, until
it is as it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from deltaopt.curves.piecewise import Array, Truths, with_neighbours
from deltaopt.motion.trajectory import Trajectory
from deltaopt.problem.problem import Problem

_RESOLVED = 0.7
"""Width of a change of sign, as a share of what a speed changes by in an interval. With half of it
solutions are caught between points; more of it asks for finer meshes."""
_QUIET = 0.05
"""Where an arm's speed hardly changes it might on the next mesh: it is taken to change by this
share of what the speed that changes most does at a mean."""
_FIRST, _LEAST = 0.6, 1.5
"""The least width on the first meshes, in units of the tolerance times the largest speed times the
torque limit over c: this costs a tenth of the tolerance to half of it. And the least that is
covered, in units of the friction's own: where that costs too much, friction is as it is."""
_COSTLY, _WANTED, _FALL = 0.25, 0.2, 0.25
"""What friction may cost by being softer, as a share of the tolerance, where a plan is not within
it yet; what it is to cost then; and to which share of itself the least width falls at most."""
_SOFT_AT_FIRST, _LESS_SOFT = 0.1, 1 / 3
"""Where rates of torques are limited: the least width on the first mesh, as a share of the largest
speed, and by what it is multiplied from mesh to mesh. With smaller steps plans take longer, with
larger ones more of them do not converge."""
_NEARLY = 1.01
_CHANGING = 3.0
"""Up to how many of its widths from rest friction changes: from there on by less than a hundredth
of its rate at rest."""
_SAMPLES = np.linspace(0.0, 1.0, 5)
"""Fractions of intervals where speeds of arms are evaluated: they are nearly straight between."""


@dataclass(frozen=True)
class Softening:
    """How much softer friction is on a mesh.

    ``least``: width of a change of its sign in the shortest intervals, rad/s. ``covers``: whether
    limits of torque are tightened by what that may hide.
    """

    least: float
    covers: bool

    @classmethod
    def of(cls, problem: Problem, motion: Trajectory, tolerance: float) -> Softening | None:
        """The softest that a plan of a tolerance may have; where rates of torques are limited, that
        to begin with. None without sharp friction.

        ``motion``: a guess, whose speeds say what is soft.
        """
        layers, torques = problem.model.layers, problem.limits.upper("torque")
        if not layers or torques is None:
            return None
        fastest = np.abs(_speeds(motion)).max()
        if problem.rates_peak:
            return cls(_SOFT_AT_FIRST * fastest, covers=False)
        friction = max(most for _, most in layers)
        soft = _FIRST * tolerance * fastest * float(torques.min()) / friction
        return cls(max(soft, _least(problem)), covers=False)

    def widths(self, motion: Trajectory, mesh: Array) -> Array:
        """Over how many rad/s friction changes its sign, from -1 to 1 over twice as many, in each
        interval of a mesh, for each arm, (N, motors). ``motion``: a guess of the mesh's."""
        speeds, shares = _speeds(motion), _shares(motion)
        changed = np.abs(np.diff(speeds, axis=0, prepend=speeds[:1])).cumsum(axis=0)
        at = np.append(0.0, mesh.cumsum())
        inside = [np.diff(np.interp(at, shares, each)) / mesh for each in changed.T]
        rates = with_neighbours(np.array(inside).T)
        rates = np.maximum(rates, _QUIET * changed[-1].max())
        return np.asarray(np.maximum(_RESOLVED * mesh[:, None] * rates, self.least))

    def after(
        self, problem: Problem, lost: float, tolerance: float, failures: int = 0
    ) -> Softening:
        """That of the mesh after one on which it lost so much, a share of the duration, and a plan
        is not within its tolerance; ``failures``: how many meshes since then were not solved."""
        if problem.rates_peak:
            least = _LESS_SOFT ** (0.5**failures) * self.least
            return Softening(least if least > _own_width(problem) else 0.0, covers=True)
        if lost <= _COSTLY * tolerance:
            return replace(self, covers=True)
        least = self.least * max(_FALL, _WANTED * tolerance / lost)
        if self.least < _NEARLY * _least(problem):
            return Softening(0.0, covers=True)
        return Softening(max(least, _least(problem)), covers=True)

    def resolved(
        self, problem: Problem, motion: Trajectory, widths: Array, fractions: Array, rows: Array
    ) -> Array:
        """Rows of torques of a motion, (N · fractions, motors), shares of their limits, as its mesh
        sees them where no finer one helps: with softer friction of the least width."""
        torques = problem.limits.upper("torque")
        assert torques is not None
        speeds = _speeds(motion, fractions)
        each = np.repeat(widths, len(rows) // len(widths), axis=0)
        found = rows
        for speed, most in problem.model.layers:
            share, (wide, soft, change) = most / torques, _softened(speeds, speed, each)
            covered = self.covers * (1 - (speed / wide) ** 2) * share * (1 - soft**2)
            found = (found + share * change) / (1 - covered)
        return np.where(self.is_least(each), found, rows)

    def is_least(self, widths: Array) -> Truths:
        """Which ``widths`` are the least there are, so that no finer mesh has smaller ones."""
        return widths < _NEARLY * self.least

    def hidden(self, problem: Problem, motion: Trajectory, widths: Array, at: Array) -> Array:
        """By how much torques of a motion are larger than a mesh of such ``widths`` sees them, at
        fractions ``at`` of all intervals, (N · fractions, motors), N·m."""
        speeds = _speeds(motion, at)
        each = np.repeat(widths, len(at), axis=0)
        found = np.zeros(speeds.shape)
        for speed, most in problem.model.layers:
            found -= most * _softened(speeds, speed, each)[2]
        return found


def turning(problem: Problem, motion: Trajectory, mesh: Array) -> Truths:
    """Whether an arm turns back, or is about to, in each interval of a mesh, (N,): it is so slow
    that Coulomb friction is changing there."""
    slow = _CHANGING * max((speed for speed, _ in problem.model.layers), default=0.0)
    shares, begin = _shares(motion), np.cumsum(mesh) - mesh
    at = begin[:, None] + mesh[:, None] * _SAMPLES
    inside = np.array([np.interp(at, shares, each) for each in _speeds(motion).T])
    is_slow = (inside.min(axis=2) < slow) & (inside.max(axis=2) > -slow)
    return np.asarray(is_slow.any(axis=0))


def _softened(speeds: Array, width: float, widths: Array) -> tuple[Array, Array, Array]:
    """Over how many rad/s friction that changes its sign over a ``width`` does so on a mesh of
    ``widths``, what share of it there is then at some ``speeds``, and how much more that is."""
    wide = np.maximum(width, widths)
    soft = np.tanh(speeds / wide)
    return wide, soft, soft - np.tanh(speeds / width)


def _least(problem: Problem) -> float:
    """The least width that is covered, rad/s."""
    return _LEAST * _own_width(problem)


def _own_width(problem: Problem) -> float:
    """Over how many rad/s the sharpest friction changes its sign."""
    return min(speed for speed, _ in problem.model.layers)


def _shares(motion: Trajectory) -> Array:
    """When ``_SAMPLES`` of all intervals are, as shares of the duration, (K · samples,)."""
    times = motion.knots[:-1, None] + np.diff(motion.knots)[:, None] * _SAMPLES
    return np.asarray((times.ravel() - motion.knots[0]) / motion.duration)


def _speeds(motion: Trajectory, fractions: Array = _SAMPLES) -> Array:
    """Speeds of the arms at fractions of all intervals, (K · fractions, motors), rad/s."""
    _, speeds, _ = motion.coordinates_inside(fractions)
    return np.asarray(speeds[:, motion.model.functions.motors])
