"""The campaign of hostile input: it notices what it looks for."""

from __future__ import annotations

import csv

import numpy as np
import pytest

import deltaopt
from studies.__main__ import main
from studies.attack.attempts import Attempt, Ended, row_of
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


def test_what_is_a_refusal():
    assert not Ended(2, "", "deltaopt: start is nan\n").unclear("start")
    for ended in (
        Ended(0, "written", ""),
        Ended(2, "", "deltaopt: start is nan\nand more\n"),
        Ended(2, "", "deltaopt: start is \x1b[31m\n"),
        Ended(2, "", "deltaopt: a riddle\n"),
        Ended(2, "", ""),
        Ended(3, "", "deltaopt: start is nan\n"),
    ):
        assert ended.unclear("start")


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


def test_rows_are_kept(tmp_path, capsys):
    words = ["attack", "--small", "-o", str(tmp_path), "--seed", "3"]
    assert main(words) == 0
    file = tmp_path / "attempts_3.csv"
    lines = file.read_text(encoding="utf-8").splitlines()
    with file.open(encoding="utf-8", newline="") as opened:
        made = list(csv.DictReader(opened))
    file.write_text("\n".join(lines[:2]) + "\n", encoding="utf-8")
    assert main(words) == 0
    with file.open(encoding="utf-8", newline="") as opened:
        again = {(row["kind"], row["number"]): row["told"] for row in csv.DictReader(opened)}
    assert again == {(row["kind"], row["number"]): row["told"] for row in made}
    capsys.readouterr()
    assert main(["attack", "--only", "motions:1", "--seed", "3"]) == 0
    assert next(
        row["told"] for row in made if row["number"] == "1" and row["kind"] == "motions"
    ) in (capsys.readouterr().out)
    assert main(["attack", "--only", "motions"]) == 2
