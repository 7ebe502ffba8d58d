"""Faults put into good motions at random places and of random directions: each must be found."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import cache
from math import comb, inf, nan

import numpy as np
import pytest

from deltaopt import Limits, Scene, baseline, load_scene, plan, verify
from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.first_motions.initial_motion import straight_line
from deltaopt.robot.model import DeltaModel, delta_model
from deltaopt.verify.bounds import DYNAMIC_ERROR
from studies.problems import PROBLEMS
from tests.hard_scenes import hard_scene, planned_and_verified

SCENES = {
    name: load_scene(PROBLEMS / f"{name}.yaml") for name in ("pick_and_place", "long_diagonal")
}
CROSS = load_scene(PROBLEMS / "industrial_cross.yaml")
SEEDS = range(1)


@cache
def planned(name: str) -> Trajectory:
    return plan(SCENES[name]).trajectory


@cache
def slower(name: str) -> Trajectory:
    """With room below its limits."""
    good = planned(name).slowed(1.002)
    assert verify(SCENES[name], good).torque_excess < 0
    return good


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
    good = slower(name)
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
    for piece, jumps in ((slice(None), 1), (int(rng.integers(1, len(position.knots) - 2)), 2)):
        coefficients = position.coefficients.copy()
        coefficients[piece, 0] += off
        bad = replace(good, position=replace(position, coefficients=coefficients))
        found = verify(SCENES[name], bad)
        assert not found.ok
        largest = max(found.start_distance, found.goal_distance, found.position_jump)
        assert largest == pytest.approx(jumps * 1e-6, rel=1e-6)


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


@pytest.mark.parametrize(("distance", "intervals"), [*zip(DURATIONS, [1, 7] * 3, strict=True)])
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


def test_the_same_path_a_thousandth_slower_at_its_knots():
    """Knots later by a thousandth, polynomials as they were; one interval longer by 0.1 ms."""
    good = planned("pick_and_place")
    stretched = good.knots * 1.001
    longer = good.knots + 1e-4 * (np.arange(len(good.knots)) > len(good.knots) // 2)
    for slower, knots in ((1.0, stretched), (60.0, longer)):
        bad = replace(good, position=replace(good.position, knots=knots)).slowed(slower)
        said = "; ".join(verify(SCENES["pick_and_place"], bad).failures())
        assert "its position jumps by" in said
        assert "its velocity jumps by" in said


@pytest.mark.parametrize("slower", [1.5, 60.0])
@pytest.mark.parametrize(("key", "more"), [("gravity", 1e-6), ("base_radius", 1e-7)])
def test_another_robot(key, more, slower):
    """By a millionth or less: in fast and in slow motions."""
    scene = SCENES["pick_and_place"]
    robot = scene.robot.model_copy(update={key: getattr(scene.robot, key) * (1 + more)})
    good = planned("pick_and_place").slowed(slower)
    assert verify(scene, good).ok
    assert not verify(scene, replace(good, model=delta_model(robot, scene.payload))).ok


@dataclass(frozen=True)
class LargerTorques(DeltaModel):
    """Reports the torques of a motion, each a little larger."""

    def inverse_dynamics(self, x, v, a):
        return super().inverse_dynamics(x, v, a) * (1 + 1e-7)


@pytest.mark.parametrize("slower", [1.5, 60.0])
def test_torques_that_the_path_does_not_need(slower):
    scene = SCENES["pick_and_place"]
    model = LargerTorques(scene.robot, scene.payload)
    found = verify(scene, replace(planned("pick_and_place").slowed(slower), model=model))
    assert any("accelerations that differ" in each for each in found.failures())


NEAR = {"07_ver_haptic": 0, "05_nc_massless": 2}
"""Scenes whose plans come near a singularity, serial or parallel, and which of the distances that
verification reports is small."""


@dataclass(frozen=True)
class LargerNearby(DeltaModel):
    """Reports torques that are a little larger where one chain is almost in line, or the bars
    almost in a plane: as near to it as a twentieth of the instants that are asked for."""

    parallel: bool = False

    def inverse_dynamics(self, x, v, a):
        tau = super().inverse_dynamics(x, v, a)
        q = self.inverse_kinematics(x)
        distance = np.abs(np.linalg.det(bars(q))) if self.parallel else self.alignments(x).min(1)
        near = distance <= np.quantile(distance, 0.05)
        return tau * (1 + 1e-6 * near[:, None])


def bars(q: np.ndarray) -> np.ndarray:
    """Unit vectors along the bars of the three chains, (N, 3, 3)."""
    found = []
    for k, azimuth in enumerate(2 * np.pi / 3 * np.arange(3)):
        (s2, s3), (c2, c3) = (
            np.sin(q[:, 4 + 3 * k : 6 + 3 * k].T),
            np.cos(q[:, 4 + 3 * k : 6 + 3 * k].T),
        )
        radial, sideways = c2 * c3, s3
        found.append(
            [
                -s2 * c3,
                np.cos(azimuth) * radial - np.sin(azimuth) * sideways,
                np.sin(azimuth) * radial + np.cos(azimuth) * sideways,
            ]
        )
    return np.moveaxis(np.array(found), 2, 0)


@pytest.mark.parametrize("name", NEAR)
def test_torques_and_masses_near_a_singularity(name):
    """There eq. (39) has too few digits to tell, and eq. (37) is asked: it must tell as much."""
    plan, found = planned_and_verified(name)
    scene, good = plan.scene, plan.trajectory
    assert found.ok
    assert found.distances[NEAR[name]].least < 2e-3
    heavier = delta_model(scene.robot, scene.payload * (1 + 1e-8))
    nearby = LargerNearby(scene.robot, scene.payload, parallel=NEAR[name] == 2)
    for model in (heavier, nearby):
        bad = verify(scene, replace(good, model=model))
        assert bad.dynamic_error > 10 * DYNAMIC_ERROR
        assert any("accelerations that differ" in each for each in bad.failures())


def test_a_motion_through_a_parallel_singularity():
    """Between the samples of a planner its torques may look as if they were finite."""
    scene = hard_scene("03_gap_massless")
    beyond = scene.model_copy(update={"goal": (0.288, -0.346, -0.534)})
    line = straight_line(delta_model(scene.robot, scene.payload), scene.start, beyond.goal, 2.0)
    found = verify(beyond, line)
    assert not found.ok
    assert found.torque_excess > 1e6
    assert found.distances[2].least < -0.1


def coordinates_of(good: Trajectory, late: float = 0.0) -> Trajectory:
    """The same motion with all coordinates as polynomials of degree 15, ``late`` (s)."""
    nodes = np.polynomial.chebyshev.chebpts1(16) / 2 + 0.5
    lengths = np.diff(good.knots)
    coefficients = []
    for k, h in enumerate(lengths):
        interval = np.full(16, k)
        x = good.position.inside(interval, nodes * h - late)
        q = good.model.inverse_kinematics(x)
        coefficients.append(np.polynomial.polynomial.polyfit(nodes, q, 15))
    powers = lengths[:, None, None] ** np.arange(16)[:, None]
    position = PiecewisePolynomial(good.knots, np.array(coefficients) / powers)
    return replace(good, coordinates=position)


def test_coordinates_that_are_a_microsecond_late():
    """They obey the constraints, but the torques are those of the path."""
    scene, line = SCENES["pick_and_place"], baseline(SCENES["pick_and_place"])
    line = replace(line, position=pieces(line, list(np.linspace(0, line.duration, 9)[1:-1]), 5))
    assert verify(scene, coordinates_of(line)).ok
    found = verify(scene, coordinates_of(line, late=1e-6))
    assert any("accelerations that differ" in each for each in found.failures())


def test_trajectories_that_are_no_functions_of_time():
    scene, good = SCENES["pick_and_place"], planned("pick_and_place")
    knots, coefficients = good.knots, good.position.coefficients
    last = np.arange(len(knots)) == len(knots) - 1
    polynomials = {
        "time does not increase": PiecewisePolynomial(np.where(last, inf, knots), coefficients),
        "of shape (0, 4, 3) where there are 1 knots": PiecewisePolynomial(
            knots[:1], coefficients[:0]
        ),
        "knots": PiecewisePolynomial(knots[:-1], coefficients),
        "where there are": PiecewisePolynomial(np.append(knots, 1.0), coefficients),
        "cannot be at": PiecewisePolynomial(knots, np.full_like(coefficients, inf)),
    }
    for said, position in polynomials.items():
        found = verify(scene, replace(good, position=position))
        assert not found.ok
        assert said in found.failures()[0]
        assert not json.loads(json.dumps(found.as_dict(), allow_nan=False))["ok"]
    for shape in ((len(knots) - 2, 4, 12), (len(knots) - 1, 4, 11)):
        bad = replace(good, coordinates=PiecewisePolynomial(knots, np.zeros(shape)))
        assert f"of shape {shape}" in verify(scene, bad).failures()[0]


def test_a_motion_of_thousands_of_years():
    """A good one passes; the torques of a payload that differs by a millionth do not."""
    scene, good = SCENES["pick_and_place"], baseline(SCENES["pick_and_place"]).slowed(1e12)
    assert verify(scene, good).failures() == []
    other = delta_model(scene.robot, (scene.payload or 0.0) * (1 + 1e-6))
    assert not verify(scene, replace(good, model=other)).ok
