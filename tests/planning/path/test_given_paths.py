"""Motions on given paths against other formulations, closed forms, and by verification."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

import deltaopt
from deltaopt.motion.extrema import sample_fractions
from deltaopt.motion.limit_curves import limit_curves
from deltaopt.planning.path import on_mesh, sweep
from deltaopt.planning.path.path_mesh import PathMesh
from deltaopt.planning.path.path_rows import PathRows
from deltaopt.planning.plan import Plan
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.scene import Scene
from studies.bench.random_scenes import random_scenes
from studies.problems import PROBLEMS
from tests.oracles.compiled_sweep import compiled_sweep
from tests.oracles.path_arcs import two_arcs
from tests.oracles.path_by_ipopt import duration_by_ipopt, torque_coefficients

PICK = deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml")
CROSS = deltaopt.load_scene(PROBLEMS / "industrial_cross.yaml")
ROUNDED = {"pick_and_place": {"height": 0.025, "blend": 0.02}}


def random_paths(
    robot: deltaopt.Robot, payload: float | None, number: int, seed: int
) -> Iterator[deltaopt.Scene]:
    """Random moves on lines, through corners and on pick-and-place paths by turns, of which some
    lead out of the workspace."""
    rng = np.random.default_rng(seed)
    for i, scene in enumerate(random_scenes(robot, payload, number, seed)):
        start, goal = np.array(scene.start), np.array(scene.goal)
        way = float(np.linalg.norm(goal - start))
        path: deltaopt.Line | deltaopt.Corners | deltaopt.PickAndPlace = deltaopt.Line()
        if i % 3 == 1:
            shares = np.sort(rng.uniform(0.15, 0.85, size=rng.integers(1, 4)))
            points = start + shares[:, None] * (goal - start)
            points += 0.2 * way * rng.uniform(-1, 1, size=points.shape)
            shortest = np.linalg.norm(np.diff([start, *points, goal], axis=0), axis=1).min()
            blend = float(rng.uniform(0.1, 0.5) * shortest)
            path = deltaopt.Corners.model_validate({"points": points.tolist(), "blend": blend})
        elif i % 3 == 2:
            height = float(rng.uniform(0.05, 0.3) * way)
            across = float(np.linalg.norm((goal - start)[1:]))
            blend = float(rng.uniform(0.1, 0.5) * min(height, across))
            path = deltaopt.PickAndPlace(height=height, blend=blend)
        yield scene.model_copy(update={"path": path})


def on(scene: Scene, path: object, **changes: object) -> Scene:
    content = {key: getattr(scene, key) for key in ("robot", "payload", "limits", "start", "goal")}
    return Scene.model_validate({**content, "path": path, **changes})


def excess(plan: Plan) -> float:
    fractions = sample_fractions(len(plan.trajectory.knots) - 1)
    curves = limit_curves(problem_of(plan.scene), plan.trajectory, fractions)
    return max(float(np.nanmax(np.abs(each.shares))) - 1 for each in curves)


def test_the_line_against_two_arcs_with_a_resolved_switch():
    """To 1e-8: an integration to 12 digits of the largest acceleration and deceleration."""
    plan = deltaopt.plan(on(PICK, "line"), tolerance=1e-7)
    reference = two_arcs(on(PICK, "line"), plan.duration)
    assert plan.gap <= 1e-7
    assert reference * (1 - 1e-8) < plan.duration < reference * (1 + plan.gap)


def test_friction_against_two_arcs():
    """Rows that are not affine: viscous friction, and Coulomb's as a smooth step."""
    drive = {"torque": 10.0, "friction": {"viscous": 0.2, "coulomb": 0.5, "speed": 0.5}}
    rough = on(PICK, "line", robot=PICK.robot.model_copy(update={"drive": drive}))
    plan = deltaopt.plan(rough, tolerance=1e-6)
    reference = two_arcs(rough, plan.duration)
    assert reference > 1.005 * deltaopt.plan(on(PICK, "line")).duration
    assert reference * (1 - 1e-7) < plan.duration < reference * (1 + plan.gap)
    assert excess(plan) < 1e-10


@pytest.mark.parametrize("ramp", [0.005, 0.05])
@pytest.mark.parametrize("speeds", [(0.0, 0.0), (0.443, 0.354)])
def test_coulomb_friction_that_changes_fast_beside_rest(ramp, speeds):
    """Tangents at a motion that creeps in a corner made the next one creep more; rows whose
    friction is flat at usual speeds were taken for affine; and near ends nobody looked. Without
    friction, with as much less torque, it takes 2 % longer."""
    robot = deltaopt.load_robot(PROBLEMS / "robots" / "industrial_drive.yaml")
    friction, most = robot.drive.friction, max(robot.speed_limits)
    steep = robot.drive.model_copy(update={"friction": friction.model_copy(update={"speed": ramp})})
    left = max(robot.torque_limits) - friction.coulomb - friction.viscous * most
    weak = robot.drive.model_copy(update={"friction": None, "torque": left})
    places = [(0.652, -0.225, -0.344), (0.734, 0.25, -0.138), (0.55, 0.017, -0.574)]
    rough, smooth = (
        Scene(
            robot=robot.model_copy(update={"drive": drive}),
            payload=0.15,
            start=(0.769, -0.174, -0.068),
            goal=(0.514, 0.44, -0.644),
            path={"points": [*places, (0.631, 0.496, -0.369)], "blend": 0.237, "speeds": speeds},
        )
        for drive in (steep, weak)
    )
    plan = deltaopt.plan(rough)
    assert deltaopt.verify(rough, plan.trajectory).ok
    assert plan.gap < 1e-3
    finer = deltaopt.plan(rough, tolerance=2e-4)
    assert plan.duration <= finer.duration * (1 + plan.gap)
    assert finer.duration <= plan.duration * (1 + finer.gap)
    assert plan.duration < deltaopt.plan(smooth).duration


def test_friction_beside_a_limit_of_acceleration():
    """Slopes of its row at another speed are no tangents: that took 40 s, and a gap of 5e-3."""
    robot = deltaopt.load_robot(PROBLEMS / "robots" / "industrial.yaml")
    rough = {"viscous": 0.4, "coulomb": 1.2, "speed": 0.02}
    drive = robot.drive.model_copy(update={"friction": rough})
    scene = Scene(
        robot=robot.model_copy(update={"drive": drive}),
        payload=1.0,
        start=(0.291, -0.665, 0.231),
        goal=(0.787, -0.381, -0.095),
        path={"points": [(0.935, -0.121, 0.248)], "blend": 0.01},
        limits={"acceleration": 20.0},
    )
    plan = deltaopt.plan(scene)
    assert plan.gap < 1e-3
    assert deltaopt.verify(scene, plan.trajectory).ok


@pytest.mark.parametrize(
    ("scene", "path", "cells"), [(PICK, "line", 800), (CROSS, "line", 800), (CROSS, ROUNDED, 2400)]
)
def test_another_formulation_takes_as_long(scene, path, cells):
    """Ipopt's constant s̈ in each cell is within 1e-3 of it, as its own error is."""
    plan = deltaopt.plan(on(scene, path), tolerance=1e-4)
    assert duration_by_ipopt(plan.scene, cells) == pytest.approx(plan.duration, rel=1e-3)


@pytest.mark.parametrize("name", ["industrial_25_305_25", "glue_line", "safe_lane"])
def test_shipped_paths_are_verified(name):
    scene = deltaopt.load_scene(PROBLEMS / "paths" / f"{name}.yaml")
    plan = deltaopt.plan(scene)
    report = deltaopt.verify(scene, plan.trajectory)
    assert report.failures() == []
    assert report.path_distance is not None
    assert report.path_distance < 1e-14
    assert plan.within_tolerance


def test_gaps_are_what_they_say():
    """Against a plan that is ten to a thousand times as exact."""
    for scene in (on(CROSS, ROUNDED), on(PICK, "line")):
        best = deltaopt.plan(scene, tolerance=1e-5)
        for tolerance in (1e-2, 1e-3, 1e-4):
            plan = deltaopt.plan(scene, tolerance=tolerance)
            assert -best.gap <= plan.duration / best.duration - 1 <= plan.gap <= tolerance
            assert excess(plan) < 1e-10


def test_gaps_on_random_paths():
    """Also where a limit that is tightened in one cell slows the motion far beyond it."""
    compared = 0
    for scene in random_paths(CROSS.robot, 1.0, 15, 1):
        try:
            plan, best = (deltaopt.plan(scene, tolerance=each) for each in (1e-3, 1e-4))
        except deltaopt.DeltaOptError:  # the path leaves the workspace
            continue
        assert plan.within_tolerance
        assert plan.duration / best.duration - 1 <= plan.gap
        compared += 1
    assert compared > 5


def test_friction_on_random_paths():
    """Its tangents are ten million times as steep at rest as elsewhere: whatever can be planned
    without friction can be with it, as well as plans say."""
    drive = {"torque": 60.0, "speed": 10.0}
    friction = {"viscous": 1.0, "coulomb": 2.0, "speed": 0.05}
    smooth = CROSS.robot.model_copy(update={"drive": drive})
    rough = CROSS.robot.model_copy(update={"drive": {**drive, "friction": friction}})
    compared = 0
    for scene in random_paths(smooth, 1.0, 12, 1):
        try:
            deltaopt.plan(scene)
        except deltaopt.DeltaOptError:  # the path leaves the workspace
            continue
        scene = scene.model_copy(update={"robot": rough})
        plan, best = (deltaopt.plan(scene, tolerance=each) for each in (1e-2, 1e-3))
        assert plan.within_tolerance
        assert plan.duration / best.duration - 1 <= plan.gap
        compared += 1
    assert compared > 4


def test_a_limit_of_acceleration_on_a_line():
    """Strong motors: T = 2 √(L / A)."""
    strong = PICK.robot.model_copy(update={"drive": {"torque": 5e3}})
    scene = on(PICK, "line", robot=strong, limits={"acceleration": 3.0})
    plan = deltaopt.plan(scene, tolerance=1e-4)
    assert plan.duration == pytest.approx(2 * np.sqrt(0.15 / 3.0), rel=1e-6)


def test_a_limit_of_acceleration_on_a_half_circle():
    """With (v²)′ = 2 √(A² - v⁴ / r²): v² = A r sin(2 s / r) until v² = A r, which is then held;
    the end mirrors the begin."""
    r, A = 0.05, 3.0
    curve = deltaopt.Curve.of(lambda s, order: half_circle(r, s, order), 0.0, np.pi * r)
    strong = PICK.robot.model_copy(update={"drive": {"torque": 5e3}})
    scene = on(
        PICK, curve, robot=strong, limits={"acceleration": A}, start=curve.x[0], goal=curve.x[-1]
    )
    plan = deltaopt.plan(scene, tolerance=1e-4)
    # ∫ ds / v from 0 to π r / 4, with sin(2 s / r) = z⁴ to take the singularity out
    z = (np.polynomial.legendre.leggauss(60)[0] + 1) / 2
    weights = np.polynomial.legendre.leggauss(60)[1] / 2
    angle = np.pi / 2 * (1 - (1 - z**2) ** 2)  # of 2 s / r, quadratic at both ends
    rate = np.pi / 2 * 4 * z * (1 - z**2)
    ramp = weights @ (rate * r / 2 / np.sqrt(A * r * np.sin(angle)))
    expected = 2 * ramp + np.pi * r / 2 / np.sqrt(A * r)
    assert expected * (1 - 1e-6) < plan.duration < expected * (1 + 1e-4)
    assert deltaopt.verify(scene, plan.trajectory).failures() == []


def half_circle(r: float, s: np.ndarray, order: int) -> np.ndarray:
    angle = s / r + order * np.pi / 2
    around = r ** (1 - order) * np.stack([0 * s, np.cos(angle), np.sin(angle)], axis=1)
    return around + (np.array([0.45, 0.0, 0.0]) if order == 0 else 0.0)


def test_a_path_with_a_point_of_standstill():
    """There and back again on one line: p′ = 0 where it turns, and the motion is two lines."""
    there = np.array([0.45, 0.05, 0.0])
    corners = deltaopt.Corners(points=(tuple(there.tolist()),), blend=0.05)
    back = on(PICK, corners, goal=(0.45, -0.02, 0.0))
    apex = back.task.path(back.task.path.knots[1] + 0.05)[0]  # the rounding turns before its corner
    assert np.linalg.norm(back.task.path(back.task.path.knots[1] + 0.05, 1)) < 1e-12
    lines = [
        deltaopt.plan(on(PICK, "line", start=begin, goal=end), tolerance=1e-5).duration
        for begin, end in ((PICK.start, tuple(apex)), (tuple(apex), back.goal))
    ]
    plan = deltaopt.plan(back, tolerance=1e-4)
    assert plan.duration == pytest.approx(sum(lines), rel=2e-4)
    assert deltaopt.verify(back, plan.trajectory).failures() == []


def test_zero_inertia_points_and_dynamic_singularities():
    """On this path every motor's torque loses its s̈ somewhere, and the fastest motion passes such
    points at the largest speed that is possible there."""
    scene = on(PICK, ROUNDED)
    path = scene.task.path
    s = np.linspace(*path.knots[[0, -1]], 2001)
    _, by_u, _ = torque_coefficients(deltaopt.DeltaModel(scene.robot, scene.payload), path, s)
    assert (np.diff(np.sign(by_u), axis=0) != 0).any(axis=0).sum() >= 2
    plan = deltaopt.plan(scene, tolerance=1e-4)
    assert plan.within_tolerance
    assert excess(plan) < 1e-10


def test_no_pulses_of_torque_at_a_point_of_zero_inertia():
    """At 0.155 s of this path motor 1 is at its limit and loses its s̈, so that leaps of s̈ would be
    all but free: the others' torques, a fifth of their limits there, must not leap."""
    scene = deltaopt.load_scene(PROBLEMS / "paths" / "industrial_25_305_25.yaml")
    trajectory = deltaopt.plan(scene).trajectory
    motion = trajectory.inside_intervals([0.0, 0.5, 1.0])
    near = (motion.t > 0.150) & (motion.t < 0.160)
    shares = motion.tau[near] / np.array(scene.robot.torque_limits)
    assert near.sum() > 60
    assert np.abs(shares[:, 0] + 1).max() < 0.01
    assert shares[:, 1:].min() > 0.05
    assert shares[:, 1:].max() < 0.35


def test_one_call_for_a_mesh_is_what_arrays_do(monkeypatch):
    """All of ``on_mesh.c`` against numpy, with curved rows and tightened bounds too."""
    if on_mesh.compiled() is None:
        pytest.skip("no compiler")
    monkeypatch.setattr(on_mesh, "swept", compiled_sweep)
    rng = np.random.default_rng(1)
    for limits in (None, {"acceleration": 60.0}):
        scene = on(CROSS, ROUNDED, limits=limits)
        rows, path = PathRows(scene), scene.task.path
        mesh = PathMesh.first(path, 60)
        n = 2 * len(mesh.h)
        state = rng.uniform(1.0, 4.0, n), rng.normal(size=n)
        tighter = rng.uniform(0.0, 0.1, (len(mesh.h), len(rows.owners)))
        given = (rows, mesh, on_mesh.Tangency(state, state), tighter)
        quick, slow = on_mesh.fastest_on_mesh(*given), on_mesh.by_arrays(*given)
        np.testing.assert_allclose(quick.motion.speeds.b, slow.motion.speeds.b, rtol=1e-9)
        np.testing.assert_allclose(quick.motion.durations, slow.motion.durations, rtol=1e-9)
        np.testing.assert_array_equal(quick.motion.stops, slow.motion.stops)
        np.testing.assert_allclose(quick.beyond, slow.beyond, atol=1e-8)
        np.testing.assert_allclose(quick.losses, slow.losses, rtol=1e-6, atol=1e-9)


def test_speeds_at_the_ends():
    """Cut at its middle, the fastest motion is that of both parts with the speed at the cut."""
    whole = deltaopt.plan(on(PICK, "line"), tolerance=1e-5)
    middle = whole.trajectory(whole.duration / 2)
    cut, speed = tuple(middle.x.tolist()), float(np.linalg.norm(middle.v))
    speed *= 1 - 1e-5  # within reach of both parts
    first = on(PICK, {"speeds": [0.0, speed]}, goal=cut)
    last = on(PICK, {"speeds": [speed, 0.0]}, start=cut)
    plans = [deltaopt.plan(scene, tolerance=1e-4) for scene in (first, last)]
    assert sum(each.duration for each in plans) == pytest.approx(whole.duration, rel=3e-4)
    for each in plans:
        report = deltaopt.verify(each.scene, each.trajectory)
        assert report.failures() == []
    with pytest.raises(deltaopt.Infeasible, match="its speed at the start"):
        deltaopt.plan(on(PICK, {"speeds": [50.0, 0.0]}))


def test_a_curve_by_arrays_is_that_by_a_function():
    """In another parameter too: how a curve is written changes no duration."""
    r = 0.05

    def doubled(s, order):  # the same half circle, run through twice as fast
        return half_circle(r, 2 * s, order) * 2.0**order

    s = np.linspace(0.0, np.pi * r, 33)
    by_arrays = deltaopt.Curve(
        s=s, **{name: half_circle(r, s, order) for order, name in enumerate(("x", "dx", "ddx"))}
    )
    curves = [
        deltaopt.Curve.of(lambda s, order: half_circle(r, s, order), 0.0, np.pi * r),
        deltaopt.Curve.of(doubled, 0.0, np.pi * r / 2),
        by_arrays,
    ]
    plans = [
        deltaopt.plan(on(PICK, curve, start=curve.x[0], goal=curve.x[-1]), tolerance=1e-5)
        for curve in curves
    ]
    for plan in plans:
        assert plan.duration == pytest.approx(plans[0].duration, rel=2e-5)
    scene = plans[-1].scene
    assert deltaopt.verify(scene, deltaopt.plan(scene).trajectory).failures() == []


def test_without_a_compiler_it_is_the_same(monkeypatch):
    scene = on(PICK, "line")
    compiled = deltaopt.plan(scene)
    monkeypatch.setattr(sweep, "compiled", lambda: None)
    monkeypatch.setattr(on_mesh, "compiled", lambda: None)
    assert deltaopt.plan(scene).duration == pytest.approx(compiled.duration, rel=1e-9)


def test_a_path_through_a_parallel_singularity_is_refused():
    """Found by a campaign: without masses and gravity torques are needed for acceleration alone,
    and between the points of a mesh they grew without bound."""
    robot = {"base_radius": 0.0, "platform_radius": 0.0, "platform": {"mass": 0.5}, "gravity": 0.0}
    robot |= {key: {"length": a, "mass": 0.0} for key, a in (("upper_arm", 0.25), ("forearm", 0.6))}
    scene = Scene(
        robot=deltaopt.Robot(name="massless", drive={"torque": 15.0, "speed": 15.0}, **robot),
        payload=1.92,
        start=(0.411, -0.0376, 0.5279),
        goal=(0.1815, 0.4304, 0.3174),
        path={"pick_and_place": {"height": 0.0562, "blend": 0.0281}},
    )
    with pytest.raises(
        deltaopt.Infeasible, match=r"the path: at .* leads through a parallel singularity"
    ):
        deltaopt.plan(scene, tolerance=1e-2)


def test_settings_of_free_paths_are_refused():
    scene = on(PICK, "line")
    with pytest.raises(ValueError, match="starts is 3; it has no effect"):
        deltaopt.plan(scene, starts=3)
    with pytest.raises(ValueError, match="solver"):
        deltaopt.plan(scene, solver=deltaopt.ipopt)


def test_a_path_out_of_the_workspace_is_told():
    scene = on(PICK, {"points": [[0.9, 0.0, 0.0]], "blend": 0.01})
    with pytest.raises(deltaopt.Unreachable, match="cannot be at"):
        deltaopt.plan(scene)


def test_limits_of_position_are_the_paths():
    """No timing keeps a workspace that the path leaves; a fourth axis is waited for."""
    walled = deltaopt.load_scene(PROBLEMS / "limits" / "drive_joints_workspace.yaml")
    inside = walled.model_copy(update={"path": "line"})
    assert deltaopt.verify(inside, deltaopt.plan(inside).trajectory).failures() == []
    x = np.array(walled.start) / 2 + np.array(walled.goal) / 2 + [0.12, 0.0, 0.0]
    path = {"points": [x.tolist()], "blend": 0.02}
    with pytest.raises(deltaopt.Infeasible, match="workspace depth"):
        deltaopt.plan(walled.model_copy(update={"path": path}))
    turning = {"angle": 1.0, "speed": 2.0, "acceleration": 1e4}
    slow = deltaopt.plan(on(PICK, "line", rotation=turning))
    assert slow.duration == pytest.approx(slow.scene.least_duration, rel=1e-9)
    assert slow.within_tolerance
