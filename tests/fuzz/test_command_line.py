"""Random arguments: a result, or an exit code and one sentence."""

from __future__ import annotations

import os
from itertools import chain
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import deltaopt.cli
from deltaopt.cli import COMMANDS, main
from studies.problems import PROBLEMS
from tests.fuzz.inputs import fewer, limited, numbers

SCENES = [str(PROBLEMS / f"{name}.yaml") for name in ("pick_and_place", "light_and_fast")]
ROBOT = str(PROBLEMS / "robots/orsino.yaml")
NAMES = st.text(st.characters(exclude_characters="/\0", exclude_categories=["Cs"]), max_size=12)
TEXTS = st.one_of(numbers.map(str), NAMES, st.text("0123456789.-+eE_ ", max_size=8))
WORDS = ("--baseline", "--tolerance", "--intervals", "--formulation", "--solver", "--closure")
WORDS += ("--transcription", "--starts", "--seed", "--rate", "--duration", "--number", "--payload")
WORDS += ("-o", "--output", "--help", "--states", "--rounds", "-h", "--", "-x")
VALUES = ("flat", "explicit", "forward", "ipopt", "interior-point", "knots", "linear", "quadratic")
VALUES += ("c", "any", "plan", "peers", "start", "dynamics", "five-bar", ROBOT, *SCENES)


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def ended(words: list[str], capfd, seconds: float = 20) -> tuple[int, str]:
    """The exit code of a command, and what it wrote to standard error."""
    capfd.readouterr()
    with limited(seconds):
        try:
            code = main(words)
        except SystemExit as end:
            code = end.code
    error = capfd.readouterr().err
    assert code in (0, 1, 2), error
    assert "Traceback" not in error
    return code, error


@given(
    command=st.one_of(st.sampled_from(sorted(COMMANDS)), TEXTS),
    rest=st.lists(st.one_of(st.sampled_from(WORDS + VALUES), TEXTS), max_size=6),
)
def test_any_words(command, rest, capfd, monkeypatch):
    """Parsed only: what the words ask for may take long."""
    for name in COMMANDS:
        monkeypatch.setattr(f"deltaopt.cli.{name}.run", lambda arguments: 0)
    ended([command, *rest], capfd)


@st.composite
def quick_commands(draw: st.DrawFn) -> list[str]:
    """Commands that take milliseconds, with options that may be wrong."""
    scene = draw(st.sampled_from([*SCENES, "nowhere.yaml", ROBOT, "."]))
    name = draw(NAMES)
    output = ["-o", name] if set(name) - {"."} and not name.startswith("-") else []
    value = draw(st.one_of(numbers.map(str), st.sampled_from(["1e3", "0.5", "20", "1e-2"])))
    words = {
        "plan": ["plan", scene, "--baseline", "--rate", value, *output],
        "inverse": ["inverse", scene, "--duration", value, *output],
        "check": ["check", scene],
        "export": ["export", "c", scene if scene not in SCENES else ROBOT, *output],
    }
    return words[draw(st.sampled_from(sorted(words)))]


@fewer(8)
@given(words=quick_commands())
def test_quick_commands(words, capfd, monkeypatch):
    """Charts, which take a second, are left out."""
    monkeypatch.setattr("deltaopt.plots.plan.draw", _chart)
    monkeypatch.setattr("deltaopt.plots.inverse.draw_motion", _chart)
    monkeypatch.setattr("deltaopt.plots.inverse.draw_torques", _chart)
    monkeypatch.setattr("deltaopt.output.plan_files.MOST_ROWS", 5000)
    monkeypatch.setattr("deltaopt.cli.plan.MOST_ROWS", 5000)
    monkeypatch.setattr("deltaopt.cli.inverse.MOST_ROWS", 5000)
    code, error = ended(words, capfd)
    if code:
        assert error.splitlines()[-1].startswith("deltaopt")
    for path in Path().rglob("*"):
        assert not path.name.startswith(".deltaopt"), os.listdir()


def _chart(file: Path, *_: object) -> None:
    file.write_bytes(b"")


@fewer(25)
@given(
    scene=st.sampled_from(SCENES),
    options=st.lists(
        st.sampled_from(
            [
                ["--tolerance", "1e-1"],
                ["--tolerance", "1e-5"],
                ["--intervals", "2"],
                ["--intervals", "33"],
                ["--solver", "ipopt"],
                ["--solver", "interior-point"],
                ["--transcription", "constant"],
                ["--transcription", "quadratic"],
                ["--starts", "2"],
                ["--seed", "9223372036854775807"],
                ["--rate", "10"],
            ]
        ),
        max_size=4,
    ),
)
def test_plans(scene, options, capfd, monkeypatch):
    """Whatever is combined, the plan is verified or it is said what is wrong."""
    monkeypatch.setattr("deltaopt.plots.plan.draw", _chart)
    code, error = ended(["plan", scene, *chain.from_iterable(options)], capfd, seconds=120)
    assert code in (0, 2), error


def test_every_command_is_among_the_words():
    assert set(deltaopt.cli.COMMANDS) >= {"plan", "check", "inverse", "compare", "export"}
