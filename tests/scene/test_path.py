"""Given paths: their geometry, what files say of them, and what is wrong in one sentence."""

from __future__ import annotations

import re

import numpy as np
import pytest

import deltaopt
from deltaopt.errors import SceneError
from deltaopt.scene.path import Corners, Curve, Line, PickAndPlace, points_in
from deltaopt.scene.scene import Scene
from studies.problems import PROBLEMS

CROSS = deltaopt.load_scene(PROBLEMS / "industrial_cross.yaml")


def scene_on(path: object) -> Scene:
    return Scene.model_validate({**dict(CROSS), "path": path})


@pytest.mark.parametrize(
    "given",
    [
        Line(),
        PickAndPlace(height=0.025, blend=0.02),
        Corners(points=((0.8, 0.0, 0.05), (0.8, 0.1, 0.0)), blend=0.02),
    ],
)
def test_paths_are_smooth_and_end_where_they_must(given):
    path = given.between(CROSS.start, CROSS.goal)
    np.testing.assert_allclose(path.ends, [CROSS.start, CROSS.goal], atol=1e-15)
    before, lengths = np.arange(len(path.knots) - 2), np.diff(path.knots)[:-1]
    for order, size in ((0, 1.0), (1, 1.0), (2, 1 / 0.02)):
        left = path.inside(before, lengths, order)
        np.testing.assert_allclose(left, path(path.knots[1:-1], order), atol=1e-12 * size)
    s = np.linspace(*path.knots[[0, -1]], 4001)
    for order in (1, 2):
        slopes = np.gradient(path(s, order - 1), s, axis=0)
        np.testing.assert_allclose(path(s, order)[2:-2], slopes[2:-2], atol=2e-3 * 50**order)
    assert path.length == pytest.approx(
        np.linalg.norm(np.diff(path(s), axis=0), axis=1).sum(), 1e-6
    )


def test_up_across_and_down():
    path = PickAndPlace(height=0.025, blend=0.02).between(CROSS.start, (0.86, 0.1525, 0.0))
    x = path(np.linspace(*path.knots[[0, -1]], 1001))
    assert x[:, 0].min() == pytest.approx(0.85 - 0.025, abs=1e-12)
    assert (np.abs(x[:, 1]) <= 0.1525 + 1e-12).all()


def test_a_function_is_followed_to_rounding():
    def spiral(s, order):
        unit = (1j * 20) ** order * np.exp(20j * s)
        rise = [0.8 + s, 1 + 0 * s, 0 * s][order]
        return np.stack([rise, 0.1 * unit.real, 0.1 * unit.imag], axis=1)

    curve = Curve.of(spiral, 0.0, 0.3)
    path = curve.between(curve.x[0], curve.x[-1])
    s = np.linspace(0, 0.3, 777)
    np.testing.assert_allclose(path(s), spiral(s, 0), atol=2e-12)
    np.testing.assert_allclose(path(s, 2), spiral(s, 2), atol=1e-5 * 40)


@pytest.mark.parametrize(
    "given",
    [
        "line",
        {"pick_and_place": {"height": 0.025, "blend": 0.02}},
        {"points": [[0.8, 0.0, 0.05]], "blend": 0.02, "speeds": [0.0, 0.1]},
        {"speeds": [0.1, 0.0]},
    ],
)
def test_files_say_what_they_said(given):
    scene = scene_on(given)
    content = scene.model_dump(mode="json", exclude_none=True)
    assert content["path"] == given
    assert Scene.model_validate(content) == scene


def test_points_from_a_file():
    lane = deltaopt.load_scene(PROBLEMS / "paths" / "safe_lane.yaml")
    assert isinstance(lane.path, Corners)
    assert lane.path.points == ((0.42, -0.03, 0.03), (0.42, 0.05, 0.04))


POINTS = [[0.42, -0.03, 0.03], [0.42, 0.05, 0.04]]
LISTS = {
    "no names": ("0.42,-0.03,0.03\n0.42,0.05,0.04\n", ""),
    "from a spreadsheet": ("\ufeffX;Y;Z\r\n0,42;-0,03;0,03\r\n0,42;0,05;0,04\r\n;;\r\n", ""),
    "another order": ("y,z,x\n-0.03,0.03,0.42\n0.05,0.04,0.42\n", ""),
    "no number": ("x,y,z\n0.42,-0.03,0.03\n0.42,n/a,0.04\n", "y is 'n/a' in line 3"),
    "no number first": ("n/a,-0.03,0.03\n0.42,0.05,0.04\n", "names 0 columns x in its first line"),
    "millimetres": ("x [mm],y [mm],z [mm]\n420,-30,30\n", "names 0 columns x in its first line"),
    "a column twice": ("x,y,z,y\n0.42,-0.03,0.03,1\n", "names 2 columns y in its first line"),
    "two columns": ("0.42,-0.03\n", "has not 3, x, y, z"),
    "a column more": ("x,y,z,note\n0.42,-0.03,0.03,first\n", "columns besides"),
    "names alone": ("x,y,z\n", "has no points"),
}


@pytest.mark.parametrize("name", LISTS)
def test_points_as_people_write_them(name, tmp_path):
    """All of them, or one sentence that says why none."""
    text, problem = LISTS[name]
    file = tmp_path / "points.csv"
    file.write_bytes(text.encode())
    if not problem:
        assert points_in(file) == POINTS
        return
    with pytest.raises(SceneError, match=re.escape(problem)):
        points_in(file)


@pytest.mark.parametrize(
    ("given", "key", "words"),
    [
        (
            {"pick_and_place": {"height": 0.025, "blend": 0.03}},
            "path.pick_and_place.blend",
            "0.025",
        ),
        ({"points": [[0.8, 0.0, 0.05]], "blend": 1.0}, "path.blend", "at most"),
        ({"points": [[0.8, 0.0, 0.05]]}, "path.blend", "is missing"),
        (
            {"points": [[0.85, -0.1525, 0.0]], "blend": 0.01},
            "path.points",
            r"through \[0.85, -0.1525, 0\] m twice in a row.*each other",
        ),
        ({"pick_and_place": 3}, "path.pick_and_place", "height"),
        (
            {"pick_and_place": {"height": -0.02, "blend": 0.02}},
            "path.pick_and_place.height",
            "greater than 0",
        ),
        (
            {"pick_and_place": {"height": 0.02, "blend": 0.02}, "speeds": [0, -1]},
            "path.speeds",
            "at least 0",
        ),
        ("curve", "path", "the word line"),
        ({"blends": 3}, "path.blends", "is not a known key"),
    ],
)
def test_what_is_wrong_is_told(given, key, words):
    with pytest.raises(SceneError, match=words) as error:
        scene_on(given)
    assert error.value.key == key


def test_a_curve_must_fit_its_scene():
    curve = Curve(
        s=(0.0, 0.1), x=((0.8, 0, 0), (0.8, 0.1, 0)), dx=((0, 1, 0),) * 2, ddx=((0, 0, 0),) * 2
    )
    with pytest.raises(SceneError, match="where the curve of path has it"):
        scene_on(curve)


@pytest.mark.parametrize(
    ("law", "begin", "slowest"),
    [
        ([0.5, 5e-4, 0, 0.4995], -1.0, "s = 0 "),
        ([0.5, 0, 0, 0.5], -1.0, "s = 0 "),
        ([0, 0.316406, -0.5625, 1 / 3], 0.0, r"s = 0\.5625 "),
    ],
    ids=["all but stands", "stands", "stands within a piece"],
)
def test_a_curve_that_all_but_stands_with_its_parameter_is_refused(law, begin, slowest):
    """Of a straight line: the first took 6.6 % longer than the line, with a gap of 7e-4."""
    with pytest.raises(SceneError, match=rf"has a .* at {slowest}that is .* of its largest"):
        Curve.of(lambda s, order: _on_a_line(law, s, order), begin, 1.0)


@pytest.mark.parametrize("law", [[0, 0, 1], [0, 0, 3, -2], [0, 0, 0, 1], [0, 2.2, -1.2]])
def test_a_curve_may_begin_slowly_and_turn_back(law):
    """A motion from rest by its time is a curve, and so is one that overshoots and comes back."""
    curve = Curve.of(lambda s, order: _on_a_line(law, s, order), 0.0, 1.0, knots=[11 / 12])
    assert curve.s[-1] == 1.0


def test_a_curve_may_stop_at_a_corner():
    """A right angle at s = 1, at which it stands."""

    def around_a_corner(s, order):
        here = np.abs(s - 1) ** (3 - order) * [1, 3, 6][order] * np.sign(s - 1) ** order
        along, zero = 0.1 * here, np.zeros_like(s)
        before = np.where(s < 1, along, 0.0), np.where(s < 1, 0.0, along)
        return np.stack([0.85 * (order == 0) + zero, *before], axis=1)

    assert 1.0 in Curve.of(around_a_corner, 0.0, 2.0, knots=[1.0]).s


def _on_a_line(law: list[float], s: np.ndarray, order: int) -> np.ndarray:
    y = np.polynomial.Polynomial([*law, 0, 0]).deriv(order)(s)
    return np.stack([0.85 * (order == 0) + 0 * s, 0.3 * y, 0 * s], axis=1)


def test_a_given_path_takes_time_only():
    with pytest.raises(SceneError, match="time, where a path is given"):
        Scene.model_validate({**dict(CROSS), "path": "line", "objective": {"effort": 0.1}})
