"""Kinds of attempts: tables, bodies and paths from files, saved plans, what is exported of them."""

from __future__ import annotations

import json
import shutil
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import deltaopt
from deltaopt import Corners
from studies.attack.attempts import Attempt, Ended, Generator, Kind, command
from studies.attack.checks import Array, table_share
from studies.attack.scene_files import SCENE, at, drawn, places, replaced, written
from studies.problems import CROSS, ORSINO, PICK_AND_PLACE

_TABLE = Path("table.csv")
_VERIFY = ("verify", _TABLE, "--robot", ORSINO, "--payload", "1")
Rows = list[list[str]]


def planned(file: Path = PICK_AND_PLACE, folder: str = "plan") -> None:
    """Plan a shipped scene into a folder. Raises AssertionError if that fails."""
    ended = command("plan", file, "--no-plot", "-o", folder)
    assert ended.code == 0, ended.errors


def _slow_table(rng: Generator) -> Rows:
    """A table that keeps its limits, of angles or positions, with all its rates: its rows."""
    folder = "plan" if rng.integers(2) else "slow"
    command("plan", PICK_AND_PLACE, "--baseline", "--no-plot", "-o", folder)
    if folder == "plan":
        cells = (Path(folder) / "trajectory.csv").read_text(encoding="utf-8")
        return [row.split(",")[:10] for row in cells.split()]
    words = ("--slower", "1.5", "--cycle", "2ms", "-o", _TABLE)
    assert command("export", "table", folder, *words).code == 0
    return [row.split(",") for row in _TABLE.read_text(encoding="utf-8").split()]


def _text(rows: Rows, sign: str = ",") -> str:
    return "\n".join(sign.join(row) for row in rows) + "\n"


def _measured(ended: Ended) -> dict[str, Any]:
    content = json.loads(ended.output or "{}")
    return {key: content.get(key) for key in ("duration", "ok", "limits", "duty")}


_TABLES: dict[str, Callable[[Rows, int, int], str]] = {
    "mark": lambda rows, i, k: "\ufeff" + _text(rows),
    "windows": lambda rows, i, k: _text(rows).replace("\n", "\r\n"),
    "quoted": lambda rows, i, k: _text([[f'"{cell}"' for cell in row] for row in rows]),
    "spaces": lambda rows, i, k: _text(rows, " , "),
    "turned": lambda rows, i, k: _text([row[k:] + row[:k] for row in rows]),
    "text column": lambda rows, i, k: _text([[*row, "ok"] for row in rows]),
    "blank lines": lambda rows, i, k: _text(rows) + "\n\n",
    "semicolons": lambda rows, i, k: _text(rows, ";"),
    "german": lambda rows, i, k: _text(rows, ";").replace(".", ","),
    "tabs": lambda rows, i, k: _text(rows, "\t"),
    "n/a": lambda rows, i, k: _text(replaced(rows, (i, k), "n/a")),
    "empty": lambda rows, i, k: _text(replaced(rows, (i, k), "")),
    "nan": lambda rows, i, k: _text(replaced(rows, (i, k), "nan")),
    "error": lambda rows, i, k: _text(replaced(rows, (i, k), "#DIV/0!")),
    "twice": lambda rows, i, k: _text(
        [[*row, rows[max(n - 1, 0)][k]] for n, row in enumerate(rows)]
    ),
    "cut": lambda rows, i, k: _text(rows[:i]) + ",".join(rows[i])[: 3 * k + 1],
    "units row": lambda rows, i, k: _text([rows[0], ["s"] + ["rad"] * 9, *rows[1:]]),
    "no header": lambda rows, i, k: _text(rows[1:]),
    "utf-16": lambda rows, i, k: "\0".join(_text(rows)),
    "swapped": lambda rows, i, k: _text([*rows[:i], rows[i + 1], rows[i], *rows[i + 2 :]]),
    "half header": lambda rows, i, k: _text([rows[0][:-1], *rows[1:]]),
    "sign": lambda rows, i, k: _text(replaced(rows, (0, k), rows[0][k] + " [rad]")),
}
_SAME = ("windows", "quoted", "spaces", "turned", "text column", "blank lines")


def tables(rng: Generator) -> Attempt:
    """A table as spreadsheets and logs write it: the same numbers are read, or none."""
    way, i, k = str(rng.choice(list(_TABLES))), int(rng.integers(5, 60)), int(rng.integers(1, 10))

    def made() -> str:
        rows = _slow_table(rng)
        _TABLE.write_text(_text(rows), encoding="utf-8")
        right = _measured(command(*_VERIFY, "--json"))
        _TABLE.write_text(_TABLES[way](rows, i, k), encoding="utf-8", newline="")
        ended = command(*_VERIFY, "--json")
        if not ended.output:
            return ended.failed() if way in _SAME else ended.unclear(_TABLE.name)
        return (
            "" if _measured(ended) == right else f"other numbers are measured: {ended.last[:200]}"
        )

    return Attempt(f"{way}, row {i}, column {k}", made)


def teleports(rng: Generator) -> Attempt:
    """Two rows of one time, or nearly, are at different places, or at different speeds."""
    i, column = int(rng.integers(5, 60)), int(rng.integers(1, 7))
    size, apart = float(10 ** rng.uniform(-3, -1)), float(rng.choice([0.0, 0.0, 2e-12, 1e-9]))

    def made() -> str:
        rows = _slow_table(rng)
        for row in rows[i + 1 :]:
            row[column] = repr(float(row[column]) + size)
            row[0] = repr(float(row[0]) + apart)
        again = list(rows[i])
        again[0], again[column] = repr(float(again[0]) + apart), repr(float(again[column]) + size)
        _TABLE.write_text(_text([*rows[: i + 1], again, *rows[i + 1 :]]), encoding="utf-8")
        ended = command(*_VERIFY)
        return "within its limits" if ended.code == 0 else ended.wrong() if ended.code == 2 else ""

    return Attempt(f"row {i} twice, {apart:g} s apart, column {column} by {size:.2e}", made)


def solids(rng: Generator) -> Attempt:
    """A body from an STL file: few corners or many, whole or damaged."""
    number = int(rng.choice([4, 100, 500, 3000, 20000, 60000]))
    way = str(
        rng.choice(["ascii", "binary", "solid", "cut", "nan", "flat", "count", "words", "same"])
    )
    box = bool(rng.integers(2))  # of all corners eight are its own
    corners = rng.normal(size=(max(number // 3, 4), 3, 3))
    corners = np.sign(corners) if box else corners / np.linalg.norm(corners, axis=2, keepdims=True)
    corners = 0.02 * corners + [0.45, 0.3, 0.3]
    if way == "flat":
        corners[:, :, 0] = 0.5
    if way == "same":
        corners[:] = corners[0, 0]

    def made() -> str:
        head = (b"solid x" if way == "solid" else b"binary").ljust(80)
        head += struct.pack("<I", len(corners) * (1000 if way == "count" else 1))
        facets = [struct.pack("<12fH", 0, 0, 1, *each.ravel(), 0) for each in corners]
        content = head + b"".join(facets)
        if way in ("ascii", "words", "nan"):
            lines = [f"vertex {x:.9g} {y:.9g} {z:.9g}" for x, y, z in corners.reshape(-1, 3)]
            if way != "ascii":
                lines[len(lines) // 2] = "vertex nan 0 0" if way == "nan" else "vertex 0,5 0 0"
            content = ("solid x\nfacet\nouter loop\n" + "\n".join(lines) + "\nendsolid").encode()
        Path("part.stl").write_bytes(content[: -len(content) // 3] if way == "cut" else content)
        robot, scene = drawn(rng, [PICK_AND_PLACE])[1:]
        written(robot, scene | {"keep_out": [{"hull": {"file": "part.stl"}}]})
        ended = command("check", SCENE)
        right = way in ("ascii", "binary", "solid") and box and number >= 100
        return ended.failed() if right else ended.wrong("part.stl", "keep_out")

    return Attempt(f"{way}, {number} corners{' of a box' * box}", made)


_PATHS: dict[str, Callable[[str, int], str]] = {
    "mark": lambda text, i: "\ufeff" + text,
    "windows": lambda text, i: text.replace("\n", "\r\n"),
    "header": lambda text, i: "x,y,z\n" + text,
    "semicolons": lambda text, i: text.replace(",", ";"),
    "german": lambda text, i: text.replace(",", ";").replace(".", ","),
    "n/a": lambda text, i: text.replace("\n", ",\n", 1) if i % 2 else text.replace("0.4", "n/a", 1),
    "two": lambda text, i: text.replace(",", " ", 1),
    "four": lambda text, i: text.replace("\n", ",0.1\n"),
    "cut": lambda text, i: text[: text.rstrip().rfind(",") - i % 6],
    "blank": lambda text, i: text.replace("\n", "\n\n"),
    "nothing": lambda text, i: "\n" * (i % 3),
    "long": lambda text, i: "".join(f"0.44,{-0.05 + n * 1e-6:.9f},0.01\n" for n in range(1, 9000)),
    "millimetres": lambda text, i: text.replace("0.", ""),
    "quoted": lambda text, i: "\n".join(f'"{line}"' for line in text.split()),
}


def paths(rng: Generator) -> Attempt:
    """Points of a path from a damaged file: the same points, or a sentence."""
    way, i = str(rng.choice(list(_PATHS))), int(rng.integers(1, 100))
    points = [
        [0.43 + 0.001 * k, -0.03 + 0.02 * k, round(rng.uniform(0, 0.02), 4)] for k in range(5)
    ]

    def made() -> str:
        text = "".join(f"{x!r},{y!r},{z!r}\n" for x, y, z in points)
        Path("points.csv").write_text(_PATHS[way](text, i), encoding="utf-8", newline="")
        robot, scene = drawn(rng, [PICK_AND_PLACE])[1:]
        written(robot, scene | {"path": {"points": "points.csv", "blend": 0.001}})
        ended = command("check", SCENE)
        if ended.code:
            return ended.failed() if way == "windows" else ended.unclear("points", "path")
        path = deltaopt.load_scene(SCENE).path
        assert isinstance(path, Corners)
        same = np.array_equal(path.points, points)
        return "" if same else f"{len(path.points)} other points are read"

    return Attempt(f"{way}, {i}: {points}", made)


def tampered(rng: Generator) -> Attempt:
    """A saved plan in which one number is another, or one file another plan's."""
    size = float(10 ** rng.uniform(-4, 0))
    way = str(
        rng.choice(["cell", "rows", "swap", "swap json", "format", "record", "motion", "scene"])
    )
    which, order = rng.integers(1000, size=2).tolist()

    def made() -> str:
        planned()
        record, table = Path("plan/plan.json"), Path("plan/trajectory.csv")
        content = json.loads(record.read_text(encoding="utf-8"))
        rows = [row.split(",") for row in table.read_text(encoding="utf-8").split()]
        if way.startswith("swap"):
            planned(CROSS, "other")
            name = record.name if way == "swap json" else table.name
            shutil.copy(Path("other") / name, Path("plan") / name)
        elif way == "cell":
            i, k = 1 + which % (len(rows) - 1), order % 22
            table.write_text(_text(replaced(rows, (i, k), repr(float(rows[i][k]) + 10 * size))))
        elif way == "rows":
            table.write_text(_text(rows[: 1 + which % (len(rows) - 1)]))
        else:
            record.write_text(json.dumps(_changed(content, way, which, order, size)))
        ended = command("verify", "plan")
        return ended.unclear() if ended.code != 1 else ""

    return Attempt(f"{way}, {which}, {order}, {size:.2e}", made)


def _changed(content: Any, way: str, which: int, order: int, size: float) -> Any:
    """A record with something changed that matters."""
    if way == "format":
        return content | {"format": [2, 0, None, "1", [], 1.5][which % 6]}
    if way == "record":
        key = ["duration", "gap", "lower_bound", "phases"][which % 4]
        worse = {"duration": 1 + size, "gap": 0.1, "lower_bound": 2.5, "phases": 1 + size}[key]
        value = content[key]
        return content | {key: [value[0] * worse] if key == "phases" else value * worse}
    if way == "scene":
        changed = [place for place in places(content["scene"]) if place[0] in ("start", "goal")]
        place: tuple[str | int, ...] = ("scene", *changed[which % len(changed)])
        return replaced(content, place, at(content, place) + size)
    motion = content["motion"]
    i = which % len(motion["position"])
    length = motion["knots"][i + 1] - motion["knots"][i]
    j = order % len(motion["position"][i])
    place = ("motion", "position", i, j, order % 3)
    return replaced(content, place, at(content, place) + size / length**j)


def exports(rng: Generator) -> Attempt:
    """A table or a program of a motion, driven faster than planned or interpolated coarsely: it
    keeps the torques, or is refused, or its head says that it does not."""
    controller = str(rng.choice(["cubic", "quintic"]))
    cycle = str(rng.choice(["own-knots", "1ms", "2ms", "4ms", "8ms"]))
    slower, target = (
        float(rng.choice([1, 0.8, 0.95, 1.3])),
        str(rng.choice(["table", "table", "c"])),
    )

    def made() -> str:
        planned()
        if target == "c":
            record = Path("plan/plan.json")
            content = json.loads(record.read_text(encoding="utf-8"))
            motion = content["motion"]
            motion["knots"] = [slower * knot for knot in motion["knots"]]
            powers = slower ** -np.arange(len(motion["position"][0]))[:, None]
            motion["position"] = [(np.array(each) * powers).tolist() for each in motion["position"]]
            record.write_text(json.dumps(content), encoding="utf-8")
            ended = command("export", "c", "plan", "-o", "c")
            if slower >= 1 or ended.code:
                return ended.failed() if slower >= 1 else ended.unclear()
            head = Path("c/plan.h").read_text(encoding="utf-8")
            told = any(word in head for word in ("exceed", "beyond", "%"))
            return "" if told else f"nothing said of a motion in {slower} of its time"
        words = ("--controller", controller, "--cycle", cycle, "--slower", slower, "-o", _TABLE)
        ended = command("export", "table", "plan", *words)
        if ended.code:
            return ended.unclear()
        text = _TABLE.read_text(encoding="utf-8")
        cells = [line.split(",") for line in text.split("\n") if line[:1].isdigit()]
        numbers: Array = np.array(cells, dtype=float)
        rows = [numbers[:, 3 * k + 1 : 3 * k + 4] for k in range(2 if controller == "cubic" else 3)]
        scene = deltaopt.load_plan("plan").scene
        share = table_share(scene, numbers[:, 0], rows)
        return "" if share < 1.001 or text.startswith("#") else f"asks for {share:.3f} of a torque"

    return Attempt(f"{target}, {controller}, {cycle}, {slower} times as slow", made)


KINDS: dict[str, Kind] = {
    "tables": tables,
    "teleports": teleports,
    "solids": solids,
    "paths": paths,
    "tampered": tampered,
    "exports": exports,
}
