"""What a motion asks of its robot: measures of all limits, distances to singularities, effort.

Everything is measured by the scene's model in twelve coordinates (never by the model that a
trajectory carries), on curves resolved between samples. Of a limit only its measure and its bounds
are used, so that a new kind of limit is verified as it is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from math import inf

import casadi as ca
import numpy as np

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.curves.piecewise import Array, Index
from deltaopt.errors import Unreachable
from deltaopt.limits.constraints import Constraints
from deltaopt.limits.limit import Bounds, Limit, OwnMeasure, first_highest
from deltaopt.mechanisms.functions import Functions
from deltaopt.mechanisms.instant import CoordinateInstant
from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.machine import Machine
from deltaopt.robot.model import model_of
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.scene import Scene
from deltaopt.verify.bounds import EXCESS, Check
from deltaopt.verify.duty import Duty, duty
from deltaopt.verify.resolved_curves import DEGREE, Cells, ResolvedCurves, ResolvedPeaks

RESOLVED = 1e-10
"""Relative accuracy of measures between samples, as a share of the limit, or of the measure if that
is larger: a tenth of the excess that a motion may have, ten thousand times its rounding."""
_ROUNDING = 1e-14
"""Relative rounding of measures is taken to be this over the distance from the nearest singularity,
which is 1 at best: 30 times what is seen from 1e-2 to 1e-10 m beside a serial one. Measures are
never asked to be more accurate than that."""
_SAFE = 1e-12
"""Share by which a motion may exceed limits without being slowed: rounding."""
_EXCHANGES = 30
"""How many rounds the search for a safe duration takes at most; three as a rule."""
_SLOWEST = 1e-6
"""Least share of the motion's speed that is tried."""

Items = tuple[tuple[Limit, int], ...]


@dataclass(frozen=True)
class Excess:
    """Where a motion is furthest beyond a limit, or nearest to it.

    ``limit`` and ``unit`` are the limit's. ``subject``: what it is a limit of, "motor 2". ``t``: s,
    from the motion's first knot. ``value``: by how much the limit is exceeded, as a share of its
    natural size; negative within it. ``amount``: the same in its unit. ``falls_below``: whether the
    limit is a least value, unless it is one of two bounds such as ± 10.
    """

    limit: str
    unit: str
    subject: str
    t: float = inf
    value: float = inf
    amount: float = inf
    falls_below: bool = False

    @property
    def key(self) -> str:
        """Its name among measures: "torque_excess"."""
        return key(self.limit)

    @property
    def check(self) -> Check:
        """Its value beside the most that it may be."""
        told = f"{self.limit} of {self.subject} exceeds its limit by {self.value:.4%}"
        if self.falls_below:
            amount = f"{self.amount:.3g} {self.unit}"
            told = f"{self.limit} of {self.subject} is {amount} below its limit"
        return Check(self.key, self.value, EXCESS, "1", f"{told} at t = {self.t:.6g} s")


@dataclass(frozen=True)
class Distance:
    """The least distance of a motion to a kind of singularity.

    ``name`` and ``formula`` as in ``SingularityDistance``. ``least``: without unit, zero in the
    singularity, 1 at best. ``subject``: "chain 2" or "robot". ``t``: s.
    """

    name: str
    formula: str
    least: float
    subject: str
    t: float
    unit: str = "1"


def key(limit: str) -> str:
    """The name of a limit's excess among measures."""
    return f"{limit.replace(' ', '_')}_excess"


class MeasuredMotion:
    """A motion with everything that a scene's limits ask of it, between samples too.

    ``sides``: for each column of excesses what it is of, as an `Excess` without values, and the
    natural size of the limit in its unit.
    """

    def __init__(self, scene: Scene, trajectory: Trajectory) -> None:
        """By the scene's model and those of its limits that verification has no own measure for."""
        self.scene, self.trajectory = scene, trajectory
        self.model, limits = model_of(scene.robot, scene.payload), limits_of(scene)
        promised = [
            (item, own)
            for item, own in zip(limits.constraints.items, limits.of_items, strict=True)
            if item[0].promised and item[0].own_measure is None
        ]
        items, numbers = tuple(item for item, _ in promised), [own for _, own in promised]
        self._function, rows = _function(self.model.functions, items)
        self._parameters = np.concatenate([*numbers, self.model.parameters])
        self._orders = range(limits.constraints.order + 1)
        self.sides = tuple(_sides(items, numbers, rows, scene.robot))

    def curves(self, pieces: Index, fractions: Array, speed: float | Array = 1.0) -> Array:
        """Everything that is measured, at (piece (N,), fraction of it (N,)) of the motion run at
        ``speed`` times its own: (N, columns).

        Columns: the excess over each side of each limit; the negative distances to singularities;
        the motors' speeds (rad/s); τᵀτ (N²m²). Raises Unreachable or Singular where there are none.
        """
        motion = self._motion(pieces, fractions, speed)
        values: Array = self._function(*motion, parameters=self._parameters)[0]
        bad = ~np.isfinite(values).all(axis=1)
        if bad.any():
            x, v, a = (each[bad] for each in motion[:3])
            self.model.motion(x, v, a)  # which say what is the matter, as a rule
            self.model.inverse_dynamics(x, v, a)
            raise Unreachable("the motion passes a singular position")
        return values

    def _motors(self, pieces: Index, fractions: Array) -> Array:
        """Speeds (rad/s), accelerations (rad/s²) and torques (N·m) of the motors, (N, 9)."""
        motion = self._motion(pieces, fractions, 1.0)
        return self._function(*motion, parameters=self._parameters)[1]

    def _motion(self, pieces: Index, fractions: Array, speed: float | Array) -> list[Array]:
        """Position and derivatives by time of the motion at a speed, (N, 3) each."""
        path = self.trajectory.position
        since = np.asarray(np.diff(path.knots)[pieces] * fractions)
        return [speed**order * path.inside(pieces, since, order) for order in self._orders]

    @cached_property
    def resolved(self) -> ResolvedCurves:
        """All columns, cut where motors turn back, resolved."""
        cells = self._sampled.cells
        for curve in range(self._rates.start, self._rates.stop):
            cells = cells.cut(*self._sampled.roots(curve, 1e-9 * float(self._sizes[curve])))
        return ResolvedCurves.of(self.curves, cells, self._tolerance)

    @cached_property
    def _sampled(self) -> ResolvedCurves:
        """All columns, with twice the samples in each piece that determine its polynomial."""
        degree = self.trajectory.position.coefficients.shape[1] - 1
        cells = Cells.even(len(self.trajectory.knots) - 1, max(1, -(-2 * degree // DEGREE)))
        return ResolvedCurves.sampled(self.curves, cells)

    @cached_property
    def _sizes(self) -> Array:
        """Natural size of each column: 1 of shares of limits and of distances, the largest speed of
        a motor, the mean of τᵀτ."""
        sizes, samples = np.ones(self._rates.stop + 1), np.abs(self._sampled.values)
        sizes[self._rates] = samples[..., self._rates].max()
        sizes[-1] = samples[..., -1].mean()
        return sizes

    def excesses(self) -> dict[str, Excess]:
        """The largest of each limit, by its name among measures."""
        peaks, found, sides = self._peaks, dict[str, Excess](), dict[str, list[int]]()
        for i, (side, _) in enumerate(self.sides):
            sides.setdefault(side.key, []).append(i)
        for name, own in sides.items():
            i = own[first_highest(peaks.values[own])]
            (side, scale), value = self.sides[i], float(peaks.values[i])
            found[name] = replace(side, t=self._time(peaks, i), value=value, amount=value * scale)
        return found

    def distances(self) -> tuple[Distance, ...]:
        """The least to each kind of singularity."""
        peaks, place, found = self._peaks, len(self.sides), []
        for kind in self.model.functions.distances:
            number = 3 if kind.per_chain else 1
            nearest = place + first_highest(peaks.values[place : place + number])
            subject = f"chain {nearest - place + 1}" if kind.per_chain else "robot"
            least, t = -float(peaks.values[nearest]), self._time(peaks, nearest)
            found.append(Distance(kind.name, kind.formula, least, subject, t))
            place += number
        return tuple(found)

    def effort(self) -> float:
        """∫ τᵀτ dt, N²m²s."""
        cells = self.resolved.cells
        lengths = np.diff(self.trajectory.knots)[cells.piece] * (cells.end - cells.begin)
        return float(lengths @ self.resolved.means()[:, -1])

    def duty(self) -> Duty:
        """The duty of the motors."""
        lengths = np.diff(self.trajectory.knots)
        return duty(self._motors, self.resolved.cells, lengths, self.scene.robot)

    def safe_duration(self) -> float:
        """The shortest duration, no less than the motion's own, to which it can be slowed
        uniformly so that it keeps every limit; infinite where none is found.

        The instants at which the motion exceeds its limits most are collected, the largest speed
        is found at which all limits hold there, the motion is measured again at that speed, and so
        on until it exceeds none.
        """
        number, speed = len(self.sides), 1.0
        pieces, fractions = np.zeros(0, np.intp), np.zeros(0)
        curves = self.resolved
        for _ in range(_EXCHANGES):
            peaks = curves.highest(number)
            beyond = peaks.values > _SAFE
            if not beyond.any():
                return self.trajectory.duration / speed
            pieces = np.concatenate([pieces, peaks.pieces[beyond]])
            fractions = np.concatenate([fractions, peaks.fractions[beyond]])
            slower = self._speed_that_holds(pieces, fractions, speed)
            if slower is None:
                return inf
            speed = slower
            slowed = partial(self.curves, speed=speed)
            curves = ResolvedCurves.of(slowed, self.resolved.cells, self._tolerance)
        return inf

    def _speed_that_holds(self, pieces: Index, fractions: Array, speed: float) -> float | None:
        """The largest speed, no more than this one, at which no limit is exceeded at these
        instants; found by comparing ever closer ones. None if there is none."""

        def holds(speeds: Array) -> Array:
            n, rates = len(speeds), np.repeat(speeds, len(pieces))[:, None]
            values = self.curves(np.tile(pieces, n), np.tile(fractions, n), rates)
            excess = values.reshape(n, len(pieces), -1)[..., : len(self.sides)]
            return np.asarray(excess.max(axis=(1, 2)) <= 0)

        speeds = np.append(speed * np.geomspace(1.0, _SLOWEST, 120), 0.0)
        while True:
            holding = np.flatnonzero(holds(speeds))
            if not len(holding):
                return None
            first = int(holding[0])
            if first == 0 or speeds[first] >= speeds[first - 1] * (1 - 1e-15):
                return float(speeds[first]) or None
            speeds = np.linspace(speeds[first - 1], speeds[first], 40)

    @property
    def _rates(self) -> slice:
        """Columns of the motors' speeds."""
        return slice(self._nearness, self._nearness + 3)

    @property
    def _nearness(self) -> int:
        """Columns before the motors' speeds: excesses and distances."""
        kinds = self.model.functions.distances
        return len(self.sides) + sum(3 if kind.per_chain else 1 for kind in kinds)

    @cached_property
    def _peaks(self) -> ResolvedPeaks:
        """Of the excesses and distances."""
        return self.resolved.highest(self._nearness)

    def _time(self, peaks: ResolvedPeaks, i: int) -> float:
        knots = self.trajectory.knots
        begin, end = knots[peaks.pieces[i]], knots[peaks.pieces[i] + 1]
        return float(begin + peaks.fractions[i] * (end - begin))

    def _tolerance(self, values: Array) -> Array:
        """To which columns are to be known in cells, (M, columns), from samples (M, n, columns)."""
        sizes = np.maximum(np.abs(values).max(axis=1), self._sizes)
        nearest = np.abs(values[:, :, len(self.sides) : self._nearness]).min(axis=(1, 2))
        with np.errstate(divide="ignore"):
            share = np.maximum(RESOLVED, _ROUNDING / nearest)
        return np.asarray(sizes * share[:, None])


def not_measured(scene: Scene) -> dict[str, Excess]:
    """The excesses of a motion that cannot be measured: infinite, by name."""
    limits = [limit for limit in limits_of(scene).constraints.limits if limit.promised]
    excesses = (Excess(each.name, scene.robot.unit(each.unit), each.subject) for each in limits)
    return {each.key: each for each in excesses}


def excess_of(scene: Scene, measure: OwnMeasure) -> Excess | None:
    """The excess, not measured yet, of the limit that has this measure of its own. None where the
    scene has no such limit."""
    limits = limits_of(scene).constraints.limits
    own = (each for each in limits if each.own_measure is measure)
    return next((Excess(e.name, e.unit, e.subject) for e in own), None)


@lru_cache(maxsize=32)
def _function(functions: Functions, items: Items) -> tuple[RowFunction, tuple[int, ...]]:
    """(x, v, a[, j], numbers of the limits and p) -> the columns of ``MeasuredMotion.curves``; θ̇,
    θ̈ and τ. And how many quantities each item measures."""
    order, p = Constraints(items).order, functions.symbols()
    symbols = [ca.SX.sym(name, 3) for name in "xvaj"[: order + 1]]
    x, v, a, *rest = symbols
    motion = CoordinateInstant.general(functions, x, v, a, p, rest[0] if rest else None)
    numbers = [ca.SX.sym(f"numbers{i}", size) for i, (_, size) in enumerate(items)]
    columns, rows = list[ca.SX](), list[int]()
    for (limit, _), own in zip(items, numbers, strict=True):
        measure = limit.measure(motion, own)
        columns += limit.bounds(own).beyond(measure)
        rows.append(measure.numel())
    columns += [-kind.of(motion.q) for kind in functions.distances]
    columns += [motion.dtheta, ca.sumsqr(motion.tau)]
    inputs = [*symbols, ca.vertcat(*numbers, p)]
    motors = ca.vertcat(motion.dtheta, motion.ddtheta, motion.tau)
    return RowFunction.of("measures", inputs, [ca.vertcat(*columns), motors]), tuple(rows)


def _sides(
    items: Items, numbers: Sequence[Array], rows_of: Sequence[int], robot: Machine
) -> Iterator[tuple[Excess, float]]:
    """What each excess is of, and the natural size of that, in the order of columns."""
    for (limit, _), own, rows in zip(items, numbers, rows_of, strict=True):
        bounds = limit.bounds(ca.SX(ca.DM(own)))
        scales = np.broadcast_to(np.array(ca.DM(bounds.scale)).ravel(), rows)
        mirrored = _mirrored(bounds)
        for bound, falls_below in ((bounds.upper, False), (bounds.lower, not mirrored)):
            if bound is not None:
                for subject, scale in zip(limit.subjects(rows), scales.tolist(), strict=True):
                    unit = robot.unit(limit.unit)
                    yield Excess(limit.name, unit, subject, falls_below=falls_below), scale


def _mirrored(bounds: Bounds) -> bool:
    """Whether the lower bound, if there is one, is the mirror image of the upper one."""
    if bounds.lower is None or bounds.upper is None:
        return False
    lower, upper = (np.array(ca.DM(each)) for each in (bounds.lower, bounds.upper))
    return bool((lower == -upper).all())
