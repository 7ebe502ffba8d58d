"""Objectives: what a motion is to minimise, time, effort, or a weighted sum.

In a scene file an objective is a word or a mapping of weights; effort alone needs a duration:

    objective: time                           # T, s: the default
    objective: effort                         # ∫ τᵀτ dt, N²m²s
    duration: 0.3                             # with effort: the given duration, s
    objective: {time: 1.0, effort: 0.002}     # 1.0 T + 0.002 ∫ τᵀτ dt, s
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated

from pydantic import Field

from deltaopt.errors import SceneError
from deltaopt.files.units import DURATION, EFFORT_WEIGHT, RATIO
from deltaopt.files.validated_record import Positive, Record

EXPECTED = (
    "the word time, the word effort with a duration in s, or weights of both such as "
    "{time: 1, effort: 0.002}, the latter in 1/(N²m²)"
)
EXPECTED_DURATION = "a duration in s, greater than 0"


class _Weighted(Record):
    """An objective that is a weighted sum of the duration and the effort."""

    @property
    def unit(self) -> str:
        """Unit of the objective's value."""
        return "s"

    @property
    def given_duration(self) -> float | None:
        """The duration of the motion in s, if the objective fixes it; None if it is free."""
        return None

    @property
    @abstractmethod
    def weights(self) -> tuple[float, float]:
        """The weights of the duration and of the effort."""


class Time(_Weighted):
    """Minimise the duration T."""

    @property
    def weights(self) -> tuple[float, float]:
        return 1.0, 0.0

    def __str__(self) -> str:
        return "least time"


class Effort(_Weighted):
    """Minimise the effort ∫ τᵀτ dt, N²m²s, over a given ``duration`` in s."""

    duration: Annotated[Positive, DURATION] = Field(description=EXPECTED_DURATION)

    @property
    def unit(self) -> str:
        return "N²m²s"

    @property
    def given_duration(self) -> float | None:
        return self.duration

    @property
    def weights(self) -> tuple[float, float]:
        return 0.0, 1.0

    def __str__(self) -> str:
        return f"least effort ∫ τᵀτ dt in {self.duration:g} s"


class TimeAndEffort(_Weighted):
    """Minimise ``time`` · T + ``effort`` · ∫ τᵀτ dt, in s; the weight ``effort`` is in 1/(N²m²)."""

    time: Annotated[Positive, RATIO] = Field(
        default=1.0, description="a weight of the duration, greater than 0"
    )
    effort: Annotated[Positive, EFFORT_WEIGHT] = Field(
        description="a weight of the effort in 1/(N²m²), greater than 0"
    )

    @property
    def weights(self) -> tuple[float, float]:
        return self.time, self.effort

    def __str__(self) -> str:
        return f"least {self.time:g} T + {self.effort:g}/(N²m²) · ∫ τᵀτ dt"


Objective = Time | Effort | TimeAndEffort


def objective_in(content: dict[str, object]) -> dict[str, object]:
    """The content of a scene file with its keys objective and duration replaced by an objective.

    Raises SceneError if they do not fit together.
    """
    rest = {key: value for key, value in content.items() if key not in ("objective", "duration")}
    given, duration = content.get("objective", "time"), content.get("duration")
    word = given if isinstance(given, str) else None  # an array compares by elements
    if word == "effort":
        if "duration" not in content:
            needed = f"{EXPECTED_DURATION}, since the objective is effort"
            raise SceneError(None, "duration", None, needed, "is missing")
        try:
            return {**rest, "objective": Effort.model_validate({"duration": duration})}
        except SceneError as error:  # in the file the key stands beside the objective
            raise SceneError(None, "duration", error.value, error.expected, error.problem) from None
    if "duration" in content:
        free = "objective: effort beside it, since it is a variable otherwise"
        raise SceneError(None, "duration", duration, free)
    if word == "time":
        return {**rest, "objective": Time()}
    if isinstance(given, dict):
        try:
            return {**rest, "objective": TimeAndEffort.model_validate(given)}
        except SceneError as error:
            raise error.inside(key="objective") from None
    return {**rest, "objective": given}


def content_of(objective: Objective) -> dict[str, object]:
    """The keys of a scene file for an objective: the inverse of ``objective_in``."""
    match objective:
        case Time():
            return {"objective": "time"}
        case Effort():
            return {"objective": "effort", "duration": objective.duration}
        case TimeAndEffort():
            return {"objective": objective.model_dump()}
