"""What can go wrong, each with the one sentence a user needs."""

from __future__ import annotations

from pathlib import Path


class DeltaOptError(Exception):
    """Base of every error deltaopt raises on purpose."""


class SceneError(DeltaOptError):
    """A scene or robot file says something that cannot be used.

    Carries ``file`` (Path or None), ``key`` (dotted, such as ``"forearm.mass"``),
    ``value`` (as found) and ``expected`` (what would be right, with its unit).
    """

    def __init__(self, file: Path | None, key: str, value: object, expected: str) -> None:
        self.file, self.key, self.value, self.expected = file, key, value, expected
        place = ": ".join(str(part) for part in (file, key) if part)
        super().__init__(f"{place}: {value!r} cannot be used; {expected}")


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


class Inconsistent(DeltaOptError):
    """A state violates the constraints of its mechanism too far to be projected onto them."""


class IntegrationFailed(DeltaOptError):
    """A motion could not be followed to its end, e.g. into a singularity."""


class MissingPackage(DeltaOptError):
    """An optional package is not installed."""
