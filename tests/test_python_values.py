"""What Python allows and a plan cannot mean; copies of plans; names that docs give."""

from __future__ import annotations

import builtins
import inspect
import pickle
import pydoc
import re
from pathlib import Path

import numpy as np
import pytest

import deltaopt
from deltaopt.cli import main
from deltaopt.output.in_words import percent

ROOT = Path(__file__).parents[1]
SCENE = deltaopt.load_scene(ROOT / "problems/pick_and_place.yaml")


def test_a_plan_equals_its_copy_and_no_other(picked):
    copied = pickle.loads(pickle.dumps(picked))
    assert copied == picked
    assert copied.trajectory == picked.trajectory
    assert len({copied, picked, copied.trajectory, picked.trajectory}) == 2
    other = deltaopt.plan(SCENE.model_copy(update={"payload": 1.0 + 1e-9}))
    assert other != picked
    assert other.trajectory != picked.trajectory
    assert picked.trajectory.slowed(1 + 1e-15) != picked.trajectory


def test_a_verification_has_a_hash(picked):
    found = deltaopt.verify(SCENE, picked.trajectory)
    again = pickle.loads(pickle.dumps(found))
    assert again == found
    assert len({found, again}) == 1


@pytest.mark.parametrize("rate", [0, -1.0, float("nan")])
def test_a_table_has_rows(picked, rate):
    with pytest.raises(ValueError, match=r"^rate is .*; it must be greater than 0$"):
        picked.table(rate)


@pytest.mark.parametrize("name", ["tolerance", "intervals", "starts", "seed", "exhaustive"])
def test_true_is_no_number(name):
    with pytest.raises(TypeError, match=f"^{name} is True; it must be a "):
        deltaopt.plan(SCENE, **{name: True})


@pytest.mark.parametrize(
    "point",
    [
        np.array([True, False, False]),
        np.ma.array([0.45, 0.0, 0.0], mask=[1, 0, 0]),
        np.array([0.45 + 0.1j, 0.0, 0.0]),
    ],
)
def test_what_is_no_array_of_real_numbers_is_no_point(point):
    model = deltaopt.DeltaModel(SCENE.robot)
    with pytest.raises(TypeError, match="real numbers are needed, not a mask"):
        model.inverse_kinematics(point)
    with pytest.raises(deltaopt.SceneError, match=r"^goal is .*, not all real numbers"):
        SCENE.model_copy(update={"goal": point})


@pytest.mark.parametrize(("robot", "payload"), [("orsino", 1.0), (SCENE.robot, float("nan"))])
def test_a_model_has_a_robot_and_a_mass(robot, payload):
    with pytest.raises((TypeError, ValueError), match=r"^(robot|payload) is .*; it must be "):
        deltaopt.DeltaModel(robot, payload)


def test_a_complaint_is_one_line_whatever_a_file_is_named(tmp_path, capsys):
    assert main(["export", "table", str(tmp_path / "a\nb\x1b[31m")]) == 2
    assert re.fullmatch(r"deltaopt: .*a\\nb\\x1b\[31m.*\n", capsys.readouterr().err)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("start", {0.45, -0.05, 0.0}),
        ("via", {(0.45, 0.0, 0.0), (0.45, 0.0, 0.01)}),
        ("payload", {0.5, 1.0}),
        ("path", {"points": [{0.45, 0.0, 0.01}], "blend": 0.01}),
    ],
)
def test_a_set_is_no_point(key, value):
    given = {"robot": SCENE.robot, "start": SCENE.start, "goal": SCENE.goal, key: value}
    with pytest.raises(deltaopt.SceneError) as caught:
        deltaopt.Scene(**given)
    assert caught.value.key.startswith(key)


@pytest.mark.parametrize("record", [deltaopt.Scene, deltaopt.Robot])
def test_help_on_a_record_is_a_page(record):
    """Its keys and its own members, without those of all of pydantic's models, which it has."""
    page = pydoc.render_doc(record, renderer=pydoc.plaintext)
    assert len(page.splitlines()) <= 110
    assert "payload=None, " in page if record is deltaopt.Scene else "joints=None, " in page
    assert "pydantic_" not in page
    assert "model_copy(self, *, update" in page
    assert record.model_validate
    assert list(inspect.signature(record).parameters) == list(record.model_fields)


def test_a_scene_takes_the_name_of_a_robots_file(monkeypatch):
    """As a scene's file does, relative to where Python runs."""
    monkeypatch.chdir(ROOT / "problems")
    ends = {"payload": 1.0, "start": SCENE.start, "goal": SCENE.goal}
    named = deltaopt.Scene(robot="robots/orsino.yaml", **ends)
    assert named == SCENE.model_copy(update={"limits": None})
    assert deltaopt.Scene(robot=SCENE.robot.model_dump(), **ends) == named
    shares = deltaopt.Scene(robot=Path("robots/orsino.yaml"), limits={"torque": "50 %"}, **ends)
    assert shares.given("torque") == 5.0
    with pytest.raises(deltaopt.SceneError, match=r"^none\.yaml: robot cannot be read"):
        deltaopt.Scene(robot="none.yaml", **ends)


def test_every_name_that_is_written_is_there():
    """deltaopt.NAME in docs, README, examples and docstrings, but for modules."""
    files = [ROOT / "README.md", *ROOT.glob("docs/**/*.md"), *ROOT.glob("examples/*")]
    files += [*ROOT.glob("deltaopt/**/*.py"), *ROOT.glob("studies/**/*.py")]
    modules = {path.stem for path in (ROOT / "deltaopt").iterdir()}
    written = {
        name
        for file in files
        if file.suffix in (".md", ".py", ".ipynb")
        for name in re.findall(r"(?<![\w./-])deltaopt\.([A-Za-z]\w*)", file.read_text("utf-8"))
    }
    assert len(written) > 30
    assert not {name for name in written - modules if not hasattr(deltaopt, name)}


def test_every_error_that_a_docstring_names_can_be_caught():
    named = set()
    for public in (getattr(deltaopt, name) for name in deltaopt.__all__):
        inner = vars(public).items() if inspect.isclass(public) else ()
        methods = [value for name, value in inner if not name.startswith("_")]
        for each in (public, *(getattr(value, "__func__", value) for value in methods)):
            for sentence in re.findall(r"[Rr]aises ([^.]*)\.", inspect.getdoc(each) or ""):
                named |= set(re.findall(r"\b[A-Z]\w+\b", sentence))
    assert {"Singular", "Infeasible", "ValueError", "UnreadablePlan"} <= named
    assert not {name for name in named if not hasattr(builtins, name)} - set(deltaopt.__all__)


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        (lambda: deltaopt.timed_line("x"), "scene is 'x'; it must be a Scene, such as load_scene"),
        (lambda: deltaopt.Box((0, 0, 0), (1, 1, 1)), r"Box is given \(0, 0, 0\); it takes values"),
        (lambda: deltaopt.Scene("robot.yaml"), "such as robot, payload, .*; load_scene and load_"),
    ],
)
def test_what_is_no_scene_and_has_no_name_is_told_in_a_sentence(asked, told):
    with pytest.raises(TypeError, match=told):
        asked()


def test_axes_are_those_of_matplotlib(picked):
    with pytest.raises(
        TypeError, match=r"^axes is 'x.png'; it must be an Axes of matplotlib; save"
    ):
        picked.plot("x.png")


def test_what_is_shown_at_a_prompt_is_a_short_line(picked):
    robot = deltaopt.load_robot(ROOT / "problems/robots/industrial_drive.yaml")
    cycle = deltaopt.load_cycle(ROOT / "problems/cycles/there_and_back.yaml")
    shown = {
        "drive": robot.drive,
        "limits": deltaopt.Limits(acceleration=40.0),
        "planner": deltaopt.Planner(robot, payload=1.0),
        "cycle": cycle,
        "instants": picked.trajectory([0.0, 0.01]),
        "instant": picked.trajectory(0.01),
    }
    lines = {name: repr(value) for name, value in shown.items()}
    assert all(len(line) < 160 and "\n" not in line for line in lines.values()), lines
    assert not [name for name, line in lines.items() if "None" in line]
    assert lines["limits"] == "Limits(acceleration=40.0)"
    assert "2 instants" in lines["instants"]
    assert "t = 0.01 s" in lines["instant"]
    assert deltaopt.Limits(acceleration=40.0) == eval(lines["limits"], vars(deltaopt))


def test_a_tolerance_is_a_share():
    with pytest.raises(ValueError, match=r"^tolerance is 5; it must be at most 1$"):
        deltaopt.plan(SCENE, tolerance=5)
    with pytest.raises(ValueError, match=r"^tolerance is 5; it must be at most 1$"):
        deltaopt.plan_cycle(
            deltaopt.load_cycle(ROOT / "problems/cycles/there_and_back.yaml"), tolerance=5
        )
    assert [percent(share) for share in (1.1, 0.234, 0.0123, 0.0)] == [
        "110 %",
        "23 %",
        "1.2 %",
        "0 %",
    ]
