"""Motions in a tube about a path: as fast as other programs and the limiting cases say, and inside.

The distances of the limit, of verification and of these tests are three programs.
"""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from scipy.spatial import cKDTree

import deltaopt
from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.errors import SceneError, Unreachable
from deltaopt.limits.tube import Tube
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.first_motions.in_tube import room_in_tube
from deltaopt.planning.plan import Plan
from deltaopt.scene.objective import Effort, TimeAndEffort
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import load_robot, load_scene
from deltaopt.verify.path_distance import farthest_from
from studies.bench.hard_moves import move
from studies.bench.statics import Statics
from studies.problems import PROBLEMS
from tests.good_plans import good_plan
from tests.hard_scenes import hard_scene

BENT = load_scene(PROBLEMS / "paths" / "tube.yaml")
STRAIGHT = BENT.model_copy(update={"path": "line"})


@cache
def free() -> Plan:
    return deltaopt.plan(BENT.model_copy(update={"path": None, "tube": None}))


def about(scene: Scene, tube: float) -> Scene:
    return scene.model_copy(update={"tube": tube})


SPACING_SQUARED = 9e-5**2 / 4
"""Of half the way between two samples of a path, m²: by as much a squared distance from the nearest
sample is more than that from the path at most."""


def away_by_samples(scene: Scene, x: np.ndarray) -> np.ndarray:
    """Distances of points, (N, 3), from the path, by 12,001 samples of it."""
    path = scene.path.between(*scene.given_points)
    places = path(np.linspace(path.knots[0], path.knots[-1], 12_001))
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() ** 2 / 4 < SPACING_SQUARED
    return cKDTree(places).query(x)[0]


def planned(scene: Scene, tolerance: float = 1e-3) -> Plan:
    """A plan that verification, and a sampling of its own, find inside the tube."""
    found = good_plan(scene, tolerance=tolerance)
    x = found.trajectory(np.linspace(0, found.duration, 2001)).x
    assert away_by_samples(scene, x).max() ** 2 <= scene.tube**2 + SPACING_SQUARED
    return found


@pytest.mark.parametrize("scene", [STRAIGHT, BENT], ids=["straight", "bent"])
def test_distances_and_their_derivatives(scene: Scene):
    """Of random points as far as 12 mm from the path, against samples and differences."""
    (numbers,) = Tube().items(scene)
    x = ca.SX.sym("x", 3)
    distance = Tube().measure(SimpleNamespace(x=x), ca.DM(numbers))
    measure = ca.Function("measure", [x], [distance, ca.gradient(distance, x)])
    path, rng = scene.path.between(*scene.given_points), np.random.default_rng(4)
    s = rng.uniform(path.knots[0], path.knots[-1], 300)
    points = path(s) + 0.012 / np.sqrt(3) * rng.uniform(-1, 1, (300, 3))
    found = [measure(point) for point in points]
    distances = np.array([float(each[0]) for each in found])
    over = away_by_samples(scene, points) ** 2 - distances**2
    assert over.min() > -1e-15
    assert over.max() < SPACING_SQUARED
    for point, (_, slope) in zip(points[:50], found, strict=False):
        steps = 1e-6 * np.eye(3)
        differences = [float(measure(point + e)[0] - measure(point - e)[0]) / 2e-6 for e in steps]
        np.testing.assert_allclose(np.array(slope).ravel(), differences, atol=1e-5)


def test_distances_where_parts_of_a_path_meet():
    """There a point was by rounding beside neither of two parts, and had its distance from a third:
    a motion along the axis itself was told to leave its tube."""
    scene = move(3, 1116).scene
    (numbers,) = Tube().items(scene)
    x = ca.SX.sym("x", 3)
    measure = ca.Function("measure", [x], [Tube().measure(SimpleNamespace(x=x), ca.DM(numbers))])
    path, rng = scene.path.between(*scene.given_points), np.random.default_rng(8)
    parts = np.linspace(path.knots[:-1], path.knots[1:], 9)[1:].ravel()[:-1]
    points = (path(parts) + 1e-17 * rng.normal(size=(200, len(parts), 3))).reshape(-1, 3)
    assert np.array(measure(points.T)).max() < 1e-11
    assert deltaopt.plan(scene).duration < 0.12


def test_a_wide_tube_is_none():
    found = planned(about(STRAIGHT, 0.2))
    assert found.duration <= free().duration * (1 + found.gap)
    assert free().duration <= found.duration * (1 + free().gap)


def test_a_narrow_tube_is_the_path():
    """From below, the nearer the narrower, and to what both plans may be above their optima."""
    durations = [planned(about(STRAIGHT, tube)).duration for tube in (1e-2, 1e-3, 1e-4)]
    assert durations == sorted(durations)
    on_line = deltaopt.plan(STRAIGHT.on_its_path, tolerance=1e-5)
    gains = 1 - np.array(durations) / on_line.duration
    assert (gains > -on_line.gap).all()
    np.testing.assert_allclose(gains, [1.11e-2, 1.1e-3, 1.1e-4], atol=5e-4)
    assert durations[-1] == pytest.approx(on_line.duration, rel=1e-3)


def test_the_same_by_ipopt():
    """Of a program that is solved by another solver."""
    scene = about(STRAIGHT, 2e-3)
    ours, other = planned(scene), deltaopt.plan(scene, solver=deltaopt.ipopt)
    assert ours.duration <= other.duration * (1 + ours.gap)
    assert other.duration <= ours.duration * (1 + other.gap)


def test_the_shipped_example():
    """Between the path timed optimally, 0.1807 s, and a free path, 0.1401 s."""
    found = planned(BENT)
    assert found.duration == pytest.approx(0.16039, rel=1.5e-3)
    assert "within 5 mm of a path" in BENT.task.description


def test_verification_sees_a_nanometre():
    """On the path moved across itself by the tube and a nanometre more or less."""
    straight = deltaopt.plan(STRAIGHT.on_its_path).trajectory
    for beyond, is_kept in ((-1e-9, True), (1e-9, False)):
        coefficients = straight.position.coefficients.copy()
        coefficients[:, 0] += [STRAIGHT.tube + beyond, 0.0, 0.0]
        position = PiecewisePolynomial(straight.knots, coefficients)
        path = STRAIGHT.path.between(*STRAIGHT.given_points)
        farthest, _ = farthest_from(path, position, STRAIGHT.tube)
        assert farthest == pytest.approx(STRAIGHT.tube + beyond, abs=1e-13)
        report = deltaopt.verify(STRAIGHT, Trajectory(position, straight.model))
        excess = report.excesses["distance_from_the_path_excess"]
        assert (excess.value <= 1e-9) == is_kept


def test_kept_where_two_places_are_equally_near():
    """This motion turns sharply out of a corner of its tube: there the nearest place leaps from
    one leg of the path to the next, and the distance has a kink between all samples."""
    planned(move(3, 306).scene, 1e-2)


def test_a_wider_tube_is_no_slower():
    """Inside of bends whose radius is less than the tube's the wall has edges. While points of a
    mesh had to find their sides of these, tubes of 9.7 mm took 1.5 % longer than those of 9.6."""
    narrow, wide = planned(about(BENT, 9.6e-3)), planned(about(BENT, 9.7e-3))
    assert wide.duration <= narrow.duration * (1 + wide.gap)


def test_all_first_motions_lead_to_one():
    """Past an edge of the wall; there were three local minima, 1 % apart."""
    found = deltaopt.plan(about(BENT, 9.7e-3), starts=6)
    assert [each.starts for each in found.optima] == [6]


def test_with_limited_jerk_too():
    """Without phases that meet on the edges this took 0.1542 s."""
    limits = deltaopt.Limits(jerk=2e4)
    assert planned(about(BENT, 1.2e-2).model_copy(update={"limits": limits})).duration < 0.154


@pytest.mark.parametrize(
    ("tube", "objective"),
    [(0.0137, Effort(duration=0.3)), (0.02, TimeAndEffort(time=1.0, effort=3e-5))],
)
def test_least_effort_stays_in_the_tube(tube: float, objective: Effort | TimeAndEffort):
    """Also at a kink of the distance between all samples, by which these plans left the tube."""
    scene = about(BENT, tube).model_copy(update={"objective": objective})
    report = deltaopt.verify(scene, deltaopt.plan(scene, tolerance=1e-2).trajectory)
    assert report.ok, report.failures()


def test_roundings_are_divided_where_they_are_sharp():
    """Once each, also where the path ends in one and its last part fills unused places."""
    path = {"pick_and_place": {"height": 0.02, "blend": 0.02}}
    ends_in_roundings = Scene.model_validate({**BENT.model_dump(), "path": path, "tube": 0.08})
    for scene, regions in ((ends_in_roundings, 3), (BENT, 1), (about(BENT, 1e-2), 3)):
        (numbers,) = Tube().items(scene)
        assert Tube().regions(np.array(numbers)) == regions


def test_a_place_is_as_far_from_a_path_as_from_the_nearest_of_its_stretches():
    """Also beside the edge inside of a bend, where both are about as near."""
    (given,) = Tube().items(about(BENT, 0.02))
    numbers, rng = np.array(given), np.random.default_rng(7)
    path = BENT.path.between(*BENT.given_points)
    begin, end, middle = path(np.array([*path.knots[1:3], path.knots[1:3].mean()]))
    inwards = (begin + end) / 2 - middle
    depth = rng.uniform(0.0, 0.02, (1000, 1)) / np.linalg.norm(inwards)
    points = middle + depth * inwards + 3e-5 * rng.standard_normal((1000, 3))
    x, own = ca.SX.sym("x", 3), ca.SX.sym("numbers", len(numbers))
    measure = ca.Function("measure", [x, own], [Tube().measure(SimpleNamespace(x=x), own)])
    regions = [numbers, *(Tube().of_regions(numbers, k, k + 1) for k in range(3))]
    whole, *each = (np.array([float(measure(point, own)) for point in points]) for own in regions)
    np.testing.assert_allclose(np.min(each, axis=0), whole, atol=1e-9)
    nearest = Tube().nearest(numbers, points)
    np.testing.assert_allclose(np.choose(nearest, each), whole, atol=1e-4)  # by chords


def test_a_way_is_found_where_the_path_itself_leaves_the_workspace():
    """Within 150 mm of it; within 3 mm there is none, and the path's own place is told."""
    move = hard_scene("17_nc_orsino")
    scene = Scene.model_validate({**move.model_dump(), "path": "line", "tube": 0.15})
    free = deltaopt.plan(move)
    assert planned(scene).duration > free.duration / (1 + free.gap)
    told = list[str]()
    with pytest.raises(Unreachable, match="arm and bars of chain 1 cannot close") as error:
        deltaopt.plan(about(scene, 0.003), progress=told.append)
    assert not any("intervals" in line for line in told)  # no motion outside the tube is tried
    written = str(error.value).split("[")[1].split("]")[0]
    place = np.array([[float(each) for each in written.split(", ")]])
    assert away_by_samples(scene, place).max() < 1e-6 + SPACING_SQUARED**0.5
    assert np.isnan(Statics(scene.robot, 0.0).at(place).angles).any()


def test_a_path_that_leaves_the_workspace_by_less_than_the_tube_is_wide():
    """Up by 94 mm, where the arms reach 72, across and down. It was refused, for its axis cannot be
    driven; but in the tube is the path that goes up by 70 mm."""
    orsino = load_robot(PROBLEMS / "robots" / "orsino.yaml")
    path = {"pick_and_place": {"height": 0.094, "blend": 0.047}}
    ends = {"start": (0.402, -0.075, 0.351), "goal": (0.361, 0.18, 0.051)}
    scene = Scene(robot=orsino, payload=0.5, path=path, tube=0.027, **ends)
    lower = scene.model_copy(update={"path": {"pick_and_place": {"height": 0.07, "blend": 0.035}}})
    assert planned(scene).duration < good_plan(lower.on_its_path).duration


def beside(body: dict, path: str | dict, tube: float, points: list) -> tuple[Scene, Scene]:
    """The move past a body in a tube, and along a path of straight lines through its room."""
    scene = {**BENT.model_dump(), "keep_out": [body]}
    known = {**scene, "tube": None, "path": {"points": points, "blend": 0.005}}
    found = {**scene, "tube": tube, "path": path}
    return Scene.model_validate(found), Scene.model_validate(known)


@pytest.mark.parametrize(("half", "tube"), [(0.009, 0.01), (0.026, 0.03)])
def test_a_body_across_the_axis_is_passed_in_the_tube(half: float, tube: float):
    """There is room on both sides, but the axis, the only motion that was tried, leads through."""
    body = {"box": {"from": [0.75, -0.01, -half], "to": [1.4, 0.01, half]}}
    aside = (half + tube) / 2
    points = [[0.85, y, aside] for y in (-0.12, 0.12)]
    scene, known = beside(body, "line", tube, points)
    assert planned(scene).duration < good_plan(known).duration


def test_a_wall_across_a_bent_axis_is_passed_in_the_tube():
    """By a path that is 23 mm from the axis at most; this wall and higher ones were not passed."""
    body = {"box": {"from": [0.774, -0.03, -0.5], "to": [1.4, 0.03, 0.5]}}
    points = [[x, y, 0.0] for x, y in ((0.79, -0.15), (0.767, -0.12), (0.767, 0.12), (0.79, 0.15))]
    path = {"pick_and_place": {"height": 0.06, "blend": 0.02}}
    scene, known = beside(body, path, 0.03, points)
    assert planned(scene).duration < good_plan(known).duration


def test_room_in_a_tube_for_first_motions():
    """By straight lines along its axis: beside its roundings of 20 mm within 0.2 mm."""
    x = np.array([0.84, 0.0, 0.0]) + np.random.default_rng(3).uniform(-0.03, 0.03, (300, 3))
    x[:, 1] *= 6
    room, inwards = room_in_tube(BENT.axis_of_tube, 0.02, x)
    np.testing.assert_allclose(0.02 - away_by_samples(BENT, x), room, atol=2e-4)
    step = 1e-7 * np.random.default_rng(4).standard_normal((300, 3))
    more, _ = room_in_tube(BENT.axis_of_tube, 0.02, x + step)
    np.testing.assert_allclose(more - room, (inwards * step).sum(axis=1), atol=1e-10)


def test_a_free_motion_leaves_the_tube():
    report = deltaopt.verify(BENT, free().trajectory)
    x = free().trajectory(np.linspace(0, free().duration, 4001)).x
    farthest = away_by_samples(BENT, x).max()
    excess = report.excesses["distance_from_the_path_excess"]
    assert excess.amount == pytest.approx(farthest - BENT.tube, rel=2e-3)
    assert any("distance from the path" in sentence for sentence in report.failures())


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"path": None}, "a path beside it"),
        ({"path": {"speeds": [0.1, 0.0]}}, "without speeds"),
        ({"path": {"points": [[0.85, 0.2, 0.0]], "blend": 0.01}}, "turns back"),
        ({"tube": 0.0}, "greater than 0"),
    ],
)
def test_what_does_not_go_with_a_tube(changes: dict, expected: str):
    with pytest.raises(SceneError, match=expected):
        Scene.model_validate({**STRAIGHT.model_dump(exclude_none=True), **changes})
