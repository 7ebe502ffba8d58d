"""Which limits a motion is at, when, and for how much of its time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from deltaopt.curves.piecewise import Array, Index
from deltaopt.motion.limit_curves import limit_curves
from deltaopt.motion.trajectory import Trajectory
from deltaopt.problem.problem import Problem

AT_LIMIT = 0.99
"""Share of a bound from which a quantity counts as being at it. A plan of the default tolerance
stays within 1 % of a torque limit that it is held at, because torques sag between the points of a
mesh; plans with resolved switches stay within rounding. A smaller share would count the ramps from
one limit to another."""
_STEPS = 32
"""Parts that each interval of a motion is looked at in: instants are then known to 3 % of it."""


@dataclass(frozen=True)
class Span:
    """A part of a motion's time, s, in which a quantity is at a bound.

    ``upper``: whether it is the upper one.
    """

    begin: float
    end: float
    upper: bool


@dataclass(frozen=True)
class ActiveLimit:
    """When a quantity is at one of its bounds.

    ``limit``: the limit's name. ``subject``: "motor 2". ``spans``: in the order of time. ``share``:
    of the motion's duration, 0 to 1. ``takes``: how long it takes by itself, s, of what sets the
    duration and not a quantity of the motion: a fourth axis's rotation.
    """

    limit: str
    subject: str
    spans: tuple[Span, ...]
    share: float
    takes: float | None = None

    @property
    def sentence(self) -> str:
        """Such as "motor 2's torque is at its limit 94 % of the time"."""
        if self.takes is not None:
            return f"the {self.limit} takes {self.takes:.4g} s by itself"
        several = self.subject[-1].isdigit()
        owner = self.subject if several else f"the {self.subject}"
        what = f"{owner}'s {self.limit}"
        if self.limit.startswith(self.subject):
            what = f"the {self.limit}"
        return f"{what} is at its limit {100 * self.share:.0f} % of the time"


def share_curves(
    problem: Problem, trajectory: Trajectory, fractions: Array
) -> dict[tuple[str, str], Array]:
    """The quantities of all limits that a motion must keep, as signed shares of their bounds, at
    fractions of every interval, (N,): by the limit's name and its subject, "motor 2".

    A share is 1 at the upper bound and -1 at the lower; between two bounds it is counted from their
    middle. Where a limit has several items for one subject, it is that of the item that is nearest
    to its bound at each instant.
    """
    found = dict[tuple[str, str], Array]()
    for curves in limit_curves(problem, trajectory, fractions):
        subjects = curves.limit.subjects(curves.values.shape[1])
        for subject, values in zip(subjects, curves.shares.T, strict=True):
            name = (curves.limit.name, subject)
            before = found.get(name, np.zeros(len(values)))
            found[name] = np.where(np.abs(values) > np.abs(before), values, before)
    return found


def active_limits(problem: Problem, trajectory: Trajectory) -> tuple[ActiveLimit, ...]:
    """The limits that a motion is at for some of its time, those of most time first, and before
    them a rotation that takes as long as the motion does."""
    cells = (np.arange(_STEPS) + 0.5) / _STEPS
    pieces, since = trajectory.position.everywhere(np.arange(_STEPS) / _STEPS)
    begins = trajectory.knots[pieces] + since
    ends = np.append(begins[1:], trajectory.knots[-1])
    found = []
    for (limit, subject), shares in share_curves(problem, trajectory, cells).items():
        at = np.where(np.abs(shares) >= AT_LIMIT, np.sign(shares), 0.0)
        spans = tuple(_spans(at, begins, ends))
        if spans:
            held = sum(span.end - span.begin for span in spans)
            found.append(ActiveLimit(limit, subject, spans, held / trajectory.duration))
    found.sort(key=lambda each: -each.share)
    return *_rotation(problem, trajectory), *found


def shares_of_time(active: Iterable[ActiveLimit], duration: float) -> dict[str, float]:
    """For what share of a motion's duration (s) any subject is at each limit, by the limit's
    name."""
    spans = dict[str, list[Span]]()
    for each in active:
        spans.setdefault(each.limit, []).extend(each.spans)
    return {limit: _covered(of_any) / duration for limit, of_any in spans.items()}


def _covered(spans: Iterable[Span]) -> float:
    """How much time is in one span at least, s."""
    covered, until = 0.0, -np.inf
    for span in sorted(spans, key=lambda span: span.begin):
        covered += max(0.0, span.end - max(span.begin, until))
        until = max(until, span.end)
    return covered


def _rotation(problem: Problem, trajectory: Trajectory) -> Iterator[ActiveLimit]:
    """That of a fourth axis, where it takes as long as the motion; nothing elsewhere."""
    if problem.is_least_duration(trajectory.duration):
        whole = Span(float(trajectory.knots[0]), float(trajectory.knots[-1]), upper=True)
        yield ActiveLimit("rotation", "fourth axis", (whole,), 1.0, problem.least_duration)


def _spans(at: Array, begins: Array, ends: Array) -> Iterator[Span]:
    """The runs of equal nonzero values of ``at``, (N,): 1 at an upper bound, -1 at a lower."""
    changes: Index = np.flatnonzero(np.diff(at)) + 1
    for first, last in zip([0, *changes.tolist()], [*changes.tolist(), len(at)], strict=True):
        if at[first]:
            yield Span(float(begins[first]), float(ends[last - 1]), bool(at[first] > 0))
