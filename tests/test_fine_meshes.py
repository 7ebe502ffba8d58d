"""Meshes alone to a gap of 1e-6: tightened limits, and Pontryagin's condition from their prices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deltaopt import load_scene, verify
from deltaopt.feasibility import least_opening
from deltaopt.model import delta_model
from deltaopt.planning.adjoint import certify_mesh
from deltaopt.planning.flat import Flat
from deltaopt.planning.gap import FRACTIONS, TIGHTENED
from deltaopt.planning.plan import Planner
from deltaopt.planning.problem import Guess
from deltaopt.planning.rounds import Round, attempt, gap_of
from deltaopt.planning.scales import Scales
from deltaopt.planning.search import Search
from deltaopt.planning.starts import first_motions
from deltaopt.planning.structure import SHARP, Limit, read_structure
from deltaopt.planning.tightening import Overshoot
from deltaopt.planning.transcription import LINEAR
from deltaopt.pontryagin import MET
from deltaopt.scene import Limits, Scene
from test_resolution import REFERENCE


def posed(scene: Scene):
    functions = delta_model(scene.robot, scene.payload).functions
    return Flat().of(functions, LINEAR, speed=scene.speed_limits is not None)


def scales_of(scene: Scene) -> Scales:
    return Scales(scene, next(first_motions(scene, 1, 1)).duration, least_opening(scene))


def first(scene: Scene, tolerance: float) -> Guess:
    return Guess(next(first_motions(scene, 1, 1)), near=False, tolerance=tolerance)


CROSS = load_scene("problems/industrial_cross.yaml")
machine_code = pytest.mark.skipif(
    posed(CROSS).on(np.full(4, 0.25))._interior_point is None,
    reason="without a compiler meshes end at 300 intervals",
)


@machine_code
@pytest.mark.parametrize("name", REFERENCE)
def test_a_mesh_alone_comes_to_the_reference(name):
    """Known by switch resolution, a quite different method."""
    scene = load_scene(f"problems/{name}.yaml")
    planner = Planner(scene.robot, scene.payload, scene.limits, tolerance=1e-6, resolved_below=0.0)
    found = planner.plan(scene.start, scene.goal)
    assert found.within_tolerance
    assert -2e-7 < found.duration / REFERENCE[name] - 1 < 1.2e-6
    assert verify(scene, found.trajectory).ok


def limited(scene: Scene, share: float) -> Scene:
    """With a share of all limits."""
    torque = tuple(share * limit for limit in scene.torque_limits)
    speed = tuple(share * limit for limit in scene.speed_limits)
    return scene.model_copy(update={"limits": Limits(torque=torque, speed=speed)})


@machine_code
def test_a_share_of_the_limits_is_that_of_weaker_motors():
    """The same program, scaled otherwise; the prices are those of the whole limits."""
    mesh, share, by_interval = np.full(12, 1 / 12), 0.8, np.full((12, 1, 3), 0.8)
    model, scales = delta_model(CROSS.robot, CROSS.payload), scales_of(CROSS)
    problem, guess = posed(CROSS).on(mesh), first(CROSS, 1e-9)
    shared = replace(scales, torque_share=by_interval, speed_share=by_interval)
    weaker = Scales(limited(CROSS, share), scales.time, scales.opening_at_ends)
    one, other = (problem.solve(guess, s, model.parameters) for s in (shared, weaker))
    assert one.position.knots[-1] == pytest.approx(other.position.knots[-1], rel=1e-8)
    np.testing.assert_allclose(share * one.prices, other.prices, atol=1e-5)
    assert (
        one.position.knots[-1]
        > 1.02 * problem.solve(guess, scales, model.parameters).position.knots[-1]
    )


# Tightened limits


def loads(N: int, value: float = 0.5) -> np.ndarray:
    return np.full((N, len(FRACTIONS), 3), value)


def bump(torque: np.ndarray, interval: int, motor: int, height: float) -> None:
    """At the limit at all points, and over it halfway between the first two."""
    torque[interval, :, motor] = 1.0
    torque[interval, len(FRACTIONS) // 6, motor] = 1 + height


N = 1000
FINE = np.full(N, 1 / N)


def test_only_what_lies_between_the_points_is_overshoot():
    torque = loads(N)
    bump(torque, 3, 1, 1e-3)
    torque[5, :, 2] = -1.002  # at the points too: no matter of the mesh
    over = Overshoot.of(FINE, torque, None).each
    assert over[3, 1] == pytest.approx(1e-3)
    over[3, 1] = 0.0
    assert (over == 0).all()


def test_limits_are_tightened_where_they_are_exceeded_and_beside(scales):
    torque = loads(N)
    bump(torque, 3, 1, 1e-3)
    share = Overshoot.of(FINE, torque, None).tightened(scales, FINE).shares(N)
    assert set(np.flatnonzero(share[:, 1] < 1 - 1e-3)) == {2, 3, 4}
    assert (np.delete(share, 1, axis=1) == 1).all()


def test_tightening_falls_with_the_interval(scales):
    torque = loads(N)
    bump(torque, 3, 1, 1e-3)
    over = Overshoot.of(FINE, torque, None)
    whole = 1 - over.tightened(scales, FINE).shares(N)
    halves = 1 - over.tightened(scales, np.repeat(FINE / 2, 2)).shares(2 * N)
    np.testing.assert_allclose(halves[::2], whole / 2)


def test_tightening_is_remembered_on_the_same_mesh(scales):
    """The next motion does not exceed the limit, and would if that were forgotten."""
    torque = loads(N)
    bump(torque, 3, 1, 1e-3)
    once = Overshoot.of(FINE, torque, None).tightened(scales, FINE)
    twice = Overshoot.of(FINE, loads(N), None).tightened(once, FINE)
    ratio = (1 - twice.shares(N)[3, 1]) / (1 - once.shares(N)[3, 1])
    assert 0.5 < ratio < 1


def test_long_intervals_are_not_tightened(scales):
    mesh = np.full(10, 0.1)
    assert mesh[0] > TIGHTENED
    torque = loads(10)
    bump(torque, 3, 1, 1e-2)
    assert (Overshoot.of(mesh, torque, None).tightened(scales, mesh).shares(10) == 1).all()


@pytest.fixture(scope="module")
def scales():
    return scales_of(CROSS)


@machine_code
def test_tightening_cures_what_slowing_pays_for():
    """On one mesh: the excess falls tenfold, and the duration hardly rises."""
    model, scales, mesh = (
        delta_model(CROSS.robot, CROSS.payload),
        scales_of(CROSS),
        np.full(400, 1 / 400),
    )
    problem = posed(CROSS).on(mesh)
    plain = attempt(problem, scales, first(CROSS, 1e-7), model)
    tighter = plain
    for _ in range(3):
        guess = Guess(tighter.trajectory, near=True, tolerance=1e-7)
        tighter = attempt(problem, tighter.overshoot.tightened(tighter.scales, mesh), guess, model)
    assert plain.safe_factor > 1 + 1e-5
    assert tighter.safe_factor - 1 < 0.1 * (plain.safe_factor - 1)
    assert (
        0
        < tighter.trajectory.duration / plain.trajectory.duration - 1
        < 0.1 * (plain.safe_factor - 1)
    )


# What a mesh says of Pontryagin's condition


@pytest.fixture(scope="module")
def searched():
    """Two meshes for one scene, coarse and fine."""
    search = Search(
        posed(CROSS), scales_of(CROSS), delta_model(CROSS.robot, CROSS.payload), 1e-6, False, print
    )
    search.from_guess(first(CROSS, 1e-4), 16)
    return search


def certified(search, attempt, prices=1.0):
    means = attempt.loads.torque.reshape(len(attempt.mesh), -1, 3).mean(axis=1)
    solution = replace(attempt.solution, prices=attempt.solution.prices * prices)
    return certify_mesh(search._stage, solution, attempt.trajectory, attempt.scales, means)


@machine_code
def test_a_fine_mesh_meets_pontryagins_condition_and_a_coarse_one_does_not(searched):
    """H = -1 by theory, from prices that know nothing of it."""
    coarse, fine = (certified(searched, searched.attempts[i]) for i in (0, -1))
    assert fine.residual <= MET < coarse.residual
    assert searched.certificate(searched.attempts[-1]) == fine
    assert searched.certificate(searched.attempts[0]) is None


@machine_code
def test_wrong_prices_do_not(searched):
    """Those of one motor a tenth too high."""
    assert (
        certified(searched, searched.attempts[-1], np.array([1.1, 1, 1, 1, 1, 1])).residual
        > 10 * MET
    )


def test_sharp_readings_tell_coming_to_a_limit_from_being_there():
    """Speed rises to its limit within three intervals, torque leaves its limit a little early."""
    torque, speed = np.zeros((10, 3, 1)), np.zeros((10, 3, 1))
    torque[:4], speed[4:, :, 0] = 1.0, 1.0
    speed[3, :, 0] = [0.992, 0.996, 0.9999]
    mesh = np.full(10, 0.1)
    coarse = read_structure(mesh, torque, speed)
    sharp = read_structure(mesh, torque, speed, None, SHARP[0])
    assert coarse.lengths[0] == pytest.approx(0.3)
    assert sharp.lengths[0] == pytest.approx(0.4)
    assert sharp.limits == ((Limit(torque=1),), (Limit(speed=1),))


# Which gap is told


def round_with(duration, gap, spent):
    return Round(10, 5, duration, duration * 1.001, gap, spent)


def test_a_worse_local_minimum_says_nothing_of_the_gap(searched):
    spent = searched.rounds[0].spent
    best, astray = round_with(1.0, 5e-3, spent), round_with(1.2, 1e-6, spent)
    assert gap_of([best, astray], 0) == 5e-3
    finer = round_with(0.9995, 1e-4, spent)
    assert gap_of([best, finer, astray], 0) == pytest.approx(
        best.safe_duration / (finer.safe_duration / 1.0001) - 1
    )
