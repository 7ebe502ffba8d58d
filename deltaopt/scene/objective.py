"""What the best motion is the best in: time, effort, or both.

In a scene file a word or weights, and a duration where the motion is given one:

    objective: time                           # T, s: the default
    objective: effort                         # ∫ τᵀτ dt, N²m²s
    duration: 0.3                             # of the least effort, s
    objective: {time: 1.0, effort: 0.002}     # 1.0 T + 0.002 ∫ τᵀτ dt, s
"""

from __future__ import annotations

from abc import abstractmethod

from pydantic import Field

from deltaopt.errors import SceneError
from deltaopt.files.validated_record import Positive, Record

EXPECTED = (
    "the word time, the word effort with a duration in s, or weights of both such as "
    "{time: 1, effort: 0.002}, the latter in 1/(N²m²)"
)
DURATION = "a duration in s, greater than 0"


class _Weighted(Record):
    """What every objective is: a weighted sum of the duration and the effort."""

    @property
    def unit(self) -> str:
        return "s"

    @property
    def given_duration(self) -> float | None:
        """The duration, s, of an objective that fixes it."""
        return None

    @property
    @abstractmethod
    def weights(self) -> tuple[float, float]:
        """Of the duration, and of the effort."""


class Time(_Weighted):
    """The shortest duration T."""

    @property
    def weights(self) -> tuple[float, float]:
        return 1.0, 0.0

    def __str__(self) -> str:
        return "least time"


class Effort(_Weighted):
    """The least effort ∫ τᵀτ dt over a given ``duration`` (s)."""

    duration: Positive = Field(description=DURATION)

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
    """The least ``time`` · T + ``effort`` · ∫ τᵀτ dt, s; ``effort`` is in 1/(N²m²)."""

    time: Positive = Field(default=1.0, description="a weight of the duration, greater than 0")
    effort: Positive = Field(description="a weight of the effort in 1/(N²m²), greater than 0")

    @property
    def weights(self) -> tuple[float, float]:
        return self.time, self.effort

    def __str__(self) -> str:
        return f"least {self.time:g} T + {self.effort:g}/(N²m²) · ∫ τᵀτ dt"


Objective = Time | Effort | TimeAndEffort


def objective_in(content: dict[str, object]) -> dict[str, object]:
    """A scene's content with its objective as a value and no duration beside it."""
    rest = {key: value for key, value in content.items() if key not in ("objective", "duration")}
    given, duration = content.get("objective", "time"), content.get("duration")
    if given == "effort":
        if "duration" not in content:
            needed = f"{DURATION}, since the objective is effort"
            raise SceneError(None, "duration", None, needed, "is missing")
        try:
            return {**rest, "objective": Effort.model_validate({"duration": duration})}
        except SceneError as error:  # its key stands beside the objective in the file
            raise SceneError(None, "duration", error.value, error.expected) from None
    if "duration" in content:
        free = "objective: effort beside it, since it is a variable otherwise"
        raise SceneError(None, "duration", duration, free)
    if given == "time":
        return {**rest, "objective": Time()}
    if isinstance(given, dict):
        try:
            return {**rest, "objective": TimeAndEffort.model_validate(given)}
        except SceneError as error:
            raise error.inside(key="objective") from None
    return {**rest, "objective": given}


def content_of(objective: Objective) -> dict[str, object]:
    """What a scene file says of it: the inverse of ``objective_in``."""
    match objective:
        case Time():
            return {"objective": "time"}
        case Effort():
            return {"objective": "effort", "duration": objective.duration}
        case TimeAndEffort():
            return {"objective": objective.model_dump()}
