"""The campaign of hostile input: it notices what it looks for."""

from __future__ import annotations

import numpy as np
import pytest

import deltaopt
from studies.attack.attempts import Attempt, row_of
from studies.attack.checks import faults, loads, table_share
from studies.bench.random_scenes import random_scenes
from studies.problems import PICK_AND_PLACE, PROBLEMS

SCENE = deltaopt.load_scene(PICK_AND_PLACE)


def good(rng):
    return Attempt("nothing", lambda: "")


def wrong(rng):
    return Attempt("a line\nand \x1b", lambda: "half of it is ignored")


def unforeseen(rng):
    return Attempt("one by zero", lambda: str(1 / 0))


def documented(rng):
    return Attempt("one by zero", lambda: str(1 / 0), (ZeroDivisionError,))


def endless(rng):
    def made() -> str:
        while True:
            pass

    return Attempt("for ever", made)


KINDS = {each.__name__: each for each in (good, wrong, unforeseen, documented, endless)}
VERDICTS = {
    "good": "good",
    "wrong": "wrong",
    "unforeseen": "traceback",
    "documented": "good",
    "endless": "hang",
}


@pytest.mark.parametrize("kind", KINDS)
def test_verdicts(kind):
    row = row_of(KINDS, kind, 1, 0, most=1)
    assert row.verdict == VERDICTS[kind]
    assert row.told.isprintable()


@pytest.mark.parametrize("name", ["orsino", "industrial_drive", "rl5"])
def test_own_dynamics(name):
    """Bars as d'Alembert's rods against the paper's equation (39)."""
    robot = deltaopt.load_robot(PROBLEMS / "robots" / f"{name}.yaml")
    rng, model = np.random.default_rng(1), deltaopt.DeltaModel(robot, 1.5)
    x = np.array([scene.start for scene in random_scenes(robot, 1.5, 5, 1)])
    v, a = rng.normal(size=x.shape), 30 * rng.normal(size=x.shape)
    own = loads(robot, 1.5, x, v, a)
    assert own.tau == pytest.approx(model.inverse_dynamics(x, v, a), rel=1e-10, abs=1e-10)
    assert own.theta == pytest.approx(model.inverse_kinematics(x)[:, 3::3], abs=1e-12)


def test_own_checks():
    """A motion that is driven too fast, or to another goal, is noticed; a good one is not."""
    line = deltaopt.baseline(SCENE)
    assert not faults(SCENE, line)
    assert "torque with 1 kg" in faults(SCENE, line.slowed(0.9))[0]
    elsewhere = SCENE.model_copy(update={"goal": (0.45, 0.11, 0.0)})
    assert "goal: 1.00e-02" in faults(elsewhere, line)
    motion = line(np.linspace(0, line.duration, 30))
    rows = [motion.theta, motion.dtheta, motion.ddtheta]
    assert table_share(SCENE, motion.t, rows) == pytest.approx(1, abs=2e-3)
    assert table_share(SCENE, 0.8 * motion.t, rows) > 1.2
