"""The most that each measure of a motion may be, and what to say of one that is more."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

EXCESS = 1e-9
"""Share by which a motion may exceed any limit: more than the rounding of inverse dynamics, and far
less than anybody knows a limit to."""
BOUNDARY_DISTANCE = 1e-7
"""Share of the upper arm's length by which a position may be wrong, at the ends and where it jumps:
encoders see a millionth, and an optimisation that is solved to 1e-8 leaves less than this."""
BOUNDARY_SPEED = 3e-7
"""By how much a velocity may be wrong, in upper arms' lengths per duration of the motion: less than
a nanometre within a controller's millisecond."""
DYNAMIC_ERROR = 1e-9
"""By how much accelerations may be wrong, in the units of ``Units``, in which they are 1 to 100.
Rounding leaves 1e-14."""
_SHARE = 1e-3
"""Share of the distance from start to goal (or of the mean speed) by which a place (or a velocity)
may be wrong: so a motion of a micrometre is held to less than a micrometre."""
_ROUNDING = 1e-13
"""Accuracy of integrating a piece of a motion, as a share of the upper arm's length, or of that per
``Units.time``. Without it motions of nanometres, or of years, would be held to less than this."""


Sizes = tuple[float, float, float, float]
"""The lengths (``arm``, ``way``, m) and times (``duration``, ``time_unit``, s) of a verification,
of which tolerances are shares."""


@dataclass(frozen=True)
class Tolerance:
    """The most that a measure with this ``unit`` may be.

    Large and small robots are held to the same, so numbers are relative. ``at_most``: a share of
    the upper arm's length (unit m), of that length per duration of the motion (m/s), per squared
    duration (m/s²), or of the duration (s); an absolute number for any other unit. ``share``: a
    share of the distance from start to goal (m) or of the mean speed (m/s), which counts where it
    is less. ``rounding``: a share of the upper arm's length (m), or of that per ``Units.time``
    (m/s), below which no tolerance falls.
    """

    unit: str
    at_most: float
    share: float = inf
    rounding: float = 0.0

    def of(self, sizes: Sizes) -> float:
        """That number for a motion of these sizes, in the unit."""
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
"""For a duration that the scene prescribes."""
_OVERLAP = Tolerance("m", 2e-9)
"""By how much a link may be too near to a body: rounding, and what the search leaves unknown."""
_PLACE = Tolerance("m", BOUNDARY_DISTANCE, _SHARE)
_SPEED = Tolerance("m/s", BOUNDARY_SPEED, _SHARE)
_ACCELERATION = Tolerance("m/s²", 1e-6)
"""For accelerations at the ends, and for their jumps where they are to be continuous: a millionth
of what motions have."""
_LOOPS = Tolerance("1", 1e-9)
"""For how far the loops are open, in upper arms' lengths and mean speeds: rounding of the
closed-form kinematics leaves 1e-15."""
_PIECE_DISTANCE = Tolerance("m", 1e-7, _SHARE, _ROUNDING)
"""For how far the torques lead off within a piece of the motion; integration itself leaves
1e-12."""
_PIECE_SPEED = Tolerance("m/s", 5e-5, _SHARE, _ROUNDING)
"""The same for the velocity: a ten-thousandth of the speed."""
_ARRIVAL_DISTANCE = Tolerance("m", 1e-5, 1e-2)
"""For where the torques lead the platform from start to goal without feedback: some micrometres, as
good robots repeat a position to 1e-4 m. A larger share of the way, and of the speed, is allowed."""
_ARRIVAL_SPEED = Tolerance("m/s", 5e-4, 1e-2)


@dataclass(frozen=True)
class Check:
    """One measure of a motion beside the most that it may be, in one unit, and the sentence to say
    if it is more."""

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
        """The columns of a table: what is measured, its value, its bound, and their unit."""
        name = self.measure.replace("_", " ")
        return name, f"{self.value:.1e}", f"{self.at_most:.0e}", self.unit


@dataclass(frozen=True)
class Bound:
    """The most that a measure may be, and the sentence to say if it is more; {} in it stands for
    the value with its unit."""

    tolerance: Tolerance
    complaint: str

    def check(self, measure: str, value: float, sizes: Sizes) -> Check:
        """Hold a value of the measure against its bound in a motion of these sizes."""
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
"""For all measures but the excesses of limits, each of which may be ``EXCESS``."""

ARRIVAL_BOUNDS = {
    "arrival_distance": Bound(
        _ARRIVAL_DISTANCE, "its torques bring the platform to {} from the goal"
    ),
    "arrival_speed": Bound(
        _ARRIVAL_SPEED, "its torques leave the platform with a velocity {} off the goal's"
    ),
}
"""For the arrival, unless a motion is so long that rounding decides where it ends."""
