"""Kinds of attempts: motions that are no solution, harmless scenes, settings at their ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

import deltaopt
from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.robot.model import delta_model
from studies.attack.attempts import Attempt, Generator
from studies.attack.checks import faults
from studies.problems import INDUSTRIAL, PICK_AND_PLACE, PROBLEMS

_SCENE = deltaopt.load_scene(PICK_AND_PLACE)
_ROBOT = deltaopt.load_robot(INDUSTRIAL)
_BEND = 256.0 * np.array([1, -4, 6, -4, 1])
"""(4 u (1 - u))⁴, 1 at its middle: its coefficients from the fourth power on."""

_BAD: dict[str, Callable[[Array, Array], tuple[Any, Any]]] = {
    "zeros": lambda t, c: (t, 0 * c),
    "no knots": lambda t, c: (t[:0], c[:0]),
    "one knot": lambda t, c: (t[:1], c[:0]),
    "turned": lambda t, c: (t[::-1], c),
    "standing": lambda t, c: (0 * t, c),
    "too many pieces": lambda t, c: (t[:-1], c),
    "too few pieces": lambda t, c: (t, c[:-1]),
    "two components": lambda t, c: (t, c[:, :, :2]),
    "flat": lambda t, c: (t, c[:, :, 0]),
    "no powers": lambda t, c: (t, c[:, :0]),
    "one power": lambda t, c: (t, c[:, :1]),
    "many powers": lambda t, c: (t, np.pad(c, ((0, 0), (0, 40), (0, 0)), constant_values=1e6)),
    "complex": lambda t, c: (t, c + 1e-3j),
    "complex times": lambda t, c: (t + 0j, c),
    "booleans": lambda t, c: (t, c > 0),
    "whole": lambda t, c: (t, c.astype(int)),
    "texts": lambda t, c: (t, c.astype(str)),
    "objects": lambda t, c: (t, c.astype(object)),
    "lists": lambda t, c: (t.tolist(), c.tolist()),
    "nan": lambda t, c: (t, np.where(c == c.max(), np.nan, c)),
    "infinite": lambda t, c: (t, np.where(c == c.max(), np.inf, c)),
    "nan in time": lambda t, c: (np.where(t == t[-1], np.nan, t), c),
    "None": lambda t, c: (None, None),
    "short floats": lambda t, c: (t.astype(np.float16), c.astype(np.float16)),
    "late": lambda t, c: (t + 1e9, c),
    "slow": lambda t, c: (t * 1e12, c),
    "table": lambda t, c: (t[:, None], c),
}


def motions(rng: Generator) -> Attempt:
    """What is no motion: verification says so, and never raises."""
    way, twelve = str(rng.choice(list(_BAD))), bool(rng.integers(2))

    def made() -> str:
        line = deltaopt.baseline(_SCENE)
        position = line.position
        coefficients = position.coefficients
        if twelve:
            shape = (*coefficients.shape[:2], 12)
            coefficients = np.resize(coefficients, shape)
        bad = PiecewisePolynomial(*_BAD[way](position.knots, coefficients))
        motion = replace(line, coordinates=bad) if twelve else replace(line, position=bad)
        return "ok" if deltaopt.verify(_SCENE, motion).ok else ""

    return Attempt(f"{way}, of {'coordinates' if twelve else 'position'}", made)


def bent(
    position: PiecewisePolynomial, begin: float, end: float, size: Array
) -> PiecewisePolynomial:
    """A position with a bump of a size, (3,), m, between two instants of one piece, s."""
    i = int(position.interval(np.array([begin]))[0])
    at = [position.knots[i], begin, end, position.knots[i + 1]]
    pieces = np.zeros((3, max(9, position.coefficients.shape[1]), 3))
    for j, start in enumerate(at[:3]):
        for k, column in enumerate(position.coefficients[i].T):
            shifted = np.polynomial.Polynomial(column)(
                np.polynomial.Polynomial([start - at[0], 1.0])
            ).coef
            pieces[j, : len(shifted), k] = shifted
    powers = np.power(end - begin, np.arange(4, 9))
    pieces[1, 4:9] += (_BEND / powers)[:, None] * size
    rest = np.pad(
        position.coefficients,
        ((0, 0), (0, pieces.shape[1] - position.coefficients.shape[1]), (0, 0)),
    )
    kept = np.array([b > a for a, b in pairwise(at)])
    return PiecewisePolynomial(
        np.concatenate([position.knots[:i], np.array(at)[:-1][kept], position.knots[i + 1 :]]),
        np.concatenate([rest[:i], pieces[kept], rest[i + 1 :]]),
    )


_PLANNED = ["pick_and_place", "via/three_points", "moving/belt", "payload/range", "paths/glue_line"]
_PLANNED += ["limits/platform_speed", "limits/specific_force", "keep_out/into_a_box", "hornet/1_kg"]


def damaged(rng: Generator) -> Attempt:
    """A good motion with a bump between two instants: it exceeds something, or is in its place."""
    name = str(rng.choice(_PLANNED))
    width, share = float(10 ** rng.uniform(-9, -2)), float(rng.uniform(0, 0.98))
    pull, direction = float(10 ** rng.uniform(2, 4)), rng.normal(size=3)
    direction /= np.linalg.norm(direction)

    def made() -> str:
        plan = deltaopt.plan(deltaopt.load_scene(PROBLEMS / f"{name}.yaml"))
        found = deltaopt.verify(plan.scene, plan.trajectory)
        if not found.ok:
            return f"the plan: {found.failures()}"
        own = faults(plan.scene, plan.trajectory)
        position = plan.trajectory.position
        begin = share * plan.duration
        i = int(position.interval(np.array([begin]))[0])
        end = min(begin + width, 0.5 * (begin + position.knots[i + 1]))
        bump = bent(position, begin, end, pull * (end - begin) ** 2 * direction)
        motion = replace(plan.trajectory, position=bump)
        beyond = faults(plan.scene, motion)
        if deltaopt.verify(plan.scene, motion).ok and beyond:
            return f"ok, with {'; '.join(beyond)}"
        return "; ".join(own)

    return Attempt(f"{name}: {width:.2e} s at {share:.3f}, {pull:.0f} m/s²: {direction}", made)


def _from_rest_to_rest(points: list[Array], duration: float, pieces: int) -> PiecewisePolynomial:
    """Straight legs, each by a quintic law, of so many pieces and seconds."""
    found: PiecewisePolynomial | None = None
    law = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    u = np.linspace(0, 1, pieces + 1)
    for one, other in pairwise(points):
        of_time = [law(np.polynomial.Polynomial([a, 1 / duration])).coef for a in u[:-1]]
        coefficients = np.array(of_time, dtype=float)[:, :, None] * (other - one)
        coefficients[:, 0] += one
        leg = PiecewisePolynomial(u * duration, coefficients)
        found = found.then(leg) if found else leg
    assert found
    return found


def strays(rng: Generator) -> Attempt:
    """A slow motion that leaves its path for a moment, leaves out a loop of it, turns back, or
    jumps a little at every knot: its torques are far within their limits, and it is not ok."""
    way = str(rng.choice(["bump", "piece", "loop", "back", "jumps"]))
    size, width = float(10 ** rng.uniform(-4, -2)), float(10 ** rng.uniform(-6, -0.5))
    share, pieces = float(rng.uniform(0.05, 0.6)), int(rng.integers(2, 40))
    start, goal = np.array([0.45, -0.06, 0.0]), np.array([0.45, 0.1, 0.0])
    crossing = start + rng.uniform(0.3, 0.6) * (goal - start)

    def made() -> str:
        path: Any = "line"
        legs = [start, goal]
        if way == "loop":
            far = crossing + np.array([0, 0.05, 0])
            aside = np.array([-0.04, 0, 0.03]), np.array([-0.04, 0, -0.03])
            corners = [far, far + aside[0], crossing + aside[1]]
            end = crossing - aside[1]
            path = {"points": [each.tolist() for each in corners], "blend": 0.005}
            legs = [start, crossing, end]
        if way == "back":
            legs = [start, goal, crossing, goal]
        scene = deltaopt.Scene(
            robot=_SCENE.robot, start=tuple(start), goal=tuple(legs[-1]), path=path, payload=1.0
        )
        duration, number = (0.25, 500 + 20 * pieces) if way == "jumps" else (2.0, pieces)
        position = _from_rest_to_rest(legs, duration, number)
        if way == "jumps":
            coefficients = position.coefficients.copy()
            apart = np.arange(number)
            coefficients[:, 0, 1] += 0.9e-8 * np.minimum(apart, apart[::-1])
            position = replace(position, coefficients=coefficients)
        if way in ("bump", "piece"):
            i = int(share * pieces)
            begin, end = position.knots[i : i + 2]
            end = end if way == "piece" else begin + width * (end - begin)
            position = bent(position, begin, end, size * np.array([1.0, 0.0, 0.0]))
        motion = deltaopt.Trajectory(position, delta_model(_SCENE.robot, 1.0))
        return "ok" if deltaopt.verify(scene, motion).ok else ""

    return Attempt(f"{way}: {size:.2e} m, {width:.2e}, at {share:.3f}, {pieces} pieces", made)


_FEATURES: dict[str, Callable[[Array], dict[str, Any]]] = {
    "wall": lambda u: {
        "keep_out": [{"box": {"from": [0.8 + 0.03 * u[0], -0.01, -0.3], "to": [1.2, 0.01, 0.3]}}]
    },
    "sphere": lambda u: {
        "keep_out": [{"sphere": {"centre": [0.86, 0.02 * u[1], 0.0], "radius": 0.03 + 0.01 * u[0]}}]
    },
    "belt": lambda u: {"goal": {"at": [0.85, 0.12, 0.02 * u[2]], "belt": [0, 0, 0.1 + 0.3 * u[3]]}},
    "state": lambda u: {"goal": {"at": [0.85, 0.14, 0.0], "velocity": [0, 0, 0.2 + 0.3 * u[3]]}},
    "via": lambda u: {"via": [{"at": [0.8, 0.02 * u[4], 0.03 * u[5]], "within": 0.005}]},
    "point": lambda u: {"via": [[0.8, 0.02 * u[4], 0.03 * u[5]]]},
    "range": lambda u: {"payload": [0.0, 0.5 + u[6]]},
    "speed": lambda u: {"limits": {"platform_speed": 2.0 + u[7]}},
    "acceleration": lambda u: {"limits": {"acceleration": 40 + 20 * u[7]}},
    "force": lambda u: {"limits": {"specific_force": 40 + 20 * u[7]}},
    "rotation": lambda u: {"rotation": {"angle": 1.0 + u[8], "speed": 20.0, "acceleration": 400.0}},
    "tool": lambda u: {"tool": {"radius": 0.01 + 0.01 * u[9]}},
    "clearance": lambda u: {"clearance": 0.002 + 0.002 * u[9]},
    "approach": lambda u: {
        "approach": {
            end: {"height": 0.02, "radius": 0.004 + 0.002 * u[0]} for end in ("start", "goal")
        }
    },
    "line": lambda u: {"path": "line"},
    "tube": lambda u: {"path": "line", "tube": 0.004 + 0.004 * u[1]},
}
_NEAR, _STEP = 1e-4, 0.01
"""How far neighbouring scenes are apart, of the range of each number; and by how much their
durations may differ, beside their gaps."""


def triples(rng: Generator) -> Attempt:
    """Three features of a harmless scene, at neighbouring values: both are planned, and alike."""
    features = sorted(rng.choice(list(_FEATURES), size=3, replace=False).tolist())
    u, start = rng.uniform(size=10), [0.85, round(float(rng.uniform(-0.16, -0.1)), 4), 0.0]

    def planned(at: Array) -> deltaopt.Plan:
        content: dict[str, Any] = {"start": start, "goal": [0.85, 0.14, 0.0], "payload": 1.0}
        for feature in features:
            content |= _FEATURES[feature](at)
        return deltaopt.plan(deltaopt.Scene(robot=_ROBOT, **content))

    def made() -> str:
        plans = []
        for near in (u, u + _NEAR):
            try:
                plans.append(planned(near))
            except deltaopt.SceneError:  # what does not go together, as documented
                return "" if not plans else "its neighbour alone is refused"
            except deltaopt.DeltaOptError as error:
                blocked = "line" in features and {"wall", "sphere"} & {*features}
                return "" if blocked and not plans else f"refused: {error}"
        problems = [each for plan in plans for each in faults(plan.scene, plan.trajectory)]
        problems += [
            f"not ok: {found.failures()}"
            for plan in plans
            if not (found := deltaopt.verify(plan.scene, plan.trajectory)).ok
        ]
        problems += [
            f"lower bound {plan.lower_bound:.6f} s, duration {plan.duration:.6f} s"
            for plan in plans
            if plan.lower_bound > plan.duration * (1 + 1e-12)  # a rotation sets both
        ]
        one, other = plans
        step = abs(other.duration / one.duration - 1) - one.gap - other.gap
        problems += [f"{one.duration:.4f} s and {other.duration:.4f} s"] * int(step > _STEP)
        return "; ".join(problems)

    return Attempt(f"{' + '.join(features)}: start {start}, u = {u.tolist()}", made)


def extremes(rng: Generator) -> Attempt:
    """Settings and scenes at the ends of what may be asked: a verified plan, or a sentence."""
    end, power = float(rng.uniform(0.05, 0.15)), int(rng.integers(1, 5))
    goal = (0.45, end, 0.0)
    number = int(rng.choice([50, 300, 1000]))
    y = np.linspace(-0.05, end, number + 2)[1:-1]
    settings: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
        "tolerance": ({}, {"tolerance": 10.0 ** -(3 * power)}),
        "intervals": ({}, {"intervals": [2, 500, 3000, 9999][power - 1]}),
        "effort": ({"objective": {"effort": 10.0**power}}, {}),
        "effort soon": ({"objective": {"effort": 0.2 + 10.0**-power}}, {}),
        "via": ({"via": [[0.44 + 0.005 * np.sin(9 * each), each, 0.0] for each in y]}, {}),
        "near": ({"goal": (0.45, -0.05 + 10.0 ** (-3 * power), 0.0)}, {}),
        "weak": ({"limits": {"torque": 3.5 + 10.0**-power}}, {}),
        "slow": ({"limits": {"platform_speed": 10.0 ** (-2 * power)}}, {}),
        "gentle": ({"limits": {"acceleration": 10.0 ** (-2 * power)}}, {}),
        "starts": ({}, {"starts": 3 * power}),
        "bodies": (
            {"keep_out": [{"sphere": {"centre": [0.6, each, 0.0], "radius": 1e-3}} for each in y]},
            {},
        ),
        "turn": ({"rotation": {"angle": 10.0**power, "speed": 1.0, "acceleration": 1.0}}, {}),
    }
    what = str(rng.choice(list(settings)))
    keys, how = settings[what]

    def made() -> str:
        content: dict[str, Any] = {"start": (0.45, -0.05, 0.0), "goal": goal, "payload": 1.0}
        scene = deltaopt.Scene(robot=_SCENE.robot, **content | keys)
        try:
            plan = deltaopt.plan(scene, **how)
        except ValueError as error:  # as documented, of a setting
            return "" if str(error).startswith(tuple(how)) and how else f"ValueError: {error}"
        found = deltaopt.verify(plan.scene, plan.trajectory)
        if not found.ok:
            return f"{found.failures()}"
        return "; ".join(faults(plan.scene, plan.trajectory))

    return Attempt(f"{what}, 10^{power}, {number}, to {end:.4f}", made)
