"""Initial motions, without optimisation, which are proposed to the planner: the straight line, or a
curve where it is blocked."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import lru_cache
from itertools import product
from math import comb, isinf
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.polynomial.polynomial import polyder, polymul, polyval

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.curves.piecewise import (
    QUINTIC,
    Array,
    PiecewisePolynomial,
    hermite_pieces,
    quintic_rest,
)
from deltaopt.errors import RULED_OUT, Infeasible, Unreachable, if_possible
from deltaopt.files.validated_record import Vector3
from deltaopt.mechanisms.functions import Functions
from deltaopt.motion.motion_sequence import waiting
from deltaopt.motion.time_scaling import needed_slowing, rough_factor
from deltaopt.motion.trajectory import Trajectory, start_of
from deltaopt.problem.boundary import REST
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.machine import Model
from deltaopt.robot.model import model_of
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import given_points
from deltaopt.settings import require_type

_PULLS = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0)
"""How far the control point of a parabola lies from the line's midpoint towards the middle of the
workspace, as a share of that way. Chosen by hand to cover small and large detours."""
_WAITING_DEPTHS = np.linspace(0.02, 0.98, 25)
"""Places on the robot's axis where a motion may wait, from nearly folded chains to nearly stretched
ones. More of them find the place of least torque more exactly, but cost time, and it is only a
guess. Nearer to 0 and 1, where the chains are singular, the guess would come to rest too slowly."""
_UNHURRIED, _HURRIED, _MOVING = 2.0, 0.7, 0.9
"""How many times as long as at its fastest a motion to a waiting place and from there takes. At
twice the time the torques that accelerate are a quarter, so that most of what remains holds the
weight. It takes less where the duration is short, and as a guess may exceed its limits by so much:
of 144 motions in 1.1 to 4 times the fastest one's duration three cost 8 to 31 % more without. It
takes this share of the duration at most."""
_JOINT_LINE_INTERVALS = 32
"""Cubics that represent a straight line in the motor angles; they only have to be a good guess."""
_FAR_OFF = 1e3
"""Factor by which a motion may be slowed or sped up at once: it costs six digits of the torques
that accelerate."""
_UNRESOLVED = 1e-20
"""Factor below which the torques that accelerate a motion of a second are lost in rounding."""
_MOST_SPEEDS = 10
"""Each brings a motion nearer to its fastest by seven orders of magnitude."""


class Proposal(NamedTuple):
    """A first ``motion``, and its ``name``: a noun phrase, such as "a straight line". ``legs``: of
    how many that are the best ones by themselves it is made; 0 where it is not. ``is_aside``:
    whether it is the fastest motion without bodies, led aside in its time."""

    name: str
    motion: Trajectory
    legs: int = 0
    is_aside: bool = False


def straight_line(model: Model, start: Vector3, goal: Vector3, duration: float) -> Trajectory:
    """The motion on the straight line from ``start`` to ``goal`` (m) in ``duration`` (s).

    It has covered 10 u³ - 15 u⁴ + 6 u⁵ of the line at u = t / duration: at rest and without
    acceleration at both ends, as in the paper's Fig. 4.
    """
    begin, way = np.array(start), np.array(goal) - np.array(start)
    coefficients = QUINTIC[:, None] * way
    coefficients[0] += begin
    return _one_piece(model, coefficients).slowed(duration)


def baseline(scene: Scene) -> Trajectory:
    """The motion on the straight line, slowed until it keeps the scene's limits, as a baseline.

    It takes the duration that the scene gives, if it gives one. Raises Unreachable where the line
    leaves the workspace, and Infeasible where gravity alone exceeds a torque limit on it or the
    given duration is too short; another path may exist all the same.

    Examples:
        >>> scene = deltaopt.load_scene("problems/pick_and_place.yaml")
        >>> round(deltaopt.baseline(scene).duration, 4)
        0.1966
    """
    require_type("scene", scene, Scene, "a Scene, such as load_scene returns")
    fastest = _fastest(scene, line(scene), "the straight line from start to goal")
    given = scene.objective.given_duration
    if given is None:
        return fastest
    if given < fastest.duration:
        raise Infeasible(
            f"duration is {given:g} s, but the straight line from start to goal takes "
            f"{fastest.duration:.6g} s at least"
        )
    return fastest.slowed(given / fastest.duration)


def detour(scene: Scene) -> Trajectory:
    """The fastest of a few motions on curves that bulge towards the middle of the workspace.

    Raises Unreachable if none of the curves stays in the workspace within the limits.
    """
    for curves in (_parabolas, _cubics):
        motions = list(drivable(scene, curves(scene)))
        if motions:
            return min(motions, key=lambda motion: motion.duration)
    raise Unreachable("neither a straight line nor a simple curve leads from start to goal")


def drivable(scene: Scene, curves: Iterator[Trajectory]) -> Iterator[Trajectory]:
    """Those of the curves that stay in the workspace, each as fast as the limits allow."""
    for curve in curves:
        motion = if_possible(RULED_OUT, _fastest, scene, curve, "the curve")
        if motion is not None:
            yield motion


def _parabolas(scene: Scene) -> Iterator[Trajectory]:
    """Parabolas whose control point lies towards the middle of the workspace, in 1 s."""
    start, goal = given_points(scene.task)
    halfway = (np.array(start) + goal) / 2
    for pull in _PULLS:
        corner = halfway + pull * (scene.robot.on_axis(0.5) - halfway)
        yield curve_between(scene, corner)


PARABOLAS_AND_CUBICS = len(_PULLS) + 36
"""How many curves ``detour`` tries."""


def _cubics(scene: Scene) -> Iterator[Trajectory]:
    """Cubics whose control points lie on the way from each end to a point on the robot's axis.

    Deep ones lead from one side of the workspace to the other, below the region near the base
    that the platform cannot enter.
    """
    start, goal = (np.array(point) for point in given_points(scene.task))
    for depth, leave, arrive in product((0.5, 0.6, 0.7, 0.8), (0.5, 1.0, 1.3), (0.5, 1.0, 1.3)):
        middle = scene.robot.on_axis(depth)
        yield curve_between(
            scene, start + leave * (middle - start), goal + arrive * (middle - goal)
        )


def joint_line(scene: Scene) -> Trajectory:
    """The motion on a straight line in the motor angles, in 1 s, approximated by cubics.

    Raises Unreachable where the loops cannot close.
    """
    model = model_of(scene.robot, scene.payload)
    start, goal = (np.array([[*point, *REST]]) for point in given_points(scene.task))
    pieces, _ = angle_quintics(model, start, goal, np.ones(1), _JOINT_LINE_INTERVALS)
    if not np.isfinite(pieces).all():
        raise Unreachable("motor angles straight from start to goal: the bars do not meet")
    u = np.linspace(0.0, 1.0, _JOINT_LINE_INTERVALS + 1)
    return Trajectory(PiecewisePolynomial(u, pieces[0]), model)


def angle_quintics(
    model: Model, begin: Array, end: Array, durations: Array, pieces: int
) -> tuple[Array, Array]:
    """Motions whose motor angles are quintics of time, between positions and velocities of the
    platform, (n, 6), m and m/s, in some durations, (n,), s, approximated by cubics.

    Returns coefficients of ascending powers of the time since a piece began, (n, pieces, 4, 3), m,
    and lengths, (n, pieces), s. Coefficients are NaN where the loops cannot close.
    """
    to_angles, to_places = _angle_functions(model.functions)
    (first, leaving), (last, arriving) = (
        to_angles(end[:, :3], end[:, 3:], parameters=model.parameters) for end in (begin, end)
    )
    T = durations[:, None]
    rest = quintic_rest(last - first - T * leaving, T * (arriving - leaving))
    by_power = np.stack([first, T * leaving, np.zeros_like(first), *rest])
    u = np.linspace(0.0, 1.0, pieces + 1)
    theta, rate = (polyval(u, each) for each in (by_power, polyder(by_power)))
    angles = (np.moveaxis(each, -1, 1).reshape(-1, first.shape[1]) for each in (theta, rate))
    found = to_places(*angles, parameters=model.parameters)
    x, v = (each.reshape(len(T), -1, 3) for each in found)
    v /= T[:, None]
    for place, given in ((0, begin), (-1, end)):
        x[:, place], v[:, place] = given[:, :3], given[:, 3:]
    lengths = np.repeat(T / pieces, pieces, axis=1)
    before, after = (
        [each[:, part].reshape(-1, 3) for each in (x, v)] for part in (slice(-1), slice(1, None))
    )
    return hermite_pieces(lengths.ravel(), before, after).reshape(len(T), pieces, 4, 3), lengths


@lru_cache(maxsize=16)
def _angle_functions(functions: Functions) -> tuple[RowFunction, RowFunction]:
    """(x, v, p) -> motor angles and their rates, and (these, p) -> x, v of the platform."""
    p, place, theta = functions.symbols(), ca.SX.sym("x", 3), ca.SX.sym("theta", 3)
    rate = ca.SX.sym("rate", 3)
    angles = functions.inverse_kinematics(place, p)[functions.motors]
    back = functions.forward_kinematics(theta, p)
    return (
        RowFunction.of("angles", [place, rate, p], [angles, ca.jtimes(angles, place, rate)]),
        RowFunction.of("places", [theta, rate, p], [back, ca.jtimes(back, theta, rate)]),
    )


def waiting_motions(scene: Scene, duration: float) -> list[Trajectory]:
    """Motions in ``duration`` (s) that go to a place of little holding torque, wait there, and go
    on to the goal: three polynomials each, the second at rest.

    The places are on the robot's axis, where the effort of holding is less than at the places
    beside it, or at the end of what the limits allow. Long motions of least effort wait near such a
    place (the turnpike property of optimal control). Empty if no such motion fits the duration, or
    if the scene says more of the way than where it begins and ends at rest.
    """
    if not scene.task.is_at_rest or scene.task.gates or scene.tube is not None:
        return []
    found = list[Trajectory]()
    for there, onwards in _ways_to_wait(scene):
        slower = min(_UNHURRIED, _MOVING * duration / (there.duration + onwards.duration))
        if slower > _HURRIED:
            found.append(_with_wait(there.slowed(slower), onwards.slowed(slower), duration))
    return found


@lru_cache(maxsize=64)
def _ways_to_wait(scene: Scene) -> list[tuple[Trajectory, Trajectory]]:
    """Ways by places on the robot's axis where the effort of holding is less than beside them."""
    ways = {i: way for i, depth in enumerate(_WAITING_DEPTHS) if (way := _by_way_of(scene, depth))}
    holding = {i: _holding_effort(way) for i, way in ways.items()}
    return [
        way
        for i, way in ways.items()
        if holding[i] <= min(holding.get(i - 1, np.inf), holding.get(i + 1, np.inf))
    ]


def has_time_to_wait(scene: Scene) -> bool:
    """Whether motions that wait are first guesses, as they are whatever the first motion is: then
    another first motion leads to the same plan."""
    given = scene.objective.given_duration
    return given is not None and bool(waiting_motions(scene, given))


def _by_way_of(scene: Scene, depth: float) -> tuple[Trajectory, Trajectory] | None:
    """Straight lines to a place on the robot's axis and from there to the goal, as fast as the
    limits roughly allow; None where they do not."""
    model, place = model_of(scene.robot, scene.payload), scene.robot.on_axis(depth)
    start, goal = given_points(scene.task)
    lines = (
        straight_line(model, start, tuple(place), 1.0),
        straight_line(model, tuple(place), goal, 1.0),
    )
    there, onwards = (if_possible(RULED_OUT, roughly_fastest, scene, line) for line in lines)
    if there is None or onwards is None:
        return None
    return there, onwards


def _holding_effort(way: tuple[Trajectory, Trajectory]) -> float:
    """τᵀτ, N²m², at rest where the first of two motions ends."""
    there, _ = way
    place, rest = there.position.at(np.array([there.duration])), np.zeros((1, 3))
    return float((there.model.inverse_dynamics(place, rest, rest) ** 2).sum())


def _with_wait(there: Trajectory, onwards: Trajectory, duration: float) -> Trajectory:
    """One motion after the other, with a wait between them that fills the ``duration`` (s)."""
    left, place = duration - there.duration - onwards.duration, start_of(onwards.position)
    return there.then(waiting(there.model, place, REST, left)).then(onwards)


def line(scene: Scene) -> Trajectory:
    """The motion on the straight line from start to goal in 1 s."""
    model = model_of(scene.robot, scene.payload)
    return straight_line(model, *given_points(scene.task), 1.0)


def roughly_fastest(scene: Scene, trajectory: Trajectory) -> Trajectory:
    """The motion slowed or sped up uniformly until it just keeps the limits at samples."""
    return _sped(
        trajectory, lambda motion: rough_factor(problem_of(scene), motion), "it cannot be driven"
    )


def _fastest(scene: Scene, trajectory: Trajectory, name: str) -> Trajectory:
    """The motion slowed or sped up uniformly until it just keeps the limits at all instants."""

    def factor(motion: Trajectory) -> float:
        try:
            needed = needed_slowing(
                problem_of(scene), motion, scene.least_duration / motion.duration
            )
        except Unreachable as error:
            raise Unreachable(f"{name}: {error}") from None
        if not needed.keeps_places:
            raise Infeasible(
                f"{name}: a limit of position is exceeded on it by {needed.misplaced:.2%}, which "
                "no slowing changes"
            )
        return needed.factor

    return _sped(trajectory, factor, f"{name}: gravity alone exceeds a torque limit on it")


def _sped(
    trajectory: Trajectory, factor_of: Callable[[Trajectory], float], obstacle: str
) -> Trajectory:
    """The motion slowed by its factor, found anew while it is far from 1: torques of a motion that
    is ten million times too slow differ by rounding alone from those at rest.

    Raises Infeasible, with the obstacle, where the factor is infinite, or however often it is found
    far from 1: of a motion that hardly keeps a limit at rest it grows beyond all numbers.
    """
    for _ in range(_MOST_SPEEDS):
        factor = factor_of(trajectory)
        if isinf(factor):
            raise Infeasible(obstacle)
        if factor < _UNRESOLVED:
            raise Infeasible("the way is so short that double precision does not resolve it")
        trajectory = trajectory.slowed(factor)
        if 1 / _FAR_OFF < factor < _FAR_OFF:
            return trajectory
    raise Infeasible(obstacle)


def curve_between(scene: Scene, *control: Array) -> Trajectory:
    """The motion in 1 s on the Bézier curve from start to goal with these control points, m."""
    start, goal = given_points(scene.task)
    points = np.array([start, *control, goal])
    n = len(points) - 1
    # In powers of the share of the way, the coefficients are forward differences of the points.
    coefficients, power = np.zeros((n * (len(QUINTIC) - 1) + 1, 3)), np.ones(1)
    for k in range(n + 1):
        coefficients[: len(power)] += np.outer(power, comb(n, k) * np.diff(points, k, axis=0)[0])
        power = polymul(power, QUINTIC)
    return _one_piece(model_of(scene.robot, scene.payload), coefficients)


def _one_piece(model: Model, coefficients: Array) -> Trajectory:
    """A motion of a single polynomial in 1 s, from its coefficients (powers, 3)."""
    return Trajectory(PiecewisePolynomial(np.array([0.0, 1.0]), coefficients[None]), model)
