"""The files that `deltaopt new` writes: every key, examples that are accepted, nothing lost."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

import pytest

from deltaopt.cli import main
from deltaopt.errors import DeltaOptError
from deltaopt.files.validated_record import Record
from deltaopt.output.starting_files import ROBOT_FILE, SCENE_FILE, text_of
from deltaopt.planning.planner import plan
from deltaopt.robot.robot import Robot, load_robot
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import load_scene
from deltaopt.verify.verification import verify
from studies.reference import keys_of as keys_by_records
from studies.reference import lines_in

ROBOT, SCENE = text_of(ROBOT_FILE), text_of(SCENE_FILE)


def keys_of(record: type[Record]) -> set[str]:
    """The keys of a record and of all records in it, read from pydantic's own schema."""
    schema = record.model_json_schema()
    found = set(schema["properties"])
    for definition in schema.get("$defs", {}).values():
        found |= set(definition.get("properties", {}))
    return found


def paths_of(text: str) -> dict[str, int]:
    """The dotted key of each line that has one, commented out or not, and the line's number."""
    found, above = {}, []
    for number, line in enumerate(text.splitlines()):
        key = re.match(r"((?:  )*)#?(\w+):", line)
        if key:
            above = [*above[: len(key[1]) // 2], key[2]]
            found[".".join(above)] = number
    return found


def with_keys(text: str, *paths: str, without: tuple[str, ...] = ()) -> str:
    """The text with these keys used, in the mappings that they are in, but for those ``without``,
    which are taken out with all that is in them."""
    lines = text.splitlines()
    for path, number in paths_of(text).items():
        if path.startswith(without):
            lines[number] = "#"
        elif any(each == path or each.startswith(f"{path}.") for each in paths):
            lines[number] = re.sub(r"^( *)#", r"\1", lines[number])
    return "\n".join(lines)


def written(folder: Path) -> Path:
    assert main(["new", str(folder)]) == 0
    return folder


def test_they_can_be_planned_as_they_are(tmp_path, capsys):
    scene = load_scene(written(tmp_path) / "scene.yaml")
    check_feasible(scene)
    assert scene.robot == load_robot(tmp_path / "robot.yaml")
    assert "next: put in your numbers" in capsys.readouterr().out
    found = plan(scene)
    assert verify(scene, found.trajectory).ok
    assert 0.1 < found.duration < 1.0


def told_by(
    record: type[Record], examples: set[str], inside: str = ""
) -> Iterator[tuple[str, str]]:
    """The dotted keys of a record in their order, each with what the record says of it; of a key
    without an example, below which those of its mapping stand, nothing but of a tool."""
    for key in keys_by_records(record):
        place = inside + key.name
        is_whole = key.inner is None or place in examples
        yield place, key.expected if is_whole or place == "tool" else ""
        if not is_whole:
            yield from told_by(key.inner, examples, f"{place}.")


@pytest.mark.parametrize(("record", "text"), [(Robot, ROBOT), (Scene, SCENE)])
def test_lines_say_what_the_records_say(record, text):
    """In the same order; a record's new key, or another description, needs a line here too."""
    lines = lines_in(text)
    examples = {place for place, (example, _) in lines.items() if example}
    said = [(place, meaning) for place, (_, meaning) in lines.items()]
    assert said == list(told_by(record, examples))


def test_every_key_is_there_with_what_it_means():
    robot, scene = paths_of(ROBOT), paths_of(SCENE)
    in_lists = {"sphere", "box", "capsule", "from", "to"}  # shapes of a tool, in one line
    assert {path.split(".")[-1] for path in robot} == keys_of(Robot) - in_lists
    assert {path for path in scene if "." not in path} == set(Scene._keys())
    limits = get_args(Scene.model_fields["limits"].annotation)[0]
    assert {f"limits.{name}" for name in limits.model_fields} <= set(scene)
    for text in (ROBOT, SCENE):
        for line in text.splitlines():
            if re.match(r" *#?\w+: (?! #)", line):
                assert re.search(r": \S.*  # \w", line), line  # an example, and what it is


AT_THE_ARM = ("drive.torque", "drive.speed", "drive.inertia", "drive.rms_torque")
OF_A_CATALOGUE = ("drive.motor", "drive.brake", "drive.gear")
OF_BODIES = ("keep_out", "clearance", "robot_keeps_clear", "tool.radius")
"""What blocks the tube of the examples, or is the tool's alternative."""
EFFORT = ("objective: time", "objective: effort")


OF_ORDER_3 = ("limits.torque_rate", "limits.jerk", "limits.joint_jerk")


def test_every_example_is_accepted(tmp_path):
    written(tmp_path)
    robot, scene = tmp_path / "robot.yaml", tmp_path / "scene.yaml"
    known = tuple(paths_of(ROBOT))
    at_the_arm = with_keys(ROBOT, *known, without=(*OF_A_CATALOGUE, "tool.shapes"))
    robot.write_text(at_the_arm, encoding="utf-8")
    assert load_robot(robot).drive.rms_torque == 25.0
    of_a_catalogue = with_keys(ROBOT, *known, without=(*AT_THE_ARM, "tool.radius"))
    robot.write_text(of_a_catalogue, encoding="utf-8")
    assert load_robot(robot).drive.gear.ratio == 20.0
    robot.write_text(ROBOT, encoding="utf-8")
    scene.write_text(
        with_keys(
            SCENE,
            *paths_of(SCENE),
            without=("duration", "tool.shapes", "tube", "via", "approach", *OF_ORDER_3),
        ),
        encoding="utf-8",
    )
    assert load_scene(scene).limits.torque == pytest.approx(0.85 * 65.0)
    assert (load_scene(scene).clearance, load_scene(scene).robot.tool.radius) == (0.002, 0.03)
    beside = ("duration", "via", "approach", *OF_BODIES)
    in_a_tube = with_keys(SCENE, *paths_of(SCENE), without=beside)
    scene.write_text(in_a_tube, encoding="utf-8")
    assert load_scene(scene).tube == 0.005
    effort = with_keys(SCENE, "objective", "duration").replace(*EFFORT)
    scene.write_text(effort, encoding="utf-8")
    assert load_scene(scene).objective.given_duration == 0.5


def uncommented(text: str) -> Iterator[tuple[str, str]]:
    """The text with the # before a key removed: before it alone, and before those above it too, and
    before those inside it too; each with the key."""
    places, lines = paths_of(text), text.splitlines()
    for path in (path for path, number in places.items() if re.match(r" *#", lines[number])):
        above = [each for each in places if path == each or path.startswith(f"{each}.")]
        inside = [each for each in places if each.startswith(f"{path}.")]
        for keys in ([path], above, above + inside):
            changed = list(lines)
            for number in (places[key] for key in keys):
                changed[number] = re.sub(r"^( *)#", r"\1", changed[number])
            yield path, "\n".join(changed)


NEEDS_MORE = re.compile(
    r"beside|is missing; expected|is ''; expected a mapping|is not a known key; expected"
    r"|each key once|is the # before the key above it removed\?|expected viscous"
)
"""What a sentence says that tells what a key needs beside it."""


@pytest.mark.parametrize(("name", "text"), [("robot", ROBOT), ("scene", SCENE)])
def test_any_key_can_be_used_by_removing_its_mark_or_says_what_it_needs(name, text, tmp_path):
    written(tmp_path)
    used, refused = set(), []
    for path, changed in uncommented(text):
        (tmp_path / f"{name}.yaml").write_text(changed, encoding="utf-8")
        try:
            load_scene(tmp_path / "scene.yaml")
            used.add(path)
        except DeltaOptError as error:
            refused.append(str(error))
    assert [each for each in refused if "\n" in each or not NEEDS_MORE.search(each)] == []
    alone = {"limits", "approach", "rotation", "keep_out", "path", "via", "elbow", "joints"}
    assert used >= alone & set(paths_of(text))
    assert len(used) >= 20


def test_nothing_is_overwritten(tmp_path, capsys):
    (tmp_path / "scene.yaml").write_text("mine", encoding="utf-8")
    assert main(["new", str(tmp_path)]) == 1
    assert "scene.yaml exists and is not overwritten" in capsys.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == ["scene.yaml"]
    assert (tmp_path / "scene.yaml").read_text(encoding="utf-8") == "mine"
