"""The numbers of a scene or a cycle by the keys of their files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deltaopt.scene.cycle import Cycle
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import made_of
from deltaopt.sensitivity.keys import Content, unit_of

Job = Scene | Cycle


@dataclass(frozen=True)
class Number:
    """A number of a file: its ``key``, such as keep_out[0].box.from[1], and its ``value`` in the SI
    ``unit``."""

    key: str
    value: float
    unit: str

    @property
    def step(self) -> float:
        """A change that is worth telling: one tooth more or less of a gear, 1 mm of a coordinate, 1
        % of anything else."""
        if self.key.endswith(".ratio"):
            return 1.0
        is_place = self.unit == "m" and self.key.endswith("]")
        return 1e-3 if is_place or not self.value else 0.01 * abs(self.value)


def content_of(job: Job) -> dict[str, Any]:
    """The content of the file of a scene or a cycle, with that of the robot's file as ``robot``.

    Of a cycle's legs what they share stands beside them; its ``start`` is the last leg's goal.
    """
    if isinstance(job, Scene):
        return job.model_dump(exclude_none=True)
    legs = [leg.model_dump(exclude_none=True) for leg in job.legs]
    if any(leg["robot"] != legs[0]["robot"] for leg in legs):  # by their tools
        for leg in legs:
            leg |= {key: leg["robot"].pop(key) for key in ("tool",) if key in leg["robot"]}
    shared = {
        key: value
        for key, value in legs[0].items()
        if key not in ("start", "goal") and all(leg.get(key) == value for leg in legs)
    }
    own = [{key: leg[key] for key in leg if key not in (*shared, "start")} for leg in legs]
    cycle = [{**leg, "dwell": dwell} for leg, dwell in zip(own, job.dwells, strict=True)]
    if job.rms_torque is not None:
        shared["limits"] = {**shared.get("limits", {}), "rms_torque": job.rms_torque}
    return {**shared, "cycle": cycle, **({} if job.period is None else {"period": job.period})}


def job_of(content: Content) -> Any:
    """The scene or the cycle of such a content. Raises SceneError for one that cannot be used."""
    legs = content.get("cycle")
    return made_of(content if legs is None else {**content, "start": legs[-1]["goal"]}, Path())


def numbers_in(content: Any, key: str = "") -> Iterator[Number]:
    """All numbers of a content, or of what it has under a key."""
    if isinstance(content, Mapping):
        for name, value in content.items():
            yield from numbers_in(value, f"{key}.{name}".removeprefix("."))
    elif isinstance(content, Sequence) and not isinstance(content, str):
        for index, value in enumerate(content):
            yield from numbers_in(value, f"{key}[{index}]")
    elif isinstance(content, int | float) and not isinstance(content, bool):
        yield Number(key, float(content), unit_of(key))
