"""Kinds of attempts: what Python is asked for, copies, threads, the names of the docs."""

from __future__ import annotations

import copy
import pickle
import re
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import date
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np

import deltaopt
from deltaopt.robot.model import delta_model
from studies.attack.attempts import Attempt, Generator, Kind
from studies.problems import LIGHT, PICK_AND_PLACE, PROBLEMS

_PYTHON = (TypeError, ValueError)
_SCENE = deltaopt.load_scene(PICK_AND_PLACE)
_START = (0.45, -0.05, 0.0)

_NO_POINTS: dict[str, object] = {
    "a set": {0.45, -0.05, 0.01},
    "a frozen set": frozenset({0.45, -0.05, 0.01}),
    "a mapping": {0.45: 1, -0.05: 2, 0.0: 3},
    "booleans": [True, False, True],
    "a mask": np.array([True, False, False]),
    "complex": np.array([0.45 + 0.1j, -0.05, 0.0]),
    "texts": ["a", "b", "c"],
    "one text": "0.45",
    "bytes": b"abc",
    "two": [0.45, 0.0],
    "four": [0.45, 0.0, 0.0, 0.0],
    "a number": 0.45,
    "a matrix": np.zeros((3, 3)),
    "nan": [float("nan"), 0.0, 0.0],
    "infinite": np.array([np.inf, 0.0, 0.0]),
    "None": None,
    "Nones": [None, 0.0, 0.0],
    "dates": [date(2026, 1, 1)] * 3,
    "nested": [[0.45], [0.0], [0.0]],
    "times": np.array([1, 2, 3], dtype="datetime64[s]"),
    "an object": object(),
    "a class": tuple,
    "ellipses": [...] * 3,
    "huge": [10**400, 0, 0],
    "masked": np.ma.array([0.45, 0.0, 0.0], mask=[True, False, False]),
    "a function": lambda: _START,
    "no points": [],
}
_POINTS: dict[str, object] = {
    "a list": list(_START),
    "an array": np.array(_START),
    "single": np.array(_START, dtype=np.float32),
    "decimals": [Decimal("0.45"), Decimal("-0.05"), Decimal(0)],
    "zero-dimensional": [np.array(each) for each in _START],
}


def _takers(value: Any) -> dict[str, Callable[[], object]]:
    """What takes a point."""
    model, goal = delta_model(_SCENE.robot, 1.0), (0.45, 0.1, 0.0)
    return {
        "Scene(start)": lambda: deltaopt.Scene(robot=_SCENE.robot, start=value, goal=goal),
        "Scene(goal)": lambda: deltaopt.Scene(robot=_SCENE.robot, start=goal, goal=value),
        "Scene(via)": lambda: deltaopt.Scene(
            robot=_SCENE.robot, start=(0.45, -0.1, 0.02), goal=goal, via=(value,)
        ),
        "model_copy": lambda: _SCENE.model_copy(update={"start": value}),
        "planner": lambda: deltaopt.Planner(_SCENE.robot, 1.0).plan(value, goal),
        "State": lambda: deltaopt.State(at=value),
        "Belt": lambda: deltaopt.Belt(at=_START, belt=value),
        "Corners": lambda: deltaopt.Corners(points=(value,), blend=0.01),
        "inverse kinematics": lambda: model.inverse_kinematics(value),
        "inverse dynamics": lambda: model.inverse_dynamics(_START, value, (0.0, 0.0, 0.0)),
        "gravity": lambda: _SCENE.robot.model_copy(update={"gravity": value}),
    }


def points(rng: Generator) -> Attempt:
    """What is no point where a point is needed, and points of other types."""
    names = [*_NO_POINTS, *_POINTS]
    name, taker = names[rng.integers(len(names))], str(rng.choice(list(_takers(None))))

    def made() -> str:
        right = name in _POINTS
        several = taker.startswith("inverse") and name in ("a matrix", "no points")
        number = taker == "gravity" and name in ("a number", "one text")
        optional = name == "no points" and taker == "Scene(via)"
        try:
            found = _takers((_POINTS | _NO_POINTS)[name])[taker]()
        except (deltaopt.DeltaOptError, *_PYTHON) as error:
            if right and taker != "Belt":
                return f"refused: {error}"
            raise
        return "" if right or several or number or optional else f"taken: {str(found)[:200]}"

    return Attempt(f"{taker} of {name}", made, _PYTHON)


_ODD: dict[str, object] = {
    "True": True,
    "False": False,
    "nan": float("nan"),
    "-1": -1,
    "a text": "x",
    "a list": [1],
    "complex": 1j,
    "a class": float,
    "numpy's True": np.bool_(True),
    "two": np.array([1.0, 2.0]),
    "1e400": 10**400,
    "an object": object(),
}
_ZERO = ("table", "tolerance", "intervals", "slowed", "Effort", "payload of a plan", "period")


def calls(rng: Generator) -> Attempt:
    """An argument that cannot be, where a number or a scene or a plan is needed."""
    name, which = str(rng.choice([*_ODD, "0"])), int(rng.integers(1000))
    value: Any = _ODD.get(name, 0)

    def made() -> str:
        line = deltaopt.baseline(_SCENE)
        saved = deltaopt.SavedPlan(_SCENE, line, {})
        robot = delta_model(_SCENE.robot, 1.0).robot
        planner = deltaopt.Planner(robot, 1.0)
        functions: dict[str, Callable[[], object]] = {
            "table": lambda: saved.table(value),
            "tolerance": lambda: deltaopt.plan(_SCENE, tolerance=value),
            "intervals": lambda: deltaopt.plan(_SCENE, intervals=value),
            "slowed": lambda: line.slowed(value),
            "Effort": lambda: deltaopt.Effort(duration=value),
            "payload of a plan": lambda: planner.plan(_SCENE.start, _SCENE.goal, payload=value),
            "seed": lambda: deltaopt.plan(_SCENE, starts=2, seed=value),
            "starts": lambda: deltaopt.plan(_SCENE, starts=value),
            "formulation": lambda: deltaopt.plan(_SCENE, formulation=value),
            "solver": lambda: deltaopt.plan(_SCENE, solver=value),
            "transcription": lambda: deltaopt.plan(_SCENE, transcription=value),
            "verify scene": lambda: deltaopt.verify(value, line),
            "verify plan": lambda: deltaopt.verify(_SCENE, value),
            "verify saved": lambda: deltaopt.verify(_SCENE, saved),  # type: ignore[arg-type]
            "load_plan": lambda: deltaopt.load_plan(value),
            "load_scene": lambda: deltaopt.load_scene(value),
            "load_robot": lambda: deltaopt.load_robot(value),
            "Planner": lambda: deltaopt.Planner(value).plan(_SCENE.start, _SCENE.goal),
            "DeltaModel": lambda: deltaopt.DeltaModel(value, 1.0).parameters,
            "payload of a model": lambda: deltaopt.DeltaModel(robot, value).parameters,
            "forward": lambda: deltaopt.DeltaModel(robot).forward_kinematics(value),
            "limits": lambda: deltaopt.Limits(torque=value and [value]),
            "copy": lambda: _SCENE.model_copy(update={"clearance": [value]}),
        }
        function = list(functions)[which % len(functions)]
        may = (name in ("0", "False") and function in ("seed", "limits")) or (
            name == "0" and function not in _ZERO
        )
        found = functions[function]()
        return "" if may else f"{function} takes it: {str(found)[:200]}"

    return Attempt(f"call {which % 23} with {name}", made, _PYTHON)


def copies(rng: Generator) -> Attempt:
    """Values that are copied, pickled, compared, hashed and shown."""
    names = "scene robot plan trajectory motion verification model belt error"
    what = str(rng.choice(names.split()))
    how = str(rng.choice(["pickle", "copy", "deepcopy", "hash", "repr", "html", "json"]))

    def made() -> str:
        plan = deltaopt.plan(_SCENE)
        value: Any = {
            "scene": _SCENE,
            "robot": _SCENE.robot,
            "plan": plan,
            "trajectory": plan.trajectory,
            "motion": plan.trajectory(0.05),
            "verification": deltaopt.verify(_SCENE, plan.trajectory),
            "model": plan.trajectory.model,
            "belt": deltaopt.Belt(at=_START, belt=(0.0, 0.1, 0.0)),
            "error": deltaopt.SceneError(Path("a"), "b", 1, "c"),
        }[what]
        if how in ("pickle", "copy", "deepcopy"):
            ways = {"copy": copy.copy, "deepcopy": copy.deepcopy}
            other = ways.get(how, lambda each: pickle.loads(pickle.dumps(each)))(value)
            if what == "error":
                return "" if str(other) == str(value) else str(other)
            if what in ("trajectory", "motion"):  # equal to itself alone, as documented
                return "" if type(other) is type(value) else repr(other)
            same = other == value and hash(other) == hash(value)
            return "" if same else f"a copy by {how} is not equal"
        if how == "json" and hasattr(value, "model_dump_json"):
            again = type(value).model_validate_json(value.model_dump_json())
            return "" if again == value else "read back it is another"
        shown: dict[str, Callable[[Any], object]] = {"hash": hash}
        shown["html"] = lambda each: getattr(each, "_repr_html_", each.__str__)()
        return "" if len(str(shown.get(how, repr)(value))) else "nothing is shown"

    return Attempt(f"{what}: {how}", made)


_DOCS = Path(__file__).parents[2] / "docs"


def documented(rng: Generator) -> Attempt:
    """A name that a page or a docstring of the package says is deltaopt's."""
    text = "".join(each.read_text(encoding="utf-8") for each in sorted(_DOCS.glob("*.md")))
    found = set(re.findall(r"\bdeltaopt\.([A-Za-z_]+)\(", text))
    found |= set(re.findall(r"\bdeltaopt\.([A-Z]\w+)", text))
    source = "".join(
        each.read_text(encoding="utf-8") for each in Path(deltaopt.__file__).parent.rglob("*.py")
    )
    raised = set(re.findall(r"^class (\w+)\(DeltaOptError\)", source, re.M))
    found |= {error for error in raised if re.search(rf"\b{error}\b", text)}
    found |= set(re.findall(r"Raises (\w+)", str(deltaopt.Trajectory.__call__.__doc__)))
    name = sorted(found)[rng.integers(len(found))]
    return Attempt(f"deltaopt.{name}", lambda: "" if hasattr(deltaopt, name) else "not exported")


def threads(rng: Generator) -> Attempt:
    """Plans of several threads at once are those of one, bit by bit."""
    scenes = [PICK_AND_PLACE, LIGHT, PROBLEMS / "moving/belt.yaml"]
    chosen = [scenes[i] for i in rng.integers(len(scenes), size=4)]

    def planned(file: Path) -> tuple[bytes, bool]:
        plan = deltaopt.plan(deltaopt.load_scene(file))
        return (
            plan.trajectory.position.coefficients.tobytes(),
            deltaopt.verify(plan.scene, plan.trajectory).ok,
        )

    def made() -> str:
        with ThreadPoolExecutor(4) as pool:
            together = list(pool.map(planned, chosen))
        alone = [planned(file) for file in chosen]
        return "" if together == alone and all(ok for _, ok in alone) else "other plans"

    return Attempt(", ".join(file.stem for file in chosen), made)


KINDS: dict[str, Kind] = {
    "points": points,
    "calls": calls,
    "copies": copies,
    "documented": documented,
    "threads": threads,
}
