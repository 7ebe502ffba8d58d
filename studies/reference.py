"""All keys of robot and scene files, as the pages docs/robot-keys.md and docs/scene-keys.md.

Names, what they may be, units, defaults and explanations are those of the records that read the
files; the examples are those of `deltaopt new` and of the files in problems/. So the pages say what
the program does.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from inspect import getdoc
from pathlib import Path

from deltaopt.files.atomic_write import atomic_write
from deltaopt.files.validated_record import Record
from deltaopt.files.yaml_file import read_yaml
from deltaopt.output.starting_files import (
    ROBOT,
    ROBOT_EXTRAS,
    SCENE,
    SCENE_EXTRAS,
    Key,
    keys_of,
)
from deltaopt.robot.robot import Robot
from deltaopt.scene.scene import Scene
from studies.problems import PROBLEMS

HELP = "write the pages that list all keys of robot and scene files"
SMALL: dict[str, object] = {}
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


def pages() -> dict[str, str]:
    """The text of each page by the name of its file."""
    robots, scenes = _shipped(lambda file: file.parent == ROBOTS), _shipped(_is_scene)
    return {
        "robot-keys.md": _page(
            "Keys of a robot file",
            f"{_ROBOT} {_explained(Robot)}",
            _rows(Robot, {**ROBOT, **ROBOT_EXTRAS}, robots, ""),
        ),
        "scene-keys.md": _page(
            "Keys of a scene file", _SCENE, _rows(Scene, {**SCENE, **SCENE_EXTRAS}, scenes, "")
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
