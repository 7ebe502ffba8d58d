"""The page that says what each measure knows between samples, and spikes to show it."""

from __future__ import annotations

import re
from dataclasses import replace
from math import comb
from pathlib import Path

import numpy as np
import pytest

import deltaopt
from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.motion.trajectory import Trajectory
from deltaopt.verify.bounds import ARRIVAL_BOUNDS, BOUNDS
from deltaopt.verify.path_distance import farthest_from, off_approach, off_path
from studies.problems import PROBLEMS

PAGE = Path(__file__).parents[2] / "docs/verification.md"
SCENES = ("keep_out/into_a_box", "paths/tube", "limits/drive_joints_workspace")


def page() -> set[str]:
    """The measures in the page's table."""
    rows = re.search(r"^\| measure \| known .*?\n\n", PAGE.read_text(), re.DOTALL | re.MULTILINE)
    firsts = (line.split("|")[1].split(", such as")[0] for line in rows[0].splitlines()[2:-1])
    return {name for first in firsts for name in re.findall(r"`(\w+)`", first) or [first.strip()]}


def test_the_page_has_every_measure():
    bounds = {*BOUNDS, *ARRIVAL_BOUNDS}
    excesses = set()
    for name in SCENES:
        scene = deltaopt.load_scene(PROBLEMS / f"{name}.yaml")
        free = deltaopt.Scene(
            robot=scene.robot, payload=scene.payload, start=scene.start, goal=scene.goal
        )
        excesses |= set(deltaopt.verify(scene, deltaopt.baseline(free)).excesses)
    assert bounds <= page()
    assert page() - bounds <= excesses | {"every other excess"}


def spiked(position: PiecewisePolynomial, piece: int, width: float, height) -> PiecewisePolynomial:
    """With a bump u⁴ (1 - u)⁴ of this width (s) and height (m, (3,)) inside of a piece, which is
    cut about it."""
    h = float(np.diff(position.knots)[piece])
    begin = position.knots[piece] + 0.437 * h
    parts = [position, position.after(begin), position.after(begin + width)]
    middle = PiecewisePolynomial(np.array([0.0, width]), parts[1].coefficients[:1])
    first = PiecewisePolynomial(
        np.append(position.knots[: piece + 1], begin), position.coefficients[: piece + 1]
    )
    bump = np.zeros((9, 3))
    for j in range(5):
        bump[4 + j] = 256 * comb(4, j) * (-1.0) ** j / width ** (4 + j) * np.asarray(height)
    raised = np.zeros((1, max(9, middle.coefficients.shape[1]), 3))
    raised[:, : middle.coefficients.shape[1]] = middle.coefficients
    raised[0, :9] += bump
    return first.then(replace(middle, coefficients=raised)).then(parts[2])


@pytest.mark.parametrize("width", [1e-9, 1e-7, 1e-5])
def test_a_spike_of_a_nanosecond_in_each_sure_measure(width):
    """As large as it is, wherever samples are."""
    glue = deltaopt.load_scene(PROBLEMS / "paths/glue_line.yaml")
    line = deltaopt.baseline(glue.model_copy(update={"path": None}))
    bad = spiked(line.position, 0, width, [1e-4, 0, 0])
    assert off_path(glue.task, Trajectory(bad, line.model), 1e-8) == pytest.approx(1e-4, rel=2e-3)
    path = glue.task.path
    assert farthest_from(path, bad, 5e-5)[0] == pytest.approx(1e-4, rel=2e-3)
    approach = deltaopt.load_scene(PROBLEMS / "approach/25_305_25.yaml")
    up = deltaopt.plan(approach, tolerance=1e-2)
    radius = max(column.radius for column in approach.columns)
    bad = spiked(up.trajectory.position, 0, width, [0, 2 * radius, 0])
    assert off_approach(approach.columns, Trajectory(bad, line.model)) > radius / 2


@pytest.mark.parametrize("width", [1e-9, 1e-6])
def test_a_spike_of_a_nanosecond_in_torque(width):
    """By an acceleration of some thousand m/s²."""
    scene = deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml")
    line = deltaopt.baseline(scene).slowed(1.2)
    assert deltaopt.verify(scene, line).torque_excess < 0
    bad = spiked(line.position, 0, width, [100 * width**2, 0, 0])
    found = deltaopt.verify(scene, replace(line, position=bad))
    assert found.torque_excess > 0
    assert line.duration * 0.43 < found.excesses["torque_excess"].t < line.duration * 0.44
