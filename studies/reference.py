"""All keys of robot and scene files, as the pages docs/robot-keys.md and docs/scene-keys.md.

Names, what they may be, units, defaults and explanations are those of the records that read the
files; the examples are those of `deltaopt new` and of the files in problems/. So the pages say what
the program does.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from inspect import getdoc
from pathlib import Path
from typing import Any, get_args, get_origin

from deltaopt.files.atomic_write import atomic_write
from deltaopt.files.validated_record import Record
from deltaopt.files.yaml_file import read_yaml
from deltaopt.output.starting_files import ROBOT_FILE, SCENE_FILE, text_of
from deltaopt.robot.robot import Robot
from deltaopt.scene.objective import EXPECTED_DURATION
from deltaopt.scene.scene import Scene
from studies.problems import PROBLEMS

ROBOTS = PROBLEMS / "robots"
_ABOUT = """\
Numbers are in SI units, or texts with a unit such as `350 mm` ([units](your-robot.md#units)). A key
without *required* or a default may be left out: what it names is then neither modelled nor limited.
An example leads to a shipped file that has the key. Points are `[x, y, z]` from the base's centre,
**x down**; [the frame](your-robot.md#the-frame-x-points-down) shows how to convert a cell in
millimetres whose z points up."""
_COMMAND = "(Written by `python -m studies reference -o docs` from the code that reads the files.)"
_ROBOT = "[Where to find the numbers](your-robot.md); [motors and gears](drives.md)."
_SCENE = """\
The tool's point moves from `start` to `goal`; it is the platform's centre if no tool has an offset.
What limits mean: [limits](limits.md). What goes together: [combinations](combinations.md). With the
key `cycle` instead of `goal` a file is a [cycle](cycles.md#keys), which explains its keys `cycle`,
`dwell`, `period` and `limits.rms_torque`; [cell.yaml](../problems/cycles/cell.yaml) has most."""
_BESIDE: dict[str, tuple[Any, str]] = {
    "duration": (None, f"with an objective of effort, jerk or torque_rate: {EXPECTED_DURATION}"),
    "tool": (Robot.model_fields["tool"].annotation, "instead of the robot's"),
}
"""Types and meanings of the keys of a scene that its record takes apart before it reads them."""
_NO_KEYS = ("least_payload", "planned_links")
"""Fields of a scene that no file gives."""
_FILES = ("robot",)
"""Keys of a scene whose values are files."""
_LINE = re.compile(r"((?:  )*)#?(\w+):(?: (?! #)(.*?))?(?:  # (.*))?$")
"""A line of a file to start from: indentation, key, example and meaning."""


def pages() -> dict[str, str]:
    """The text of each page by the name of its file."""
    robots, scenes = _shipped(lambda file: file.parent == ROBOTS), _shipped(_is_scene)
    return {
        "robot-keys.md": _page(
            "Keys of a robot file",
            f"{_ROBOT} {_explained(Robot)}",
            _rows(Robot, _examples(ROBOT_FILE), robots, ""),
        ),
        "scene-keys.md": _page(
            "Keys of a scene file",
            _SCENE,
            _rows(Scene, _examples(SCENE_FILE), scenes, ""),
        ),
    }


def _page(title: str, about: str, rows: Iterable[str]) -> str:
    table = "\n".join(["|key|what it is|default|example|", "|---|---|---|---|", *rows])
    return "\n\n".join([f"# {title}", _ABOUT, about, table, _COMMAND]) + "\n"


def _is_scene(file: Path) -> bool:
    return file.parent != ROBOTS


def _shipped(wanted: Callable[[Path], bool]) -> dict[str, Path]:
    """A shipped file that has a key, by the key with all that it stands in: the shortest one."""
    found: dict[str, Path] = {}
    files = [file for file in sorted(PROBLEMS.glob("**/*.yaml")) if wanted(file)]
    for file in sorted(files, key=lambda each: each.stat().st_size):
        for key in _places(read_yaml(file), ""):
            found.setdefault(key, file)
    return found


def _places(value: object, inside: str) -> Iterator[str]:
    """The dotted keys of what a file says."""
    if isinstance(value, Mapping):
        for name, inner in value.items():
            yield f"{inside}{name}"
            yield from _places(inner, f"{inside}{name}.")


def _rows(
    record: type[Record], examples: Mapping[str, str], shipped: Mapping[str, Path], inside: str
) -> Iterator[str]:
    """A row of each key, and after one that is a mapping those of the keys in it."""
    for key in keys_of(record):
        place = inside + key.name
        default = "required" if key.required else "" if key.default is None else str(key.default)
        example = f"`{examples[place]}`" if place in examples else "a file" * (place in shipped)
        if place in shipped:
            example = f"[{example}](../{shipped[place].relative_to(PROBLEMS.parent).as_posix()})"
        cells = (f"`{place}`", _meaning(key), default, example)
        yield "|" + "|".join(" ".join(cell.replace("|", "\\|").split()) for cell in cells) + "|"
        if key.inner is not None:
            yield from _rows(key.inner, examples, shipped, f"{place}.")


def _meaning(key: Key) -> str:
    """What a key may be; of a mapping what its keys mean."""
    if key.inner is None:
        return key.expected
    explained = _explained(key.inner)
    return explained if key.expected.startswith("a mapping") else f"{key.expected}. {explained}"


def _explained(record: type[Record]) -> str:
    """What the record's docstring says, for readers of files: a key that is None is absent."""
    told, *_ = str(getdoc(record)).partition("\n\nExamples:")
    text = re.sub(r"\s*\bRaises [^.]*\.", "", told).replace("``", "`")
    text = re.sub(r"(?<=\.)(\s)None\b", r"\1Absent", text)
    return re.sub(r"\bNone\b", "absent", text).strip()


@dataclass(frozen=True)
class Key:
    """A key of a file: its ``name``, what it may be, the ``inner`` record that stands under it if
    it is a mapping of keys of its own, its ``default`` and whether it is ``required``."""

    name: str
    expected: str
    inner: type[Record] | None
    default: object
    required: bool


def keys_of(record: type[Record]) -> Iterator[Key]:
    """The keys that a file may have where it describes such a record, in their order."""
    for name, field in record.model_fields.items():
        if record is Scene and name in _NO_KEYS:
            continue
        inner = None if name in _FILES else _record_in(field.annotation)
        required = field.is_required()
        default = None if required else field.default
        yield Key(name, str(field.description), inner, default, required)
    if record is Scene:
        for name, (annotation, expected) in _BESIDE.items():
            yield Key(name, expected, _record_in(annotation), None, False)


def _record_in(annotation: Any) -> type[Record] | None:
    """The record that a field's type is, or may be; None for other types, and for those that are
    one of several records and told apart by what stands there."""
    found = _records_in(annotation)
    return found[0] if len(found) == 1 else None


def _records_in(annotation: Any) -> list[type[Record]]:
    if get_origin(annotation) is tuple:  # a list of records is written as a whole
        return []
    if isinstance(annotation, type) and issubclass(annotation, Record):
        return [annotation]
    return [record for each in get_args(annotation) for record in _records_in(each)]


def lines_in(text: str) -> dict[str, tuple[str, str]]:
    """The example and the meaning in each line of a file to start from that has a key, used or
    commented out, by the dotted key; empty where there is none."""
    found, above = dict[str, tuple[str, str]](), list[str]()
    for line in filter(None, map(_LINE.match, text.splitlines())):
        indented, key, example, meaning = line.groups(default="")
        above = [*above[: len(indented) // 2], key]
        found[".".join(above)] = example, meaning
    return found


def _examples(name: str) -> dict[str, str]:
    """Those of a file to start from."""
    return {place: example for place, (example, _) in lines_in(text_of(name)).items() if example}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "-o",
        dest="directory",
        type=Path,
        metavar="DIR",
        help="write the pages there, docs/ for example, instead of printing them",
    )


def run(arguments: argparse.Namespace) -> int:
    for name, text in pages().items():
        if arguments.directory is None:
            print(text)
            continue
        file = arguments.directory / name
        with atomic_write(file) as temporary:
            temporary.write_text(text, encoding="utf-8")
        print("written:", file)
    return 0
