"""Seeded random moves between points of a robot's workspace.

The workspace is where all chains close in the industrial assembly mode, at a distance from
every kind of singularity, measured without dimension: cos q_{k,3} and sin(q_{k,1} - q_{k,2})
(serial), the volume spanned by the three bars' directions (parallel), and that of the normals
of the three parallelograms (the platform could tilt, which twelve coordinates cannot see).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import compress, islice
from math import inf

import numpy as np

from deltaopt.codegen.vectorised import evaluate_rows
from deltaopt.curves.piecewise import Array
from deltaopt.errors import DeltaOptError, Infeasible, Unreachable
from deltaopt.files.validated_record import Vector3, vector3
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import Robot
from deltaopt.scene.feasibility import are_surely_feasible, check_feasible
from deltaopt.scene.links import LinkGeometry
from deltaopt.scene.scene import Scene

MARGIN = 0.1
"""Least distance from every singularity, where 1 is the best there is: a tenth leaves out the edge
of the workspace, which tests/planning/test_edge.py looks at."""
_BATCH = 4096
_MOST_BATCHES = 1000
"""Batches in a row without a point in the workspace, before the search for points ends."""
_MOST_MOVES = 500
"""Moves in a row that are not possible, before points are tried one by one; and then points, before
the search ends. Where one point in ten is possible, as with narrow ranges of joints, one pair in a
hundred is; a robot that can be at one point in fifty is given up once in 25 000 moves."""


def random_scenes(robot: Robot, payload: float | None, number: int, seed: int) -> Iterator[Scene]:
    """Yield moves between points drawn uniformly from the workspace, at both of which the motors
    can hold the platform against gravity.

    Raises Infeasible if hardly any points are in the workspace or hardly any moves are possible.
    """
    rng = np.random.default_rng(seed)
    points = _random_points(DeltaModel(robot, payload), rng)
    refused = 0
    while number:
        start, goal = next(points), next(points)
        scene = Scene(robot=robot, payload=payload, start=start, goal=goal)
        error = _refusal(scene)
        if error is None:
            number, refused = number - 1, 0
            yield scene
            continue
        refused += 1
        if refused == _MOST_MOVES:
            points = _possible_points(scene, points, error)
        if refused == 2 * _MOST_MOVES:
            raise Infeasible(
                f"{robot.name}: of {_MOST_MOVES} random moves in a row between possible points "
                f"none is possible; of the last, {error}"
            )


def _random_points(model: DeltaModel, rng: np.random.Generator) -> Iterator[Vector3]:
    """Yield points of the workspace; raises Infeasible if hardly any are in it."""
    points = np.empty((0, 3))
    while True:
        for _ in range(_MOST_BATCHES):
            if len(points) >= 2:
                break
            points = np.concatenate([points, points_in_workspace(model, rng)])
        else:
            raise Infeasible(
                f"{model.robot.name}: no moves were found, for of {_MOST_BATCHES * _BATCH} random "
                "points not even two are in the workspace"
            )
        yield from map(vector3, points[: len(points) // 2 * 2])
        points = points[len(points) // 2 * 2 :]


def _possible_points(
    scene: Scene, points: Iterator[Vector3], error: DeltaOptError
) -> Iterator[Vector3]:
    """Of some points those at which the robot of a scene can be at rest with room to spare; raises
    Infeasible where it hardly can anywhere. ``error``: of the last move that was not possible."""
    while True:
        some = list(islice(points, _MOST_MOVES))
        kept = are_surely_feasible(scene, np.array(some))
        if not kept.any():
            raise Infeasible(
                f"{scene.robot.name}: none of {_MOST_MOVES} random moves in a row, and of as many "
                f"points after them, is possible; of the last, {error}"
            )
        yield from compress(some, kept)


def _refusal(scene: Scene) -> DeltaOptError | None:
    """Why a move is not possible; None if nothing speaks against it."""
    try:
        check_feasible(scene)
    except (Unreachable, Infeasible) as error:
        return error
    return None


def points_in_workspace(
    model: DeltaModel, rng: np.random.Generator, least: float | None = None, most: float = inf
) -> Array:
    """Draw a batch of points in a box around the workspace, and return those in it, (n, 3).

    ``least``, ``most``: between which their distance from the nearest singularity lies; ``MARGIN``
    at least if it is not given.
    """
    least = MARGIN if least is None else least
    reach = model.robot.upper_arm.length + model.robot.forearm.length
    box = rng.uniform([0, -reach, -reach], reach, size=(_BATCH, 3)) + model.robot.tool_offset
    serial = evaluate_rows(model.functions.serial_distances, box, parameters=model.parameters)[0]
    closes = (serial > least**2).all(axis=1)
    # The sign is that of the assembly mode: beyond it lies another one, past a singularity.
    volumes = singular_volumes(model, box[closes]) * np.array([1.0, -1.0])
    nearest = np.minimum(np.sqrt(serial[closes]).min(axis=1), volumes.min(axis=1))
    kept: Array = box[closes][(nearest > least) & (nearest < most)]
    return kept


def singular_volumes(model: DeltaModel, x: Array) -> Array:
    """Return the volumes that the bars' directions and the parallelograms' normals span, (N, 2)."""
    links = LinkGeometry(model.robot, x, model.inverse_kinematics(x)[:, 3::3])
    bars = (links.pins - links.elbows) / links.forearm
    normals = np.cross(bars, np.cross(links.elbows - links.shafts, links.ahead))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    return np.stack([np.linalg.det(bars), np.linalg.det(normals)], axis=1)


def farthest_apart(points: Array) -> tuple[Vector3, Vector3] | None:
    """The two of some points, (n, 3), that are farthest apart; None of fewer than two."""
    if len(points) < 2:
        return None
    apart = np.linalg.norm(points[:, None] - points, axis=2)
    i, j = np.unravel_index(apart.argmax(), apart.shape)
    (a, b, c), (d, e, f) = points[i].tolist(), points[j].tolist()
    return (a, b, c), (d, e, f)
