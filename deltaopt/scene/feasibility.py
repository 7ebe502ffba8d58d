"""Feasibility: whether start and goal allow a motion at all, checked before optimisation."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import product
from math import dist

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.codegen.vectorised import Array, RowFunction
from deltaopt.errors import Infeasible, Singular, Unreachable, in_words
from deltaopt.files.validated_record import Vector3
from deltaopt.limits.constraints import Constraints
from deltaopt.mechanisms.functions import Functions
from deltaopt.mechanisms.instant import CoordinateInstant
from deltaopt.robot.machine import Model
from deltaopt.robot.model import model_of
from deltaopt.scene.links import name_of, rooms_at
from deltaopt.scene.parallel_singularity import volumes_at
from deltaopt.scene.scene import Scene, limits_of
from deltaopt.scene.task import REST, EndState, ViaPoint

_SHORTEST_MOVE = 1e-12
"""Shortest distance from start to goal, m: coordinates of about a metre have a rounding error of
1e-16, so that such a move still has four digits."""
_ON_SPHERE = 0.99
"""Share of the radius of a via point's sphere at which the platform is looked at: where it can be
at the sphere alone, rounding would decide."""
_CLEAR = 1e-6
"""Squared distance from serial singularities above which an end needs no closer look."""
_ROUNDING = 1e-12
"""By how much, in its unit, a quantity may be beyond a bound that it was given to be at."""
_PLANNED = 1e-8
"""Share of a bound by which a state that is passed may be beyond it: a planned motion keeps its
limits to 1e-9, and who interrupts it may know it to fewer digits."""
_SAME_PLACE = 1e-6
"""Distance in m within which forward and inverse kinematics must agree. Near a parallel singularity
forward kinematics loses half of its digits."""


def check_feasible(scene: Scene) -> None:
    """Check that the platform can be at rest at start and goal within all limits, and leave.

    Where an end moves, it must keep the limits of position and speed. Of a goal on a belt nothing
    is known before it is met. Raises Unreachable, Singular or Infeasible, each with a sentence that
    says why not.
    """
    if scene.robot_keeps_clear and scene.keep_out:
        _require_links_clear(scene)
    _require_passages(scene)
    if scene.moves_at_ends:
        return _check_moving_ends(scene)
    start, goal = scene.given_points
    way = dist(goal, start)
    if way < _SHORTEST_MOVE and not scene.via:
        raise Infeasible(
            f"start and goal are {way:.1e} m apart, which coordinates in double precision "
            f"cannot resolve; at least {_SHORTEST_MOVE:g} m are needed"
        )
    if _is_feasible(scene):
        return
    model = model_of(scene.robot, scene.payload)
    for name, point in (("start", start), ("goal", goal)):
        _require_reach(scene, model, name, point)
        _require_rest(model, scene, name, point)
        _require_departure(model, name, point)


def _require_links_clear(scene: Scene) -> None:
    """Raise Infeasible if an arm or a forearm is too near to a body at a point that is given."""
    ends = zip(("start", "goal"), scene.given_points, strict=False)  # a goal that moves is none
    exact = ((f"via {n}", v.position) for n, v in enumerate(scene.task.via, 1) if not v.within)
    for name, point in (*ends, *exact):
        rooms = rooms_at(scene, np.array([point]))[0]
        for link, body in np.argwhere(rooms < -_ROUNDING).tolist():
            assert scene.keep_out is not None
            too_near = f"{-1e3 * rooms[link, body]:.4g} mm too near to"
            raise Infeasible(
                f"{name}: at {in_words(point)} m {name_of(link)} is {too_near} "
                f"keep_out[{body}], a {scene.keep_out[body].kind}"
            )


def _require_passages(scene: Scene) -> None:
    """Raise Unreachable, Singular or Infeasible if the platform cannot be at one of the via points,
    or nowhere in the sphere about one as far as it is looked at."""
    exact = [(n, each.position) for n, each in enumerate(scene.task.via, 1) if not each.within]
    if exact:
        _require_exact_passages(scene, exact)
    for number, each in enumerate(scene.task.via, 1):
        if each.within:
            _require_sphere(scene, number, each)


def _require_sphere(scene: Scene, number: int, sphere: ViaPoint) -> None:
    """Raise Infeasible if the platform can be neither at the centre of a sphere nor at places
    around it."""
    ways = np.array([each for each in product((-1.0, 0.0, 1.0), repeat=3) if any(each)])
    ways *= _ON_SPHERE * sphere.within / np.linalg.norm(ways, axis=1, keepdims=True)
    first = None
    for away in [np.zeros(3), *ways]:
        x, y, z = (np.array(sphere.position) + away).tolist()
        try:
            return _require_exact_passages(scene, [(number, (x, y, z))])
        except (Unreachable, Singular, Infeasible) as error:
            first = first or error
    assert first is not None
    away = f"{1e3 * _ON_SPHERE * sphere.within:g} mm away"
    raise Infeasible(f"{first}; nor is any of {len(ways)} places {away} possible") from first


def _require_exact_passages(scene: Scene, numbered: list[tuple[int, Vector3]]) -> None:
    """Raise Unreachable, Singular or Infeasible if the platform cannot be at one of some points on
    its way, each with its number among the via points."""
    points = [point for _, point in numbered]
    model, limits = model_of(scene.robot, scene.payload), limits_of(scene)
    states = np.pad(np.array(points), ((0, 0), (0, 3)))
    back, rows, distances = _state_function(model.functions, limits.constraints)(
        states, parameters=np.concatenate([limits.numbers, model.parameters])
    )
    for number, point in numbered:
        for sentence in _too_near(scene, point):
            raise Infeasible(f"via {number}: at {in_words(point)} m the tool {sentence}")
    there = np.linalg.norm(back - points, axis=1) <= _SAME_PLACE  # False where not a number
    if there.all() and (np.abs(rows) <= 1).all() and (distances > _CLEAR).all():
        return
    for number, point in numbered:
        name = f"via {number}"
        _require_reach(scene, model, name, point)
        for sentence in exceeded(scene, EndState(point), orders=1):
            raise Infeasible(f"{name}: at {in_words(point)} m the {sentence}")
        _require_departure(model, name, point)


def _check_moving_ends(scene: Scene) -> None:
    """``check_feasible`` for a motion that begins or ends moving."""
    model, limits = model_of(scene.robot, scene.payload), limits_of(scene)
    of, (start, goal) = (model.functions, limits.constraints), scene.ends
    known = [("goal", goal)] if isinstance(goal, EndState) else []
    for name, end in [("start", start), *known]:
        numbers = np.concatenate([limits.numbers, model.parameters])
        at, rates = np.array([end.position]), np.array([end.velocity])
        back, rows, distances = (
            _rest_function(*of)(at, parameters=numbers)
            if end.velocity == REST
            else _state_function(*of)(np.hstack([at, rates]), parameters=numbers)
        )
        there = np.linalg.norm(back - at) <= _SAME_PLACE
        if there and (np.abs(rows) <= 1).all() and distances.min() > _CLEAR:
            continue
        _require_reach(scene, model, name, end.position)
        for sentence in exceeded(scene, end):
            moving = "at rest" if end.velocity == REST else f"at {in_words(end.velocity)} m/s"
            raise Infeasible(f"{name}: {moving} at {in_words(end.position)} m the {sentence}")
        _require_departure(model, name, end.position)


@lru_cache(maxsize=32)
def _state_function(functions: Functions, constraints: Constraints) -> RowFunction:
    """(x and v, numbers of the limits and p) -> as ``_rest_function`` for a platform that moves,
    with the rows of positions and speeds alone."""
    state, p, numbers = (
        ca.SX.sym("state", 6),
        functions.symbols(),
        constraints.numbers(),
    )
    x, v = state[:3], state[3:]
    motion = CoordinateInstant.general(functions, x, v, ca.SX.zeros(3), p, ca.SX.zeros(3))
    back, rows = functions.forward_kinematics(motion.theta, p), constraints.rows(motion, numbers)
    of_state = np.flatnonzero(constraints.orders < 2).tolist()
    within = [_within(rows[i], *constraints.sides[i]) for i in of_state]
    results = [back, ca.vertcat(*within), functions.serial_distances(x, p)]
    inputs = [state, ca.vertcat(numbers, p)]
    return RowFunction(ca.Function("state", inputs, results, {"cse": True}))


def serial_distances_at_ends(scene: Scene) -> Array:
    """Squared distances of start and goal from serial singularities, (2, 6), without unit.

    For each end cos² q_{k,3} of the three chains, then sin² (q_{k,1} - q_{k,2}).
    """
    return _ends(scene)[2]


def room_at_rest(scene: Scene, points: Array) -> Array:
    """How far the platform at rest at points, (N, 3) in m, is from what it must not exceed, (N,).

    It is the least of three: what is left of a limit as a share of it, the squared distance from a
    serial singularity, and the distance from a parallel one. Negative where the platform cannot be
    at rest, or is beyond a parallel singularity, seen from the start.
    """
    _, rows, distances = _at_rest(scene, points)
    limits = 1 - np.abs(rows).max(axis=1)
    model = model_of(scene.robot, scene.payload)
    volumes = volumes_at(model, np.vstack([scene.given_points[0], points]))
    beyond = np.sign(volumes[0]) * volumes[1:]
    room = np.minimum(np.minimum(limits, distances.min(axis=1)), beyond)
    return np.where(np.isfinite(room), room, -1.0)


def limit_room_at_ends(scene: Scene) -> float:
    """The least share of a limit that rest at start and goal leaves unused."""
    return float(1 - np.abs(_ends(scene)[1]).max())


def _is_feasible(scene: Scene) -> bool:
    """Whether start and goal pass all checks with room to spare, in one compiled evaluation."""
    return bool(are_surely_feasible(scene, np.array(scene.given_points)).all())


def are_surely_feasible(scene: Scene, points: Array) -> NDArray[np.bool]:
    """Whether the platform can be at rest at points, (N, 3), m, with room to spare, (N,): where it
    can not, a closer look may find that it just can."""
    back, rows, distances = _at_rest(scene, points)
    there = np.linalg.norm(back - points, axis=1) <= _SAME_PLACE  # False where not a number
    held = (np.abs(rows) <= 1).all(axis=1) & (distances > _CLEAR).all(axis=1)
    return np.asarray(there & held)


def _ends(scene: Scene) -> tuple[Array, ...]:
    """The results of ``_rest_function`` at start and goal, two rows each."""
    return _at_rest(scene, np.array(scene.given_points))


def _at_rest(scene: Scene, points: Array) -> tuple[Array, ...]:
    """The results of ``_rest_function`` at points, (N, 3)."""
    model, limits = model_of(scene.robot, scene.payload), limits_of(scene)
    rest = _rest_function(model.functions, limits.constraints)
    return rest(points, parameters=np.concatenate([limits.numbers, model.parameters]))


@lru_cache(maxsize=32)
def _rest_function(functions: Functions, constraints: Constraints) -> RowFunction:
    """(x, numbers of the limits and p) -> three results for the platform at rest at x:

    the position by forward kinematics of its motor angles, m (3); the constraint rows, within ±1
    if all limits are kept; squared distances from serial singularities (6).
    """
    rest = ca.SX.zeros(3)
    x, p, numbers = ca.SX.sym("x", 3), functions.symbols(), constraints.numbers()
    motion = CoordinateInstant.general(functions, x, rest, rest, p, rest)
    back = functions.forward_kinematics(motion.theta, p)
    rows = constraints.rows(motion, numbers)
    within = [_within(rows[i], *constraints.sides[i]) for i in range(constraints.number)]
    results = [back, ca.vertcat(*within), functions.serial_distances(x, p)]
    inputs = [x, ca.vertcat(numbers, p)]
    return RowFunction(ca.Function("rest", inputs, results, {"cse": True}))


def _within(row: ca.SX, lower: bool, upper: bool) -> ca.SX:
    """A normalised row, replaced by 0 where it is beyond a side that has no bound."""
    if lower and upper:
        return row
    return ca.fmax(row, 0) if upper else ca.fmin(row, 0)


def _require_reach(scene: Scene, model: Model, name: str, point: Vector3) -> None:
    """Raise Unreachable if a point is outside the workspace or the industrial assembly mode."""
    try:
        q = model.inverse_kinematics(point)
        back = model.forward_kinematics(q[model.functions.motors])
    except Unreachable as error:
        raise Unreachable(f"{name}: {error}{perhaps_meant(scene, point)}") from None
    if np.linalg.norm(back - point) > _SAME_PLACE:
        raise Unreachable(
            f"{name}: at {in_words(point)} m the platform is not below its elbows, which is "
            f"outside the industrial assembly mode{perhaps_meant(scene, point)}"
        )


def perhaps_meant(scene: Scene, point: Vector3) -> str:
    """What a point (m) out of reach may be that was given with z upward, z downward or x upward."""
    x, y, z = point
    places = np.array([(-z, x, y), (z, x, y), (-x, y, z)])
    fitting = places[are_surely_feasible(scene, places)]
    meant = (f"; x points down from the base's centre, as in {in_words(p)} m" for p in fitting)
    return next(meant, "")


def _require_rest(model: Model, scene: Scene, name: str, point: Vector3) -> None:
    """Raise Infeasible if a limit is exceeded at rest at a point, for instance by gravity."""
    try:
        model.inverse_dynamics(point, np.zeros(3), np.zeros(3))
    except Unreachable as error:
        raise Unreachable(f"{name}: {error}") from None
    for sentence in _too_near(scene, point):
        raise Infeasible(f"{name}: at {in_words(point)} m the tool {sentence}")
    for sentence in exceeded(scene, EndState(point)):
        raise Infeasible(f"{name}: at rest at {in_words(point)} m the {sentence}")


def _too_near(scene: Scene, point: Vector3) -> Iterator[str]:
    """A phrase for each body that the tool is too near to at a point."""
    limits = limits_of(scene)
    if not limits.constraints.has_convex:
        return
    x, numbers = (ca.SX(ca.DM(each)) for each in (point, limits.numbers))
    measures = np.array(ca.DM(limits.constraints.convex_measures(x, numbers))).ravel()
    used = np.isfinite(limits.bounds[0][limits.constraints.convex])
    for distance, (index, _) in zip(measures[used].tolist(), scene.obstacles, strict=True):
        assert scene.keep_out is not None
        body = f"keep_out[{index}], a {scene.keep_out[index].kind}"
        if distance < min(scene.least_clearance, 0.0) - _ROUNDING:
            yield f"overlaps {body}, by {-1e3 * distance:.4g} mm"
        elif distance < scene.least_clearance - _ROUNDING:
            asked = f"a clearance of {1e3 * scene.least_clearance:g} mm is asked for"
            yield f"is {1e3 * distance:.4g} mm from {body}, where {asked}"


def exceeded(scene: Scene, end: EndState, orders: int = 3) -> Iterator[str]:
    """A phrase for each limit that is exceeded with the platform in a state: those of torque and
    acceleration only if it is at rest, for else these are not known yet.

    ``orders``: of limits that count, below this one.
    """
    model, limits = model_of(scene.robot, scene.payload), limits_of(scene)
    constraints, row_orders = limits.constraints, limits.constraints.orders
    given = end.position, end.velocity, model.parameters, limits.numbers
    x, v, p, numbers = (ca.SX(ca.DM(each)) for each in given)
    motion = CoordinateInstant.general(model.functions, x, v, ca.SX.zeros(3), p, ca.SX.zeros(3))
    found = np.array(ca.DM(constraints.measures(motion, numbers))).ravel()
    for row, (value, lower, upper) in enumerate(zip(found, *limits.bounds, strict=True)):
        if row_orders[row] >= orders or (end.velocity != REST and row_orders[row] > 1):
            continue
        rounding = _ROUNDING if end.velocity == REST else _PLANNED * max(1.0, abs(value))
        if not lower - rounding <= value <= upper + rounding:
            limit = constraints.limits[constraints.item_of(row)[0]]
            beyond, bound = ("at most", upper) if value > upper else ("at least", lower)
            by = f" by {limit.robot_key}" if limit.robot_key else ""
            unit = scene.robot.unit(limit.unit)
            yield (
                f"{constraints.label(row)} is {value:.4g} {unit}, where {beyond} {bound:g} "
                f"{unit} is allowed{by}"
            )


def _require_departure(model: Model, name: str, point: Vector3) -> None:
    """Raise Singular if a point is in a serial singularity, where the platform's motion does not
    determine that of the chains."""
    try:
        model.motion(point, np.zeros(3), np.zeros(3))
    except Singular as error:
        raise Singular(error.kind, error.chain, error.margin, name) from None
