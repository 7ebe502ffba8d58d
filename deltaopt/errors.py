"""Errors, each with one sentence that says what is wrong and what would be right."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from enum import Enum
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

if TYPE_CHECKING:  # the command line says what is wrong with its words before numbers are needed
    import numpy as np
    from numpy.typing import NDArray


class DeltaOptError(Exception):
    """The base class of all errors that deltaopt raises on purpose.

    Examples:
        >>> try:
        ...     deltaopt.load_robot("nowhere.yaml")
        ... except deltaopt.DeltaOptError as error:
        ...     print(type(error).__name__)
        SceneError
    """


class Unusable(DeltaOptError):
    """What was given, a file or an argument, cannot be used as it is.

    Examples:
        >>> issubclass(deltaopt.SceneError, deltaopt.Unusable)
        True
    """


class SceneError(Unusable):
    """A scene or a robot has a value that cannot be used.

    ``file``: Path, or None for a record made in Python. ``key``: dotted, such as
    ``"forearm.mass"``; empty if the whole file is meant. ``value``: as found; None if missing.
    ``expected``: what would be right, with its unit, as a noun phrase. ``problem``: what is wrong,
    such as "is missing"; by default that it is this value. ``place``: in the file, such as "line 3,
    column 10"; empty where that is not known.

    Examples:
        >>> try:
        ...     deltaopt.Limits(platform_speed="3 kg")
        ... except deltaopt.SceneError as error:
        ...     print(error.key, error.value)
        platform_speed 3 kg
    """

    def __init__(
        self,
        file: Path | None,
        key: str,
        value: object,
        expected: str,
        problem: str = "",
        place: str = "",
    ) -> None:
        super().__init__(file, key, value, expected, problem, place)  # as passed: copies, pickles
        self.file, self.key, self.value, self.expected = file, key, value, expected
        self.problem, self.place = problem, place

    def __str__(self) -> str:
        file = ", ".join(on_one_line(str(part)) for part in (self.file, self.place) if part)
        where = ": ".join(part for part in (file, on_one_line(self.key)) if part)
        problem = self.problem or f"is {shown(self.value)}"
        return f"{where} {problem}; expected {self.expected}"

    def at(self, file: Path | None, key: str, place: str = "") -> SceneError:
        """This error with another key, in a ``place`` of a file."""
        return SceneError(file, key, self.value, self.expected, self.problem, place)

    def inside(self, *, file: Path | None = None, key: str = "") -> SceneError:
        """This error with its ``file``, or with the ``key`` of the record that contains it; a file
        and a place that it has stay where no other file is given."""
        dotted = ".".join(part for part in (key, self.key) if part)
        return self.at(file, dotted) if file else self.at(self.file, dotted, self.place)


@contextmanager
def inside(*, file: Path | None = None, key: str = "") -> Iterator[None]:
    """What is wrong in a file, or in the record under a key, is raised with these."""
    try:
        yield
    except SceneError as error:
        raise error.inside(file=file, key=key) from None


def shortened(text: str, limit: int = 120) -> str:
    """A text of at most ``limit`` characters: what is longer ends in dots."""
    return text if len(text) <= limit else text[: limit - 3] + "..."


def shown(value: object) -> str:
    """A value for a sentence, as Python writes it, on one line and not too long of it."""
    value = float(f"{value:.15g}") if isinstance(value, float) else value  # all but rounding
    try:
        written = repr(value)
    except ValueError:  # Python does not write whole numbers of thousands of digits
        return "a number of thousands of digits"
    return shortened(" ".join(line.strip() for line in written.splitlines()))


def on_one_line(name: str) -> str:
    """A name of a file or a key for a sentence, in quotes with escapes if it has a line break or
    another sign that cannot be printed."""
    return shortened(name if name.isprintable() else repr(name), limit=400)


def in_words(point: Iterable[float]) -> str:
    """Coordinates as text for a sentence, such as [0.45, -0.05, 0]."""
    return "[" + ", ".join(f"{coordinate:g}" for coordinate in point) + "]"


class Unreachable(DeltaOptError):
    """A point is outside the workspace, or outside the industrial assembly mode.

    ``points``: indices of all such points among those that were asked for, the first of which the
    message names; empty where no array of points was.

    Examples:
        >>> model = deltaopt.DeltaModel(deltaopt.load_robot("problems/robots/orsino.yaml"))
        >>> try:
        ...     model.inverse_kinematics([(0.45, 0.0, 0.0), (2.0, 0.0, 0.0)])
        ... except deltaopt.Unreachable as error:
        ...     print([int(point) for point in error.points])
        [1]
    """

    def __init__(self, message: str, points: Sequence[int] | NDArray[np.intp] = ()) -> None:
        super().__init__(message, points)  # as passed: copies and pickles
        self.points = _indices(points)

    def __str__(self) -> str:
        return str(self.args[0])


def _indices(points: Sequence[int] | NDArray[np.intp]) -> NDArray[np.intp]:
    import numpy as np

    return np.asarray(points, dtype=np.intp)


class Singularity(Enum):
    """The kinds of singular positions of a Delta; the values name what is zero in them."""

    SIDEWAYS = "cos q_k3"
    IN_LINE = "sin(q_k1 - q_k2)"
    PARALLEL = "volume spanned by the directions of the bars"


_SENTENCES = {
    Singularity.SIDEWAYS: "the bars of chain {chain} lie sideways, serial singularity",
    Singularity.IN_LINE: "arm and bars of chain {chain} are in line, serial singularity",
    Singularity.PARALLEL: "all bars lie in one plane, parallel singularity",
}


class Singular(DeltaOptError):
    """A position so close to a singularity that a result does not exist or has too few digits.

    ``kind``: of the singularity. ``chain``: 1 to 3; None for a parallel singularity, which concerns
    all three. ``margin``: the quantity that is zero in the singularity. ``place``: the first point,
    in words. ``points``: indices of all such points among those that were asked for.

    Examples:
        >>> issubclass(deltaopt.Singular, deltaopt.DeltaOptError)
        True
    """

    def __init__(
        self,
        kind: Singularity,
        chain: int | None,
        margin: float,
        place: str,
        points: Sequence[int] | NDArray[np.intp] = (),
    ) -> None:
        super().__init__(kind, chain, margin, place, points)  # as passed: copies and pickles
        self.points = _indices(points)
        self.kind, self.chain, self.margin, self.place = kind, chain, margin, place

    def __str__(self) -> str:
        sentence = _SENTENCES[self.kind].format(chain=self.chain)
        zero = self.kind.value.replace("_k", f"_{self.chain}")
        return f"{self.place}: {sentence} ({zero} = {self.margin:.1e})"


class Infeasible(DeltaOptError):
    """No motion can exist, for instance because gravity exceeds a torque limit at the start.

    Examples:
        >>> weak = deltaopt.load_scene("problems/pick_and_place.yaml").model_copy(
        ...     update={"limits": deltaopt.Limits(torque=0.1)}
        ... )
        >>> try:
        ...     deltaopt.plan(weak)
        ... except deltaopt.Infeasible:
        ...     print("gravity is more than the motors can hold")
        gravity is more than the motors can hold
    """


class NotConverged(DeltaOptError):
    """A solver stopped without a solution.

    ``status``: the solver's. ``iterate``: where it stopped: the variables of the program or a
    trajectory.

    Examples:
        >>> try:
        ...     plan = deltaopt.plan(deltaopt.load_scene("problems/pick_and_place.yaml"))
        ... except deltaopt.NotConverged as error:
        ...     print(error.status)
    """

    def __init__(self, message: str, status: str, iterate: object) -> None:
        super().__init__(message, status, iterate)  # as passed: copies and pickles
        self.status, self.iterate = status, iterate

    def __str__(self) -> str:
        return str(self.args[0])


class EndMoves(DeltaOptError):
    """What is for motions from rest at one point to rest at another was asked of another one.

    Examples:
        >>> issubclass(deltaopt.EndMoves, deltaopt.DeltaOptError)
        True
    """


RULED_OUT = (Unreachable, Singular, Infeasible)
"""What rules a motion out: where it leads, or a limit."""
ENDS_AN_ATTEMPT = (NotConverged, Unreachable, Singular)
"""What may go wrong with an iterate: it ends the attempt from one first motion, not the plan."""
NO_PLAN = (NotConverged, *RULED_OUT)
"""What is raised where no plan is found for what was asked."""
_LOG = logging.getLogger("deltaopt.planning")
Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


def if_possible(
    expected: tuple[type[DeltaOptError], ...],
    make: Callable[Parameters, Result],
    *arguments: Parameters.args,
    **options: Parameters.kwargs,
) -> Result | None:
    """What ``make`` returns for these arguments; None where it raises an error that is ``expected``
    of one possibility among several, which is told with ``-vv``. Others it lets through."""
    try:
        return make(*arguments, **options)
    except expected as error:
        _LOG.debug("set aside: %s", error)
        return None


class Inexpressible(DeltaOptError):
    """A robot has something that another program's format, or a study, has no word for.

    Examples:
        >>> issubclass(deltaopt.Inexpressible, deltaopt.DeltaOptError)
        True
    """


class MissingPackage(DeltaOptError):
    """An optional package is not installed.

    Examples:
        >>> issubclass(deltaopt.MissingPackage, deltaopt.DeltaOptError)
        True
    """


def installed(package: str, extra: str) -> Any:
    """A module that only one of this package's extras installs. Raises MissingPackage."""
    try:
        return import_module(package)
    except ImportError:
        raise MissingPackage(f"{package} is not installed: {how_to_install(extra)}") from None


def how_to_install(extra: str) -> str:
    """What installs an extra: in a clone, and where a wheel is installed."""
    return (
        f"pip install -e '.[{extra}]' in the clone, or pip install 'deltaopt[{extra}]' with a wheel"
    )
