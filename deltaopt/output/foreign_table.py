"""Motions that someone else made: tables of motor angles or of positions, at any rate.

A table is taken as a controller would: pieces between rows that meet the angles (or positions), and
the speeds and accelerations too where the table has them. What it does not have is taken from the
smoothest cubic through its rows.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from deltaopt.errors import DeltaOptError, on_one_line
from deltaopt.files.validated_record import LARGEST
from deltaopt.motion.trajectory import Array, PiecewisePolynomial, Trajectory
from deltaopt.output.joint_table import Cubic, JointTable, Quintic, platform_motion
from deltaopt.robot.joints import Joints
from deltaopt.robot.model import DeltaModel

ANGLES = ("theta1", "theta2", "theta3")
POSITION = ("x", "y", "z")
_RATES = {ANGLES: ("d", "dd"), POSITION: ("v", "a")}
_LARGEST = 500_000_000
"""Bytes of a table: a million rows of every quantity are fewer."""
_SHORTEST = 1e-12
"""Least time between rows of different times, s: a thousandth of ROS 2's nanosecond. Accelerations
are divided by its square."""
_SPLIT = 4
"""Parts of a piece of motor angles, each of which a quintic piece of the position follows: with so
many they differ by less than 1e-9 of what a millisecond's piece moves."""


class UnreadableTable(DeltaOptError):
    """A CSV file is no table of a motion."""


@dataclass(frozen=True, eq=False)
class ForeignTable:
    """Rows of a motion: times t, (N,), s, and three columns with rates as far as they are known.

    ``quantity``: ``ANGLES``, rad, or ``POSITION``, m. ``rates``, ``accelerations``: None where the
    table has none.
    """

    quantity: tuple[str, str, str]
    t: Array
    values: Array
    rates: Array | None
    accelerations: Array | None

    @property
    def interpolation(self) -> str:
        """How it is interpolated, in words."""
        if self.rates is None:
            return "the smooth cubic spline through its rows"
        return "cubic" if self.accelerations is None else "quintic"

    def without_accelerations(self) -> ForeignTable:
        """The same for a controller that does not use accelerations."""
        return replace(self, accelerations=None)

    def in_radians(self, per_radian: float) -> ForeignTable:
        """A table of angles whose unit is 1/per_radian rad."""
        if self.quantity != ANGLES:
            return self
        return replace(
            self,
            values=self.values / per_radian,
            rates=None if self.rates is None else self.rates / per_radian,
            accelerations=None if self.accelerations is None else self.accelerations / per_radian,
        )

    def from_controller(self, joints: Joints) -> ForeignTable:
        """A table of a controller's angles in the model's."""
        if self.quantity != ANGLES:
            return self
        turned = joints.rate_from_controller
        return replace(
            self,
            values=joints.angle_from_controller(self.values),
            rates=None if self.rates is None else turned(self.rates),
            accelerations=None if self.accelerations is None else turned(self.accelerations),
        )

    def trajectory(self, model: DeltaModel) -> Trajectory:
        """The motion of a robot's tool's point that follows the table.

        Raises Unreachable or Singular where the robot cannot follow.
        """
        pieces = self._pieces()
        if self.quantity == POSITION:
            return Trajectory(pieces, model)
        u = np.linspace(0.0, 1.0, _SPLIT + 1)
        lengths = np.diff(pieces.knots)
        interval = np.repeat(np.arange(len(lengths)), 2 * _SPLIT)
        since = (lengths[:, None] * np.repeat(u, 2)[1:-1]).ravel()
        speed = pieces.derivative()
        angles = (each.inside(interval, since) for each in (pieces, speed, speed.derivative()))
        motion = platform_motion(model, *angles)
        return Trajectory(Quintic()(JointTable(pieces.knots[interval] + since, *motion)), model)

    def _pieces(self) -> PiecewisePolynomial:
        rates = self.rates
        if rates is None:
            rates = _spline_rates(self.t, self.values)
        table = JointTable(self.t, self.values, rates, np.zeros_like(rates))
        if self.accelerations is None:
            return Cubic()(table)
        return Quintic()(JointTable(self.t, self.values, rates, self.accelerations))


def read_foreign_table(file: Path) -> ForeignTable:
    """Read a CSV file with a header: t, and theta1 to theta3 or x, y, z, and as far as it has them
    their rates (dtheta1 … or vx …) and accelerations (ddtheta1 … or ax …).

    A table with both angles and positions is taken by its angles. Raises UnreadableTable.
    """
    columns = _columns(file)
    quantity = next((q for q in (ANGLES, POSITION) if set(q) <= set(columns)), None)
    if quantity is None or "t" not in columns:
        raise UnreadableTable(
            f"{file}: its header has no t with theta1, theta2, theta3 (rad) or x, y, z (m), but "
            f"{', '.join(map(on_one_line, list(columns)[:8])) or 'nothing'}"
        )
    t, values = columns["t"], _three(columns, quantity)
    if values is None or len(t) < 4:
        raise UnreadableTable(f"{file}: has {len(t)} rows; a motion has four at least")
    rates, accelerations = (_three(columns, _names(quantity, p)) for p in _RATES[quantity])
    if rates is None:
        accelerations = None
    _require_times(file, t, jumps=rates is not None)
    return ForeignTable(quantity, t, values, rates, accelerations)


def _require_times(file: Path, t: Array, *, jumps: bool) -> None:
    """Raise UnreadableTable unless times increase. ``jumps``: whether two may be the same."""
    steps = np.diff(t)
    row = int(steps.argmin()) + 2
    if steps.min() < 0 or (not jumps and steps.min() == 0):
        raise UnreadableTable(f"{file}: time does not increase from row {row} to row {row + 1}")
    if t[-1] == t[0]:
        raise UnreadableTable(f"{file}: time does not increase at all")
    near = np.flatnonzero((steps > 0) & (steps < _SHORTEST))
    if len(near):
        row = int(near[0]) + 2
        raise UnreadableTable(
            f"{file}: rows {row} and {row + 1} are less than {_SHORTEST:g} s apart"
        )


def _columns(file: Path) -> dict[str, Array]:
    """Every column by its name; raises UnreadableTable."""
    try:
        if not file.is_file():
            raise UnreadableTable(f"{file}: there is no such file")
        if file.stat().st_size > _LARGEST:
            raise UnreadableTable(f"{file}: larger than {_LARGEST} bytes")
        with file.open(encoding="utf-8", newline="") as lines:
            header, *rows = [row for row in csv.reader(lines) if row] or [[]]
    except (OSError, UnicodeDecodeError, csv.Error, ValueError) as error:
        raise UnreadableTable(f"{file}: cannot be read as CSV: {error}") from None
    for number, row in enumerate(rows, 2):
        if len(row) != len(header):
            raise UnreadableTable(
                f"{file}: row {number} has {len(row)} columns, the header {len(header)}"
            )
    names = [name.strip() for name in header]
    found = {}
    for k, name in enumerate(names):
        try:
            found[name] = np.array([float(row[k]) for row in rows])
        except ValueError:
            continue  # a column of text is nobody's motion
        if name in _KNOWN and not np.isfinite(found[name]).all():
            raise UnreadableTable(f"{file}: column {name} has values that are no finite numbers")
        if name in _KNOWN and (np.abs(found[name]) > LARGEST).any():
            raise UnreadableTable(f"{file}: column {name} has numbers beyond {LARGEST:g}")
    return found


def _names(quantity: tuple[str, str, str], prefix: str) -> tuple[str, str, str]:
    first, second, third = quantity
    return prefix + first, prefix + second, prefix + third


_KNOWN = {
    "t",
    *(name for quantity in _RATES for p in ("", *_RATES[quantity]) for name in _names(quantity, p)),
}


def _three(columns: dict[str, Array], names: tuple[str, str, str]) -> Array | None:
    if not set(names) <= set(columns):
        return None
    return np.stack([columns[name] for name in names], axis=1)


def _spline_rates(t: Array, values: Array) -> Array:
    """Rates at the rows of the C² cubic spline that is at rest at both ends, as motions are.

    Its second derivative is continuous: r_{i-1}/h_{i-1} + 2 (1/h_{i-1} + 1/h_i) r_i + r_{i+1}/h_i =
    3 ((y_i - y_{i-1})/h_{i-1}² + (y_{i+1} - y_i)/h_i²), solved by Thomas's elimination.
    """
    h, slope = np.diff(t)[:, None], np.diff(values, axis=0)
    number = len(t)
    rates = np.zeros_like(values)
    right = 3 * (slope[:-1] / h[:-1] ** 2 + slope[1:] / h[1:] ** 2)
    diagonal = 2 * (1 / h[:-1] + 1 / h[1:])
    above = 1 / h[1:]
    for i in range(1, number - 2):
        factor = above[i - 1] / diagonal[i - 1]
        diagonal[i] -= factor * above[i - 1]
        right[i] -= factor * right[i - 1]
    for i in reversed(range(number - 2)):
        rates[i + 1] = (right[i] - above[i] * rates[i + 2]) / diagonal[i]
    return rates
