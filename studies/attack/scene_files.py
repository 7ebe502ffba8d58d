"""Kinds of attempts: files of scenes and robots."""

from __future__ import annotations

import copy
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

import deltaopt
from deltaopt.files.yaml_file import read_yaml, write_yaml
from studies.attack.attempts import Attempt, Generator, Kind, command
from studies.problems import PROBLEMS

Content = dict[str, Any]
Place = tuple[str | int, ...]

SHIPPED = sorted(
    file
    for file in PROBLEMS.rglob("*.yaml")
    if file.parent.name != "robots" and file.stem != "safe_lane"
)
SCENE, ROBOT = Path("scene.yaml"), Path("robot.yaml")
_MARK = "0.123456789"
_NO_NUMBERS = [".nan", ".inf", "-.inf", "nan", "1e999", "true", "[]", "{}", "''", "abc", "3 apples"]
_NO_NUMBERS += ["1,5", "[[1, 2], [3]]", "{a: 1}", "5 parsec", "!!python/object:os.system 1", "*a"]
_DOUBTFUL = ["0", "-1", "1e-300", "1e300", "-0.0", "1e9", "'\u0663'", "~", "1_000", "0x1F", "1:30"]
_NO_WORDS = re.compile(r"(?<![\w.])-?(nan|inf|None)(?![\w.])")
_NUMBER, _DIGITS = re.compile(r"-?[.\d]"), re.compile(r"-?\d[-+.e\d]*")
_ALONE = [PROBLEMS / "pick_and_place.yaml", PROBLEMS / "long_diagonal.yaml"]
"""Scenes with nothing but a robot, a payload and two ends."""


def drawn(rng: Generator, files: list[Path] = SHIPPED) -> tuple[Path, Content, Content]:
    """A shipped scene: its file, its robot's content and its own."""
    file = files[rng.integers(len(files))]
    scene = read_yaml(file)
    return file, read_yaml(file.parent / str(scene["robot"])), scene | {"robot": str(ROBOT)}


def written(robot: Content, scene: Content) -> None:
    """Write both files into the current folder."""
    write_yaml(ROBOT, robot)
    write_yaml(SCENE, scene)


def places(content: Any, place: Place = ()) -> list[Place]:
    """Where numbers are, and texts that begin with one."""
    if isinstance(content, dict | list):
        inner = content.items() if isinstance(content, dict) else enumerate(content)
        return [each for key, value in inner for each in places(value, (*place, key))]
    return [place] if _NUMBER.match(str(content)) else []


def at(content: Any, place: Place) -> Any:
    """What is at a place."""
    for key in place:
        content = content[key]
    return content


def replaced(content: Any, place: Place, value: object) -> Any:
    """The content with another value at a place."""
    found = copy.deepcopy(content)
    at(found, place[:-1])[place[-1]] = value
    return found


def values(rng: Generator) -> Attempt:
    """A number of a scene or its robot becomes something else."""
    file, robot, scene = drawn(rng)
    name, content = [(ROBOT, robot), (SCENE, scene)][rng.integers(2)]
    found = places(content)
    place = found[rng.integers(len(found))]
    odd = str(rng.choice(_NO_NUMBERS + _DOUBTFUL))

    def made() -> str:
        written(robot, scene)
        write_yaml(name, replaced(content, place, float(_MARK)))
        name.write_text(name.read_text(encoding="utf-8").replace(_MARK, odd), encoding="utf-8")
        ended = command("check", SCENE)
        words = [str(key) for key in place if isinstance(key, str)]
        if odd in _NO_NUMBERS:
            return ended.unclear(*words, "alias or a tag", "not valid YAML")
        said = _NO_WORDS.search(ended.output)
        return f"it prints {said[0]}" if said else ended.wrong()

    return Attempt(f"{file.name}, {name}: {'.'.join(map(str, place))} = {odd}", made)


_HARMLESS = ("windows", "comment", "quoted", "mark", "flow", "spaces")


def texts(rng: Generator) -> Attempt:
    """The text of a file is damaged, or written in another way."""
    file, robot, scene = drawn(rng)
    cut = int(rng.integers(3, 200))
    ways: dict[str, Callable[[str], str]] = {
        "windows": lambda text: text.replace("\n", "\r\n"),
        "comment": lambda text: "# \u00e9\u2028\n\n---\n" + text + "# end\n\n",
        "quoted": lambda text: re.sub(r"^(\w+):", r'"\1":', text, flags=re.M),
        "mark": lambda text: "\ufeff" + text,
        "flow": lambda text: text + "clearance: 0.001\n",
        "spaces": lambda text: text.replace("\n", "   \n"),
        "twice": lambda text: text + "start: [0.8, 0, 0]\n",
        "tabs": lambda text: text + "limits:\n\ttorque: 5\n",
        "bomb": lambda text: "a: &a [1, 1, 1, 1]\nb: [*a, *a, *a, *a]\n" + text,
        "merge": lambda text: text + "<<: {payload: 2}\n",
        "two": lambda text: text + "---\n" + text,
        "python": lambda text: text + "via: !!python/object/apply:os.system ['touch done']\n",
        "sign": lambda text: text + "via\0: []\n",
        "latin": lambda text: text + "payl\u043ead: 1\n",
        "misspelt": lambda text: text + "payloda: 1\n",
        "deep": lambda text: text + "via: " + "[" * 50 * cut + "]" * 50 * cut + "\n",
        "long": lambda text: text + "via: [" + "[0, 0, 0], " * 500 * cut + "]\n",
        "list": lambda text: "- " + text.replace("\n", "\n  "),
        "empty": lambda text: "" if cut % 2 else "# nothing\n",
        "number": lambda text: text + "1: 2\n",
        "wrong place": lambda text: text.replace("goal:", "goal: goal:"),
    }
    way = str(rng.choice(list(ways)))

    def made() -> str:
        written(robot, scene)
        SCENE.write_text(ways[way](SCENE.read_text(encoding="utf-8")), encoding="utf-8", newline="")
        ended = command("check", SCENE)
        harmless = way in _HARMLESS and (way != "flow" or "clearance" not in scene)
        problem = ended.failed() if harmless else ended.unclear(SCENE.name, ROBOT.name)
        return "a command in it was run" if Path("done").exists() else problem

    return Attempt(f"{file.name}: {way}, {cut}", made)


_SHEETS: dict[str, tuple[tuple[Place, float], ...]] = {
    "arm in mm": ((("upper_arm", "length"), 350.0),),
    "forearm in mm": ((("forearm", "length"), 800.0),),
    "base in mm": ((("base_radius",), 200.0),),
    "platform in mm": ((("platform_radius",), 45.0),),
    "all in mm": (
        (("upper_arm", "length"), 350.0),
        (("forearm", "length"), 800.0),
        (("base_radius",), 200.0),
        (("platform_radius",), 45.0),
    ),
    "speed in rpm": ((("drive", "speed"), 3000.0),),
    "rotor in kg cm²": ((("drive", "inertia"), 59.0),),
    "arm in g": ((("upper_arm", "mass"), 400.0),),
    "platform in g": ((("platform", "mass"), 300.0),),
}


def millimetres(rng: Generator) -> Attempt:
    """Numbers of a data sheet without their units."""
    _, robot, scene = drawn(rng, _ALONE)
    sheet, factor = str(rng.choice([*_SHEETS, "scene in mm"])), float(rng.uniform(0.7, 1.4))

    def made() -> str:
        changed, points = robot, scene
        for place, value in _SHEETS.get(sheet, ()):
            changed = replaced(changed, place, value * factor)
        if sheet == "scene in mm":
            points = scene | {key: [1e3 * x for x in scene[key]] for key in ("start", "goal")}
        written(changed, points)
        return command("check", SCENE).unclear("unit", "mm", "rpm", "kg*cm^2", " g ")

    return Attempt(f"{sheet}, {factor:.3f} times", made)


def upwards(rng: Generator) -> Attempt:
    """Points with another axis down."""
    file, robot, scene = drawn(rng, _ALONE)
    how = int(rng.integers(3))

    def turned(point: list[float]) -> list[float]:
        x, y, z = point
        return [[y, z, -x], [-x, y, z], [y, z, x]][how]

    points = {key: turned(scene[key]) for key in ("start", "goal")}

    def made() -> str:
        written(robot, scene | points)
        return command("check", SCENE).unclear("down")

    return Attempt(f"{file.name} with {points}", made)


_IN_UNITS = {
    "start goal from to radius centre point height blend within clearance tube at via depth length"
    " base_radius platform_radius offset points": ("mm", 1e3),
    "payload mass pins": ("g", 1e3),
    "belt velocity platform_speed": ("mm/s", 1e3),
    "arm ball angle zero": ("deg", 180 / np.pi),
    "effort duration": ("ms", 1e3),
    "torque": ("kN*m", 1e-3),
}
_UNITS = {word: unit for words, unit in _IN_UNITS.items() for word in words.split()}


def units(rng: Generator) -> Attempt:
    """A number of a scene or its robot is written with a unit: the same scene."""
    file, robot, scene = drawn(rng)
    scene |= {"payload": 1.5} if "path" in scene else {}
    both = {"robot": robot, "scene": scene}

    def unit_of(place: Place) -> tuple[str, float] | None:
        words = [key for key in place if isinstance(key, str)]
        return _UNITS.get(words[-1]) if "motor" not in words and "gear" not in words else None

    found = [place for place in places(both) if unit_of(place) and _is_bare(at(both, place))]
    place = found[rng.integers(len(found))]
    unit, factor = unit_of(place) or ("", 1.0)
    text = f"{float(at(both, place)) * factor!r} {unit}"

    def made() -> str:
        written(robot, scene)
        plain = deltaopt.load_scene(SCENE).model_dump_json()
        changed = replaced(both, place, text)
        written(changed["robot"], changed["scene"])
        other = deltaopt.load_scene(SCENE).model_dump_json()
        one, two = (np.array(_DIGITS.findall(each), float) for each in (plain, other))
        same = len(one) == len(two) and np.allclose(one, two, rtol=1e-12, atol=1e-15)
        return "" if same else "another scene is read"

    def told() -> str:
        try:
            return made()
        except deltaopt.SceneError as error:
            return f"refused: {error}"

    return Attempt(f"{file.name}: {'.'.join(map(str, place))} = {text}", told)


def _is_bare(value: object) -> bool:
    return isinstance(value, float) or str(value).replace(".", "").isdecimal()


_SIGNS = ["$", "$x$", "$\\frac{", "/*", "*/", "//", "\\", "\x1b[31m", "\0", "\n", "%s%n", "'", '"']
_SIGNS += ["</script><script>alert(1)</script>", "<!--", "-->", "]]>", "&amp;", "{x}", "(*", "*)"]
_SIGNS += ["\u202e", "\u2028", "\U0001f916", "??/", "#error x", "\r", "\t", "_", "^", "%", "{", "é"]


def names(rng: Generator) -> Attempt:
    """A robot's name with signs that mean something where it is written."""
    _, robot, scene = drawn(rng, [PROBLEMS / "pick_and_place.yaml"])
    name = "".join(["R", *rng.choice(_SIGNS, size=int(rng.integers(1, 4)))])

    def made() -> str:
        written(robot | {"name": name}, scene)
        planned = command("plan", SCENE, "--baseline", "--report", "--plot-limits", "-o", "out")
        exported = [
            planned,
            command("check", SCENE),
            command("export", "c", "out", "-o", "c"),
            command("export", "mjcf", ROBOT, "-o", "robot.xml"),
            command("export", "cam", "out", "-o", "cam"),
            command("verify", "out"),
        ]
        if planned.code:
            return planned.unclear("name")
        problems = [each.failed() for each in exported]
        problems += ["ESC is printed" for each in exported if "\x1b" in each.output + each.errors]
        page = Path("out/report.html").read_text(encoding="utf-8")
        problems += ["a script in the page"] * ("<script>alert" in page)
        ElementTree.parse("robot.xml")  # raises if it is not well-formed
        compiler = ["gcc", "-fsyntax-only", "-Wall", "-Werror", "-std=c99", "c/delta.c", "c/plan.c"]
        compiled = subprocess.run(compiler, capture_output=True, check=False)
        problems += [compiled.stderr.decode().replace("\n", " ")[:300]]
        return next(filter(None, problems), "")

    return Attempt(f"name: {name!r}", made)


KINDS: dict[str, Kind] = {
    "values": values,
    "texts": texts,
    "millimetres": millimetres,
    "upwards": upwards,
    "units": units,
    "names": names,
}
