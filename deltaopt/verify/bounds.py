"""The most that each measure of a motion may be, and what to say of one that is more."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf

from deltaopt.verify.measures import Excess, Known

EXCESS = 1e-9
"""Of every limit, as a share of it: above rounding of inverse dynamics, below any meaning of a
limit."""
DURATION = 1e-10
"""Of a duration that the scene gives."""
BOUNDARY_DISTANCE = 1e-7
"""Of the upper arm, also for jumps: encoders see a millionth; an NLP solved to 1e-8 leaves less."""
BOUNDARY_SPEED = 3e-7
"""Upper arms in the duration of the motion, also for jumps: less than a nanometre within a
controller's millisecond."""
BOUNDARY_ACCELERATION = 1e-6
"""Upper arms in the duration of the motion twice, also for jumps: a millionth of what a motion
asks for, where it is continuous."""
ROBOT_OVERLAP = 2e-9
"""Of the upper arm, by which a link may be too near to a body: rounding, and what bounds leave."""
KINEMATIC_ERROR = 1e-9
"""Of the upper arm and of the mean speed: rounding of the closed-form kinematics leaves 1e-15."""
DYNAMIC_ERROR = 1e-9
"""In units of the arm and of ``Units.time``, in which accelerations are 1 to 100: rounding leaves
1e-14."""
DEFECT_DISTANCE = 1e-7
"""Of the upper arm, after a piece of the motion: integration leaves 1e-12."""
DEFECT_SPEED = 5e-5
"""Upper arms in the duration of the motion, after a piece of it: a ten-thousandth of the speed."""
DEFECT_ROUNDING = 1e-13
"""Of the upper arm, and of it in ``Units.time``: to which the integration is known. It is more than
the shares of a way of nanometres or of a motion of years."""
ARRIVAL_DISTANCE = 1e-5
"""Of the upper arm, some micrometres, the most the project promises: good robots repeat to 1e-4 m.
"""
ARRIVAL_SPEED = 5e-4
"""Upper arms in the duration of the motion."""
BOUNDARY_SHARE = 1e-3
"""Of the way, and of its mean speed: a motion of a micrometre is held to less than one."""
ARRIVAL_SHARE = 1e-2
"""Of the way, and of its mean speed, for where the torques lead."""


@dataclass(frozen=True)
class Bound:
    """The most a measure may be, and what to say of a value that is more.

    ``at_most``: of the upper arm's length (m), of that length in the motion's duration (m/s), or of
    the duration (s), so that large and small robots are held to the same; of nothing else.
    ``share``: of the distance from start to goal (m) or of the mean speed (m/s), if that is less.
    ``rounding``: of the upper arm (m) or of it in ``Units.time`` (m/s), if that is more.
    ``known``: what is known of the measure between samples.
    """

    measure: str
    known: Known
    complaint: str
    unit: str
    at_most: float
    share: float = inf
    rounding: float = 0.0

    def of(self, arm: float, way: float, duration: float, time_unit: float) -> Bound:
        """The bound of a motion in the measure's unit, from what ``Verification`` calls so, m and
        s."""
        rate, own_rate = (1 / t if t > 0 else inf for t in (duration, time_unit))
        units = {"s": duration, "m": arm, "m/s": arm * rate, "m/s²": arm * rate**2}
        own = {"m": way, "m/s": way * rate}
        known = {"m": arm, "m/s": arm * own_rate}
        at_most = self.at_most * units.get(self.unit, 1.0)
        if self.unit in own:
            at_most = min(at_most, self.share * own[self.unit])
            at_most = max(at_most, self.rounding * known[self.unit])
        return replace(self, at_most=at_most)


def _place(measure: str, known: Known, complaint: str) -> Bound:
    """Of a place, by the upper arm and the way."""
    return Bound(measure, known, complaint, "m", BOUNDARY_DISTANCE, BOUNDARY_SHARE)


def _acceleration(measure: str, complaint: str) -> Bound:
    """Of an acceleration at an end or a knot, by the upper arm in the duration."""
    return Bound(measure, Known.EXACT, complaint, "m/s²", BOUNDARY_ACCELERATION)


def _speed(measure: str, complaint: str) -> Bound:
    """Of a speed at an end or a knot, by the upper arm and the way in the duration."""
    return Bound(measure, Known.EXACT, complaint, "m/s", BOUNDARY_SPEED, BOUNDARY_SHARE)


BOUNDS = (
    Bound(
        "duration_error",
        Known.EXACT,
        "it takes {:.3g} s more or less than the scene says",
        "s",
        DURATION,
    ),
    Bound(
        "robot_overlap",
        Known.SURE,
        "an arm or a forearm is up to {:.3g} m too near to a keep-out body, or inside",
        "m",
        ROBOT_OVERLAP,
    ),
    Bound(
        "rotation_left",
        Known.EXACT,
        "it ends {:.3g} s before the fourth axis has turned",
        "s",
        DURATION,
    ),
    _place("start_distance", Known.EXACT, "it begins {:.3g} m from the scene's start"),
    _place("goal_distance", Known.EXACT, "it ends {:.3g} m from the scene's goal"),
    _place("path_distance", Known.SURE, "it is up to {:.3g} m off the scene's path"),
    _place(
        "via_distance",
        Known.SURE,
        "it misses a via point by {:.3g} m, or passes it out of turn",
    ),
    _place("approach_distance", Known.SURE, "it is up to {:.3g} m outside the scene's approach"),
    _speed("start_speed", "it begins with a velocity {:.3g} m/s off the scene's"),
    _speed("goal_speed", "it ends with a velocity {:.3g} m/s off the scene's"),
    _place(
        "position_jump",
        Known.EXACT,
        "its position jumps by {:.3g} m at its knots, all jumps together",
    ),
    _speed("velocity_jump", "its velocity jumps by {:.3g} m/s at its knots, all jumps together"),
    _acceleration(
        "start_acceleration", "it begins with an acceleration {:.3g} m/s² off the scene's"
    ),
    _acceleration("goal_acceleration", "it ends with an acceleration {:.3g} m/s² off the scene's"),
    _acceleration(
        "jump_of_acceleration",
        "its acceleration jumps by {:.3g} m/s² at its knots, all jumps together",
    ),
    Bound(
        "kinematic_error",
        Known.SAMPLED,
        "its coordinates leave the loops open by {:.3g} (of the upper arm and of the mean speed, "
        "on average)",
        "1",
        KINEMATIC_ERROR,
    ),
    Bound(
        "dynamic_error",
        Known.SAMPLED,
        "its torques give accelerations that differ by {:.3g} from its own (in units of the robot "
        "and the motion, on average)",
        "1",
        DYNAMIC_ERROR,
    ),
    Bound(
        "defect_distance",
        Known.FOLLOWED,
        "its torques lead {:.3g} m off its path within a piece of it",
        "m",
        DEFECT_DISTANCE,
        BOUNDARY_SHARE,
        DEFECT_ROUNDING,
    ),
    Bound(
        "defect_speed",
        Known.FOLLOWED,
        "its torques give a speed {:.3g} m/s off its own within a piece of it",
        "m/s",
        DEFECT_SPEED,
        BOUNDARY_SHARE,
        DEFECT_ROUNDING,
    ),
)
"""Of everything but limits, whose excesses are measures of their own, each at most ``EXCESS``."""

ARRIVAL_BOUNDS = (
    Bound(
        "arrival_distance",
        Known.FOLLOWED,
        "its torques bring the platform to {:.3g} m from the goal",
        "m",
        ARRIVAL_DISTANCE,
        ARRIVAL_SHARE,
    ),
    Bound(
        "arrival_speed",
        Known.FOLLOWED,
        "its torques leave the platform with a velocity {:.3g} m/s off the goal's",
        "m/s",
        ARRIVAL_SPEED,
        ARRIVAL_SHARE,
    ),
)
"""Of the arrival, unless a motion is so long that rounding decides where it ends."""


@dataclass(frozen=True)
class Check:
    """One measure of a motion beside its bound."""

    bound: Bound
    value: float

    @property
    def ok(self) -> bool:
        """Whether the measure is within its bound; what is not a number is not."""
        return bool(self.value <= self.bound.at_most < inf)

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """For a table: what is measured, its value, the most that it may be, and their unit."""
        name, unit = self.bound.measure.replace("_", " "), self.bound.unit
        return name, f"{self.value:.1e}", f"{self.bound.at_most:.0e}", unit

    @property
    def complaint(self) -> str:
        """The sentence for a value that is out of bounds."""
        return self.bound.complaint.format(self.value)


def check_of(excess: Excess) -> Check:
    """The excess of a limit beside its bound."""
    return Check(Bound(excess.key, excess.known, excess.sentence, "1", EXCESS), excess.value)
