"""Names that are no files: pipes and devices are not read, and what is no file is not replaced."""

from __future__ import annotations

import os
import stat
import struct
from dataclasses import dataclass

import numpy as np
import pytest

from deltaopt.cli import main
from deltaopt.errors import SceneError
from deltaopt.files.atomic_write import atomic_write
from deltaopt.files.output_folder import all_or_none
from deltaopt.files.yaml_file import read_yaml
from deltaopt.output.saved_plan import UnreadablePlan, load_plan
from deltaopt.plots.style import figure, verbatim
from deltaopt.robot.robot import load_robot
from deltaopt.scene import convex_hull
from deltaopt.scene.scene_file import load_scene
from studies.kept_rows import read_rows
from studies.problems import PROBLEMS


@dataclass(frozen=True)
class Row:
    number: int


ORSINO = PROBLEMS / "robots" / "orsino.yaml"
MOVE = f"robot: {ORSINO}\nstart: [0.45, -0.05, 0]\ngoal: [0.45, 0.10, 0]\n"


def scene(folder, more: str = "", robot: str = str(ORSINO)):
    file = folder / "scene.yaml"
    file.write_text(MOVE.replace(str(ORSINO), robot) + more, encoding="utf-8")
    return file


def sentence(file) -> str:
    with pytest.raises(SceneError) as error:
        load_scene(file)
    return str(error.value)


# What is read


@pytest.mark.parametrize("key", ["keep_out: [{hull: {file: %s}}]\n", "path: {points: %s}\n"])
@pytest.mark.parametrize("other", ["pipe", "/dev/zero", "a\\0b"])
def test_other_than_regular_files_are_not_read(key, other, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    problem = "is no name of a file" if "0" in other else "is not a regular file"
    assert problem in sentence(scene(tmp_path, key % f'"{other}"'))


def test_a_pipe_is_no_table_of_rows_and_no_plan(tmp_path):
    os.mkfifo(tmp_path / "plan.json")
    with pytest.raises(UnreadablePlan, match=r"plan\.json is not a regular file"):
        load_plan(tmp_path)
    with pytest.raises(OSError, match="is not a regular file"):
        read_rows(tmp_path / "plan.json", Row)


@pytest.mark.parametrize("text", ["root:x:0:s3cret\nb:y:1\n", "root:s3cret:0::\n", "s3cret*: 1\n"])
def test_what_is_no_robot_is_not_quoted(text, tmp_path):
    (tmp_path / "passwd").write_text(text)
    assert "s3cret" not in sentence(scene(tmp_path, robot="passwd"))
    assert "s3cret" not in sentence(scene(tmp_path, "path: {points: passwd}\n"))


def sphere(triangles: int) -> bytes:
    """An STL file with so many triangles, whose corners are all on a sphere."""
    corners = np.random.default_rng(1).normal(size=(triangles, 3, 3))
    corners /= np.linalg.norm(corners, axis=2, keepdims=True)
    kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows = np.zeros(triangles, kind)
    rows["corners"] = 0.03 * corners + (0.5, 0.3, 0.3)
    return bytes(80) + struct.pack("<I", triangles) + rows.tobytes()


def test_a_part_with_too_many_corners_is_refused_at_once(tmp_path, monkeypatch):
    """In so many steps as its first corners take: each looks at all others once."""
    steps = []
    cone = convex_hull._cone
    monkeypatch.setattr(convex_hull, "_cone", lambda *given: steps.append(given) or cone(*given))
    (tmp_path / "part.stl").write_bytes(sphere(1_000))
    told = sentence(scene(tmp_path, "keep_out: [{hull: {file: part.stl}}]\n"))
    assert "has at most 64 triangles" in told
    assert len(steps) <= 64


# What is written


def kinds(folder) -> dict[str, int]:
    """What everything in a folder is: a file, a link, a pipe."""
    return {each.name: stat.S_IFMT(each.lstat().st_mode) for each in folder.iterdir()}


@pytest.fixture
def things(tmp_path):
    """A pipe, links to a file elsewhere and to nothing, and a folder with one of them."""
    (tmp_path / "elsewhere").write_text("mine")
    folder = tmp_path / "folder"
    folder.mkdir()
    os.mkfifo(folder / "pipe")
    (folder / "link").symlink_to(tmp_path / "elsewhere")
    (folder / "dangling").symlink_to(tmp_path / "nowhere")
    return folder


@pytest.mark.parametrize("name", ["pipe", "link", "dangling"])
def test_what_is_no_file_is_not_replaced(name, things, capsys):
    before = kinds(things)
    with pytest.raises(OSError, match="is not replaced"), atomic_write(things / name) as file:
        file.write_text("new")
    with pytest.raises(OSError, match="is not replaced"), all_or_none(things) as folder:
        (folder / name).write_text("new")
    assert main(["export", "schema", "-o", str(things / name)]) == 2
    assert f"{things / name}: is " in capsys.readouterr().err
    assert kinds(things) == before
    assert (things.parent / "elsewhere").read_text() == "mine"


@pytest.mark.parametrize("name", ["pipe", "link", "dangling", "pipe/deeper"])
def test_what_is_no_folder_is_not_written_to(name, things):
    """A pipe was waited for."""
    before = kinds(things)
    with pytest.raises(OSError, match="not a directory"), all_or_none(things / name) as folder:
        (folder / "a").write_text("new")
    assert kinds(things) == before


def test_a_link_to_a_folder_is_written_through(things):
    (things / "there").symlink_to(things.parent)
    with all_or_none(things / "there") as folder:
        (folder / "new").write_text("new")
    assert (things.parent / "new").read_text() == "new"
    assert (things / "there").is_symlink()


# Names of robots


@pytest.mark.parametrize("name", ["a\nb", "\x1b[31mred", "a\0b", "\u202eabc", "x" * 201, ""])
def test_a_name_is_a_line_of_printable_text(name):
    with pytest.raises(SceneError, match="expected the robot's name, a line of"):
        load_robot(ORSINO).model_copy(update={"name": name})


@pytest.mark.parametrize("name", ["Δ-Roboter № 1", "$x^2 {a} _b_", r"\$ a $ \frac{", "机器人 😀"])
def test_a_name_is_drawn_as_it_stands(name, tmp_path, recwarn):
    assert load_robot(ORSINO).model_copy(update={"name": name}).name == name
    with figure(tmp_path / "a.svg", 3, 1) as page:
        page.suptitle(verbatim(name))
    assert name in (tmp_path / "a.svg").read_text(encoding="utf-8")
    assert not [each for each in recwarn if "Glyph" in str(each.message)]


def test_what_was_made_of_a_file_does_not_change_what_is_read_of_it_again(tmp_path):
    """Texts are kept, their contents are not."""
    file = tmp_path / "a.yaml"
    file.write_text("a: {b: [1, 2]}", encoding="utf-8")
    read_yaml(file)["a"]["b"].append(3.0)
    assert read_yaml(file) == {"a": {"b": [1.0, 2.0]}}
