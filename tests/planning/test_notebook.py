"""Plans, scenes and verifications in a notebook: tables, and curves on one's own axes."""

from __future__ import annotations

import sys
from io import StringIO
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from deltaopt.files.progress_bar import ProgressBar
from deltaopt.output.saved_plan import load_plan
from deltaopt.planning.planner import Planner, plan
from deltaopt.scene.scene_file import load_scene
from deltaopt.verify.verification import verify
from studies.problems import PROBLEMS

SCENE = load_scene(PROBLEMS / "industrial_cross.yaml")
NAME = "<b>bold & 'quoted'</b>"


@pytest.fixture(scope="module")
def found():
    return plan(SCENE)


def test_a_plan_shows_its_picture(found):
    assert found._repr_png_().startswith(b"\x89PNG\r\n\x1a\n")


def test_all_are_one_short_line(found, tmp_path):
    verification = verify(SCENE, found.trajectory)
    failed = verify(SCENE, found.trajectory.slowed(0.9))
    found.save(tmp_path, chart=False)
    shown = (found, load_plan(tmp_path), verification, SCENE, found.trajectory, SCENE.robot)
    for each in shown:
        assert len(repr(each)) < 150
        assert "\n" not in repr(each)
    assert f"{found.duration:.6g} s, gap {found.gap:.1e}" in repr(found)
    assert "ok: every bound is kept" in repr(verification)
    assert "FAILED: torque of motor 1 exceeds its limit" in repr(failed)
    assert "with 1 kg, from (0.85, " in repr(SCENE)
    assert SCENE.robot.name in repr(SCENE.robot)


def test_tables_say_what_was_found(found):
    verification = verify(SCENE, found.trajectory)
    table = verification._repr_html_()
    assert table.count("<tr>") == 1 + len(verification.checks())
    assert "verified: every bound is kept" in table
    failed = verify(SCENE, found.trajectory.slowed(0.9))._repr_html_()
    assert "exceeds its limit" in failed
    assert "verified" not in failed


def test_names_are_escaped():
    robot = SCENE.robot.model_copy(update={"name": NAME})
    table = SCENE.model_copy(update={"robot": robot})._repr_html_()
    assert "<b>" not in table
    assert "&lt;b&gt;bold &amp; &#x27;quoted&#x27;&lt;/b&gt;" in table
    assert '<th scope="row">payload</th><td>' in table


def test_curves_on_ones_own_axes(found):
    axes = Figure().add_subplot()
    assert found.plot(axes, limit="speed") is axes
    first = axes.get_lines()[0]
    t, drawn = np.array(first.get_xdata()), np.array(first.get_ydata())
    inside = np.flatnonzero(np.diff(t) > 0)
    np.testing.assert_allclose(drawn[inside], found.trajectory(t[inside]).dtheta[:, 0], atol=1e-9)
    assert axes.get_ylabel() == "speed (rad/s)"
    assert found.plot().get_ylabel() == "torque (N·m)"
    with pytest.raises(ValueError, match="limit is 'jerk'; the scene has torque, speed"):
        found.plot(limit="jerk")


class Frame(dict):
    """Stands for pandas' DataFrame, which also takes columns by name."""


@pytest.mark.parametrize("pandas", [None, SimpleNamespace(DataFrame=Frame)])
def test_table_is_a_frame_where_pandas_is(found, monkeypatch, pandas, tmp_path):
    monkeypatch.setitem(sys.modules, "pandas", pandas)
    table = found.table(rate=500)
    assert type(table) is (dict if pandas is None else Frame)
    found.save(tmp_path, chart=False)
    with (tmp_path / "trajectory.csv").open(encoding="utf-8") as lines:
        names = lines.readline().strip().split(",")
    assert list(table) == names
    written = np.loadtxt(tmp_path / "trajectory.csv", delimiter=",", skiprows=1)
    every = load_plan(tmp_path).table()  # at 1000 Hz, as the file
    np.testing.assert_array_equal(np.transpose([every[name] for name in names]), written)
    np.testing.assert_array_equal(table["tau2"], found.trajectory(table["t"]).tau[:, 1])
    with pytest.raises(ValueError, match="at most"):
        found.table(rate=1e9)


class Notebook:
    """Stands for IPython in a notebook: what cells show, in order."""

    def __init__(self):
        self.shown = []
        self.display = SimpleNamespace(HTML=str, display=self.put)

    def get_ipython(self):
        return SimpleNamespace(kernel=self)

    def put(self, content, display_id):
        assert display_id
        self.shown.append([content])
        return SimpleNamespace(update=self.shown[-1].append)


def test_a_bar_below_the_cell(monkeypatch, capsys):
    notebook = Notebook()
    monkeypatch.setitem(sys.modules, "IPython", notebook)
    monkeypatch.setitem(sys.modules, "IPython.display", notebook.display)
    tell = ProgressBar().counting(4, "<moves>")
    for done in (1, 2, 4):
        tell(done)
    tell(1)  # another time: another bar
    assert notebook.shown == [
        [
            f'<progress value="{share:.4f}"></progress> {share:.0%} &lt;moves&gt;'
            for share in (0.25, 0.5, 1.0)
        ],
        ['<progress value="0.2500"></progress> 25% &lt;moves&gt;'],
    ]
    assert capsys.readouterr().err == ""


def test_many_plans_say_how_many_are_done():
    pairs = [((0.8, -0.1, 0.0), (0.8, 0.1, 0.0))] * 3
    done: list[int] = []
    plans = Planner(SCENE.robot, tolerance=1e-2).plan_many(pairs, progress=done.append)
    assert done == [1, 2, 3]
    assert len({plan.duration for plan in plans}) == 1


def test_a_file_receives_one_progress_bar_at_the_end(monkeypatch):
    """A terminal does: each bar is written over the one before, which a log cannot do."""

    class Stream(StringIO):
        terminal = True

        def isatty(self):
            return self.terminal

    file, terminal = Stream(), Stream()
    file.terminal = False
    for stream in (file, terminal):
        tell = ProgressBar(stream).counting(2, "moves")
        tell(1)
        tell(2)
    assert file.getvalue().count("\r") == 1
    assert "100%" in file.getvalue()
    assert terminal.getvalue().count("\r") == 2
