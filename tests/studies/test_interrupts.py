"""The study of commands that are stopped: it notices what it looks for."""

from __future__ import annotations

import shutil
import signal
from pathlib import Path

import pytest

from deltaopt.cli import main
from studies.interrupts import (
    FILES,
    NOTES,
    STOPPED,
    Ended,
    Experiment,
    contents,
    faults_of_files,
    left_behind,
)
from studies.problems import PICK_AND_PLACE

CHECK = Experiment(("check",), signal.SIGINT, 1.0, False, frozenset({"usual"}))


@pytest.fixture(scope="module")
def good(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("good") / "plan"
    assert main(["plan", str(PICK_AND_PLACE), "--baseline", "-o", str(folder)]) == 0
    return folder


@pytest.fixture
def plan(good, tmp_path) -> Path:
    return Path(shutil.copytree(good, tmp_path / "place" / "plan"))


def test_a_whole_plan_and_none_are_no_fault(plan, tmp_path):
    assert faults_of_files(plan, {}) == ()
    assert faults_of_files(tmp_path / "absent", {}) == ()
    assert left_behind(plan) == ()


@pytest.mark.parametrize("name", sorted(FILES))
def test_half_a_file_is_a_fault(plan, name):
    whole = (plan / name).read_bytes()
    (plan / name).write_bytes(whole[: len(whole) // 2])
    assert faults_of_files(plan, {}) == (f"{name} is not whole",)
    (plan / name).unlink()
    (fault,) = faults_of_files(plan, {})
    assert fault.startswith("only ")


def test_a_mixture_of_two_plans_is_a_fault(plan):
    old = contents(plan)
    (plan / NOTES).write_text("mine", encoding="utf-8")
    assert faults_of_files(plan, old) == ()
    (plan / "plan.json").write_text("[1]", encoding="utf-8")
    assert faults_of_files(plan, old) == ("of the old plan only plan.png, trajectory.csv stayed",)
    (plan / NOTES).unlink()
    assert f"{NOTES} is gone" in faults_of_files(plan, old)


def test_what_is_left_behind_is_a_fault(plan):
    (plan / ".deltaopt-1").mkdir()
    (plan.parent / ".deltaopt-2").mkdir()
    assert len(left_behind(plan)) == 2


@pytest.mark.parametrize(
    ("code", "errors", "word", "faults"),
    [
        (0, ["usual"], "finished", 0),
        (130, ["usual", STOPPED], "stopped", 0),
        (130, [STOPPED, STOPPED], "stopped", 1),
        (130, [], "stopped", 1),
        (0, ["a warning"], "stopped", 1),
        (-2, ["  File runpy", "KeyboardInterrupt"], "too early", 0),
        (-2, ["  File /a/deltaopt/b.py", "KeyboardInterrupt"], "stopped", 1),
        (-2, [], "stopped", 1),
    ],
)
def test_how_a_command_takes_it(code, errors, word, faults):
    found, wrong = CHECK._judged(Ended(0.5, code, tuple(errors)))
    assert (found, len(wrong)) == (word, faults)
