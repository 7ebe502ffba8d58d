"""The picture of a plan: the robot is drawn where it is, and what is written there is true."""

import re

import numpy as np
import pytest
from matplotlib.patches import Circle, Polygon

import deltaopt
from deltaopt.motion.active_limits import AT_LIMIT
from deltaopt.output.facts import facts, headline
from deltaopt.output.in_words import told
from deltaopt.planning.comparisons import straight_lines
from deltaopt.plots import plan as chart
from deltaopt.plots.colours import ORANGE
from deltaopt.plots.robot_view import View, chains
from deltaopt.plots.style import figure
from studies.problems import PROBLEMS

SCENE = deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml")


def test_bars_have_their_length_and_elbows_are_where_the_model_has_them():
    robot = SCENE.robot
    x = np.array(SCENE.goal)
    theta = deltaopt.DeltaModel(robot).inverse_kinematics(x)[[3, 6, 9]]
    for chain in chains(robot, x, theta):
        for upper, lower in zip(chain.elbow_ends, chain.platform_ends, strict=True):
            assert np.linalg.norm(upper - lower) == pytest.approx(robot.forearm.length, rel=1e-12)
        arm = np.linalg.norm(chain.elbow - chain.shaft)
        assert arm == pytest.approx(robot.upper_arm.length, rel=1e-12)


def test_motor_1_is_towards_y_and_the_others_follow_at_120_degrees():
    found = chains(SCENE.robot, np.array([0.45, 0.0, 0.0]), np.zeros(3))
    angles = [np.degrees(np.arctan2(c.shaft[2], c.shaft[1])) for c in found]
    assert angles == pytest.approx([0, 120, -120])
    for chain in found:  # an angle of 0 is level, a positive one is up
        assert chain.elbow[0] == 0.0
    assert all(c.elbow[0] < 0 for c in chains(SCENE.robot, found[0].elbow, np.full(3, 0.3)))


@pytest.mark.parametrize("turn", [0.0, 0.7, 3.0])
def test_pictures_are_not_mirrored(turn):
    """A positive turn about x, which points down, is clockwise to those who look down."""
    shafts = [c.shaft for c in chains(SCENE.robot, np.array([0.45, 0.0, 0.0]), np.zeros(3))]
    one, two, three = View(turn, np.pi / 2)(np.array(shafts))
    assert np.linalg.det([two - one, three - two]) < 0


def test_picture_says_what_is_true(drawn, tmp_path):
    line, others = deltaopt.baseline(SCENE), straight_lines(SCENE)
    duty = deltaopt.verify(SCENE, line).duty
    chart.draw(tmp_path / "plan.png", SCENE, line, others, duty)
    (page,) = drawn
    assert list(others.values()) == [line.duration, deltaopt.timed_line(SCENE).duration]
    assert page.get_suptitle() == "0.197 s, 153 parts per minute"
    _, path, _, bars, torques = page.axes
    best = min(others.values())
    assert best < line.duration
    more = 100 * (line.duration / best - 1)
    assert bars.get_title(loc="left") == f"{more:.0f} % more time than the line"
    assert path.get_title(loc="left") == "side view: 0 mm up at most"
    widths = [bar.get_width() for bar in bars.patches]
    assert widths == [*others.values(), line.duration]
    across, up = path.get_lines()[0].get_data()
    assert (across[0], across[-1]) == pytest.approx((0, 150))
    assert np.abs(up).max() < 1e-9  # mm: a line on one level
    t = torques.get_lines()[0].get_xdata() / 1e3
    for k, curve in enumerate(torques.get_lines()[:3]):
        torque = curve.get_ydata() / 100 * SCENE.robot.drive.torque
        np.testing.assert_allclose(torque, line(t).tau[:, k], atol=1e-6)
        root = np.sqrt(np.mean((curve.get_ydata()) ** 2))
        assert f"RMS {root:.0f} %" in curve.get_label()


def test_the_share_of_time_at_a_limit_is_one_number_everywhere(drawn, tmp_path):
    """That in which any motor is at it: in print, in the picture, and counted at instants."""
    scene = deltaopt.load_scene(PROBLEMS / "limits" / "drive_joints_workspace.yaml")
    plan = deltaopt.plan(scene)
    chart.draw(tmp_path / "plan.png", plan.scene, plan.trajectory, {}, None)
    tau = plan.trajectory(plan.trajectory.instants(100_001)).tau
    at = np.abs(tau) >= AT_LIMIT * plan.scene.robot.drive.torque
    share = 100 * at.any(axis=1).mean()
    assert share > 100 * at.mean(axis=0).max() + 3  # no motor is at its limit as long
    (printed,) = re.findall(r"torque \((\d+) % of the time", "\n".join(told(facts(plan))))
    assert int(printed) == pytest.approx(share, abs=1)
    title = drawn[0].axes[-1].get_title(loc="left")
    assert title == f"torques: one is at its limit {printed} % of the time"


VIA = deltaopt.load_scene(PROBLEMS / "via" / "within.yaml")


def test_via_points_and_bodies_are_marked_from_the_side_and_from_above(drawn, tmp_path):
    box = {"box": {"from": (0.84, -0.05, -0.02), "to": (0.9, 0.05, 0.06)}}
    scene = VIA.model_copy(update={"keep_out": [box]})
    chart.draw(tmp_path / "plan.png", scene, deltaopt.baseline(VIA), {}, None)
    (page,) = drawn
    robot, side, above = page.axes[:3]
    start = np.array(VIA.start)  # the move is along y, and the view from above has z towards it
    for axes, up in ((side, lambda x: start[0] - x[0]), (above, lambda x: start[2] - x[2])):
        marks = [line.get_xydata()[0] for line in axes.get_lines() if line.get_marker() == "D"]
        wanted = [1e3 * np.array([v.at[1] - start[1], up(v.at)]) for v in VIA.via]
        np.testing.assert_allclose(marks, wanted, atol=1e-9)
        circles = [patch for patch in axes.patches if isinstance(patch, Circle)]
        assert [circle.radius for circle in circles] == pytest.approx([10.0, 25.0])
        np.testing.assert_allclose([circle.center for circle in circles], wanted, atol=1e-9)
        (shadow,) = (patch for patch in axes.get_children() if isinstance(patch, Polygon))
        corners = shadow.get_xy()
        assert np.ptp(corners, axis=0) == pytest.approx([100, 60 if axes is side else 80])
    circles = [patch for patch in robot.patches if isinstance(patch, Circle)]
    assert [circle.radius for circle in circles] == pytest.approx([0.01, 0.025])
    told = page.get_supxlabel()
    assert "grey: keep out; diamonds: via points; circles: pass within" in told


def test_the_clearance_is_that_from_the_nearest_body(drawn, tmp_path):
    least, most = np.array([0.84, -0.05, -0.02]), np.array([0.9, 0.05, 0.06])
    box = {"box": {"from": tuple(least), "to": tuple(most)}}
    ball = {"sphere": {"centre": (0.95, 0.0, 0.0), "radius": 0.02}}
    scene = VIA.model_copy(update={"keep_out": [box, ball], "clearance": 0.001})
    line = deltaopt.baseline(VIA)
    chart.draw(tmp_path / "plan.png", scene, line, {}, None)
    curve, _, asked = drawn[0].axes[-1].get_lines()
    t, distance = curve.get_data()
    x = line(t / 1e3).x
    outside = np.linalg.norm(x - np.clip(x, least, most), axis=1)
    inside = np.minimum(x - least, most - x).min(axis=1)
    from_box = np.where(outside > 0, outside, -inside)
    from_ball = np.linalg.norm(x - [0.95, 0.0, 0.0], axis=1) - 0.02
    np.testing.assert_allclose(distance / 1e3, np.minimum(from_box, from_ball), atol=1e-9)
    assert asked.get_ydata()[0] == pytest.approx(1.0)
    assert distance.min() < 0  # the straight line leads through the box
    told = drawn[0].axes[-1].get_title(loc="left")
    least = f"{distance.min():.2f} mm at least, 1 mm are asked for"
    assert told == f"clearance: from the tool to a box {least}"


def test_the_clearance_that_binds_is_told(drawn, tmp_path):
    """Where a forearm passes a column, it is not the tool's."""
    scene = deltaopt.load_scene(PROBLEMS / "keep_out" / "beside_a_column.yaml")
    line = deltaopt.baseline(scene)
    chart.draw(tmp_path / "plan.png", scene, line, {}, None)
    least = 1e3 * (scene.clearance - deltaopt.verify(scene, line).robot_overlap)
    told = drawn[0].axes[-1].get_title(loc="left")
    assert told.startswith("clearance: from arms, forearms to a cylinder ")
    assert float(told.split()[7]) == pytest.approx(least, rel=0.01)  # as closely as it looks


def test_what_a_motion_stays_in_and_meets_is_drawn(drawn, tmp_path):
    for number, name in enumerate(("paths/tube", "approach/25_305_25", "moving/belt")):
        scene = deltaopt.load_scene(PROBLEMS / f"{name}.yaml")
        at_rest = SCENE.model_copy(update={"robot": scene.robot, "start": scene.start})
        motion = deltaopt.baseline(at_rest.model_copy(update={"goal": (0.85, 0.1525, 0.0)}))
        chart.draw(tmp_path / f"{number}.png", scene, motion, {}, None)
    tube, approach, belt = (page.axes[1] for page in drawn)
    allowed = [axes.collections[0].get_paths() for axes in (tube, approach)]
    boxes = [np.ptp(np.vstack([path.vertices for path in each]), axis=0) for each in allowed]
    np.testing.assert_allclose(boxes, [(315, 35), (315, 25)], rtol=2e-2)
    (band,) = (line for line in belt.get_lines() if line.get_linewidth() == 6)
    assert band.get_color() == ORANGE


def test_overload_stands_in_the_headline():
    scene = deltaopt.load_scene(PROBLEMS / "hornet" / "1_kg.yaml")
    line = deltaopt.baseline(scene)
    duty = deltaopt.verify(scene, line).duty
    most = max(m.rms_torque / r for m, r in zip(duty.motors, duty.rated_torque, strict=True))
    assert most > 1
    assert f"RMS torque {most:.2g} times the rated one" in chart.headline_of(scene, line, duty)


@pytest.mark.parametrize(
    ("duration", "said"),
    [
        (0.14091, "0.141 s, 213 parts per minute"),
        (0.0123, "0.0123 s, 2439 parts per minute"),
        (12.0, "12.000 s, 2.5 parts per minute"),
    ],
)
def test_headline_counts_there_and_back(duration, said):
    assert headline(duration) == said


def test_long_names_stay_on_the_page(tmp_path):
    """The check of all charts, in conftest.py, would say otherwise."""
    robot = SCENE.robot.model_copy(update={"name": "A robot with a name as of a noble house " * 5})
    scene = SCENE.model_copy(update={"robot": robot})
    line = deltaopt.baseline(scene)
    chart.draw(tmp_path / "plan.png", scene, line, {}, None)
    assert (tmp_path / "plan.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("place", "fault"),
    [
        ({"x": 0.5, "y": 0.5, "s": "one"}, "overlaps"),
        ({"x": 0.98, "y": 0.2, "s": "a long word"}, "leaves its panel"),
    ],
)
def test_the_check_of_labels_finds_faults(tmp_path, place, fault):
    def draw() -> None:
        with figure(tmp_path / "a.png", 3, 2) as page:
            axes = page.subplots()
            axes.text(0.5, 0.5, "another")
            axes.text(**place)

    with pytest.raises(AssertionError, match=fault):
        draw()
