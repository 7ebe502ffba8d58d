"""What a motion does, by formulas of the campaign's own: nothing of deltaopt but the scene's words.

Dynamics by d'Alembert's principle: a slender bar of mass m with its ends at A and B resists with
m/6 (2 A'' + B'') at A and m/6 (A'' + 2 B'') at B. So no angle of a bar and no matrix is needed.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import cos, pi, sin

import numpy as np

from deltaopt import Belt, Line, Robot, Scene, State, Trajectory
from deltaopt.curves.piecewise import Array
from deltaopt.robot.robot import as_delta
from tests.oracles.body_distances import tool_distances

_SLACK = 1e-6
"""Share of a bound, and m: what is beyond it by less is not called wrong here."""
_SAMPLES = np.linspace(0.0, 1.0, 21)
_DOWN = np.array([1.0, 0.0, 0.0])
_OUT = np.array([[0.0, cos(2 * pi * k / 3), sin(2 * pi * k / 3)] for k in (0, 1, -1)])


@dataclass(frozen=True)
class Loads:
    """Angles, speeds and torques of the motors, (N, 3) each, rad, rad/s, N·m."""

    theta: Array
    dtheta: Array
    tau: Array


def loads(robot: Robot, payload: float, x: Array, v: Array, a: Array) -> Loads:
    """What a motion of the tool's point, (N, 3) each, m, m/s, m/s², asks of the motors of a robot
    with slender bars."""
    arm, bars, drive = robot.upper_arm, robot.forearm, robot.drive
    g = np.array(robot.gravity_vector)
    along, across = arm.centre or (arm.length / 2, 0.0)
    own = arm.mass * arm.length**2 / 12 if arm.inertia is None else arm.inertia
    elbow = robot.elbow.mass if robot.elbow else 0.0
    inertia = own + arm.mass * (along**2 + across**2) + elbow * arm.length**2
    inertia += drive.inertia or 0.0
    mass = robot.platform.mass + 3 * (robot.platform.pins or 0.0) + payload
    mass += (robot.tool.mass if robot.tool else None) or 0.0
    force, found, rates = mass * (a - g), [], []
    for out in _OUT:
        tip = x - np.array(robot.tool_offset) + robot.platform_radius * out
        theta = _angle(robot, tip - robot.base_radius * out, out)
        e, u = _directions(theta, out)
        bar = tip - robot.base_radius * out - arm.length * e
        rate = 1 / _dot(bar, arm.length * u)
        dtheta = rate * _dot(bar, v)
        ddtheta = rate * (
            _dot(v - arm.length * u * dtheta, v - arm.length * u * dtheta)
            + _dot(bar, a + arm.length * e * dtheta**2)
        )
        lifted = arm.length * (u * ddtheta - e * dtheta**2)
        moment = inertia * ddtheta - arm.mass * (along * u - across * e) @ g[:, None]
        push = bars.mass / 6 * (2 * lifted + a) - (bars.mass / 2 + elbow) * g
        moment = moment + _dot(arm.length * u, push)
        if drive.friction:
            moment += (drive.friction.viscous or 0.0) * dtheta
            if drive.friction.coulomb:
                moment += drive.friction.coulomb * np.tanh(dtheta / (drive.friction.speed or 1.0))
        force = force + bars.mass / 6 * (lifted + 2 * a) - bars.mass / 2 * g
        found.append((theta, dtheta, moment))
        rates.append(bar * rate)
    theta, dtheta, moment = (np.concatenate(each, axis=1) for each in zip(*found, strict=True))
    tau = moment + np.linalg.solve(np.stack(rates, axis=2), force[:, :, None])[:, :, 0]
    return Loads(theta, dtheta, tau)


def _dot(one: Array, other: Array) -> Array:
    return np.asarray(np.sum(one * other, axis=1, keepdims=True))


def _directions(theta: Array, out: Array) -> tuple[Array, Array]:
    """Along an arm, and where a positive turn moves its end, (N, 3) each."""
    c, s = np.cos(theta), np.sin(theta)
    return c * out - s * _DOWN, -s * out - c * _DOWN


def _angle(robot: Robot, tip: Array, out: Array) -> Array:
    """Of the arm whose forearm ends at ``tip``, seen from the shaft: the elbow outside, (N, 1)."""
    arm, bars = robot.upper_arm.length, robot.forearm.length
    down, outward = tip @ _DOWN[:, None], tip @ out[:, None]
    cosine = (_dot(tip, tip) + arm**2 - bars**2) / (2 * arm * np.hypot(down, outward))
    return np.asarray(np.arccos(np.clip(cosine, -1, 1)) - np.arctan2(down, outward))


def sampled(trajectory: Trajectory) -> tuple[Array, Array, Array, Array]:
    """Times, (N,), and position, velocity and acceleration, (N, 3) each, from its polynomials."""
    knots, pieces = trajectory.position.knots, trajectory.position.coefficients
    found: list[tuple[Array, ...]] = []
    for (begin, end), piece in zip(pairwise(knots), pieces, strict=True):
        since = _SAMPLES * (end - begin)
        own = [np.polynomial.Polynomial(column) for column in piece.T]
        motion = [np.stack([each.deriv(k)(since) for each in own], axis=1) for k in range(3)]
        found.append((begin + since, *motion))
    t, x, v, a = (np.concatenate(each) for each in zip(*found, strict=True))
    return t, x, v, a


def faults(scene: Scene, trajectory: Trajectory) -> list[str]:
    """What is wrong with a motion that is to solve a scene, in words."""
    t, x, v, a = sampled(trajectory)
    robot, limits, found = as_delta(scene.robot), scene.limits, []
    given = limits.model_dump(exclude_none=True) if limits else {}
    masses = [each for each in (scene.payload, scene.least_payload) if each is not None] or [0.0]
    for mass in masses:
        on = loads(robot, mass, x, v, a)
        torque = np.minimum(robot.torque_limits, given.get("torque", np.inf))
        found.append((f"torque with {mass:g} kg", np.abs(on.tau) / torque))
        for (slow, most), (fast, least) in pairwise(robot.drive.torque_curve or ()):
            slope = (most - least) / (fast - slow)
            at_rest = most + slope * slow
            found.append(("torque at speed", np.abs(on.tau + slope * on.dtheta) / at_rest))
    speed = np.minimum(robot.speed_limits or np.inf, given.get("speed", np.inf))
    found.append(("speed", np.abs(on.dtheta) / speed))
    force = a - np.array(robot.gravity_vector)
    sizes = {"platform_speed": v, "acceleration": a, "specific_force": force}
    for key, vectors in sizes.items():
        if key in given:
            found.append((key, np.linalg.norm(vectors, axis=1) / given[key]))
    wrong = [f"{name} {share.max():.6f}" for name, share in found if share.max() > 1 + _SLACK]
    return wrong + _misplaced(scene, t, x, v)


def _misplaced(scene: Scene, t: Array, x: Array, v: Array) -> list[str]:
    """Where a motion is that it must not be, in words."""
    away: dict[str, float] = {}
    for name, end, i in (("start", scene.start, 0), ("goal", scene.goal, -1)):
        if isinstance(end, tuple | State | Belt):
            at = np.array(end if isinstance(end, tuple) else end.at)
            velocity = np.array(
                end.belt if isinstance(end, Belt) else getattr(end, "velocity", (0.0, 0.0, 0.0))
            )
            moved = velocity * (t[-1] - t[0]) if isinstance(end, Belt) else 0.0
            away[name] = float(np.linalg.norm(x[i] - at - moved))
            away[f"{name} speed"] = float(np.linalg.norm(v[i] - velocity))
    for point in scene.via or ():
        place, within = (point, 0.0) if isinstance(point, tuple) else (point.at, point.within)
        away[f"via {place}"] = float(np.linalg.norm(x - place, axis=1).min()) - within
    if isinstance(scene.path, Line):
        one, other = np.array(scene.given_points)
        ahead = (other - one) / np.linalg.norm(other - one)
        aside = np.linalg.norm((x - one) - ((x - one) @ ahead)[:, None] * ahead, axis=1)
        away["path"] = float(aside.max()) - (scene.tube or 0.0)
    if scene.keep_out and not (scene.robot.tool and scene.robot.tool.shapes):
        away["bodies"] = (scene.clearance or 0.0) - float(tool_distances(scene, x).min())
    return [f"{name}: {distance:.2e}" for name, distance in away.items() if distance > _SLACK]


def table_share(scene: Scene, t: Array, rows: list[Array]) -> float:
    """The largest share of a torque that a table of motor angles and their derivatives, (N, 3)
    each, asks for where Hermite polynomials, as many as fit, move between its rows."""
    most, order = 0.0, 2 * len(rows)
    for i, length in enumerate(np.diff(t)):
        if length < 1e-12:
            continue
        u = np.linspace(0.0, 1.0, 9)
        both = [(end, k) for end in (0, 1) for k in range(len(rows))]
        matrix = [_powers(np.array([float(end)]), order, k)[0] for end, k in both]
        ends = [rows[k][i + end] * length**k for end, k in both]
        solved = np.linalg.solve(np.array(matrix), np.array(ends))
        motion = [_powers(u, order, k) @ solved / length**k for k in range(3)]
        robot = as_delta(scene.robot)
        tau = loads(robot, scene.payload or 0.0, *_platform(robot, *motion)).tau
        most = max(most, float((np.abs(tau) / scene.robot.torque_limits).max()))
    return most


def _powers(u: Array, number: int, order: int) -> Array:
    """Derivatives of an order of so many powers, (N, number)."""
    each = [np.polynomial.Polynomial.basis(n).deriv(order)(u) for n in range(number)]
    return np.stack([np.broadcast_to(column, u.shape) for column in each], axis=1)


def _platform(robot: Robot, theta: Array, dtheta: Array, ddtheta: Array) -> tuple[Array, ...]:
    """Motion of the tool's point for a motion of the arms, (N, 3) each: three spheres meet."""
    e, u = zip(*(_directions(theta[:, [k]], out) for k, out in enumerate(_OUT)), strict=True)
    arm, apart = robot.upper_arm.length, robot.base_radius - robot.platform_radius
    a, b, c = (apart * out + arm * e[k] for k, out in enumerate(_OUT))
    rows = np.stack([b - a, c - a], axis=1)
    squares = np.concatenate([_dot(b, b) - _dot(a, a), _dot(c, c) - _dot(a, a)], axis=1) / 2
    foot = (np.linalg.pinv(rows) @ (squares - (rows @ a[:, :, None])[:, :, 0])[:, :, None])[:, :, 0]
    normal = np.cross(b - a, c - a)
    normal *= np.sign(normal[:, :1]) / np.linalg.norm(normal, axis=1, keepdims=True)
    point = a + foot
    point = point + normal * np.sqrt(robot.forearm.length**2 - _dot(foot, foot))
    bars = np.stack([point - each for each in (a, b, c)], axis=1)
    turned = np.einsum("nkc,knc->nk", bars, arm * np.array(u))
    v = np.linalg.solve(bars, (turned * dtheta)[:, :, None])[:, :, 0]
    rates = np.stack([v - arm * u[k] * dtheta[:, [k]] for k in range(3)], axis=1)
    inward = np.einsum("nkc,knc->nk", bars, arm * np.array(e)) * dtheta**2
    right = turned * ddtheta - inward - np.sum(rates**2, axis=2)
    return point + robot.tool_offset, v, np.linalg.solve(bars, right[:, :, None])[:, :, 0]
