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
    """The most a measure may be, and what to say of a value that is more."""

    measure: str
    tolerance: Tolerance
    complaint: str

    def check(self, value: float, sizes: Sizes) -> Check:
        """A value of the measure beside the most that it may be in a motion of these sizes."""
        most, unit = self.tolerance.of(sizes), self.tolerance.unit
        return Check(self.measure, value, most, unit, self.complaint.format(value))


BOUNDS = (
    Bound("duration_error", _DURATION, "it takes {:.3g} s more or less than the scene says"),
    Bound(
        "robot_overlap",
        _OVERLAP,
        "an arm or a forearm is up to {:.3g} m too near to a keep-out body, or inside",
    ),
    Bound("rotation_left", _DURATION, "it ends {:.3g} s before the fourth axis has turned"),
    Bound("start_distance", _PLACE, "it begins {:.3g} m from the scene's start"),
    Bound("goal_distance", _PLACE, "it ends {:.3g} m from the scene's goal"),
    Bound("path_distance", _PLACE, "it is up to {:.3g} m off the scene's path"),
    Bound("via_distance", _PLACE, "it misses a via point by {:.3g} m, or passes it out of turn"),
    Bound("approach_distance", _PLACE, "it is up to {:.3g} m outside the scene's approach"),
    Bound("start_speed", _SPEED, "it begins with a velocity {:.3g} m/s off the scene's"),
    Bound("goal_speed", _SPEED, "it ends with a velocity {:.3g} m/s off the scene's"),
    Bound(
        "position_jump", _PLACE, "its position jumps by {:.3g} m at its knots, all jumps together"
    ),
    Bound(
        "velocity_jump", _SPEED, "its velocity jumps by {:.3g} m/s at its knots, all jumps together"
    ),
    Bound(
        "start_acceleration",
        _ACCELERATION,
        "it begins with an acceleration {:.3g} m/s² off the scene's",
    ),
    Bound(
        "goal_acceleration",
        _ACCELERATION,
        "it ends with an acceleration {:.3g} m/s² off the scene's",
    ),
    Bound(
        "jump_of_acceleration",
        _ACCELERATION,
        "its acceleration jumps by {:.3g} m/s² at its knots, all jumps together",
    ),
    Bound(
        "kinematic_error",
        _LOOPS,
        "its coordinates leave the loops open by {:.3g} (of the upper arm and of the mean speed, "
        "on average)",
    ),
    Bound(
        "dynamic_error",
        Tolerance("1", DYNAMIC_ERROR),
        "its torques give accelerations that differ by {:.3g} from its own (in units of the robot "
        "and the motion, on average)",
    ),
    Bound(
        "defect_distance",
        _PIECE_DISTANCE,
        "its torques lead {:.3g} m off its path within a piece of it",
    ),
    Bound(
        "defect_speed",
        _PIECE_SPEED,
        "its torques give a speed {:.3g} m/s off its own within a piece of it",
    ),
)
"""Of everything but limits, whose excesses are measures of their own, each at most ``EXCESS``."""

ARRIVAL_BOUNDS = (
    Bound(
        "arrival_distance",
        _ARRIVAL_DISTANCE,
        "its torques bring the platform to {:.3g} m from the goal",
    ),
    Bound(
        "arrival_speed",
        _ARRIVAL_SPEED,
        "its torques leave the platform with a velocity {:.3g} m/s off the goal's",
    ),
)
"""Of the arrival, unless a motion is so long that rounding decides where it ends."""
