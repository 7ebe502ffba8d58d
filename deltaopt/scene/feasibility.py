"""Feasibility: whether start and goal allow a motion at all, checked before optimisation."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import product
from math import dist

import casadi as ca
import numpy as np

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.curves.piecewise import Array, Truths
from deltaopt.errors import Infeasible, Singular, Unreachable, in_words
from deltaopt.files.validated_record import Vector3, vector3
from deltaopt.limits.constraints import Constraints
from deltaopt.mechanisms.functions import Functions
from deltaopt.mechanisms.instant import CoordinateInstant
from deltaopt.problem.boundary import REST, Boundary
from deltaopt.robot.machine import Model
from deltaopt.robot.model import model_of
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.links import name_of, rooms_at
from deltaopt.scene.parallel_singularity import volumes_at
from deltaopt.scene.scene import Scene

_SHORTEST_MOVE = 1e-12
"""Shortest distance from start to goal, m: coordinates of about a metre have a rounding error of
1e-16, so that such a move still has four digits."""
_ON_SPHERE = 0.99
"""Share of the radius of a via point's sphere at which the platform is looked at: where it can be
at the sphere alone, rounding would decide."""
_CUBE = np.array([each for each in product((-1.0, 0.0, 1.0), repeat=3) if any(each)])
_DIRECTIONS = np.vstack([np.zeros(3), _CUBE / np.linalg.norm(_CUBE, axis=1, keepdims=True)])
"""To places of a sphere that are looked at: its centre, and 26 of a cube's, (27, 3)."""
_STEPS, _SHORTER = 12, 0.6
"""How many steps the place with the most room is looked for in, each so much shorter."""
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
    if scene.keeps_links_clear:
        ends = zip(("start", "goal"), scene.given_points, strict=False)  # a goal that moves is none
        via = enumerate(scene.task.via, 1)
        exact = ((f"via {number}", each.position) for number, each in via if not each.within)
        for name, point in (*ends, *exact):
            require_links_clear(scene, name, point)
    for number, each in enumerate(scene.task.via, 1):
        if each.within:
            _require_sphere(scene, number, each)
        else:
            require_state(scene, f"via {number}", Boundary(each.position), orders=1)
    start, goal = scene.ends
    if not scene.moves_at_ends and not scene.via:
        way = dist(*scene.given_points)
        if way < _SHORTEST_MOVE:
            raise Infeasible(
                f"start and goal are {way:.1e} m apart, which coordinates in double precision "
                f"cannot resolve; at least {_SHORTEST_MOVE:g} m are needed"
            )
    require_state(scene, "start", start)
    if goal.is_given:
        require_state(scene, "goal", goal)


def require_links_clear(scene: Scene, name: str, point: Vector3) -> None:
    """Raise Infeasible if an arm or a forearm is too near to a body with the platform at a point,
    m. ``name``: of the point in sentences."""
    rooms = rooms_at(scene, np.array([point]))[0]
    for link, body in np.argwhere(rooms < -_ROUNDING).tolist():
        assert scene.keep_out is not None
        raise Infeasible(
            f"{name}: at {in_words(point)} m {name_of(link)} is {-1e3 * rooms[link, body]:.4g} mm "
            f"too near to {scene.keep_out[body].named(body)}"
        )


def require_ride(scene: Scene, name: str, places: Array, velocity: Vector3) -> None:
    """Raise as ``require_state`` if the platform cannot be at one of many places, (N, 3), m, where
    a belt carries it at a velocity, m/s; and if a link that is to keep clear does not."""
    doubtful = ~are_surely_feasible(scene, places, np.broadcast_to(velocity, places.shape))
    for place in places[doubtful]:
        require_state(scene, name, Boundary(vector3(place), velocity), is_given=False)
    if scene.keeps_links_clear:
        least = rooms_at(scene, places).min(axis=(1, 2))
        require_links_clear(scene, name, vector3(places[least.argmin()]))


def _require_sphere(scene: Scene, number: int, sphere: Boundary) -> None:
    """Raise Infeasible if the platform can be neither at the centre of a sphere nor at places
    around it."""
    centre, most = np.array(sphere.position), _ON_SPHERE * sphere.within
    places = np.vstack([centre + most * _DIRECTIONS, roomiest(scene, centre, most)])
    first = None
    for x, y, z in places.tolist():
        try:
            return require_state(scene, f"via {number}", Boundary((x, y, z)), orders=1)
        except (Unreachable, Singular, Infeasible) as error:
            first = first or error
    assert first is not None
    within = f"{1e3 * most:g} mm of it"
    raise Infeasible(f"{first}; no possible place was found within {within}") from first


def roomiest(scene: Scene, centre: Array, radius: float) -> Array:
    """The place in a sphere, m, where the platform at rest has the most room, (3,): looked for from
    the centre in smaller and smaller steps."""
    best, step = centre, radius
    for _ in range(_STEPS):
        away = best + step * _DIRECTIONS - centre
        beyond = np.maximum(np.linalg.norm(away, axis=1, keepdims=True) / radius, 1.0)
        places = centre + away / beyond
        best, step = places[room_at_rest(scene, places).argmax()], _SHORTER * step
    return np.asarray(best)


def require_state(
    scene: Scene, name: str, end: Boundary, orders: int = 3, is_given: bool = True
) -> None:
    """Raise Unreachable, Singular or Infeasible if the platform cannot be in a state, or not leave
    it. ``name``: of the state in sentences; ``orders``: of limits that count, below this one;
    ``is_given``: whether it is the scene's own, perhaps with its coordinates in another order."""
    point, at_rest = end.position, end.velocity == REST
    velocity = None if at_rest and orders > 1 else np.array([end.velocity])
    is_looked_at = scene.has_rates and orders > 1 and not end.is_rest_at_a_point
    if not is_looked_at and are_surely_feasible(scene, np.array([point]), velocity).all():
        return
    model, still = model_of(scene.robot, scene.payload), np.zeros(3)
    try:
        _require_reach(model, point)
    except Unreachable as error:
        meant = perhaps_meant(scene, point) if is_given else ""
        raise Unreachable(f"{name}: {error}{meant}") from None
    if velocity is None:
        model.inverse_dynamics(point, still, still)
    place, how = f"at {in_words(point)} m the", f"at {in_words(end.velocity)} m/s "
    how += f"and {in_words(end.acceleration)} m/s² " if scene.has_rates else ""
    for sentence in _too_near(scene, point) if at_rest else ():
        raise Infeasible(f"{name}: {place} tool {sentence}")
    for sentence in exceeded(scene, end, orders):
        moving = "" if orders == 1 else "at rest " if end.is_rest_at_a_point else how
        raise Infeasible(f"{name}: {moving}{place} {sentence}")
    try:  # in a serial singularity the platform's motion does not determine that of the chains
        model.motion(point, still, still)
    except Singular as error:
        raise Singular(error.kind, error.chain, error.margin, name) from None


def serial_distances_at_ends(scene: Scene) -> Array:
    """Squared distances of start and goal from serial singularities, (2, 6), without unit.

    For each end cos² q_{k,3} of the three chains, then sin² (q_{k,1} - q_{k,2}).
    """
    return _evaluated(scene, np.array(scene.given_points))[2]


def room_at_rest(scene: Scene, points: Array) -> Array:
    """How far the platform at rest at points, (N, 3) in m, is from what it must not exceed, (N,).

    It is the least of three: what is left of a limit as a share of it, the squared distance from a
    serial singularity, and the distance from a parallel one. Negative where the platform cannot be
    at rest, or is beyond a parallel singularity, seen from the start.
    """
    _, rows, distances = _evaluated(scene, points)
    limits = 1 - np.abs(rows).max(axis=1)
    model = model_of(scene.robot, scene.payload)
    volumes = volumes_at(model, np.vstack([scene.given_points[0], points]))
    beyond = np.sign(volumes[0]) * volumes[1:]
    room = np.minimum(np.minimum(limits, distances.min(axis=1)), beyond)
    return np.where(np.isfinite(room), room, -1.0)


def are_surely_feasible(scene: Scene, x: Array, v: Array | None = None) -> Truths:
    """Whether the platform can be at rest at points x, (N, 3), m, with room to spare, (N,): where
    it can not, a closer look may find that it just can. With velocities v, (N, 3), m/s, whether it
    can pass the points, where limits of positions and speeds alone count."""
    back, rows, distances = _evaluated(scene, x, v)
    there = np.linalg.norm(back - x, axis=1) <= _SAME_PLACE  # False where not a number
    held = (np.abs(rows) <= 1).all(axis=1) & (distances > _CLEAR).all(axis=1)
    return np.asarray(there & held)


def _evaluated(scene: Scene, x: Array, v: Array | None = None) -> tuple[Array, ...]:
    """Three results for the platform at points x at velocities v, (N, 3) each, or at rest.

    The positions by forward kinematics of the motor angles, m, (N, 3); the constraint rows, within
    ±1 if all limits are kept, those of positions and speeds alone for a platform that moves;
    squared distances from serial singularities, (N, 6).
    """
    model, limits = model_of(scene.robot, scene.payload), limits_of(scene)
    function = _function(model.functions, limits.constraints, v is None)
    states = x if v is None else np.hstack([x, v])
    return function(states, parameters=np.concatenate([limits.numbers, model.parameters]))


@lru_cache(maxsize=64)
def _function(functions: Functions, constraints: Constraints, at_rest: bool) -> RowFunction:
    """(x, and v unless at rest; numbers of the limits and p) -> the results of ``_evaluated``."""
    x, rest = ca.SX.sym("x", 3), ca.SX.zeros(3)
    v = rest if at_rest else ca.SX.sym("v", 3)
    p, numbers = functions.symbols(), constraints.numbers()
    motion = CoordinateInstant.general(functions, x, v, rest, p, rest)
    back, rows = functions.forward_kinematics(motion.theta, p), constraints.rows(motion, numbers)
    which = np.flatnonzero(constraints.orders < (4 if at_rest else 2)).tolist()
    within = [_within(rows[i], *constraints.sides[i]) for i in which]
    results = [back, ca.vertcat(*within), functions.serial_distances(x, p)]
    inputs = [x if at_rest else ca.vertcat(x, v), ca.vertcat(numbers, p)]
    return RowFunction.of("state", inputs, results)


def _within(row: ca.SX, lower: bool, upper: bool) -> ca.SX:
    """A normalised row, replaced by 0 where it is beyond a side that has no bound."""
    if lower and upper:
        return row
    return ca.fmax(row, 0) if upper else ca.fmin(row, 0)


def _require_reach(model: Model, point: Vector3) -> None:
    """Raise Unreachable if a point is outside the workspace or the industrial assembly mode."""
    q = model.inverse_kinematics(point)
    back = model.forward_kinematics(q[model.functions.motors])
    if np.linalg.norm(back - point) > _SAME_PLACE:
        raise Unreachable(
            f"at {in_words(point)} m the platform is not below its elbows, which is "
            "outside the industrial assembly mode"
        )


def perhaps_meant(scene: Scene, point: Vector3) -> str:
    """What a point (m) out of reach may be that was given with z upward, z downward or x upward:
    the lowest of those in reach, for robots work well below their base."""
    x, y, z = point
    places = np.array(sorted([(-z, x, y), (z, x, y), (-x, y, z)], reverse=True)) + 0.0  # no -0
    fitting = places[are_surely_feasible(scene, places)]
    meant = (f"; x points down from the base's centre, as in {in_words(p)} m" for p in fitting)
    return next(meant, "")


def _too_near(scene: Scene, point: Vector3) -> Iterator[str]:
    """A phrase for each body that the tool is too near to at a point."""
    limits = limits_of(scene)
    if scene.keep_out is None:
        return
    used = limits.constraints.convex & np.isfinite(limits.bounds[0])
    distances = _measures(scene, Boundary(point))[used].tolist()
    for distance, (index, _) in zip(distances, scene.obstacles, strict=True):
        body = scene.keep_out[index].named(index)
        if distance < min(scene.least_clearance, 0.0) - _ROUNDING:
            yield f"overlaps {body}, by {-1e3 * distance:.4g} mm"
        elif distance < scene.least_clearance - _ROUNDING:
            asked = f"a clearance of {1e3 * scene.least_clearance:g} mm is asked for"
            yield f"is {1e3 * distance:.4g} mm from {body}, where {asked}"


def _measures(scene: Scene, end: Boundary) -> Array:
    """The measures of all limits with the platform in a state, (rows,), each in its unit."""
    model, limits = model_of(scene.robot, scene.payload), limits_of(scene)
    function = _measures_of(model.functions, limits.constraints)
    given = end.position, end.velocity, end.acceleration, model.parameters, limits.numbers
    return np.array(function(*given)).ravel()


@lru_cache(maxsize=64)
def _measures_of(functions: Functions, constraints: Constraints) -> ca.Function:
    """(x, v, a, p, numbers of the limits) -> the measures of all limits, (rows,)."""
    x, v, a = (ca.SX.sym(name, 3) for name in "xva")
    p, numbers = functions.symbols(), constraints.numbers()
    motion = CoordinateInstant.general(functions, x, v, a, p, ca.SX.zeros(3))
    return ca.Function("measures", [x, v, a, p, numbers], [constraints.measures(motion, numbers)])


def exceeded(scene: Scene, end: Boundary, orders: int = 3) -> Iterator[str]:
    """A phrase for each limit that is exceeded with the platform in a state: those of torque and
    acceleration only if it is at rest or if acceleration is continuous, for else these are not
    known yet.

    ``orders``: of limits that count, below this one.
    """
    limits, found = limits_of(scene), _measures(scene, end)
    constraints, row_orders = limits.constraints, limits.constraints.orders
    is_known = scene.has_rates or end.velocity == REST
    for row, (value, lower, upper) in enumerate(zip(found, *limits.bounds, strict=True)):
        if row_orders[row] >= (orders if is_known else min(orders, 2)):
            continue
        rounding = _ROUNDING if end.velocity == REST else _PLANNED * max(1.0, abs(value))
        if not lower - rounding <= value <= upper + rounding:
            limit = constraints.limits[constraints.item_of(row)[0]]
            beyond, bound = ("at most", upper) if value > upper else ("at least", lower)
            by = f" by {limit.robot_key}" if limit.robot_key else ""
            unit = scene.robot.unit(limit.unit)
            unit = "" if unit == "1" else f" {unit}"
            yield (
                f"{constraints.label(row)} is {value:.4g}{unit}, where {beyond} {bound:g}{unit} "
                f"is allowed{by}"
            )
