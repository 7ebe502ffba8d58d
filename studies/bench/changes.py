"""Changes of random moves into those of a stratum: other drives, limits, paths, bodies, ends.

A change may make a scene that is not possible; another move is drawn then.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.files.validated_record import Vector3, vector3
from deltaopt.robot.drive import Friction
from deltaopt.robot.joints import Joints
from deltaopt.robot.machine import Workspace
from deltaopt.robot.model import delta_model
from deltaopt.robot.robot import as_delta
from deltaopt.robot.tool import Tool
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.links import LinkGeometry
from deltaopt.scene.moving_ends import Anywhere, Belt, State
from deltaopt.scene.objective import TimeAndEffort
from deltaopt.scene.parallel_singularity import distance_from_parallel
from deltaopt.scene.path import Corners, Line, PickAndPlace
from deltaopt.scene.scene import Scene
from deltaopt.scene.way import Approach, ApproachAtEnd, Rotation
from studies.bench.random_scenes import singular_volumes

Change = Callable[[Scene, np.random.Generator], Scene]
"""A change of a random move of a robot into one of a stratum."""


def as_it_is(scene: Scene, rng: np.random.Generator) -> Scene:
    return scene


def with_drive(**of: object) -> Change:
    """Terms of the drive beside those that there are."""

    def change(scene: Scene, rng: np.random.Generator) -> Scene:
        drive = scene.robot.drive.model_copy(update=of)
        return scene.model_copy(update={"robot": scene.robot.model_copy(update={"drive": drive})})

    return change


def strong_motors(scene: Scene, rng: np.random.Generator) -> Scene:
    """Motors with five to twenty times the torque there is."""
    torque = np.multiply(scene.robot.torque_limits, rng.uniform(5.0, 20.0))
    return with_drive(torque=tuple(torque.tolist()))(scene, rng)


def torque_that_holds(share: float) -> Change:
    """Motors that need so much less than their torque to hold both ends."""

    def change(scene: Scene, rng: np.random.Generator) -> Scene:
        ends, rest = np.array(scene.given_points), np.zeros((2, 3))
        model = delta_model(scene.robot, scene.payload)
        needed = float(np.abs(model.inverse_dynamics(ends, rest, rest)).max())
        largest = max(scene.robot.torque_limits)
        torque = share * needed if needed > 1e-9 * largest else 1e-4 * largest
        return with_drive(torque=torque)(scene, rng)

    return change


def _speed(scene: Scene) -> float:
    """A speed of the motors, rad/s: their limit, or a usual one."""
    limits = scene.robot.speed_limits
    return 10.0 if limits is None else min(limits)


def slow_motors(scene: Scene, rng: np.random.Generator) -> Scene:
    """Motors whose speed is limited to a hundredth to a third of the usual one."""
    return with_drive(speed=_speed(scene) * 10 ** rng.uniform(-2, -0.5))(scene, rng)


def short(least: float, most: float) -> Change:
    """A goal near the start: away by powers of ten of the upper arm's length, between these."""

    def change(scene: Scene, rng: np.random.Generator) -> Scene:
        size = 10 ** rng.uniform(least, most) * as_delta(scene.robot).upper_arm.length
        goal = np.array(scene.given_points[0]) + size * rng.normal(size=3)
        return scene.model_copy(update={"goal": tuple(goal.tolist())})

    return change


def on_the_axis(scene: Scene, rng: np.random.Generator) -> Scene:
    """Straight up or down on the robot's axis, where all chains are alike."""
    start, goal = ((point[0], 0.0, 0.0) for point in scene.given_points)
    return scene.model_copy(update={"start": start, "goal": goal})


def mirrored(scene: Scene, rng: np.random.Generator) -> Scene:
    """From a point to its mirror image across the plane of the first chain."""
    x, y, z = scene.given_points[0]
    return scene.model_copy(update={"goal": (x, y, -z)})


def friction(scene: Scene, rng: np.random.Generator) -> Scene:
    torque = min(scene.robot.torque_limits)
    friction = Friction(viscous=0.2 * torque / _speed(scene), coulomb=0.1 * torque, speed=0.05)
    return with_drive(friction=friction)(scene, rng)


def heavy_rotors(scene: Scene, rng: np.random.Generator) -> Scene:
    length = as_delta(scene.robot).upper_arm.length
    return with_drive(inertia=as_delta(scene.robot).platform.mass * length**2)(scene, rng)


def limited(**of: float | str) -> Change:
    """Limits of the scene; as a text they are shares of the drive's."""
    return lambda scene, rng: scene.model_copy(update={"limits": dict(of)})


def kept_from_singularity(scene: Scene, rng: np.random.Generator) -> Scene:
    """A distance from the parallel singularity that the ends have, and little more."""
    least = distance_from_parallel(scene) * rng.uniform(0.3, 0.95)
    return scene.model_copy(update={"limits": {"parallel_singularity": least}})


def all_limits(scene: Scene, rng: np.random.Generator) -> Scene:
    """Every limit at once, each such that it may be the one that counts."""
    robot, usual = scene.robot, _usual_speed(scene)
    acceleration = usual**2 / _distance(scene)
    limits = {
        "torque": tuple((0.7 * np.array(robot.torque_limits)).tolist()),
        "speed": rng.uniform(0.2, 1.0) * _speed(scene),
        "platform_speed": rng.uniform(0.1, 1.0) * usual,
        "acceleration": rng.uniform(0.2, 2.0) * acceleration,
        "specific_force": rng.uniform(0.2, 2.0) * acceleration + 9.81,
        "parallel_singularity": rng.uniform(0.1, 0.9) * distance_from_parallel(scene),
    }
    return scene.model_copy(update={"limits": limits})


def joint_ranges(scene: Scene, rng: np.random.Generator) -> Scene:
    """Ranges of arms and ball joints that the ends are in, and little more."""
    model = delta_model(scene.robot, scene.payload)
    q = model.inverse_kinematics(np.array(scene.given_points))
    spare, ball = rng.uniform(0.01, 0.3, size=2)
    arm = float(q[:, 3::3].min() - spare), float(q[:, 3::3].max() + spare)
    largest = min(float(np.abs(q[:, 5::3]).max() + ball), 1.55)
    joints = Joints(arm=arm, ball=largest)
    return scene.model_copy(update={"robot": scene.robot.model_copy(update={"joints": joints})})


def in_a_workspace(scene: Scene, rng: np.random.Generator) -> Scene:
    """A cylinder that the ends are in, and little more."""
    points = np.array(scene.given_points)
    spare = rng.uniform(0.001, 0.2, size=2) * as_delta(scene.robot).upper_arm.length
    depth = float(points[:, 0].min() - spare[0]), float(points[:, 0].max() + spare[0])
    radius = float(np.hypot(points[:, 1], points[:, 2]).max() + spare[1])
    workspace = Workspace(depth=depth, radius=radius)
    robot = scene.robot.model_copy(update={"workspace": workspace})
    return scene.model_copy(update={"robot": robot})


def combined(*changes: Change) -> Change:
    """One change after the other."""

    def change(scene: Scene, rng: np.random.Generator) -> Scene:
        for each in changes:
            scene = each(scene, rng)
        return scene

    return change


def on_a_line(scene: Scene, rng: np.random.Generator) -> Scene:
    return scene.model_copy(update={"path": Line()})


def lifted(scene: Scene, rng: np.random.Generator) -> Scene:
    path = PickAndPlace(height=0.1 * _distance(scene), blend=0.05 * _distance(scene))
    return scene.model_copy(update={"path": path})


def round_a_corner(scene: Scene, rng: np.random.Generator) -> Scene:
    corner = _middle(scene) + _across(scene, rng) * rng.uniform(0.1, 0.5)
    path = Corners(points=(vector3(corner),), blend=0.1 * _distance(scene))
    return scene.model_copy(update={"path": path})


def around_a_sphere(scene: Scene, rng: np.random.Generator) -> Scene:
    """A sphere near the middle of the straight line, which it is in the way of."""
    radius = rng.uniform(0.05, 0.25) * _distance(scene)
    centre = _middle(scene) + rng.uniform(0.0, 0.8) * radius * _unit(_across(scene, rng))
    body = {"sphere": {"centre": centre.tolist(), "radius": radius}}
    return scene.model_copy(update={"keep_out": [body]})


def over_a_wall(scene: Scene, rng: np.random.Generator) -> Scene:
    """A wall across the straight line, from a little above the higher end downwards; x is down."""
    thick, high = rng.uniform(0.1, 0.6), rng.uniform(0.02, 0.2)
    ends, size = np.array(scene.given_points), _distance(scene)
    half = thick / 2 * np.abs(ends[1] - ends[0])
    half[1:][half[1:] < 0.05 * size] = size  # thin in the direction of the move, wide across it
    least, most = _middle(scene) - half, _middle(scene) + half
    least[0], most[0] = ends[:, 0].min() - high * size, ends[:, 0].max() + size
    body = {"box": {"from": least.tolist(), "to": most.tolist()}}
    return scene.model_copy(update={"keep_out": [body]})


def moving(share: float) -> Change:
    """Both ends passed at random speeds up to a share of the usual one."""

    def change(scene: Scene, rng: np.random.Generator) -> Scene:
        start, goal = (_passed(scene, at, share, rng) for at in scene.given_points)
        return scene.model_copy(update={"start": start, "goal": goal})

    return change


def stopping(scene: Scene, rng: np.random.Generator) -> Scene:
    """The fastest stop from a state."""
    start = _passed(scene, scene.given_points[0], 0.3, rng)
    return scene.model_copy(update={"start": start, "goal": Anywhere()})


def to_a_belt(scene: Scene, rng: np.random.Generator) -> Scene:
    """To a point that moves horizontally."""
    velocity = 0.1 * _usual_speed(scene) * rng.uniform() * _unit(rng.normal(size=3) * [0, 1, 1])
    goal = Belt(at=scene.given_points[1], belt=vector3(velocity))
    return scene.model_copy(update={"goal": goal})


def _passed(scene: Scene, at: Vector3, share: float, rng: np.random.Generator) -> State:
    velocity = share * _usual_speed(scene) * rng.uniform() * _unit(rng.normal(size=3))
    return State(at=at, velocity=vector3(velocity))


def range_of_payloads(scene: Scene, rng: np.random.Generator) -> Scene:
    largest = scene.payload or as_delta(scene.robot).platform.mass
    return scene.model_copy(update={"payload": [largest * rng.uniform(0.0, 0.9), largest]})


def falling_torque(scene: Scene, rng: np.random.Generator) -> Scene:
    torque, speed = min(scene.robot.torque_limits), _speed(scene)
    curve = ((0.0, torque), (0.4 * speed, torque), (speed, rng.uniform(0.2, 0.8) * torque))
    return with_drive(torque_curve=curve)(scene, rng)


def through_points(scene: Scene, rng: np.random.Generator) -> Scene:
    """Through one to three points beside the straight line."""
    start, goal = np.array(scene.given_points)
    number = int(rng.integers(1, 4))
    shares = (1 + np.arange(number)) / (1 + number)
    via = tuple(
        vector3(start + share * (goal - start) + rng.uniform(0, 0.3) * _across(scene, rng))
        for share in shares
    )
    return scene.model_copy(update={"via": via})


def near_points(scene: Scene, rng: np.random.Generator) -> Scene:
    """Through spheres about one to three points beside the straight line."""
    through = through_points(scene, rng).task.via
    within = rng.uniform(0.01, 0.2, size=len(through)) * _distance(scene)
    spheres = zip(through, within.tolist(), strict=True)
    via = [{"at": point.position, "within": radius} for point, radius in spheres]
    return scene.model_copy(update={"via": via})


def beside_a_forearm(scene: Scene, rng: np.random.Generator) -> Scene:
    """A sphere near a forearm as it is in the middle of the straight line, which arms and forearms
    keep clear of too."""
    chain = int(rng.integers(3))
    elbow, end = _forearm(scene, chain)
    size = _distance(scene)
    radius = float(rng.uniform(0.02, 0.1)) * size
    away = rng.uniform(0.0, 1.5) * radius * _unit(np.cross(end - elbow, rng.normal(size=3)))
    centre = elbow + rng.uniform(0.2, 0.8) * (end - elbow) + away
    body = {"sphere": {"centre": centre.tolist(), "radius": radius}}
    return scene.model_copy(update={"keep_out": [body], "robot_keeps_clear": True})


def _forearm(scene: Scene, chain: int) -> tuple[Array, Array]:
    """Elbow and platform's joint of a chain with the tool's point in the middle of the line, m."""
    robot, middle = as_delta(scene.robot), _middle(scene)[None]
    theta = delta_model(robot, scene.payload).inverse_kinematics(middle)[:, 3::3]
    links = LinkGeometry(robot, middle, theta)
    return links.elbows[0, chain], links.pins[0, chain]


def kept_from_tilt(scene: Scene, rng: np.random.Generator) -> Scene:
    """A distance from the tilt of the platform that the ends have, and little more."""
    model = delta_model(scene.robot, scene.payload)
    ends = singular_volumes(model, np.array(scene.given_points))[:, 1]
    least = float(np.abs(ends).min() * rng.uniform(0.3, 0.95))
    return scene.model_copy(update={"limits": {"tilt_singularity": least}})


def up_and_down(scene: Scene, rng: np.random.Generator) -> Scene:
    """Straight up from the start and straight down to the goal, as far as the platform can be."""
    heights, radii = rng.uniform([0.05, 0.01], [0.3, 0.1], size=(2, 2)).T * _distance(scene)
    start, goal = (
        ApproachAtEnd(height=float(height), radius=float(radius))
        for height, radius in zip(heights, radii, strict=True)
    )
    changed = scene.model_copy(update={"approach": Approach(start=start, goal=goal)})
    above = tuple((column.level, column.y, column.z) for column in changed.columns)
    check_feasible(scene.model_copy(update={"via": above}))
    return changed


def in_a_tube(path: Change) -> Change:
    """Within a distance of a path."""

    def change(scene: Scene, rng: np.random.Generator) -> Scene:
        tube = float(rng.uniform(0.01, 0.1)) * _distance(scene)
        return path(scene, rng).model_copy(update={"tube": tube})

    return change


def among_bodies(scene: Scene, rng: np.random.Generator) -> Scene:
    """A sphere and an upright cylinder near the straight line, and a floor below."""
    start, goal = np.array(scene.given_points)
    size, bodies = _distance(scene), []
    for share in (0.3, 0.7):
        radius = float(rng.uniform(0.03, 0.12)) * size
        centre = (
            start
            + share * (goal - start)
            + rng.uniform(0, 1.2) * radius * _unit(_across(scene, rng))
        )
        bodies.append((centre, radius))
    (ball, first), (foot, second) = bodies
    floor = max(start[0], goal[0]) + 0.02 * size
    keep_out = [
        {"sphere": {"centre": ball.tolist(), "radius": first}},
        {
            "cylinder": {
                "from": foot.tolist(),
                "to": [float(floor + size), *foot[1:].tolist()],
                "radius": second,
            }
        },
        {"half_space": {"point": [float(floor), 0.0, 0.0], "normal": [1.0, 0.0, 0.0]}},
    ]
    return scene.model_copy(update={"keep_out": keep_out})


def with_clearance(scene: Scene, rng: np.random.Generator) -> Scene:
    """A tool with a radius, and a distance that it keeps from bodies."""
    size = _distance(scene)
    tool = Tool(radius=float(rng.uniform(0.005, 0.05)) * size)
    robot = scene.robot.model_copy(update={"tool": tool})
    clearance = float(rng.uniform(0.0, 0.02)) * size
    return scene.model_copy(update={"robot": robot, "clearance": clearance})


def little_effort(scene: Scene, rng: np.random.Generator) -> Scene:
    """Time and effort together, of which neither is negligible."""
    squares = float(np.sum(np.square(scene.robot.torque_limits)))
    objective = TimeAndEffort(time=1.0, effort=10 ** rng.uniform(-1, 1) / squares)
    return scene.model_copy(update={"objective": objective})


def _usual_speed(scene: Scene) -> float:
    """m/s: what the motors bring the platform to on the straight line, about."""
    force = sum(as_delta(scene.robot).torque_limits) / as_delta(scene.robot).upper_arm.length
    mass = as_delta(scene.robot).platform.mass + (scene.payload or 0.0)
    return float(np.sqrt(_distance(scene) * force / mass))


def _distance(scene: Scene) -> float:
    start, goal = np.array(scene.given_points)
    return float(np.linalg.norm(goal - start))


def _middle(scene: Scene) -> Array:
    return np.asarray(np.mean(scene.given_points, axis=0))


def _across(scene: Scene, rng: np.random.Generator) -> Array:
    """A random vector across the straight line, as long as that."""
    start, goal = np.array(scene.given_points)
    found = np.cross(goal - start, rng.normal(size=3))
    return np.asarray(_unit(found) * _distance(scene))


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


def rotated(scene: Scene, rng: np.random.Generator) -> Scene:
    rotation = Rotation(angle=1.57, speed=30.0, acceleration=400.0)
    return scene.model_copy(update={"rotation": rotation})
