"""Maps of a cell: one move at many places, or many random moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import Infeasible
from deltaopt.files.yaml_file import read_yaml
from deltaopt.robot.robot import load_robot
from deltaopt.scene.feasibility import are_surely_feasible
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import made_of
from deltaopt.sensitivity.keys import PLACE, Content, content_of, ends_of
from deltaopt.sweeps.points import Base, SweepPoints
from deltaopt.sweeps.sweep_file import Samples, base_of

ENDS = tuple(f"{end}.{axis}" for end in ("start", "goal") for axis in range(3))
"""Columns of random moves."""
_USUAL: Content = {
    "payload": 1.0,
    "start": [0.0, -0.1525, 0.0],
    "goal": [0.0, 0.1525, 0.0],
    "approach": {end: {"height": 0.025, "radius": 0.005} for end in ("start", "goal")},
}
"""The usual test cycle of packaging robots, 25 mm up, 305 mm across, 25 mm down, with 1 kg."""
_OF_ONE_MOVE = ("via", "approach", "path", "tube")
"""Keys of a scene that random moves do not have."""
_STEPS, _DEPTHS = (3, 9, 9), (0.1, 0.9)
"""How many places there are along each axis, and between which shares of the depths that the middle
can have below the base's, where no range is given."""
_DIGITS = 6
"""Of places, m."""
_LOOKED = 25
"""Places along each axis that are looked at for the region in which a move can be."""
_DRAWN = 32
"""Random moves that are drawn for each that is asked for: some are out of reach."""

Range = Sequence[float]
"""One place along an axis, m, or the first and the last, and how many there are; empty for all that
is possible."""


@dataclass(frozen=True)
class Cell:
    """A robot with a move or a cycle. ``base``: its content and file."""

    base: Base

    def places(self, x: Range = (), y: Range = (), z: Range = ()) -> SweepPoints:
        """The move with its middle at the places of a grid: in ranges, and where an axis has none,
        in the region in which its ends can be. Raises Infeasible if there is none."""
        middles = self._region(ends_of(self.base.content))
        below = middles[(middles[:, 1:] == 0).all(axis=1)]
        high, low = np.quantile((below if len(below) else middles)[:, 0], _DEPTHS)
        middles = middles[(middles[:, 0] >= high) & (middles[:, 0] <= low)]
        usual = np.array([middles.min(axis=0), middles.max(axis=0), _STEPS]).T
        axes = []
        for axis, given, (least, most, steps) in zip(PLACE, (x, y, z), usual.tolist(), strict=True):
            first, *rest = given or (least, most)
            last, number = (*rest, steps)[:2] if rest else (first, 1)
            values = np.linspace(first, last, int(number)).round(_DIGITS) + 0.0
            axes.append([{axis: value} for value in values.tolist()])
        return SweepPoints([self.base], axes, PLACE)

    def moves(
        self, number: int, x: Range = (), y: Range = (), z: Range = (), seed: int = 1
    ) -> SweepPoints:
        """Random moves between points in a region at which the robot can be at rest; those of a
        cycle with all that its first leg has, but for its way.

        Raises Infeasible if there are hardly any, and MissingPackage without scipy.
        """
        content = {k: v for k, v in content_of(self._first).items() if k not in _OF_ONE_MOVE}
        content |= {"start": [0.0, 0.0, 0.0], "goal": [1.0, 0.0, 0.0]}
        region = self._region(np.zeros((1, 3)))
        whole = np.array([region.min(axis=0), region.max(axis=0)]).T.tolist()
        sides = [given or ends for given, ends in zip((x, y, z), whole, strict=True)]
        named = zip(ENDS, 2 * sides, strict=True)
        ranges = {name: {"from": least, "to": most} for name, (least, most, *_) in named}
        drawn = Samples(ranges=ranges, number=_DRAWN * number, seed=seed).drawn
        points = np.array([[*each.values()] for each in drawn])
        sure = are_surely_feasible(self._scene, points.reshape(-1, 3)).reshape(-1, 2)
        possible = [each for each, can_be in zip(drawn, sure, strict=True) if can_be.all()][:number]
        if len(possible) < number:
            raise Infeasible(
                f"of {len(drawn)} random moves only {len(possible)} begin and end where the robot "
                "can be at rest; a smaller region would do"
            )
        return SweepPoints([Base(self.base.name, self.base.file, content)], [possible], ENDS)

    @property
    def _first(self) -> Scene:
        """The move, or the first one of the cycle."""
        found = made_of(self.base.content, self.base.file)
        return found if isinstance(found, Scene) else found.legs[0]

    @property
    def _scene(self) -> Scene:
        """The robot with its first payload, and nothing in its way."""
        first, start, goal = self._first, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)
        return Scene(robot=first.robot, payload=first.payload, start=start, goal=goal)

    def _region(self, ends: Array) -> Array:
        """The places, (N, 3), m, at which the middle of points, (M, 3), can be for the robot to be
        at rest at all of them. Raises Infeasible."""
        scene = self._scene
        far = scene.robot.farthest
        sides = [np.linspace(least, far, _LOOKED) for least in (0.0, -far, -far)]
        middles = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 3)
        away = ends - ends.mean(axis=0)
        can_be = [are_surely_feasible(scene, middles + each) for each in away]
        found = middles[np.all(can_be, axis=0)]
        if not len(found):
            raise Infeasible(f"{self.base.file}: the robot can be at rest at all ends nowhere")
        return found


def load_cell(path: str | Path) -> Cell:
    """The cell of the file of a scene, of a cycle, or of a robot, which then has the usual test
    cycle of packaging robots. Raises SceneError, naming file and key.

    Examples:
        >>> cell = deltaopt.load_cell("problems/robots/hornet_565.yaml")
        >>> len(cell.places(x=(0.5, 0.9, 9), y=[0.0], z=[0.0]))
        9
    """
    file = Path(path)
    content = read_yaml(file)
    if "drive" in content and "robot" not in content:
        load_robot(file)
        return Cell(Base({"scene": file.name}, file, {"robot": content, **_USUAL}))
    return Cell(base_of(file.parent, file.name, None))
