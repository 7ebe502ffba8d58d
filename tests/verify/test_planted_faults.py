"""Faults put into good motions at random places and of random directions: each must be found."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import comb, nan
from pathlib import Path

import numpy as np
import pytest

from deltaopt import Limits, Scene, baseline, load_scene, plan, verify
from deltaopt.motion.trajectory import PiecewisePolynomial, Trajectory
from deltaopt.planning.initial_motion import straight_line
from deltaopt.robot.model import delta_model
from deltaopt.verify.verification import DYNAMIC_ERROR

PROBLEMS = Path(__file__).parents[2] / "problems"
SCENES = {
    name: load_scene(PROBLEMS / f"{name}.yaml") for name in ("pick_and_place", "long_diagonal")
}
CROSS = load_scene(PROBLEMS / "industrial_cross.yaml")
SEEDS = range(2)


@cache
def planned(name: str) -> Trajectory:
    return plan(SCENES[name]).trajectory


def pieces(trajectory: Trajectory, times: list[float], degree: int) -> PiecewisePolynomial:
    """The same path with knots at these times too, as polynomials of a degree."""
    position = trajectory.position
    old, powers = position.coefficients, position.coefficients.shape[1]
    knots = np.sort(np.concatenate([position.knots, times]))
    begun = position.interval(knots[:-1])
    since = knots[:-1] - position.knots[begun]
    coefficients = np.zeros((len(knots) - 1, max(degree + 1, powers), 3))
    for k in range(powers):
        for j in range(k, powers):
            coefficients[:, k] += comb(j, k) * since[:, None] ** (j - k) * old[begun, j]
    return PiecewisePolynomial(knots, coefficients)


def direction(rng: np.random.Generator) -> np.ndarray:
    d = rng.normal(size=3)
    return d / np.linalg.norm(d)


def most_in(scene: Scene, position: PiecewisePolynomial, piece: int) -> np.ndarray:
    """Largest torque over its limit at 401 instants inside one piece, (401,)."""
    trajectory = Trajectory(position, delta_model(scene.robot, scene.payload))
    t = np.linspace(*position.knots[piece : piece + 2], 403)[1:-1]
    return np.abs(trajectory(t).tau / scene.robot.torque_limits).max(axis=1)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    ("length", "rising", "falling"),
    [(1e-4, 4, 4), (3e-4, 6, 6), (3e-4, 8, 4)],
    ids=["in a piece of 0.1 ms", "amid a longer piece", "off its middle"],
)
@pytest.mark.parametrize("name", SCENES)
def test_torque_for_a_tenth_of_a_millisecond(name, length, rising, falling, seed):
    """0.1 % too much: a smooth bump uⁿ (1 - u)ᵐ in the path, of some nanometres."""
    rng, scene = np.random.default_rng(seed), SCENES[name]
    good = planned(name).slowed(1.002)
    assert verify(scene, good).torque_excess < 0
    begin = rng.uniform(0.02, 0.97) * good.duration
    degree = rising + falling
    position = pieces(good, [begin, begin + length], degree)
    piece = int(np.searchsorted(position.knots, begin + length * 1e-6)) - 1
    h = position.knots[piece + 1] - position.knots[piece]
    bump = np.zeros(degree + 1)
    for j in range(falling + 1):
        bump[rising + j] = comb(falling, j) * (-1.0) ** j
    top = rising / degree
    bump /= top**rising * (1 - top) ** falling * h ** np.arange(degree + 1.0)
    bump, along = bump[:, None] * h**2, direction(rng)

    def bumped(size: float) -> PiecewisePolynomial:
        coefficients = position.coefficients.copy()
        coefficients[piece, : degree + 1] += size * bump * along
        return replace(position, coefficients=coefficients)

    low, high = 0.0, 100.0
    for _ in range(30):
        middle = (low + high) / 2
        excess = most_in(scene, bumped(middle), piece).max() - 1
        low, high = (low, middle) if excess > 1e-3 else (middle, high)
    bad = bumped(high)
    too_much = (most_in(scene, bad, piece) > 1).mean() * h
    assert 0 < too_much < 1.5e-4
    found = verify(scene, replace(good, position=bad))
    assert not found.ok
    assert found.torque_excess == pytest.approx(1e-3, rel=2e-3)
    when = found.excesses["torque_excess"].t
    assert position.knots[piece] <= when <= position.knots[piece + 1]
    assert found.safe_duration > good.duration


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", SCENES)
def test_a_path_that_is_a_micrometre_off(name, seed):
    """As a whole, or one piece of it."""
    rng, good = np.random.default_rng(seed), planned(name)
    position, off = good.position, 1e-6 * direction(rng)
    for piece in (slice(None), int(rng.integers(len(position.knots) - 1))):
        coefficients = position.coefficients.copy()
        coefficients[piece, 0] += off
        bad = replace(good, position=replace(position, coefficients=coefficients))
        found = verify(SCENES[name], bad)
        assert not found.ok
        largest = max(found.start_distance, found.goal_distance, found.position_jump)
        assert largest == pytest.approx(1e-6, rel=1e-6)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("heavier", [1e-8, -1e-8])
def test_another_payload(heavier, seed):
    """By 1e-8 of it: the torques reported do not move what the scene says, fast or slowly."""
    slower = 1 + np.random.default_rng(seed).uniform(0, 3)
    for name, scene in SCENES.items():
        payload = (scene.payload or 1.0) * (1 + heavier)
        other = scene.model_copy(update={"payload": payload})
        model = delta_model(scene.robot, scene.payload or 1.0)
        bad = replace(planned(name).slowed(slower), model=model)
        if scene.payload is None:
            bad = replace(bad, position=bad.position)
        found = verify(other, bad)
        assert not found.ok
        assert found.dynamic_error > DYNAMIC_ERROR


@pytest.mark.parametrize("seed", SEEDS)
def test_a_motor_that_turns_too_fast_by_a_millionth(seed):
    rng = np.random.default_rng(seed)
    line = baseline(CROSS).slowed(1 + rng.uniform(0.1, 1))
    largest = np.abs(line(np.linspace(0, line.duration, 100_001)).dtheta).max(axis=0)
    motor = int(rng.integers(3))
    limits = 1.01 * largest
    limits[motor] = largest[motor] / (1 + 1e-6)
    scene = CROSS.model_copy(update={"limits": Limits(speed=tuple(limits.tolist()))})
    found = verify(scene, line)
    assert not found.ok
    assert found.speed_excess == pytest.approx(1e-6, rel=1e-3)
    assert found.excesses["speed_excess"].subject == f"motor {motor + 1}"
    assert found.safe_duration == pytest.approx(line.duration * (1 + found.speed_excess), rel=1e-12)


@pytest.mark.parametrize("name", SCENES)
def test_time_compressed_by_a_millionth(name):
    found = verify(SCENES[name], planned(name).slowed(1 - 1e-6))
    assert not found.ok
    assert 1e-7 < found.torque_excess < 1e-5
    assert found.safe_duration == pytest.approx(planned(name).duration, rel=1e-11)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_coefficient_that_is_not_a_number(seed):
    rng, good = np.random.default_rng(seed), planned("pick_and_place")
    coefficients = good.position.coefficients.copy()
    coefficients[tuple(rng.integers(coefficients.shape))] = nan
    found = verify(
        SCENES["pick_and_place"],
        replace(good, position=replace(good.position, coefficients=coefficients)),
    )
    assert not found.ok
    assert found.obstacles


def grazing(distance: float) -> Scene:
    """Chain 1 comes so near to being folded, between all samples: sin² = 6 per m of distance."""
    x, robot = 0.3 + distance, SCENES["pick_and_place"].robot
    return Scene(robot=robot, payload=1.0, start=(x, 0.041, 0.0), goal=(x, 0.162, 0.0))


DURATIONS = {
    1e-5: 0.308763,
    1e-6: 0.550214,
    1e-7: 0.776755,
    1e-8: 0.464682,
    1e-9: 0.123861,
    1e-10: 0.123861,
}
"""Distance (m) and the duration (s) that samples at 1/240 of it call safe."""


@pytest.mark.parametrize("distance", DURATIONS)
@pytest.mark.parametrize("intervals", [1, 7])
def test_a_graze_of_a_serial_singularity(distance, intervals):
    """The torque there is known by closing in on the place where sin² is least."""
    scene, T = grazing(distance), DURATIONS[distance]
    line = straight_line(delta_model(scene.robot, 1.0), scene.start, scene.goal, T)
    t, width = np.linspace(0, T, 20_001), T / 100
    for _ in range(12):
        least = line.model.alignments(line(t).x)[:, 0].argmin()
        width /= 4
        t = np.clip(t[least] + width * np.linspace(-1, 1, 2001), 0, T)
        torque = np.abs(line(t).tau).max() / 10
        if width < 1e-2 * T * distance**0.5:
            break
    knots = list(np.linspace(0, T, intervals + 1)[1:-1])
    found = verify(scene, replace(line, position=pieces(line, knots, 5)))
    assert found.torque_excess == pytest.approx(torque - 1, rel=1e-5, abs=2e-6)
    assert found.ok == (torque <= 1 + 1e-9)
    assert found.distances[0].least == pytest.approx(6 * distance, rel=1e-2)
    assert found.distances[0].subject == "chain 1"


def test_the_other_side_of_the_singularity():
    """A line that leaves the workspace for a part in ten thousand of its way."""
    scene = grazing(-1e-9)
    line = straight_line(delta_model(scene.robot, 1.0), scene.start, scene.goal, 1.0)
    found = verify(scene, line)
    assert "arm and bars of chain 1 cannot close there" in found.failures()[0]
