"""OMPL and TOPP-RA past bodies: what they are given, and one scene of the study."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import deltaopt
from studies.__main__ import main
from studies.kept_rows import read_rows
from studies.ompl import CHECKS, METHODS, OURS, Row
from studies.ompl.geometric import Clear
from studies.ompl.rounded import Rounded, rounded, timed_motion
from studies.ompl.scenes import KINDS, scene_of
from studies.problems import CROSS, INDUSTRIAL, PROBLEMS
from tests.oracles.body_distances import tool_distances
from tests.oracles.clear_grid import can_be_held

ROBOT = deltaopt.load_robot(INDUSTRIAL)


def test_lines_are_clear_where_all_their_places_are():
    """Against distances and places at rest by other code, on samples of random lines."""
    scene, rng = scene_of(ROBOT, "eight boxes", 1, 0), np.random.default_rng(1)
    clear, held = Clear(scene), can_be_held(scene)
    start, goal = (np.array(point) for point in scene.given_points)
    shares = np.linspace(0, 1, 300)[:, None]
    found = []
    for _ in range(300):
        middle, size = start + rng.uniform() * (goal - start), np.linalg.norm(goal - start)
        a, b = middle + rng.normal(0, 0.1 * size, (2, 3))
        line = a + shares * (b - a)
        if not held(line).all():
            continue
        room = tool_distances(scene, line).min() - scene.least_clearance
        if abs(room) > 1e-4:
            found.append((clear(np.array([a, b])), room > 0))
    ours, theirs = np.array(found).T
    np.testing.assert_array_equal(ours, theirs)
    assert 20 < ours.sum() < len(ours) - 20


def test_rounded_corners():
    """Derivatives against differences, the lines far from the corners, and no place outside."""
    corners = np.array([[0.0, 0, 0], [0.3, 0, 0], [0.3, 0.4, 0], [0.3, 0.4, 0.2]])
    path = Rounded(corners, np.array([0.1, 0.05]))
    s = np.linspace(0.0, 0.9, 9001)
    x, dx, ddx = path(s)
    np.testing.assert_allclose(np.gradient(x, s, axis=0)[1:-1], dx[1:-1], atol=1e-6)
    bends = np.gradient(dx, s, axis=0)[1:-1]  # whose slope jumps where a rounding begins
    np.testing.assert_allclose(bends, ddx[1:-1], atol=1e-3 * 15.0)  # of the largest, 3 / (4 · 0.05)
    np.testing.assert_allclose(x[[0, -1]], corners[[0, -1]], atol=1e-12)
    np.testing.assert_allclose(x[s < 0.2][:, 1:], 0, atol=1e-12)
    assert (x >= corners.min(axis=0) - 1e-12).all()
    assert (x <= corners.max(axis=0) + 1e-12).all()


@pytest.mark.parametrize("kind", KINDS)
def test_scenes_ask_for_a_detour(kind):
    scene = scene_of(ROBOT, kind, 1, 1)
    line = np.linspace(*scene.given_points, 1001)
    assert tool_distances(scene, line).min() < scene.least_clearance


def test_a_line_takes_as_long_as_by_deltaopt():
    pytest.importorskip("toppra")
    scene = deltaopt.load_scene(CROSS)
    ends = np.array(scene.given_points)
    motion = timed_motion(scene, Rounded(ends, np.zeros(0)))
    line = deltaopt.timed_line(scene).duration
    assert line * (1 - 1e-3) < motion.duration < line * (1 + 5e-3)


def test_a_corner_is_rounded_as_widely_as_bodies_allow():
    scene = deltaopt.load_scene(PROBLEMS / "keep_out/wall_25_305_25.yaml")
    (body,) = scene.keep_out
    start, goal = (np.array(point) for point in scene.given_points)
    top = body.box.centre[0] - body.box.half[0] - 0.02
    corners = np.array([start, [top, *start[1:]], [top, *goal[1:]], goal])
    clear = Clear(scene)
    assert clear(corners)
    path = rounded(clear, corners)
    s = path.grid
    assert tool_distances(scene, path(s)[0]).min() >= 0
    assert path.halves.min() > 0.02


def test_one_scene(tmp_path, capsys, monkeypatch):
    """What is taken is verified, and on the way that deltaopt takes nothing is faster."""
    monkeypatch.setattr(sys.modules["studies.ompl.rounded"], "_STEP", 8e-3)  # m, coarse
    pytest.importorskip("ompl")
    pytest.importorskip("toppra")
    assert main(["ompl", "--small", "-o", str(tmp_path)]) == 0
    assert "1 of 1" in capsys.readouterr().out
    rows = {row.method: row for row in read_rows(tmp_path / "ompl_1.csv", Row)}
    assert list(rows) == list(METHODS)
    ours = rows[OURS].duration
    assert all(rows[each].duration > ours for each in CHECKS)
    assert rows["best, then Ipopt"].duration > ours * (1 - 2e-3)


def test_what_is_missing_is_said(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "ompl", None)
    assert main(["ompl", "--small", "-o", str(tmp_path)]) == 1
    assert "ompl is not installed: pip install -e '.[ompl]' in the clone" in capsys.readouterr().err
