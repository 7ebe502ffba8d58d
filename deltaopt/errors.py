"""What can go wrong, each with the one sentence a user needs."""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum
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


class Singularity(Enum):
    """Kinds of singular positions of a Delta, as what is zero there."""

    SIDEWAYS = "cos q_k3"
    IN_LINE = "sin(q_k1 - q_k2)"
    PARALLEL = "volume spanned by the directions of the bars"


_SENTENCES = {
    Singularity.SIDEWAYS: "the bars of chain {chain} lie sideways, serial singularity",
    Singularity.IN_LINE: "arm and bars of chain {chain} are in line, serial singularity",
    Singularity.PARALLEL: "all bars lie in one plane, parallel singularity",
}


class Singular(DeltaOptError):
    """A position where what was asked for does not exist, or has lost its digits.

    Carries ``kind``, ``chain`` (1 to 3; None where it takes all three, as for a parallel
    singularity) and ``margin`` (what should not be zero).
    """

    def __init__(self, kind: Singularity, chain: int | None, margin: float, place: str) -> None:
        super().__init__(kind, chain, margin, place)  # as passed: copies and pickles
        self.kind, self.chain, self.margin, self.place = kind, chain, margin, place

    def __str__(self) -> str:
        sentence = _SENTENCES[self.kind].format(chain=self.chain)
        zero = self.kind.value.replace("_k", f"_{self.chain}")
        return f"{self.place}: {sentence} ({zero} = {self.margin:.1e})"


class Infeasible(DeltaOptError):
    """No motion can exist, e.g. gravity alone exceeds a torque limit at the start."""


class NotConverged(DeltaOptError):
    """Ipopt stopped without a solution.

    Carries ``status`` (Ipopt's return status) and ``iterate`` (the last values of
    the variables, as packed).
    """

    def __init__(self, message: str, status: str, iterate: object) -> None:
        super().__init__(message, status, iterate)  # as passed: copies and pickles
        self.status, self.iterate = status, iterate

    def __str__(self) -> str:
        return str(self.args[0])


class DependentConstraints(DeltaOptError):
    """Constraints of a mechanism follow from others, so that no multiplier is unique."""


class Inconsistent(DeltaOptError):
    """A state violates the constraints of its mechanism too far to be projected onto them."""


class IntegrationFailed(DeltaOptError):
    """A motion could not be followed to its end, e.g. into a singularity."""


class MissingPackage(DeltaOptError):
    """An optional package is not installed."""
