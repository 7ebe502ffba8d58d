"""Given paths: curves from start to goal that a motion follows exactly, as piecewise polynomials.

In a scene file a path is a word or a mapping:

    path: line                                          # the straight line from start to goal
    path: {points: [[0.42, 0.0, 0.05]], blend: 0.02}    # through these points, corners rounded
    path: {points: corners.csv, blend: 0.02}            # the same from a file, a point on each line
    path: {pick_and_place: {height: 0.025, blend: 0.02}}  # up, across, down
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path as File
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BeforeValidator, Field, PlainSerializer

from deltaopt.curves.nodes import gauss
from deltaopt.curves.piecewise import Array, Index, PiecewisePolynomial, shifted
from deltaopt.curves.standing import slowest_onwards
from deltaopt.errors import SceneError, in_words, inside
from deltaopt.files.csv_table import WrongCsv, read_csv
from deltaopt.files.units import LENGTH, SPEED, WIDTH
from deltaopt.files.validated_record import NonNegative, Number, Positive, Record, Triple, Vector3

_Points = Annotated[tuple[Triple, ...], LENGTH]
_Speeds = Annotated[tuple[NonNegative, NonNegative], SPEED]
_Width = Annotated[Positive, WIDTH]

EXPECTED_PATH = (
    "the word line, {points: [[x, y, z], …] or a CSV file, blend: …} or "
    "{pick_and_place: {height: …, blend: …}}, lengths in m"
)
_POINTS = "points [x, y, z] in m between start and goal, each other than the one before"
_BLEND = "a distance in m before a corner where its rounding begins, greater than 0"
_SPEEDS = "speeds along the path at its start and its goal, m/s, two numbers of at least 0"
_SAME_PLACE = 1e-9
"""Of the length of a path: closer points are one. A curve must begin at the scene's start and end
at its goal to this, which is rounding."""
_LIKE_THE_FUNCTION = 1e-12
"""Of its largest coordinate: how closely quintic pieces must follow a given function."""
_MOST_PIECES = 4096
_STANDING = 1e-3
"""Of its largest rate by its parameter, below which a curve is refused: where meshes in s hardly
move they tell less than what a motion loses."""
_LARGEST_CSV = 1
"""Largest size of a file of points, MB: some ten thousand."""
_REVERSED = -1 + 1e-9
"""Cosine of the turn at a corner below which the path goes back: it stands still in the middle of
the rounding, which must be a knot, for nothing accelerates along the path there."""


@dataclass(frozen=True, eq=False)
class Path(PiecewisePolynomial):
    """A curve p(s), (3,), m, made of polynomials in its parameter s.

    The unit of s is free: m if s is the length.
    """

    def __call__(self, s: ArrayLike, order: int = 0) -> Array:
        """p or its derivative of an order, (N, 3), at parameters s, (N,); at a knot where the
        derivative jumps it is that of the piece that begins there, if any."""
        return self.at(s, order)

    def with_derivatives(self, pieces: Index, since: Array) -> tuple[Array, Array, Array]:
        """p, dp/ds and d²p/ds², (N, 3) each, in given pieces at s since they began, (N,)."""
        powers = np.vander(since, self.coefficients.shape[1], increasing=True)
        values = np.einsum("np,npc->nc", powers, self.stacked[pieces])
        return values[:, :3], values[:, 3:6], values[:, 6:]

    @cached_property
    def stacked(self) -> Array:
        """Coefficients of p and its first two derivatives, side by side, (K, d + 1, 9)."""
        stacked = np.zeros((*self.coefficients.shape[:2], 9))
        for order, own in enumerate(self._derivatives[:3]):
            stacked[:, : own.shape[1], 3 * order : 3 * order + 3] = own
        return stacked

    @property
    def over_shares(self) -> Array:
        """Coefficients of the ascending powers of shares, from 0 to 1, of each piece,
        (K, d + 1, 3)."""
        powers = np.vander(np.diff(self.knots), self.coefficients.shape[1], increasing=True)
        return np.asarray(self.coefficients * powers[:, :, None])

    @property
    def ends(self) -> Array:
        """p at its begin and its end, (2, 3), m."""
        return self(self.knots[[0, -1]])

    @property
    def end_speeds(self) -> Array:
        """‖dp/ds‖ at the begin and the end, (2,), m per unit of s."""
        return np.asarray(np.linalg.norm(self(self.knots[[0, -1]], 1), axis=1))

    @cached_property
    def length(self) -> float:
        """Its length, m, to about 1e-9 of it."""
        shares, weights = gauss(12)
        rates = np.linalg.norm(self.inside(*self.everywhere(shares), 1), axis=1)
        return float((rates.reshape(-1, len(shares)) @ weights) @ np.diff(self.knots))


class GivenPath(Record):
    """What all kinds of path have: ``speeds`` along it at start and goal, m/s, 0 for at rest."""

    speeds: _Speeds = Field(default=(0.0, 0.0), description=_SPEEDS)

    @abstractmethod
    def between(self, start: Vector3, goal: Vector3) -> Path:
        """The curve from start to goal, m. Raises SceneError where there is none."""

    @property
    @abstractmethod
    def description(self) -> str:
        """The path in words."""


class Line(GivenPath):
    """The straight line from start to goal.

    Examples:
        >>> scene = deltaopt.load_scene("problems/pick_and_place.yaml")
        >>> on_line = scene.model_copy(update={"path": deltaopt.Line()})
        >>> round(deltaopt.plan(on_line).duration, 3)
        0.144
    """

    def between(self, start: Vector3, goal: Vector3) -> Path:
        return _through(np.array([start, goal]), [])

    @property
    def description(self) -> str:
        return "on the straight line"


class Corners(GivenPath):
    """Straight legs from start through ``points`` (m) to goal, rounded at the points.

    ``blend``: the distance (m) before a corner where its rounding begins, the same behind it. Two
    roundings on a leg must not overlap. Without it only three points or more on a line make sense.

    Examples:
        >>> path = deltaopt.Corners(points=[(0.42, 0.0, 0.05)], blend="20 mm")
        >>> path.blend
        0.02
    """

    points: _Points = Field(description=_POINTS, min_length=1)
    blend: _Width = Field(description=_BLEND)

    def between(self, start: Vector3, goal: Vector3) -> Path:
        corners = np.array([start, *self.points, goal])
        return _rounded(corners, self.blend, "path.blend", "path.points")

    @property
    def description(self) -> str:
        return f"through {len(self.points)} points, corners rounded from {self.blend:g} m on"


class PickAndPlace(GivenPath):
    """Up by ``height`` (m) above the higher end, across, and down, corners rounded by ``blend``.

    Examples:
        >>> path = deltaopt.PickAndPlace(height="25 mm", blend="20 mm")
        >>> path.height
        0.025
    """

    height: _Width = Field(description="a height in m above the higher end, greater than 0")
    blend: _Width = Field(description=_BLEND)

    def between(self, start: Vector3, goal: Vector3) -> Path:
        top = min(start[0], goal[0]) - self.height  # x points down
        corners = np.array([start, (top, *start[1:]), (top, *goal[1:]), goal])
        return _rounded(corners, self.blend, "path.pick_and_place.blend", "goal")

    @property
    def description(self) -> str:
        return f"up {self.height:g} m, across and down, corners rounded from {self.blend:g} m on"


class Curve(GivenPath):
    """A curve given by values and derivatives at increasing parameters ``s``, (N,).

    ``x``, ``dx``, ``ddx``: p, dp/ds, d²p/ds² there, (N, 3) each; between them it is the quintic
    that has these values, so that the curve is C². ``Curve.of`` makes one from functions. A place
    where dp/ds = 0, as where it turns back, must be among the parameters; where it goes on in the
    same direction |dp/ds| is at least 0.001 of its largest.

    Examples:
        >>> import numpy as np
        >>> curve = deltaopt.Curve(
        ...     s=np.array([0.0, 0.1]),
        ...     x=np.array([[0.45, 0.0, 0.0], [0.45, 0.1, 0.0]]),
        ...     dx=np.array([[0.0, 1.0, 0.0]] * 2),
        ...     ddx=np.zeros((2, 3)),
        ... )
        >>> len(curve.x)
        2
    """

    s: tuple[Number, ...] = Field(description="increasing parameters, two or more", min_length=2)
    x: _Points = Field(description="a point in m for each s")
    dx: tuple[Triple, ...] = Field(description="dx/ds for each s")
    ddx: tuple[Triple, ...] = Field(description="d²x/ds² for each s")

    @classmethod
    def _read(cls, content: dict[str, Any]) -> dict[str, Any]:
        """Arrays of numbers as tuples."""
        return {
            key: value.tolist() if isinstance(value, np.ndarray) else value
            for key, value in content.items()
        }

    def require_consistent(self) -> None:
        if not (np.diff(self.s) > 0).all():
            raise SceneError(None, "s", self.s, "increasing parameters")
        for name in ("x", "dx", "ddx"):
            rows = getattr(self, name)
            if len(rows) != len(self.s):
                raise SceneError(None, name, len(rows), f"{len(self.s)} rows, as many as s has")
        s, share = slowest_onwards(self._path)
        if share < _STANDING:
            expected = f"{_STANDING:g} at least: a parameter that grows about as the length does"
            found = f"has a |dp/ds| at s = {s:.6g} that is {share:.3g} of its largest"
            raise SceneError(None, "path", None, expected, found)

    @property
    def _path(self) -> Path:
        return Path.hermite(
            *(np.array(each, dtype=float) for each in (self.s, self.x, self.dx, self.ddx))
        )

    @classmethod
    def of(
        cls,
        function: Callable[[Array, int], ArrayLike],
        begin: float,
        end: float,
        *,
        knots: ArrayLike = (),
        speeds: tuple[float, float] = (0.0, 0.0),
    ) -> Curve:
        """The curve of a function from s = ``begin`` to ``end``.

        ``function``: (s (N,), order) -> p, dp/ds or d²p/ds² of order 0, 1 or 2, (N, 3). ``knots``:
        parameters between where higher derivatives jump or dp/ds = 0. Pieces are halved until they
        follow the function to 1e-12 of its largest coordinate. Raises SceneError where 4096 pieces
        do not.
        """
        s = np.unique([begin, *np.asarray(knots, dtype=float).ravel().tolist(), end])
        if len(s) < 2:
            raise SceneError(None, "path", [begin, end], "begin before end")
        while True:
            x, dx, ddx = (np.asarray(function(s, order), dtype=float) for order in range(3))
            middles = (s[:-1] + s[1:]) / 2
            away = Path.hermite(s, x, dx, ddx).at(middles) - np.asarray(
                function(middles, 0), dtype=float
            )
            rough = np.linalg.norm(away, axis=1) > _LIKE_THE_FUNCTION * np.abs(x).max()
            if not rough.any():
                arrays = {"s": s, "x": x, "dx": dx, "ddx": ddx}
                return cls.model_validate({**arrays, "speeds": speeds})
            if len(s) + rough.sum() > _MOST_PIECES:
                raise SceneError(
                    None,
                    "path",
                    "a function",
                    "a smooth function with its own derivatives",
                    f"is a function that {_MOST_PIECES} quintic pieces do not follow",
                )
            s = np.sort(np.concatenate([s, middles[rough]]))

    def between(self, start: Vector3, goal: Vector3) -> Path:
        path = self._path
        for key, end, found in (("start", start, self.x[0]), ("goal", goal, self.x[-1])):
            if np.linalg.norm(np.subtract(end, found)) > _SAME_PLACE * path.length:
                raise SceneError(None, key, end, f"where the curve of path has it, {list(found)} m")
        return path

    @property
    def description(self) -> str:
        return f"on a curve of {len(self.s) - 1} pieces"


def path_in(value: object) -> object:
    """What stands under the key ``path`` as a path; unchanged if it is none of the known forms.

    Raises SceneError for a mapping with a wrong key or value.
    """
    if not isinstance(value, dict):
        return Line() if isinstance(value, str) and value == "line" else value
    if "pick_and_place" in value:
        inner = value["pick_and_place"]
        others = {key: each for key, each in value.items() if key != "pick_and_place"}
        if not isinstance(inner, dict):
            raise SceneError(None, "pick_and_place", inner, "{height: …, blend: …} in m")
        with inside(key="pick_and_place"):
            own = PickAndPlace.model_validate(inner)
        return own.model_copy(update=others)
    for kind in (Corners, Curve):
        if any(key in value for key in kind.model_fields if key != "speeds"):
            return kind.model_validate(value)
    return Line.model_validate(value) if set(value) == {"speeds"} else value


def _content_of(path: GivenPath) -> object:
    """The inverse of ``path_in``."""
    content = path.model_dump(mode="json", exclude_defaults=True)
    if isinstance(path, PickAndPlace):
        speeds = {"speeds": content.pop("speeds")} if "speeds" in content else {}
        return {"pick_and_place": content, **speeds}
    return content or "line"


AnyPath = Annotated[
    Line | Corners | PickAndPlace | Curve, BeforeValidator(path_in), PlainSerializer(_content_of)
]


def points_in(file: File) -> list[list[float]]:
    """The points of a CSV file, m: three columns, which a first line may name x, y and z.

    Raises SceneError where it has none.
    """
    expected = "a CSV file with x, y, z in m on each line"
    try:
        table = read_csv(file, _LARGEST_CSV)
        points: list[list[float]] = table.columns("xyz").tolist()
        if not points or set(table.names) > set("xyz"):
            raise WrongCsv("has no points" if not points else "has columns besides x, y, z")
    except WrongCsv as error:
        raise SceneError(None, "path.points", str(file), f"{expected} ({error})") from None
    return points


def _rounded(corners: Array, blend: float, blend_key: str, points_key: str) -> Path:
    """Straight legs through corners, (n, 3), m, with every inner corner rounded.

    Raises SceneError where a leg has no length or two roundings overlap.
    """
    lengths = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    if lengths.min() <= _SAME_PLACE * lengths.sum():
        problem = f"leads through {in_words(corners[lengths.argmin()])} m twice in a row"
        raise SceneError(None, points_key, None, _POINTS, problem)
    used = np.full(len(lengths), 2 * blend)  # an outer leg has one corner
    used[[0, -1]] = blend
    shortest = float((lengths / used).min())
    if shortest < 1:
        most = shortest * blend
        raise SceneError(
            None, blend_key, blend, f"at most {most:.6g} m, so that roundings on a leg do not meet"
        )
    return _through(corners, [blend] * (len(corners) - 2))


def _through(corners: Array, blends: list[float]) -> Path:
    """Legs through corners and a quartic for each inner one, by arc length on the legs.

    In a rounding of parameter length 2 δ the direction turns as p′ = d₀ + (d₁ − d₀) (3 z² − 2 z³)
    with z from 0 to 1: p″ is continuous and zero at both ends, and p gets from δ before the corner
    to δ behind it because the mean of 3 z² − 2 z³ is 1/2.
    """
    ways = np.diff(corners, axis=0)
    lengths = np.linalg.norm(ways, axis=1)
    directions = ways / lengths[:, None]
    pieces, steps = list[Array](), list[float]()

    def add(begin: Array, first: Array, second: Array, length: float) -> None:
        turn, zero = second - first, np.zeros(3)
        pieces.append(np.array([begin, first, zero, turn / length**2, -turn / (2 * length**3)]))
        steps.append(length)

    before = 0.0
    for i, direction in enumerate(directions):
        after = blends[i] if i < len(blends) else 0.0
        left = lengths[i] - before - after
        if left > _SAME_PLACE * lengths[i]:
            add(corners[i] + before * direction, direction, direction, left)
        if after:
            add(corners[i + 1] - after * direction, direction, directions[i + 1], 2 * after)
            if direction @ directions[i + 1] < _REVERSED:
                half, whole = steps.pop() / 2, pieces.pop()  # cut in the middle
                pieces += [whole, shifted(whole, half)]
                steps += [half, half]
        before = after
    knots = np.concatenate([[0.0], np.cumsum(steps)])
    coefficients = np.array(pieces)
    straight = not coefficients[:, 2:].any()
    return Path(knots, coefficients[:, :2] if straight else coefficients)
