"""Plans as data for other programs: the columns of trajectory.csv and the content of plan.json."""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.files.atomic_write import write_text
from deltaopt.files.csv_table import write_csv
from deltaopt.files.tables import finite
from deltaopt.files.version import installed_version
from deltaopt.motion.limit_sensitivity import as_dicts
from deltaopt.motion.motion_sequence import MotionSequence
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.facts import Facts
from deltaopt.settings import require_positive

TABLE, RECORD = "trajectory.csv", "plan.json"
"""Names of the files that every plan has."""
RATE = 1000.0
"""Instants per second in trajectory.csv, Hz: a common rate of position controllers."""

MOST_ROWS = 1_000_000
"""Most rows of a CSV file: a move has some thousands at the rate of a controller, and a million are
350 MB."""

FORMAT = 1
"""Version of plan.json as ``plan.schema.json`` describes it: another one where a key changes its
meaning or goes."""

_AS_FOUND = (
    "lower_bound",
    "formulation",
    "transcription",
    "intervals",
    "status",
    "iterations",
    "solve_seconds",
    "gap",
    "tolerance",
    "phases",
    "free_duration",
)
"""What plan.json says of a plan as it is."""

COLUMNS = (
    "t",
    *(name + axis for name in ("", "v", "a") for axis in "xyz"),
    *(name + motor for name in ("theta", "dtheta", "ddtheta", "tau") for motor in "123"),
)


def write_motion(file: Path, trajectory: Trajectory, rate: float = RATE) -> None:
    """Write a motion at ``rate`` (Hz) and at its last instant as CSV, one row each. Raises
    ValueError if there are more than ``MOST_ROWS`` rows."""
    write_csv(file, COLUMNS, _rows(trajectory, rate).tolist())


def content(facts: Facts) -> dict[str, object]:
    """What plan.json says of a motion and how it was found, for JSON: no infinite number."""
    found = facts.plan
    return {
        "duration": found.duration,
        "cost": {"value": found.cost, "unit": found.scene.objective.functional.unit},
        **{name: finite(getattr(found, name)) for name in _AS_FOUND},
        "certificate": found.certificate and vars(found.certificate),
        "optima": [
            {name: finite(value) for name, value in vars(each).items()} for each in found.optima
        ],
        "ways": [
            {"way": each.name, "duration": each.duration, "planned": each.is_planned}
            for each in found.ways  # planned to the tolerance, otherwise on a coarse mesh
        ],
        "active_limits": as_dicts(facts.active, found.sensitivities),
        "verification": facts.verification.as_dict(),
    }


def summary(facts: Facts) -> dict[str, object]:
    """A part of plan.json, which commands print for other programs."""
    record = content(facts)
    same = ("gap", "tolerance", "optima", "ways", "active_limits", "verification")
    return {
        "ok": facts.verification.ok,
        "duration": record["duration"],
        "objective": str(facts.plan.scene.objective),
        **{name: record[name] for name in same},
    }


def write_json(file: Path, facts: Facts) -> None:
    """Write how a motion was found, the measures of verification, versions, the scene, and the
    motion itself: its polynomials, from which ``saved_plan.load_plan`` makes the same again."""
    record = {
        "format": FORMAT,
        **content(facts),
        "versions": versions(),
        "scene": facts.plan.scene.model_dump(mode="json", exclude_none=True),
        "motion": _motion(facts.plan.trajectory),
    }
    write_record(file, {**record, "checksums": checksums(record)})


def write_record(file: Path, record: Mapping[str, object]) -> None:
    """Write a record without infinite numbers as JSON."""
    text = json.dumps(record, indent=2, ensure_ascii=False, allow_nan=False)
    write_text(file, text + "\n")


def checksums(content: Mapping[str, object]) -> dict[str, str]:
    """Of each key of plan.json, so that what was changed since can be told; however it is laid out,
    for numbers are written with all their digits."""
    texts = {name: json.dumps(value, sort_keys=True) for name, value in content.items()}
    return {name: sha256(text.encode()).hexdigest()[:16] for name, text in texts.items()}


def _motion(trajectory: Trajectory) -> dict[str, object]:
    """The polynomials between knots: ``coefficients``[interval][power][coordinate], of the time
    since the knot, in SI units."""
    coordinates = trajectory.coordinates
    found = {"knots": trajectory.knots, "position": trajectory.position.coefficients}
    if coordinates is not None:
        found["coordinates"] = coordinates.coefficients
    return {name: values.tolist() for name, values in found.items()}


def schema() -> str:
    """The text of the JSON schema of plan.json."""
    return (files("deltaopt.output") / "plan.schema.json").read_text(encoding="utf-8")


def highest_rate(trajectory: Trajectory | MotionSequence) -> float:
    """The rate (Hz) at which the motion fills ``MOST_ROWS`` rows."""
    return (MOST_ROWS - 1) / trajectory.duration


def instants(trajectory: Trajectory | MotionSequence, rate: float) -> Array:
    """Times, s, at ``rate`` (Hz) from the start, and the last instant once."""
    before_the_end = int(np.ceil(trajectory.duration * rate * (1 - 1e-12)))
    times = trajectory.knots[0] + np.arange(before_the_end) / rate
    return np.append(times, trajectory.knots[-1])


def frame(trajectory: Trajectory, rate: float = RATE) -> Any:
    """The rows of trajectory.csv, by column: a pandas DataFrame, or a dictionary of arrays, (N,),
    where pandas is not installed. Raises ValueError as ``write_motion``."""
    columns = dict(zip(COLUMNS, _rows(trajectory, rate).T.copy(), strict=True))
    try:
        from pandas import DataFrame
    except ImportError:
        return columns
    return DataFrame(columns)


def versions() -> dict[str, str | None]:
    """Of what a plan depends on."""
    found = {name: installed_version(name) for name in ("deltaopt", "casadi", "numpy")}
    return {"python": platform.python_version(), **found}


def rows_at(trajectory: Trajectory | MotionSequence, times: Array) -> Array:
    """Rows of trajectory.csv at times (N,), s: (N, len(COLUMNS))."""
    m = trajectory(times)
    return np.hstack([m.t[:, None], m.x, m.v, m.a, m.theta, m.dtheta, m.ddtheta, m.tau])


def _rows(trajectory: Trajectory, rate: float) -> Array:
    """Rows of trajectory.csv at ``rate`` (Hz) and at the last instant. Raises ValueError if there
    are more than ``MOST_ROWS``, or none at this rate."""
    require_positive("rate", rate)
    most = highest_rate(trajectory)
    if rate > most:
        raise ValueError(f"rate is {rate:g} Hz; for {MOST_ROWS} rows it may be {most:.6g} at most")
    return rows_at(trajectory, instants(trajectory, rate))
