"""Flips of durations along a line of problems: jumps, and single problems beside the others."""

from __future__ import annotations

import numpy as np

from studies.continuity import flips

SMOOTH = 0.2 * (1 + 0.05 * np.linspace(-1.0, 1.0, 21) ** 2)


def test_a_smooth_line_has_none_nor_has_one_with_a_bend():
    assert flips(SMOOTH) == []
    assert flips(0.2 * (1 + 0.1 * np.abs(np.linspace(-1.0, 1.0, 21)))) == []


def test_a_jump_and_a_problem_beside_the_others():
    """The latter makes two: up to it and down again."""
    jump = SMOOTH * np.where(np.arange(21) > 12, 1.01, 1.0)
    assert flips(jump) == [12]
    single = SMOOTH * np.where(np.arange(21) == 7, 1.1, 1.0)
    assert flips(single) == [6, 7]


def test_problems_without_a_plan():
    assert flips(np.where(np.arange(21) == 4, np.nan, SMOOTH)) == [3, 4]
