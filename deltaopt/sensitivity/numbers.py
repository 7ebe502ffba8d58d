"""The numbers of a scene or a cycle by the keys of their files, and the same with one of them
changed."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, get_args

from deltaopt.files.units import Quantity
from deltaopt.files.validated_record import Record
from deltaopt.robot.robot import Robot
from deltaopt.scene.cycle import Cycle
from deltaopt.scene.scene import Scene

Job = Scene | Cycle
Path = tuple[str | int, ...]
Content = Mapping[str, Any]
_FIELDS = {"dwell": "dwells"}
"""Keys of files that are called otherwise in records."""
_PARTS = re.compile(r"[^.\[\]]+")


@dataclass(frozen=True)
class Number:
    """A number of a file: its key, such as keep_out[0].box.from[1], and its ``value`` in the SI
    ``unit``."""

    path: Path
    value: float
    unit: str

    @property
    def key(self) -> str:
        """Its key in a file."""
        return key_of(self.path)

    @property
    def step(self) -> float:
        """A change that is worth telling: one tooth more or less of a gear, 1 mm of a coordinate, 1
        % of anything else."""
        if self.path[-1] == "ratio":
            return 1.0
        is_place = self.unit == "m" and isinstance(self.path[-1], int)
        return 1e-3 if is_place or not self.value else 0.01 * abs(self.value)


def key_of(path: Path) -> str:
    """The key in a file of a path through its content."""
    parts = (f"[{each}]" if isinstance(each, int) else f".{each}" for each in path)
    return "".join(parts).removeprefix(".")


def path_of(key: str) -> Path:
    """The path through the content of a file that a key stands for, such as goal[2] or goal.2."""
    return tuple(int(part) if part.isdigit() else part for part in _PARTS.findall(key))


def content_of(job: Job) -> dict[str, Any]:
    """The content of the file of a scene or a cycle, with that of the robot's file as ``robot``.

    Of a cycle's legs what they share stands beside them; its ``start`` is the last leg's goal.
    """
    if isinstance(job, Scene):
        return job.model_dump(exclude_none=True)
    legs = [leg.model_dump(exclude_none=True, exclude={"start"}) for leg in job.legs]
    for leg in legs:
        leg.pop("start", None)
    if any(leg["robot"] != legs[0]["robot"] for leg in legs):  # by their tools
        for leg in legs:
            tool = leg["robot"].pop("tool", None)
            leg |= {} if tool is None else {"tool": tool}
    shared = {
        key: value
        for key, value in legs[0].items()
        if key != "goal" and all(leg.get(key) == value for leg in legs)
    }
    own = [{key: leg[key] for key in leg if key not in shared} for leg in legs]
    cycle = [{**leg, "dwell": dwell} for leg, dwell in zip(own, job.dwells, strict=True)]
    if job.rms_torque is not None:
        shared["limits"] = {**shared.get("limits", {}), "rms_torque": job.rms_torque}
    return {**shared, "cycle": cycle, **({} if job.period is None else {"period": job.period})}


def job_of(content: Content) -> Job:
    """The scene or the cycle of such a content. Raises SceneError for one that cannot be used."""
    if "cycle" not in content:
        return Scene.model_validate(content)
    shared = {key: content[key] for key in content if key not in ("cycle", "period")}
    limits = dict(shared.pop("limits", {}))
    rms_torque = limits.pop("rms_torque", None)
    shared |= {
        "robot": Robot.model_validate(shared["robot"]),
        **({"limits": limits} if limits else {}),
    }
    legs = list[Scene]()
    for leg in content["cycle"]:
        own = {key: value for key, value in leg.items() if key != "dwell"}
        before = legs[-1].goal if legs else content["cycle"][-1]["goal"]
        legs.append(Scene.model_validate({**shared, **own, "start": before}))
    dwells = tuple(leg["dwell"] for leg in content["cycle"])
    return Cycle(
        legs=tuple(legs), dwells=dwells, period=content.get("period"), rms_torque=rms_torque
    )


def with_value(content: Content, path: Path, value: Any) -> dict[str, Any]:
    """A content with another value under a path. Raises KeyError, IndexError or TypeError for one
    that does not lead anywhere."""
    changed = deepcopy(dict(content))
    inner: Any = changed
    for step, after in zip(path, (*path[1:], None), strict=True):
        if after is None:
            inner[step] = value
        elif isinstance(inner[step], tuple):
            inner[step] = list(inner[step])
        inner = inner[step]
    return changed


def numbers_in(content: Content) -> Iterator[Number]:
    """All numbers of a content."""
    for path, value in _leaves(content, ()):
        inside = path[2:] if path[0] == "cycle" else path
        inside = path[1:] if path[:2] == ("limits", "rms_torque") else inside
        yield Number(path, float(value), _unit(inside))


def _leaves(content: Any, path: Path) -> Iterator[tuple[Path, float]]:
    if isinstance(content, Mapping):
        for key, value in content.items():
            yield from _leaves(value, (*path, key))
    elif isinstance(content, Sequence) and not isinstance(content, str):
        for index, value in enumerate(content):
            yield from _leaves(value, (*path, index))
    elif isinstance(content, int | float) and not isinstance(content, bool):
        yield path, content


def _unit(path: Path) -> str:
    """The SI unit of a number of a scene, of its robot or of a cycle; empty without one."""
    kinds: list[Any] = [Scene, Cycle]
    for name in (each for each in path if isinstance(each, str)):
        records = [kind for kind in kinds if isinstance(kind, type) and issubclass(kind, Record)]
        fields = (record.model_fields.get(_FIELDS.get(name, name)) for record in records)
        field = next(filter(None, fields), None)
        if field is None:  # the word that tells a path's kind, as pick_and_place
            continue
        kinds = [Robot] if name == "robot" else [*_inside(field.annotation), *field.metadata]
    units = [kind.unit for kind in kinds if isinstance(kind, Quantity)]
    of_point = path[-1] if isinstance(path[-1], int) and len(units) > 1 else 0
    return units[of_point].replace("**", "^") if units else ""


def _inside(kind: Any) -> Iterator[Any]:
    """A type and all that it is made of, marks among them."""
    yield kind
    for inner in get_args(kind):
        yield from _inside(inner)
