"""Objectives: what a motion is to minimise: time, an integral over the motion, or a weighted sum.

In a scene file an objective is a word or a mapping of weights; an integral alone needs a duration:

    objective: time                           # T, s: the default
    objective: effort                         # ∫ τᵀτ dt, N²m²s
    duration: 0.3                             # with it: the given duration, s,
    duration: 101 %                           # or a share of that of the fastest motion
    objective: {time: 1.0, effort: 0.002}     # 1.0 T + 0.002 ∫ τᵀτ dt, s; or three weights

In the place of effort may stand jerk, ∫ ‖d³x/dt³‖² dt of the platform, and torque_rate,
∫ ‖dτ/dt‖² dt: costs of smooth motions, whose acceleration is continuous.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, ClassVar

from pydantic import Field

from deltaopt.errors import SceneError, inside
from deltaopt.files.units import (
    DURATION,
    EFFORT_WEIGHT,
    JERK_WEIGHT,
    RATIO,
    TORQUE_RATE_WEIGHT,
    percentage,
)
from deltaopt.files.validated_record import NonNegative, Positive, Record, optional
from deltaopt.limits.running_cost import LEAST_TIME, CostFunctional, Running

Weight = Annotated[NonNegative, EFFORT_WEIGHT]
EXPECTED = (
    "the word time; one of the words effort, jerk and torque_rate with a duration; or weights of "
    "time and of one of them such as {time: 1, effort: 0.002}, the latter in 1/(N²m²), s⁶/m² or "
    "s²/(N²m²)"
)
EXPECTED_DURATION = (
    "a duration in s, greater than 0, or a share of the fastest motion's, 100 % at least"
)


class _Weighted(Record):
    """An objective that is a weighted sum of the duration and an integral over the motion."""

    rate: ClassVar[Running] = Running.EFFORT

    @property
    @abstractmethod
    def functional(self) -> CostFunctional:
        """What is minimised, as numbers."""

    @property
    def given_duration(self) -> float | None:
        """The duration of the motion in s, if the objective fixes it; None if it is free."""
        return self.functional.duration

    @property
    def is_share(self) -> bool:
        """Whether the duration of the motion is a share of the fastest one's."""
        return not self.functional.time and self.given_duration is None

    def after(self, fastest: float) -> Objective:
        """This objective with its duration in s, where the fastest motion takes so long, s."""
        return self  # type: ignore[return-value]  # all that are made are among them

    def alone(self, duration: float) -> Objective:
        """The least of its integral over a duration, s."""
        return _IN_TIME[self.rate.word](duration=duration)


class Time(_Weighted):
    """Minimise the duration T.

    Examples:
        >>> deltaopt.load_scene("problems/pick_and_place.yaml").objective == deltaopt.Time()
        True
    """

    @property
    def functional(self) -> CostFunctional:
        return LEAST_TIME

    def __str__(self) -> str:
        return "least time"


class _InTime(_Weighted):
    """Minimise an integral over a motion whose duration is given."""

    duration: Annotated[Positive, DURATION] | None = optional(EXPECTED_DURATION)
    of_fastest: Annotated[Positive, RATIO] | None = optional(
        "a share of the fastest motion's duration, 1 at least", ge=1
    )

    def require_consistent(self) -> None:
        if (self.duration is None) == (self.of_fastest is None):
            raise SceneError(None, "duration", self.duration, EXPECTED_DURATION)

    @property
    def functional(self) -> CostFunctional:
        return CostFunctional(0.0, 1.0, self.rate, self.duration)

    def after(self, fastest: float) -> Objective:
        return self.alone(self.duration or (self.of_fastest or 1.0) * fastest)

    def __str__(self) -> str:
        share, s = self.of_fastest, self.duration
        given = f"{s:g} s" if share is None else f"{share:.6g} times the least duration"
        return f"least {self.rate.integral} in {given}"


class Effort(_InTime):
    """Minimise the effort ∫ τᵀτ dt, N²m²s, over a given ``duration`` in s, or ``of_fastest``, a
    share of the fastest motion's.

    Examples:
        >>> deltaopt.Effort(duration="280 ms").duration
        0.28
    """


class SmoothMotion(_InTime):
    """Minimise ∫ ‖d³x/dt³‖² dt of the platform, m²/s⁵, over a given ``duration`` in s, or
    ``of_fastest``, a share of the fastest motion's.

    Examples:
        >>> deltaopt.SmoothMotion(of_fastest="101 %").of_fastest
        1.01
    """

    rate = Running.JERK


class SmoothTorque(_InTime):
    """Minimise ∫ ‖dτ/dt‖² dt, N²m²/s, over a given ``duration`` in s, or ``of_fastest``, a share of
    the fastest motion's.

    Examples:
        >>> deltaopt.SmoothTorque(of_fastest=1.01).of_fastest
        1.01
    """

    rate = Running.TORQUE_RATE


class _WithTime(_Weighted):
    """Minimise a weighted sum of the duration and an integral over the motion."""

    time: Annotated[Positive, RATIO] = Field(
        default=1.0, description="a weight of the duration, greater than 0"
    )

    @property
    def functional(self) -> CostFunctional:
        return CostFunctional(self.time, getattr(self, self.rate.word), self.rate)

    def __str__(self) -> str:
        weight, integral = self.functional.running, self.rate.integral
        integral = integral[integral.index("∫") :]
        return f"least {self.time:g} T + {weight:g} {self.rate.unit_of_weight} · {integral}"


class TimeAndEffort(_WithTime):
    """Minimise ``time`` · T + ``effort`` · ∫ τᵀτ dt, in s; the weight ``effort`` is in 1/(N²m²).

    Examples:
        >>> deltaopt.TimeAndEffort(time=1.0, effort=1e-4).effort
        0.0001
    """

    effort: Annotated[Positive, EFFORT_WEIGHT]


class TimeAndEfforts(_WithTime):
    """Minimise ``time`` · T + ∫ Σ wᵢ τᵢ² dt, in s, where the weight wᵢ of each motor, 1/(N²m²), is
    one of ``effort``: at least 0, not all of them.

    Examples:
        >>> deltaopt.TimeAndEfforts(time=1.0, effort=(1e-4, 2e-4, 0.0)).effort
        (0.0001, 0.0002, 0.0)
    """

    effort: tuple[Weight, Weight, Weight] = Field(
        description="a weight of the effort in 1/(N²m²), or one for each motor"
    )
    rate = Running.WEIGHTED_EFFORT

    @property
    def functional(self) -> CostFunctional:
        return CostFunctional(self.time, 1.0, self.rate, motors=self.effort)

    def require_consistent(self) -> None:
        if not any(self.effort):
            raise SceneError(None, "effort", self.effort, "a weight above 0 for some motor")

    def __str__(self) -> str:
        weights = ", ".join(f"{weight:g}" for weight in self.effort)
        return f"least {self.time:g} T + ∫ Σ w τ² dt, w = {weights} 1/(N²m²)"


class TimeAndJerk(_WithTime):
    """Minimise ``time`` · T + ``jerk`` · ∫ ‖d³x/dt³‖² dt, in s; the weight ``jerk`` is in s⁶/m².

    Examples:
        >>> deltaopt.TimeAndJerk(time=1.0, jerk=1e-9).jerk
        1e-09
    """

    jerk: Annotated[Positive, JERK_WEIGHT]
    rate = Running.JERK


class TimeAndTorqueRate(_WithTime):
    """Minimise ``time`` · T + ``torque_rate`` · ∫ ‖dτ/dt‖² dt, in s; the weight ``torque_rate`` is
    in s²/(N²m²).

    Examples:
        >>> deltaopt.TimeAndTorqueRate(time=1.0, torque_rate=1e-9).torque_rate
        1e-09
    """

    torque_rate: Annotated[Positive, TORQUE_RATE_WEIGHT]
    rate = Running.TORQUE_RATE


Objective = (
    Time
    | Effort
    | SmoothMotion
    | SmoothTorque
    | TimeAndEffort
    | TimeAndEfforts
    | TimeAndJerk
    | TimeAndTorqueRate
)
_IN_TIME = {kind.rate.word: kind for kind in (Effort, SmoothMotion, SmoothTorque)}
_WITH_TIME = {kind.rate.word: kind for kind in (TimeAndEffort, TimeAndJerk, TimeAndTorqueRate)}


def objective_in(content: dict[str, object]) -> dict[str, object]:
    """The content of a scene file with its keys objective and duration replaced by an objective.

    Raises SceneError if they do not fit together.
    """
    rest = {key: value for key, value in content.items() if key not in ("objective", "duration")}
    given, duration = content.get("objective", "time"), content.get("duration")
    word = given if isinstance(given, str) else ""  # an array compares by elements
    if word in _IN_TIME:
        if "duration" not in content:
            needed = f"{EXPECTED_DURATION}, since the objective is {word}"
            raise SceneError(None, "duration", None, needed, "is missing")
        share = percentage(duration)
        try:
            of = {"duration": duration} if share is None else {"of_fastest": share}
            return {**rest, "objective": _IN_TIME[word].model_validate(of)}
        except SceneError as error:  # in the file the key stands beside the objective
            raise SceneError(None, "duration", duration, EXPECTED_DURATION, error.problem) from None
    if "duration" in content:
        free = "objective: effort, jerk or torque_rate beside it, since it is a variable otherwise"
        raise SceneError(None, "duration", duration, free)
    if word == "time":
        return {**rest, "objective": Time()}
    if isinstance(given, dict):
        costs = [key for key in given if key in _WITH_TIME]
        if len(costs) > 1:
            raise SceneError(None, "objective", given, EXPECTED, f"has {' and '.join(costs)}")
        kind: type[_WithTime]
        kind = _WITH_TIME[costs[0]] if costs else TimeAndEffort
        if kind is TimeAndEffort and isinstance(given.get("effort"), list | tuple):
            kind = TimeAndEfforts
        with inside(key="objective"):
            return {**rest, "objective": kind.model_validate(given)}
    return {**rest, "objective": given}


def content_of(objective: Objective) -> dict[str, object]:
    """The keys of a scene file for an objective: the inverse of ``objective_in``."""
    if isinstance(objective, Time):
        return {"objective": "time"}
    if isinstance(objective, _WithTime):
        return {"objective": objective.model_dump()}
    share = objective.of_fastest
    duration = objective.duration if share is None else f"{100 * share!r} %"
    return {"objective": objective.rate.word, "duration": duration}
