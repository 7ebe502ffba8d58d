"""Saved plans: the scene and motion of a plan.json, exactly as they were planned."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.errors import SceneError, Unusable, on_one_line, shown
from deltaopt.files.csv_table import WrongCsv, read_csv
from deltaopt.files.regular_file import content_of
from deltaopt.motion.motion_sequence import MotionSequence
from deltaopt.motion.trajectory import Trajectory, moving_on
from deltaopt.output.plan_files import (
    COLUMNS,
    FORMAT,
    RATE,
    RECORD,
    checksums,
    frame,
    highest_rate,
    instants,
    rows_at,
)
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import delta_model
from deltaopt.robot.robot import Robot
from deltaopt.scene.scene import Scene

_SAME = 1e-9
"""Share of the largest number of its kind by which one in a table may be off: other processors'
rounding."""
_LARGEST = 100
"""Size of a plan.json, MB: the finest meshes have some thousand intervals, of 1 kB."""


class UnreadablePlan(Unusable):
    """A folder or file does not hold a plan as ``Plan.save`` writes it.

    Examples:
        >>> try:
        ...     deltaopt.load_plan("problems")
        ... except deltaopt.UnreadablePlan:
        ...     print("there is no plan")
        there is no plan
    """


@dataclass(frozen=True, eq=False)
class SavedPlan:
    """A plan that was read back: its scene and motion are the planned ones, to the last bit.

    ``record``: all that plan.json says, such as ``gap``, ``tolerance`` and ``verification``.

    Examples:
        >>> from tempfile import TemporaryDirectory
        >>> plan = deltaopt.plan(deltaopt.load_scene("problems/pick_and_place.yaml"))
        >>> with TemporaryDirectory() as folder:
        ...     files = plan.save(folder, chart=False)
        ...     saved = deltaopt.load_plan(folder)
        >>> saved.record["gap"] == plan.gap
        True
    """

    scene: Scene
    trajectory: Trajectory
    record: Mapping[str, Any]

    def __repr__(self) -> str:
        return f"<SavedPlan of {self.duration:.6g} s: {self.scene.robot.name}>"

    @property
    def duration(self) -> float:
        """Time from start to goal, s."""
        return self.trajectory.duration

    def table(self, rate: float = RATE) -> Any:
        """The motion at ``rate`` (Hz) and at its last instant, with trajectory.csv's columns: a
        pandas DataFrame if pandas is installed, otherwise a dictionary of arrays."""
        return frame(self.trajectory, rate)


def load_plan(path: str | Path) -> SavedPlan:
    """Read a plan from the folder it was saved to, or from its plan.json.

    Raises UnreadablePlan, in one sentence, where there is none or it is not whole.

    Examples:
        >>> from tempfile import TemporaryDirectory
        >>> plan = deltaopt.plan(deltaopt.load_scene("problems/pick_and_place.yaml"))
        >>> with TemporaryDirectory() as folder:
        ...     files = plan.save(folder, chart=False)
        ...     saved = deltaopt.load_plan(folder)
        >>> saved.trajectory == plan.trajectory
        True
    """
    file = Path(path)
    file = file / RECORD if file.is_dir() else file
    content = read_record(file)
    try:
        scene, motion = _scene(content["scene"]), content["motion"]
        knots = np.array(motion["knots"], dtype=float)
        position = _polynomials(knots, motion["position"], 3)
        coordinates = motion.get("coordinates")
        trajectory = Trajectory(
            position,
            delta_model(scene.robot, scene.payload),
            None if coordinates is None else _polynomials(knots, coordinates, 12),
        )
    except SceneError as error:
        raise UnreadablePlan(f"{file}: its scene cannot be used: {error}") from None
    except KeyError as error:
        problem = f"it has no {error}, which plans of deltaopt 0.2 and later have"
        raise UnreadablePlan(f"{file}: {problem}") from None
    except (TypeError, ValueError, AttributeError, OverflowError) as error:
        raise UnreadablePlan(f"{file}: its motion cannot be used: {error}") from None
    return SavedPlan(scene, moving_on(problem_of(scene), trajectory), content)


def record_differences(saved: SavedPlan, ok: bool | None) -> list[str]:
    """What in plan.json is not as it was written, or not so in its motion: one sentence each.

    ``ok``: what its verification gives now; None where it was held against another scene.
    """
    record, sentences = saved.record, list[str]()
    if record.get("duration") != saved.duration:
        given = f"its duration is {shown(record.get('duration'))}"
        sentences.append(f"{given}, but its motion takes {saved.duration!r} s")
    judged = record.get("verification")
    judged = judged.get("ok") if isinstance(judged, dict) else None
    if ok is not None and judged is not ok:
        sentences.append(f"it says that ok is {shown(judged)}, and verification now {ok}")
    written = record.get("checksums")
    if not isinstance(written, dict):
        return [*sentences, "it has no checksums, and nothing else tells whether its gap is right"]
    now = checksums({name: value for name, value in record.items() if name != "checksums"})
    changed = sorted(name for name in now | written if now.get(name) != written.get(name))
    if changed:
        sentences.append(f"changed since it was written: {on_one_line(', '.join(changed))}")
    return sentences


def table_difference(file: Path, trajectory: Trajectory | MotionSequence) -> str | None:
    """Where a trajectory.csv, at whatever rate, is not a motion's: a sentence; None if it is."""
    try:
        table = read_csv(file)
        values = table.columns(COLUMNS)
    except WrongCsv as error:
        return str(error)
    if len(values) < 2:
        return f"has {len(values)} rows"
    t = values[:, 0]
    span = float(t[max(len(t) - 2, 1)] - t[0])  # to the last row but one: whole steps
    step = float(np.median(np.diff(t)))
    rate = round(span / step) / span if min(span, step) > 0 else 0.0
    if not 0 < rate <= 2 * highest_rate(trajectory):
        return "its time does not increase in equal steps"
    expected = instants(trajectory, rate)
    if len(t) != len(expected):
        takes = f"the motion has {len(expected)} at {rate:.6g} Hz, in {trajectory.duration:.6g} s"
        return f"has {len(t)} rows in {t[-1] - t[0]:.6g} s; {takes}"
    late = np.abs(t - expected) > _SAME * trajectory.duration
    wanted = rows_at(trajectory, np.where(late, expected, t))  # on which side of a jump t is
    sizes = np.abs(wanted).max(axis=0)
    sizes[1:] = np.repeat(sizes[1:].reshape(-1, 3).max(axis=1), 3)
    off = np.argwhere(np.abs(values - wanted) > _SAME * sizes)
    if not len(off):
        return None
    row, column = off[0].tolist()
    is_now, was = float(values[row, column]), float(wanted[row, column])
    where = f"{COLUMNS[column]} is {is_now!r} in line {table.lines[row]}"
    return f"{where}; the motion has {was!r} there ({len(off)} numbers differ)"


def read_record(file: Path) -> dict[str, Any]:
    """What a plan.json or cycle.json says. Raises UnreadablePlan where it is none."""
    try:
        if not file.exists():
            legs = [each.parent.name for each in sorted(file.parent.glob(f"leg_*/{file.name}"))]
            of_cycle = f"this is a cycle, whose legs are plans: {', '.join(legs)}"
            first = of_cycle if legs else "plan and save one first"
            raise UnreadablePlan(f"{file}: there is no such file; {first}")
        content = json.loads(content_of(file, _LARGEST).decode("utf-8"))
    except OSError as error:
        raise UnreadablePlan(f"{file} {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        needed = "a plan's folder or its plan.json is needed"
        if file.suffix in (".yaml", ".yml"):
            problem = "is no plan; if it is a scene, run deltaopt plan on it first"
            raise UnreadablePlan(f"{file} {problem}, and take the folder that it writes") from None
        raise UnreadablePlan(f"{file} cannot be read as JSON ({error}); {needed}") from None
    if not isinstance(content, dict):
        raise UnreadablePlan(f"{file}: it is no record of a plan")
    found = content.get("format")
    if type(found) is not int or found != FORMAT:
        problem = f"its format is {shown(found)}" if "format" in content else "it has no format"
        raise UnreadablePlan(f"{file}: {problem}; this version of deltaopt reads format {FORMAT}")
    return content


def _scene(content: Mapping[str, Any]) -> Scene:
    """Raises SceneError, also where scene or robot are no mappings."""
    if not isinstance(content, dict):
        raise SceneError(None, "scene", content, "a mapping of keys to values")
    if not isinstance(content["robot"], dict):
        raise SceneError(None, "robot", content["robot"], "a mapping of keys to values")
    return Scene.model_validate({**content, "robot": Robot.model_validate(content["robot"])})


def _polynomials(knots: Any, coefficients: Any, columns: int) -> PiecewisePolynomial:
    """Raises ValueError where they do not fit the knots, or are no numbers."""
    try:
        values = np.array(coefficients, dtype=float)
    except (TypeError, ValueError):
        told = f"its coefficients are not {columns} numbers for each power in each interval"
        raise ValueError(told) from None
    if values.ndim != 3 or values.shape[0] != len(knots) - 1 or values.shape[2] != columns:
        raise ValueError(f"{len(knots)} knots do not fit coefficients of shape {values.shape}")
    if not (np.isfinite(values).all() and (np.diff(knots) > 0).all()):
        raise ValueError("not all numbers are finite and all knots increasing")
    return PiecewisePolynomial(knots, values)
