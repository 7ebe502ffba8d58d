"""The most that each measure of a motion may be, and what to say of one that is more."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

EXCESS = 1e-9
"""Of every limit, as a share of it: above rounding of inverse dynamics, below any meaning of a
limit."""
BOUNDARY_DISTANCE = 1e-7
"""Of the upper arm, also for jumps: encoders see a millionth; an NLP solved to 1e-8 leaves less."""
BOUNDARY_SPEED = 3e-7
"""Upper arms in the duration of the motion, also for jumps: less than a nanometre within a
controller's millisecond."""
DYNAMIC_ERROR = 1e-9
"""In units of the arm and of ``Units.time``, in which accelerations are 1 to 100: rounding leaves
1e-14."""
_SHARE = 1e-3
"""Of the way, and of its mean speed: a motion of a micrometre is held to less than one."""
_ROUNDING = 1e-13
"""Of the upper arm, and of it in ``Units.time``: to which the integration of a piece is known. It
is more than the shares of a way of nanometres or of a motion of years."""


Sizes = tuple[float, float, float, float]
"""Of a motion, as ``Verification`` calls them: ``arm`` and ``way``, m, ``duration`` and
``time_unit``, s."""


@dataclass(frozen=True)
class Tolerance:
    """How much of something may be, in its ``unit``.

    ``at_most``: of the upper arm's length (m), of that length in the motion's duration (m/s) or in
    its square (m/s²), or of the duration (s), so that large and small robots are held to the same;
    of nothing else. ``share``: of the distance from start to goal (m) or of the mean speed (m/s),
    if that is less. ``rounding``: of the upper arm (m) or of it in ``Units.time`` (m/s), if that is
    more.
    """

    unit: str
    at_most: float
    share: float = inf
    rounding: float = 0.0

    def of(self, sizes: Sizes) -> float:
        """The most of a motion of these sizes, in the unit."""
        arm, way, duration, time_unit = sizes
        rate, own_rate = (1 / t if t > 0 else inf for t in (duration, time_unit))
        units = {"s": duration, "m": arm, "m/s": arm * rate, "m/s²": arm * rate**2}
        own = {"m": way, "m/s": way * rate}
        known = {"m": arm, "m/s": arm * own_rate}
        at_most = self.at_most * units.get(self.unit, 1.0)
        if self.unit in own:
            at_most = min(at_most, self.share * own[self.unit])
            at_most = max(at_most, self.rounding * known[self.unit])
        return at_most


_DURATION = Tolerance("s", 1e-10)
"""Of a duration that the scene gives."""
_OVERLAP = Tolerance("m", 2e-9)
"""By which a link may be too near to a body: rounding, and what bounds leave."""
_PLACE = Tolerance("m", BOUNDARY_DISTANCE, _SHARE)
_SPEED = Tolerance("m/s", BOUNDARY_SPEED, _SHARE)
_ACCELERATION = Tolerance("m/s²", 1e-6)
"""Also of jumps: a millionth of what a motion asks for, where it is continuous."""
_LOOPS = Tolerance("1", 1e-9)
"""Of the upper arm and of the mean speed: rounding of the closed-form kinematics leaves 1e-15."""
_PIECE_DISTANCE = Tolerance("m", 1e-7, _SHARE, _ROUNDING)
"""After a piece of the motion: integration leaves 1e-12."""
_PIECE_SPEED = Tolerance("m/s", 5e-5, _SHARE, _ROUNDING)
"""After a piece of it: a ten-thousandth of the speed."""
_ARRIVAL_DISTANCE = Tolerance("m", 1e-5, 1e-2)
"""Some micrometres, the most the project promises: good robots repeat to 1e-4 m. Of where the
torques lead a larger share of the way and of the speed is allowed."""
_ARRIVAL_SPEED = Tolerance("m/s", 5e-4, 1e-2)


@dataclass(frozen=True)
class Check:
    """One measure of a motion, the most that it may be, their unit, and what to say of a value
    that is more."""

    measure: str
    value: float
    at_most: float
    unit: str
    complaint: str

    @property
    def ok(self) -> bool:
        """Whether the measure is within its bound; what is not a number is not."""
        return bool(self.value <= self.at_most < inf)

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """For a table: what is measured, its value, the most that it may be, and their unit."""
        name = self.measure.replace("_", " ")
        return name, f"{self.value:.1e}", f"{self.at_most:.0e}", self.unit


@dataclass(frozen=True)
class Bound:
    """The most a measure may be, and what to say of a value that is more: in the place of {} that
    value and its unit."""

    tolerance: Tolerance
    complaint: str

    def check(self, measure: str, value: float, sizes: Sizes) -> Check:
        """A value of the measure beside the most that it may be in a motion of these sizes."""
        most, unit = self.tolerance.of(sizes), self.tolerance.unit
        told = f"{value:.3g} {unit}".removesuffix(" 1")
        return Check(measure, value, most, unit, self.complaint.format(told))


BOUNDS = {
    "duration_error": Bound(_DURATION, "it takes {} more or less than the scene says"),
    "robot_overlap": Bound(
        _OVERLAP, "an arm or a forearm is up to {} too near to a keep-out body, or inside"
    ),
    "rotation_left": Bound(_DURATION, "it ends {} before the fourth axis has turned"),
    "start_distance": Bound(_PLACE, "it begins {} from the scene's start"),
    "goal_distance": Bound(_PLACE, "it ends {} from the scene's goal"),
    "path_distance": Bound(_PLACE, "it is up to {} off the scene's path"),
    "via_distance": Bound(_PLACE, "it misses a via point by {}, or passes it out of turn"),
    "approach_distance": Bound(_PLACE, "it is up to {} outside the scene's approach"),
    "start_speed": Bound(_SPEED, "it begins with a velocity {} off the scene's"),
    "goal_speed": Bound(_SPEED, "it ends with a velocity {} off the scene's"),
    "position_jump": Bound(_PLACE, "its position jumps by {} at its knots, all jumps together"),
    "velocity_jump": Bound(_SPEED, "its velocity jumps by {} at its knots, all jumps together"),
    "start_acceleration": Bound(_ACCELERATION, "it begins with an acceleration {} off the scene's"),
    "goal_acceleration": Bound(_ACCELERATION, "it ends with an acceleration {} off the scene's"),
    "jump_of_acceleration": Bound(
        _ACCELERATION, "its acceleration jumps by {} at its knots, all jumps together"
    ),
    "kinematic_error": Bound(
        _LOOPS,
        "its coordinates leave the loops open by {} (of the upper arm and of the mean speed, on "
        "average)",
    ),
    "dynamic_error": Bound(
        Tolerance("1", DYNAMIC_ERROR),
        "its torques give accelerations that differ by {} from its own (in units of the robot and "
        "the motion, on average)",
    ),
    "defect_distance": Bound(
        _PIECE_DISTANCE, "its torques lead {} off its path within a piece of it"
    ),
    "defect_speed": Bound(
        _PIECE_SPEED, "its torques give a speed {} off its own within a piece of it"
    ),
}
"""Of everything but limits, whose excesses are measures of their own, each at most ``EXCESS``."""

ARRIVAL_BOUNDS = {
    "arrival_distance": Bound(
        _ARRIVAL_DISTANCE, "its torques bring the platform to {} from the goal"
    ),
    "arrival_speed": Bound(
        _ARRIVAL_SPEED, "its torques leave the platform with a velocity {} off the goal's"
    ),
}
"""Of the arrival, unless a motion is so long that rounding decides where it ends."""
