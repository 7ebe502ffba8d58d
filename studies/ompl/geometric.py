"""Geometric paths of the tool among boxes, by planners of OMPL.

A state is the place of the tool's point; a motion is a straight line, which surely keeps clear of
the bodies (clear.c, machine code) and stays where the platform can be held at rest.
"""

from __future__ import annotations

import ctypes
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from deltaopt.codegen.compile import library
from deltaopt.curves.piecewise import Array
from deltaopt.errors import DeltaOptError, installed
from deltaopt.robot.robot import as_delta
from deltaopt.scene.feasibility import room_at_rest
from deltaopt.scene.scene import Scene

_SPACING, _NO_ROOM = 0.01, -0.01
"""m, of a lattice of places; and the room at rest that stands where the platform cannot be at all:
so little that between a place where it can be and one where it cannot the border is not moved far.
"""
_LONGER = 3
"""How many times as long a planner goes on where it has no path yet."""
_RANGE = 0.2
"""m, longest step of RRTConnect; BIT* keeps its own settings."""


class Clear:
    """Whether polylines, (n, 3), m, are clear of a scene's boxes, by a ``margin`` (m) more than is
    asked for where they are far from start and goal. Raises DeltaOptError without a C compiler."""

    def __init__(self, scene: Scene, margin: float = 0.0) -> None:
        boxes = [body.box for body in scene.keep_out or () if body.box]
        tool, self.ends = scene.robot.tool, np.array(scene.given_points)
        kept = [(tool.radius or 0.0 if tool else 0.0) + scene.least_clearance, margin]
        sizes = [[*box.centre, *box.half] for box in boxes]
        self._scene = np.concatenate([kept, self.ends.ravel(), np.ravel(sizes)])
        self.lattice, self._rest = _rest(scene)
        others = [each.ctypes.data for each in (self._scene, self._rest, self.lattice)]
        self._given = others[0], len(boxes), *others[1:]

    def __call__(self, points: Array) -> bool:
        return self.at(np.ascontiguousarray(points).ctypes.data, len(points))

    def at(self, address: int, count: int) -> bool:
        """Of so many points in memory."""
        return bool(_code()(address, count, *self._given))


@lru_cache(maxsize=1)
def _code() -> Any:
    built = library(Path(__file__).with_name("clear.c").read_text(encoding="utf-8"))
    if built is None:
        raise DeltaOptError("a C compiler is needed")
    code, pointer = ctypes.CDLL(str(built)).is_clear, ctypes.c_void_p
    code.argtypes = [pointer, ctypes.c_long, pointer, ctypes.c_long, pointer, pointer]
    return code


_LATTICES: dict[tuple[str, float | None], tuple[Array, Any]] = {}


def _rest(scene: Scene) -> tuple[Array, Any]:
    """The lattice of a robot and a payload: its first place, spacing and sizes, (7,), and the room
    that the platform has at rest at each of its places; made once, as it would be for a cell."""
    key = scene.robot.name, scene.payload
    if key not in _LATTICES:
        alone = scene.model_copy(update={"keep_out": None, "clearance": None})
        reach = as_delta(scene.robot).upper_arm.length + as_delta(scene.robot).forearm.length
        axes = [np.arange(low, reach, _SPACING) for low in (0.0, -reach, -reach)]
        places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        rest = np.array([room_at_rest(alone, layer.reshape(-1, 3)) for layer in places])
        lattice = np.array([0.0, -reach, -reach, _SPACING, *map(len, axes)])
        _LATTICES[key] = lattice, np.maximum(rest, _NO_ROOM).astype(np.float32)
    return _LATTICES[key]


def path_of(clear: Clear, planner: str, seed: int, most: int) -> Array | None:
    """The corners, (n, 3), m, of a planner's path after at most so many checks of places and lines,
    simplified; None if it has none after ``_LONGER`` times as many."""
    ompl = installed("ompl", "ompl")
    base, geometric, counted, two = ompl.base, ompl.geometric, [0], (ctypes.c_double * 6)()
    ompl.util.setLogLevel(ompl.util.LogLevel.LOG_NONE)
    ompl.util.RNG.setSeed(seed)
    space, bounds = base.RealVectorStateSpace(3), base.RealVectorBounds(3)
    for i, (low, size) in enumerate(zip(clear.lattice[:3], clear.lattice[4:], strict=True)):
        bounds.setLow(i, low)
        bounds.setHigh(i, low + _SPACING * (size - 1))
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    information, address = setup.getSpaceInformation(), ctypes.addressof(two)

    def is_clear(*states: Any) -> bool:
        counted[0] += 1
        two[: 3 * len(states)] = [state[i] for state in states for i in range(3)]
        return clear.at(address, len(states))

    lines = type("Lines", (base.MotionValidator,), {"checkMotion": lambda _, *two: is_clear(*two)})
    setup.setStateValidityChecker(is_clear)
    information.setMotionValidator(lines(information))
    ends = [space.allocState() for _ in clear.ends]
    for state, place in zip(ends, clear.ends, strict=True):
        for i in range(3):
            state[i] = place[i]
    setup.setStartAndGoalStates(*ends)
    chosen = getattr(geometric, planner)(information)
    if hasattr(chosen, "setRange"):
        chosen.setRange(_RANGE)
    setup.setPlanner(chosen)
    for last in range(most, _LONGER * most + 1, most):
        setup.solve(base.PlannerTerminationCondition(lambda last=last: counted[0] > last))
        if setup.haveExactSolutionPath():
            path = setup.getSolutionPath()
            geometric.PathSimplifier(information).simplifyMax(path)
            return np.array([[state[i] for i in range(3)] for state in path.getStates()])
    return None
