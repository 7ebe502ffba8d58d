"""Plans, scenes and verifications in a notebook: tables, and curves on one's own axes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from deltaopt.planning.planner import plan
from deltaopt.scene.scene import load_scene
from deltaopt.verify.verification import verify

SCENE = load_scene(Path(__file__).parents[2] / "problems/industrial_cross.yaml")
NAME = "<b>bold & 'quoted'</b>"


@pytest.fixture(scope="module")
def found():
    return plan(SCENE)


def test_tables_say_what_was_found(found):
    assert f"<td>{found.duration:.6f} s</td>" in found._repr_html_()
    assert "motor 1&#x27;s torque is at its limit" in found._repr_html_()
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
