"""Multistart and random proportions: what they measure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from deltaopt.compare.dynamics.many_digits import ManyDigits
from deltaopt.compare.dynamics.tasks import TASKS
from deltaopt.robot.model import DeltaModel
from studies import multistart, proportions
from studies.gap_moves import INSIDE, move_of_random_robot
from studies.kept_rows import kept_rows, read_rows

ROW = multistart.Row(3, "a, b", INSIDE, 0.2, 0.19, 0.01, 0.08, 2, True, "")


def test_rows_of_a_file_go_on_where_they_were_interrupted(tmp_path):
    file, made = tmp_path / "rows.csv", []

    def of(number):
        made.append(number)
        return replace(ROW, number=number, one=0.1 * number)

    def rows(numbers):
        return kept_rows(file, multistart.Row, numbers, lambda r: r.number, of, lambda _: None)

    first = rows([1, 2])
    text = file.read_text(encoding="utf-8")
    file.write_text(text[:-9], encoding="utf-8")  # in the midst of the second row
    assert rows([1, 2, 3]) == [*first, replace(ROW, number=3, one=0.1 * 3)]
    assert made == [1, 2, 2, 3]
    assert read_rows(file, multistart.Row) == rows([1, 2, 3])


def test_models_of_a_random_robot_are_held_against_many_digits():
    """And a model of another payload is told apart."""
    scene = move_of_random_robot(1, 0).scene
    x, v, a = np.array([scene.start]), np.array([[0.5, -0.2, 0.3]]), np.array([[3.0, 5.0, -2.0]])
    model, heavier = (DeltaModel(scene.robot, payload) for payload in (0.5, 0.6))
    states = list(zip(*model.motion(x, v, a), model.inverse_dynamics(x, v, a), strict=True))
    for task in TASKS:
        assert max(proportions.errors_of(model, task, states, ManyDigits(30))) < 1e-12
    wrong = heavier.inverse_dynamics(x, v, a)[0] - states[0][3]
    assert np.abs(wrong).max() > 1e-3 * np.abs(states[0][3]).max()
