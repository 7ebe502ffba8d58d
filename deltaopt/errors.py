"""What can go wrong, each with the one sentence a user needs."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path


class DeltaOptError(Exception):
    """Base of every error deltaopt raises on purpose."""


class SceneError(DeltaOptError):
    """A scene or robot says something that cannot be used.

    Carries ``file`` (Path, or None for a record made in Python), ``key`` (dotted, such as
    ``"forearm.mass"``; empty where the whole file is meant), ``value`` (as found; None if there
    is none) and ``expected`` (what would be right, with its unit, as a noun phrase).  ``problem``
    says what is wrong where "is <value>" would not, e.g. "is missing".
    """

    def __init__(
        self, file: Path | None, key: str, value: object, expected: str, problem: str = ""
    ) -> None:
        super().__init__(file, key, value, expected, problem)  # as passed: copies and pickles
        self.file, self.key, self.value, self.expected = file, key, value, expected
        self.problem = problem

    def __str__(self) -> str:
        place = ": ".join(str(part) for part in (self.file, self.key) if part)
        problem = self.problem or f"is {_shortened(repr(self.value))}"
        return f"{place} {problem}; expected {self.expected}"

    def inside(self, *, file: Path | None = None, key: str = "") -> SceneError:
        """The same complaint, seen from the enclosing ``file`` or from the record at ``key``."""
        dotted = ".".join(part for part in (key, self.key) if part)
        return SceneError(file, dotted, self.value, self.expected, self.problem)


def _shortened(text: str, limit: int = 120) -> str:
    return text if len(text) <= limit else text[: limit - 3] + "..."


def in_words(point: Iterable[float]) -> str:
    """Coordinates for a sentence: [0.45, -0.05, 0]."""
    return "[" + ", ".join(f"{coordinate:g}" for coordinate in point) + "]"


class Unreachable(DeltaOptError):
    """A point lies outside the workspace, or outside the industrial assembly mode."""


class Infeasible(DeltaOptError):
    """No motion can exist, e.g. gravity alone exceeds a torque limit at the start."""


class NotConverged(DeltaOptError):
    """Ipopt stopped without a solution.

    Carries ``status`` (Ipopt's return status) and ``iterate`` (the last values of
    the variables, as packed).
    """

    def __init__(self, message: str, status: str, iterate: object) -> None:
        self.status, self.iterate = status, iterate
        super().__init__(message)


class DependentConstraints(DeltaOptError):
    """Constraints of a mechanism follow from others, so that no multiplier is unique."""


class Inconsistent(DeltaOptError):
    """A state violates the constraints of its mechanism too far to be projected onto them."""


class IntegrationFailed(DeltaOptError):
    """A motion could not be followed to its end, e.g. into a singularity."""


class MissingPackage(DeltaOptError):
    """An optional package is not installed."""
