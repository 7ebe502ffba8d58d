"""How the duration of a plan, or the period of a cycle, depends on each number of its files.

By differences of ``PricedMotion.of_job``, ln of the least cost but for a constant and what is of
second order. What meshes have missed shows where they differ.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from math import isfinite, nan

import numpy as np

from deltaopt.errors import SceneError, if_possible
from deltaopt.files.tables import finite
from deltaopt.planning.cycles.cycle_plan import CyclePlan
from deltaopt.planning.plan import Plan
from deltaopt.sensitivity.keys import Content, Number, changed, content_of, job_of, numbers_in
from deltaopt.sensitivity.priced_cycle import PricedCycle, priced_cycles
from deltaopt.sensitivity.priced_motion import PricedMotion, priced_motions

Found = Plan | CyclePlan
Meshes = Sequence[PricedMotion] | Sequence[PricedCycle]

_STEP, _OF_ZERO = 1e-5, 1e-7
"""By which a number is changed to and fro: of itself, or of 0 in its SI unit."""
_KINK = 1e-2
"""Of the larger of two slopes: by what they differ that are not the same."""
_SURE, _ROUNDING = 3.0, 1e-6
"""The error that is told, over the range of what meshes tell; and what is added to it, a share of
the duration for a change by the whole number."""
_TOLD, _DOUBTFUL = 5e-5, 0.05
"""Share of the duration from which a change is told in words, and of a change from which its error
is."""


@dataclass(frozen=True)
class Sensitivity:
    """How a duration depends on one number.

    ``number``: its key, value and unit. ``duration``: s. ``slope``: of the duration, s per unit;
    ``error``: of the slope, an estimate. ``below``, ``above``: the slopes for less and for more of
    the number, not a number where there can be no such. They differ where something else begins to
    count there, and ``slope`` is then their mean; or the one that is known.

    Examples:
        >>> plan = deltaopt.plan(deltaopt.load_scene("problems/pick_and_place.yaml"))
        >>> (heavier,) = plan.sensitivity(["payload"])
        >>> heavier.slope > 0
        True
    """

    number: Number
    duration: float
    slope: float
    error: float
    below: float
    above: float

    @property
    def exponent(self) -> float:
        """d ln duration / d ln number: by what share the duration changes for one of the number."""
        return self.slope * self.number.value / self.duration

    @property
    def is_one_sided(self) -> bool:
        """Whether less and more of the number do not change the duration alike."""
        apart = abs(self.above - self.below)
        return not apart <= _KINK * max(abs(self.above), abs(self.below)) + self.error

    @property
    def told(self) -> float:
        """The most that a step up or down changes, a share of the duration."""
        return max(abs(share) for _, share in self._steps)

    @property
    def _steps(self) -> list[tuple[float, float]]:
        """Steps up and down, one where both change the same, and what they change, shares."""
        step = self.number.step
        both = [(step, self.above), (-step, self.below)][: 1 + self.is_one_sided]
        return [(by, by * slope / self.duration) for by, slope in both if isfinite(slope)]

    def __str__(self) -> str:
        """Such as "robot.drive.gear.ratio: 34 instead of 33: 0.4 % longer"."""
        number = self.number
        now, steps = f"{number.value:.6g} {number.unit}".rstrip(), self._steps
        told = [f"{number.value + by:.6g} instead of {now}: {_in_words(x)}" for by, x in steps]
        error = self.error * number.step / self.duration
        told += [f"known to {100 * error:.1g} %"] if error > _DOUBTFUL * self.told else []
        told += [] if isfinite(self.above + self.below) else ["the other way it cannot be"]
        return f"{number.key}: {'; '.join(told)}"

    def as_dict(self) -> dict[str, object]:
        """All of it for machines; None for what is not known."""
        names = ("slope", "error", "below", "above", "exponent")
        numbers = {name: finite(getattr(self, name)) for name in names}
        return {**vars(self.number), **numbers}


def _in_words(share: float) -> str:
    if abs(share) < _TOLD:
        return "as long"
    return f"{100 * abs(share):.2g} % {'longer' if share > 0 else 'shorter'}"


def sensitivity(found: Found, keys: Collection[str] | None = None) -> tuple[Sensitivity, ...]:
    """How the duration of a plan, or a cycle's period, depends on each number of its scene and its
    robot, or on those with some ``keys`` alone; those first of which a step changes it most.

    Numbers that are in no equation, such as a mass of 0, are left out. Raises SceneError where the
    dependence is not known, and for a key of no number that is given, and NotConverged.
    """
    content = content_of(found.scene if isinstance(found, Plan) else found.cycle)
    given = {each.key: each for each in numbers_in(content)}
    if isinstance(keys, str):
        keys = (keys,)
    unknown = set(keys or ()) - given.keys()
    if unknown:
        expected = "the key of one, such as robot.upper_arm.length or start[0]"
        raise SceneError(None, min(unknown), None, expected, "is no number that is given")
    meshes: Meshes = priced_motions(found) if isinstance(found, Plan) else priced_cycles(found)
    duration = found.trajectory.duration
    numbers = (each for key, each in given.items() if keys is None or key in keys)
    each = (_of_number(content, number, meshes, duration) for number in numbers)
    return tuple(sorted((one for one in each if one), key=lambda one: -one.told))


def _of_number(
    content: Content, number: Number, meshes: Meshes, duration: float
) -> Sensitivity | None:
    """The sensitivity to one number; None where it is in no equation."""
    step = _STEP * abs(number.value) or _OF_ZERO
    values = [number.value + by for by in (-step, 0.0, step)]
    jobs = [if_possible((SceneError,), job_of, changed(content, {number.key: x})) for x in values]
    each = [[nan if job is None else mesh.of_job(job) for job in jobs] for mesh in meshes]
    sides = duration / step * np.diff(each)
    known = np.isfinite(sides).all(axis=0)
    if not known.any():
        return None
    below, above = sides.mean(axis=0).tolist()
    slopes, size = sides[:, known], abs(number.value) or 1.0
    sure = (_ROUNDING + max(mesh.accuracy for mesh in meshes)) * duration / size
    error = _SURE * float(np.ptp(slopes, axis=0).max()) + sure
    return Sensitivity(number, duration, float(slopes.mean()), error, below, above)


def for_machines(each: Sequence[Sensitivity]) -> dict[str, object]:
    """What is printed of sensitivities, for machines; empty without any."""
    return {"sensitivity": [one.as_dict() for one in each]} if each else {}


def told_of_sensitivity(each: Sequence[Sensitivity]) -> Iterator[str]:
    """Lines on all that matter; none without any."""
    if not each:
        return
    yield "what a little more of a number would change:"
    yield from (f"  {one}" for one in each if one.told >= _TOLD)
    rest = sum(one.told < _TOLD for one in each)
    yield f"  {rest} other numbers: less than {100 * _TOLD:g} % each"
