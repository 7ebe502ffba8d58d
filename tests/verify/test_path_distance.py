"""Motions that leave their scene's path fail."""

from __future__ import annotations

import numpy as np
import pytest

import deltaopt
from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.motion.trajectory import Trajectory
from deltaopt.verify.path_distance import nearest_places, off_path
from studies.problems import PROBLEMS


def test_a_free_motion_is_off_the_path():
    line = deltaopt.load_scene(PROBLEMS / "paths" / "glue_line.yaml")
    free = deltaopt.plan(line.model_copy(update={"path": None}))
    report = deltaopt.verify(line, free.trajectory)
    x = free.trajectory(np.linspace(0, free.duration, 2001)).x
    away = np.linalg.norm(x[:, [0, 2]] - np.array(line.start)[[0, 2]], axis=1).max()
    assert report.path_distance == pytest.approx(away, rel=1e-2)
    assert any("off the scene's path" in sentence for sentence in report.failures())


def test_a_micrometre_is_seen():
    lane = deltaopt.load_scene(PROBLEMS / "paths" / "safe_lane.yaml")
    plan = deltaopt.plan(lane, tolerance=1e-2)
    assert deltaopt.verify(lane, plan.trajectory).path_distance < 1e-14
    knots, coefficients = plan.trajectory.knots, plan.trajectory.position.coefficients.copy()
    coefficients[:, 0] += 1e-6 * np.array([1.0, 0.0, 0.0])
    moved = Trajectory(PiecewisePolynomial(knots, coefficients), plan.trajectory.model)
    report = deltaopt.verify(lane, moved)
    assert report.path_distance == pytest.approx(1e-6, rel=1e-6)
    assert not report.ok


def test_a_free_scene_has_no_such_measure():
    scene = deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml")
    report = deltaopt.verify(scene, deltaopt.baseline(scene))
    assert report.path_distance is None


def test_the_nearest_place_of_a_path_is_found_beyond_the_centres_of_its_bends():
    """Where a tube is thicker than a bend, two places of the path may be nearly as near."""
    start, goal = (0.5, -0.2, 0.0), (0.48, 0.15, 0.1)
    path = deltaopt.PickAndPlace(height=0.04, blend=0.02).between(start, goal)
    rng = np.random.default_rng(5)
    on, away = path(rng.uniform(path.knots[0], path.knots[-1], 4000)), rng.normal(size=(4000, 3))
    x = on + 0.035 * away / np.linalg.norm(away, axis=1)[:, None]
    s, found = nearest_places(path, x)
    np.testing.assert_allclose(np.linalg.norm(path(s) - x, axis=1), found, atol=1e-15)
    dense = path(np.linspace(path.knots[0], path.knots[-1], 4001))
    apart = np.linalg.norm(np.diff(dense, axis=0), axis=1).max()
    parts = (part[:, None] - dense for part in np.array_split(x, 40))
    sampled = np.concatenate([np.linalg.norm(part, axis=2).min(axis=1) for part in parts])
    assert (found <= sampled + 1e-15).all()
    np.testing.assert_allclose(found, sampled, rtol=0, atol=apart / 2)


GLUE = deltaopt.load_scene(PROBLEMS / "paths" / "glue_line.yaml")
GLUED = deltaopt.plan(GLUE, tolerance=1e-2).trajectory


def test_off_the_path_between_all_samples():
    """By 10 mm in a piece, at rest on the path at places where samples may be."""
    position, zeros = GLUED.position, 8
    piece, powers = len(position.coefficients) // 2, position.coefficients.shape[1]
    h = float(np.diff(position.knots)[piece])
    bump = np.polynomial.Polynomial.fromroots(
        np.linspace(0, h, zeros), domain=[0, h], window=[0, h]
    )
    t = np.linspace(0, h, 4001)
    coefficients = np.zeros((len(position.coefficients), max(zeros + 1, powers), 3))
    coefficients[:, :powers] = position.coefficients
    coefficients[piece, : zeros + 1, 0] += 0.01 / np.abs(bump(t)).max() * bump.coef
    bad = Trajectory(PiecewisePolynomial(position.knots, coefficients), GLUED.model)
    assert off_path(GLUE.task, bad, 1e-8) == pytest.approx(0.01, rel=2e-3)


CROSSING = (0.88, 0.0, 0.0)
LOOP = ((0.88, 0.1, 0.0), (0.88, 0.1, 0.1), (0.88, 0.0, 0.1))
"""The way goes through the crossing, round the loop, and through it again at a right angle."""


def on_path(points, start, goal) -> deltaopt.Scene:
    scene = deltaopt.load_scene(PROBLEMS / "paths" / "industrial_25_305_25.yaml")
    path = deltaopt.Corners(points=points, blend=0.01) if points else deltaopt.Line()
    return scene.model_copy(update={"start": start, "goal": goal, "path": path})


def in_turn(*scenes: deltaopt.Scene) -> Trajectory:
    """Planned one after the other, from rest to rest."""
    found = [deltaopt.plan(scene, tolerance=1e-2).trajectory for scene in scenes]
    position = found[0].position
    for each in found[1:]:
        position = position.then(each.position)
    return Trajectory(position, found[0].model)


def test_a_loop_of_the_path_is_not_left_out():
    begin, end = (0.88, -0.1, 0.0), (0.88, 0.0, -0.1)
    whole = on_path(LOOP, begin, end)
    good, short = in_turn(whole), in_turn(on_path((), begin, CROSSING), on_path((), CROSSING, end))
    assert deltaopt.verify(whole, good).failures() == []
    found = deltaopt.verify(whole, short)
    assert found.path_distance >= 0.1 / 2**0.5  # of its farthest place from the crossing, halved
    assert not found.ok


def part(position: PiecewisePolynomial, begin: float, end: float) -> PiecewisePolynomial:
    """Of a motion, between two instants."""
    rest = position.after(begin)
    kept = rest.knots < end - begin
    return PiecewisePolynomial(
        np.append(rest.knots[kept], end - begin), rest.coefficients[: kept.sum()]
    )


def test_the_loop_is_not_run_the_other_way_round_nor_twice():
    whole = on_path(LOOP, (0.88, -0.1, 0.0), (0.88, 0.0, -0.1))
    position = in_turn(whole).position
    t = np.linspace(0, position.knots[-1], 200_001)
    away = np.linalg.norm(position.at(t) - CROSSING, axis=1)
    first, second = t[1:-1][
        (away[1:-1] < away[2:]) & (away[1:-1] <= away[:-2]) & (away[1:-1] < 1e-4)
    ]
    into, loop = part(position, 0, first), part(position, first, second)
    out = part(position, second, t[-1])
    lengths = np.diff(loop.knots)
    other_way = PiecewisePolynomial.hermite(
        np.append(0, np.cumsum(lengths[::-1])),
        loop.at(loop.knots)[::-1],
        -loop.derivative().at(loop.knots)[::-1],
    )
    for middle, least, most in ((loop, 0, 1e-5), (loop.then(loop), 0.04, 1), (other_way, 0.04, 1)):
        position = into.then(middle).then(out)
        found = off_path(whole.task, Trajectory(position, None), 1e-5)
        assert least <= found <= most


def test_a_path_that_turns_back_is_followed_by_a_motion_with_other_knots():
    """There two places are as near as each other, before and after the turn."""
    points = ((0.88, 0.1, 0.0), (0.88, -0.05, 0.0))
    scene = on_path(points, (0.88, -0.1, 0.0), (0.88, 0.1, 0.05))
    good = in_turn(scene).position
    for cut in np.random.default_rng(1).uniform(0, good.knots[-1], 3):
        both = part(good, 0, cut).then(good.after(cut))
        assert off_path(scene.task, Trajectory(both, None), 1e-8) < 1e-13


def test_jumps_at_many_knots_add_up():
    """Each is below what one jump may be."""
    scene = deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml")
    line = deltaopt.baseline(scene).slowed(2.0)
    number, T = 300, line.duration
    t = np.linspace(0, T, number + 1)
    x, v = line.position, line.position.derivative()
    exact = PiecewisePolynomial.hermite(t, x.at(t), v.at(t))
    steps = exact.coefficients.copy()
    up = np.minimum(np.arange(number), number - 1 - np.arange(number))
    steps[:, 0, 0] += 1e-8 * up
    drifting = Trajectory(PiecewisePolynomial(t, steps), line.model)
    found = deltaopt.verify(scene, drifting)
    assert found.position_jump == pytest.approx(1e-8 * (number - 2), rel=1e-6)
    assert any("its position jumps by" in sentence for sentence in found.failures())
