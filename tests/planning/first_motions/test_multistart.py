"""Several first guesses: what is random, what is distinct, what is delivered."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt import load_scene, plan, verify
from deltaopt.cli import main
from deltaopt.motion.time_scaling import safe_factor
from deltaopt.planning.first_motions.multistart import first_motions
from deltaopt.planning.first_motions.order_of_merit import first_motion, in_order_of_merit
from deltaopt.problem.of_scene import problem_of
from studies.problems import PROBLEMS

FILE = PROBLEMS / "pick_and_place.yaml"
SCENE = load_scene(FILE)


def test_first_motions_begin_with_the_usual_one_and_keep_limits():
    line, *curves = first_motions(SCENE, 4, seed=3)
    assert line.duration == first_motion(SCENE).duration
    assert len(curves) == 3
    for motion in curves:
        ends = motion([0.0, motion.duration])
        np.testing.assert_allclose(ends.x, [SCENE.start, SCENE.goal], atol=1e-9)
        np.testing.assert_allclose(ends.v, 0, atol=1e-9)
        assert safe_factor(problem_of(SCENE), motion) < 1 + 1e-9


def test_first_motions_are_seeded():
    durations = [[m.duration for m in first_motions(SCENE, 8, seed)] for seed in (1, 1, 2)]
    assert durations[0] == durations[1]
    ways = len(list(in_order_of_merit(SCENE)))
    assert durations[0][:ways] == durations[2][:ways]
    assert not set(durations[0][ways:]) & set(durations[2][ways:])


def test_the_best_is_delivered():
    found = plan(SCENE, tolerance=1e-2, starts=2, seed=2)
    assert sum(o.starts for o in found.optima) == 2
    assert found.duration == found.optima[0].duration
    assert verify(SCENE, found.trajectory).ok


def test_command_tells_the_optima(tmp_path, capsys):
    arguments = ["plan", str(FILE), "--tolerance", "1e-2", "--starts", "2", "--no-plot"]
    assert main([*arguments, "--details", "-o", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert "local optimum 1: 0.14" in told
    optima = told.count("local optimum ")
    assert optima == 1 or f"the best of {optima} local optima" in told


@pytest.mark.parametrize("text", ["0", "-1", "many"])
def test_starts_must_be_a_number(text, tmp_path):
    with pytest.raises(SystemExit):
        main(["plan", str(FILE), "--starts", text, "-o", str(tmp_path)])
