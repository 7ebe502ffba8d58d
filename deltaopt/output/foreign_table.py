"""Motions that someone else made: tables of motor angles or of positions, at any rate.

A table is taken as a controller would: pieces between rows that meet the angles (or positions), and
the speeds and accelerations too where the table has them. What it does not have is taken from the
smoothest cubic through its rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain, takewhile
from pathlib import Path

import numpy as np

from deltaopt.curves.piecewise import Array, spline_rates
from deltaopt.errors import Unusable, in_words
from deltaopt.files.csv_table import CsvTable, WrongCsv, read_csv
from deltaopt.files.units import ANGLE, LENGTH
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.joint_table import pieces_between, platform_motion
from deltaopt.robot.joints import Joints
from deltaopt.robot.model import DeltaModel

ANGLES = ("theta1", "theta2", "theta3")
POSITION = ("x", "y", "z")
_RATES = {ANGLES: ("d", "dd"), POSITION: ("v", "a")}
_IN_DEGREES = "_deg"
"""Ending of the names of columns of angles and their rates in degrees."""
_SHORTEST = 1e-12
"""Least time between rows of different times, s: a thousandth of ROS 2's nanosecond. Accelerations
are divided by its square."""
_SAME = 1e-5
"""Share of the way, and of the largest speed, by which rows of one time may differ: digits that a
table was rounded to, and a tenth of what good robots repeat to."""
_LEAST_SHARE = 0.7
"""Least that the way may be by speeds of what it is by positions: rows may be few, and rounded."""
_STOPS = 1e-6
"""Share of the way below which speeds are none: the robot stops at every row."""
_JUDGED, _LITTLE = 2000, 1e-2
"""Rows whose speeds are judged by their values, and share of the largest mean square of a way below
which a way may be noise."""
_EQUAL = 0.9
"""Share of equal steps from which others stand out."""
_RESTS = 1e-2
"""Share of the mean speed below which a table rests at an end: noise of what was measured."""
_SPLIT = 4
"""Parts of a piece of motor angles, each of which a quintic piece of the position follows: with so
many they differ by less than 1e-9 of what a millisecond's piece moves."""


class UnreadableTable(Unusable):
    """A CSV file is no table of a motion."""


@dataclass(frozen=True, eq=False)
class ForeignTable:
    """Rows of a motion: times t, (N,), s, and three columns with rates as far as they are known.

    ``quantity``: ``ANGLES``, rad, or ``POSITION``, m. ``rates``, ``accelerations``: None where the
    table has none. ``unused``: names of columns that nothing here follows from. ``unit``: of angles
    if the names of their columns end in it. ``lines``: of the file, in which the rows stand.
    """

    quantity: tuple[str, str, str]
    t: Array
    values: Array
    rates: Array | None
    accelerations: Array | None
    unused: tuple[str, ...] = ()
    unit: str | None = None
    lines: Sequence[int] = ()

    def implausible(self) -> str | None:
        """In words the first row of a table in the model's unit that is of no robot; None if all
        may be."""
        most = (ANGLE if self.quantity == ANGLES else LENGTH).most
        beyond = np.abs(self.values).max(axis=1) > most
        if not beyond.any():
            return None
        row = int(beyond.argmax())
        what = "motor angles in rad" if self.quantity == ANGLES else "positions in m"
        return f"line {self.lines[row]}: {in_words(self.values[row])} are no {what}"

    def contradiction(self) -> str | None:
        """In words the first column whose speeds are not those of its values, None if all are."""
        if self.rates is None:
            return None
        some = slice(_JUDGED)  # for what rounding adds up to in hours
        away, steps = (self.values - self.values[0])[some], np.diff(self.t[some])[:, None]
        ways = np.cumsum(steps * (self.rates[some][1:] + self.rates[some][:-1]) / 2, axis=0)
        sizes = (away**2).sum(axis=0)
        for name, way, far, size in zip(self.quantity, ways.T, away.T[:, 1:], sizes, strict=True):
            share = float(way @ far) / size if size > _LITTLE * sizes.max() else 1.0
            if abs(share) > _STOPS and not _LEAST_SHARE <= share <= 1 / _LEAST_SHARE:
                given = f"speeds of {name} over times give {share:.3g} of the way that it goes"
                return f"{given}; are columns in their order, and times in s?"
        return None

    def missing_rows(self) -> str | None:
        """In words the first place where rows seem to be missing of a table of equal steps."""
        steps = np.diff(self.t)
        usual = float(np.median(steps))
        times = np.round(steps / max(usual, _SHORTEST))
        if np.mean(np.abs(steps - usual) < _SAME * usual) < _EQUAL or not (times > 1).any():
            return None
        row = int((times > 1).argmax())
        lines = f"from line {self.lines[row]} to line {self.lines[row + 1]}"
        return f"{lines} it is {steps[row]:.6g} s, elsewhere {usual:.6g} s; are rows missing?"

    def cut_off(self) -> str | None:
        """In words at which ends a table with speeds is in motion; None where it rests at both."""
        if self.rates is None:  # the spline rests
            return None
        unit = "rad/s" if self.quantity == ANGLES else "m/s"
        mean = np.abs(self.values - self.values[0]).max() / (self.t[-1] - self.t[0])
        ends = zip(("begins", "ends"), np.abs(self.rates[[0, -1]]).max(axis=1), strict=True)
        told = [f"{end} at {speed:.3g} {unit}" for end, speed in ends if speed > _RESTS * mean]
        return f"it {' and '.join(told)}; is it cut off, or meets it a belt?" if told else None

    @property
    def interpolation(self) -> str:
        """How it is interpolated, in words."""
        if self.rates is None:
            return "the smooth cubic spline through its rows"
        return "cubic" if self.accelerations is None else "quintic"

    def in_model(self, per_radian: float, joints: Joints) -> ForeignTable:
        """A table of angles whose unit is 1/per_radian rad, as a controller of such joints counts
        them, in the model's. One of positions as it is."""
        if self.quantity != ANGLES:
            return self
        rates, accelerations = (
            None if each is None else joints.rate_from_controller(each / per_radian)
            for each in (self.rates, self.accelerations)
        )
        values = joints.angle_from_controller(self.values / per_radian)
        return replace(self, values=values, rates=rates, accelerations=accelerations)

    def trajectory(self, model: DeltaModel) -> Trajectory:
        """The motion of a robot's tool's point that follows the table.

        Raises Unreachable or Singular where the robot cannot follow.
        """
        rates = self.rates
        if rates is None:  # at rest at both ends, as motions are
            rates = spline_rates(np.diff(self.t), self.values)
        known = (rates,) if self.accelerations is None else (rates, self.accelerations)
        pieces = pieces_between(self.t, self.values, *known)
        if self.quantity == POSITION:
            return Trajectory(pieces, model)
        u = np.linspace(0.0, 1.0, _SPLIT + 1)
        lengths = np.diff(pieces.knots)
        interval = np.repeat(np.arange(len(lengths)), 2 * _SPLIT)
        since = (lengths[:, None] * np.repeat(u, 2)[1:-1]).ravel()
        motion = platform_motion(model, *pieces.with_derivatives(interval, since))
        return Trajectory(pieces_between(pieces.knots[interval] + since, *motion), model)


def read_foreign_table(file: Path) -> ForeignTable:
    """Read a CSV file with a header: t, and theta1 to theta3 or x, y, z, and as far as it has them
    their rates (dtheta1 … or vx …) and accelerations (ddtheta1 … or ax …). Names of columns in
    degrees may end in _deg.

    A table with both angles and positions is taken by its angles. Raises UnreadableTable.
    """
    try:
        return _foreign_table(read_csv(file))
    except WrongCsv as error:
        raise UnreadableTable(f"{file}: {error}") from None


def _foreign_table(table: CsvTable) -> ForeignTable:
    """Raises WrongCsv."""
    if "theta1" not in table.names and "theta1" + _IN_DEGREES in table.names:
        return replace(_foreign_table(_without_unit(table)), unit="deg")
    header = set(table.names)
    quantity = next((q for q in (ANGLES, POSITION) if set(q) <= header), None)
    if quantity is None or "t" not in header:
        needed = "t with theta1, theta2, theta3 (rad) or x, y, z (m)"
        if not table.names:
            raise WrongCsv(f"names no columns in its first line; it needs {needed}")
        raise WrongCsv(f"its header has no {needed}, but {', '.join(table.names[:8])}")
    if len(table.rows) < 4:
        raise WrongCsv(f"has {len(table.rows)} rows; a motion has four at least")
    parts = [[prefix + name for name in quantity] for prefix in ("", *_RATES[quantity])]
    parts = list(takewhile(lambda part: not header.isdisjoint(part), parts))
    values, rates, accelerations = [*map(table.columns, parts), None, None][:3]
    assert values is not None
    t = table.columns(["t"])[:, 0]
    _require_times(t, table.lines, jumps=rates is not None)
    unused = tuple(name for name in table.names if name and name not in ("t", *chain(*parts)))
    found = ForeignTable(quantity, t, values, rates, accelerations, unused, lines=table.lines)
    _require_one_place(found, table.lines)
    return found


def _without_unit(table: CsvTable) -> CsvTable:
    """A table in degrees with the names that one in radians has. Raises WrongCsv where it has
    columns in both."""
    both = [prefix + name for prefix in ("", *_RATES[ANGLES]) for name in ANGLES]
    for name in both:
        if name in table.names:
            raise WrongCsv(f"has a column {name} beside theta1_deg; all are to end in _deg")
    return replace(table, names=[name.removesuffix(_IN_DEGREES) for name in table.names])


def _require_times(t: Array, lines: Sequence[int], *, jumps: bool) -> None:
    """Raise WrongCsv unless times increase. ``jumps``: whether two may be the same."""
    steps = np.diff(t)
    if t[-1] == t[0]:
        raise WrongCsv("time does not increase at all")
    for wrong, problem in (
        (steps < 0 if jumps else steps <= 0, "time does not increase"),
        ((steps > 0) & (steps < _SHORTEST), f"it is less than {_SHORTEST:g} s"),
    ):
        if wrong.any():
            row = int(wrong.argmax())
            raise WrongCsv(f"{problem} from line {lines[row]} to line {lines[row + 1]}")


def _require_one_place(table: ForeignTable, lines: Sequence[int]) -> None:
    """Raise WrongCsv where rows of one time differ in more than accelerations, all such jumps of a
    table taken together: no robot is at two places, or has two speeds, at once."""
    jumps = np.flatnonzero(np.diff(table.t) == 0)
    if table.rates is None or not len(jumps):
        return
    away = table.values - table.values[0]
    for what, rows in (("position", away), ("speed", table.rates)):
        off = np.abs(rows[jumps + 1] - rows[jumps]).max(axis=1)
        if off.sum() > _SAME * np.abs(rows).max():
            row = jumps[off.argmax()]
            which = f"lines {lines[row]} and {lines[row + 1]} have the same time"
            raise WrongCsv(f"{which}, but {what}s that differ by {off.max():g}")
