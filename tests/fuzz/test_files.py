"""Random files: a scene, or one sentence; and what loads can be checked."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from deltaopt.cli import main
from deltaopt.robot.robot import Robot, load_robot
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import load_scene
from tests.fuzz.inputs import (
    ROBOT_CONTENT,
    SCENE_CONTENT,
    changed,
    fewer,
    limited,
    result_or_sentence,
    scaled,
    trees,
)

SIGNS = st.text("abz019.:-+[]{}&*!|>'\"#%@,?~=<\\ \n\t\r\x00é\u2028\ufeff", max_size=200)
TEXTS = [(yaml.safe_dump(each)) for each in (ROBOT_CONTENT, SCENE_CONTENT)]


@st.composite
def damaged(draw: st.DrawFn) -> bytes:
    """A good file from which a piece was removed, doubled, or replaced by other bytes."""
    text = draw(st.sampled_from(TEXTS)).encode()
    begin = draw(st.integers(0, len(text)))
    end = draw(st.integers(begin, min(len(text), begin + 30)))
    piece = draw(
        st.one_of(st.binary(max_size=8), SIGNS.map(str.encode), st.just(text[begin:end] * 2))
    )
    return text[:begin] + piece + text[end:]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("files")


def written(folder: Path, robot: object, scene: object) -> Path:
    """Files of a robot and of its scene; what YAML cannot say is said in JSON, which it reads."""
    for name, content in (("robot.yaml", robot), ("scene.yaml", scene)):
        (folder / name).write_text(json.dumps(content), encoding="utf-8")
    return folder / "scene.yaml"


@given(content=st.one_of(st.binary(max_size=100), SIGNS.map(str.encode), damaged()))
def test_any_bytes(content, folder):
    (folder / "robot.yaml").write_bytes(content)
    (folder / "scene.yaml").write_bytes(content)
    with result_or_sentence():
        load_robot(folder / "robot.yaml")
    with result_or_sentence():
        load_scene(folder / "scene.yaml")


@given(content=trees)
def test_any_tree(content, folder):
    with result_or_sentence():
        load_scene(written(folder, ROBOT_CONTENT, content))
    with result_or_sentence():
        load_scene(written(folder, content, SCENE_CONTENT))


@fewer(4)
@given(depth=st.integers(1, 2000), opening=st.sampled_from(["[", "{a: ", "- ", "a:\n", "? "]))
def test_any_depth(depth, opening, folder):
    (folder / "deep.yaml").write_text(opening * depth, encoding="utf-8")
    with result_or_sentence(seconds=5):
        load_robot(folder / "deep.yaml")


@given(robot=changed(ROBOT_CONTENT, trees), scene=changed(SCENE_CONTENT, trees))
def test_changed_values(robot, scene, folder):
    """One after the other, so that the fault of one does not hide that of the other."""
    with result_or_sentence():
        Robot.from_content(robot, Path("robot.yaml"))
    with result_or_sentence():
        load_scene(written(folder, ROBOT_CONTENT, scene))
    with result_or_sentence():
        found = load_scene(written(folder, robot, SCENE_CONTENT))
        assert Scene.model_validate_json(found.model_dump_json()) == found


def checked(folder: Path, robot: object, scene: object, capfd) -> None:
    """The command ``check`` prints a description, or one sentence."""
    file = written(folder, robot, scene)
    capfd.readouterr()
    with limited(20):
        code = main(["check", str(file)])
    told = capfd.readouterr()
    assert code in (0, 1, 2)
    assert (told.err == "") == (code == 0)
    if code:
        assert told.err.startswith("deltaopt: ")
        assert told.err.count("\n") == 1


@fewer(2)
@given(robot=scaled(ROBOT_CONTENT), scene=scaled(SCENE_CONTENT))
def test_what_loads_can_be_checked(robot, scene, folder, capfd):
    checked(folder, robot, scene, capfd)
