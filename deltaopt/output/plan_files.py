"""Plans as files: trajectory.csv, plan.json, two pictures and report.html, all of them or none."""

from __future__ import annotations

import json
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from math import isfinite
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from deltaopt.files.atomic_write import atomic_write
from deltaopt.files.output_folder import all_or_none
from deltaopt.motion.active_limits import active_limits
from deltaopt.motion.certificate import MET, Certificate
from deltaopt.motion.effort import cost
from deltaopt.motion.limit_sensitivity import LimitSensitivity, as_dicts
from deltaopt.motion.trajectory import Array, Trajectory
from deltaopt.planning.comparisons import straight_lines
from deltaopt.planning.first_motions.multistart import Optimum
from deltaopt.planning.plan import TakenWay
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.scene import Scene
from deltaopt.settings import require_positive
from deltaopt.verify.duty import exceeding
from deltaopt.verify.pontryagin import Extremal, extremal
from deltaopt.verify.verification import Verification

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

COLUMNS = (
    "t",
    *(name + axis for name in ("", "v", "a") for axis in "xyz"),
    *(name + motor for name in ("theta", "dtheta", "ddtheta", "tau") for motor in "123"),
)


class Provenance(Protocol):
    """How a motion was found, as plan.json records it; a Plan has all of it."""

    @property
    def formulation(self) -> str | None: ...
    @property
    def transcription(self) -> str: ...
    @property
    def intervals(self) -> int: ...
    @property
    def status(self) -> str: ...
    @property
    def iterations(self) -> int: ...
    @property
    def solve_seconds(self) -> float: ...
    @property
    def gap(self) -> float | None: ...
    @property
    def tolerance(self) -> float | None: ...
    @property
    def certificate(self) -> Certificate | None: ...
    @property
    def optima(self) -> Sequence[Optimum]: ...
    @property
    def ways(self) -> Sequence[TakenWay]: ...
    @property
    def phases(self) -> Sequence[float]: ...
    @property
    def free_duration(self) -> float | None: ...
    @property
    def sensitivities(self) -> Sequence[LimitSensitivity]: ...
    @property
    def lower_bound(self) -> float: ...


@dataclass(frozen=True)
class StraightLine:
    """How a baseline was found: without a solver. ``lower_bound``: for every path, s."""

    lower_bound: float
    formulation: str | None = None
    transcription: str = "straight line"
    intervals: int = 1
    status: str = "closed form"
    iterations: int = 0
    solve_seconds: float = 0.0
    gap: float | None = None
    tolerance: float | None = None
    certificate: Certificate | None = None
    optima: Sequence[Optimum] = ()
    ways: Sequence[TakenWay] = ()
    phases: Sequence[float] = ()
    free_duration: float | None = None

    @property
    def sensitivities(self) -> Sequence[LimitSensitivity]:
        """None: there is no optimum that they would be of."""
        return ()


def save(
    directory: Path,
    scene: Scene,
    trajectory: Trajectory,
    verification: Verification,
    solution: Provenance,
    rate: float = RATE,
    *,
    chart: bool = True,
    limits: bool = False,
    report: bool = False,
) -> list[Path]:
    """Write the files of a plan into a directory, made if need be, and return their paths.

    All of them appear there at once, or none; what else is there stays. ``rate``: instants per
    second in trajectory.csv, Hz. ``chart``: whether plan.png is drawn, the plan
    beside straight lines, which takes longer than all else. ``limits``: whether limits.png is,
    every limit over time and the switching functions. ``report``: whether report.html is written.
    Raises OSError, naming the file, if one cannot be written.
    """
    csv, record, picture, curves, page = (
        TABLE,
        RECORD,
        "plan.png",
        "limits.png",
        "report.html",
    )
    written = [csv, record]
    with all_or_none(directory) as folder:
        write_csv(folder / csv, trajectory, rate)
        write_json(folder / record, scene, trajectory, verification, solution)
        if chart:
            from deltaopt.plots.plan import draw  # slow to import

            draw(folder / picture, scene, trajectory, straight_lines(scene), verification.duty)
            written.append(picture)
        if limits:
            from deltaopt.plots.limits import draw_limits

            drawn = _drawn(scene, trajectory, verification)
            draw_limits(folder / curves, scene, trajectory, drawn, caption(verification))
            written.append(curves)
        if report:
            from deltaopt.report.page import write_report

            found = verification, solution.gap, solution.sensitivities, solution
            write_report(folder / page, scene, trajectory, *found)
            written.append(page)
    return [directory / name for name in written]


def write_csv(file: Path, trajectory: Trajectory, rate: float = RATE) -> None:
    """Write the motion at ``rate`` (Hz) and at its last instant, one row each.

    Numbers have so many digits that reading them gives the same doubles. Raises ValueError if there
    are more than ``MOST_ROWS`` rows.
    """
    _require_rows(trajectory, rate)
    with (
        atomic_write(file) as temporary,
        temporary.open("w", encoding="utf-8", newline="\n") as out,
    ):
        out.write(",".join(COLUMNS) + "\n")
        out.writelines(_rows(trajectory, rate))


def write_json(
    file: Path,
    scene: Scene,
    trajectory: Trajectory,
    verification: Verification,
    solution: Provenance,
) -> None:
    """Write how a motion was found, the measures of verification, versions, the scene, and the
    motion itself: its polynomials, from which ``saved_plan.load_plan`` makes the same again."""
    found = {f.name: getattr(solution, f.name) for f in fields(StraightLine)}
    content = {
        "format": FORMAT,
        "duration": trajectory.duration,
        "cost": {"value": cost(problem_of(scene), trajectory), "unit": scene.objective.unit},
        **{name: _finite(value) for name, value in found.items()},
        "certificate": _certificate(solution.certificate),
        "optima": [_optimum(each) for each in solution.optima],
        "ways": [way_content(each) for each in solution.ways],
        "active_limits": as_dicts(
            active_limits(problem_of(scene), trajectory), solution.sensitivities
        ),
        "verification": verification.as_dict(),
        "versions": {"python": platform.python_version()}
        | {name: _version(name) for name in ("deltaopt", "casadi", "numpy")},
        "scene": scene.model_dump(mode="json", exclude_none=True),
        "phases": list(solution.phases),
        "motion": _motion(trajectory),
    }
    content["checksums"] = checksums(content)
    with atomic_write(file) as temporary:
        text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
        temporary.write_text(text + "\n", encoding="utf-8")


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


def _certificate(certificate: Certificate | None) -> dict[str, float] | None:
    if certificate is None:
        return None
    return {
        "hamiltonian_spread": certificate.hamiltonian_spread,
        "sign_violation": certificate.sign_violation,
    }


def _optimum(found: Optimum) -> dict[str, object]:
    return {
        "duration": found.duration,
        "cost": found.cost,
        "halfway": list(found.halfway),
        "gap": _finite(found.gap),
        "starts": found.starts,
    }


def way_content(way: TakenWay) -> dict[str, object]:
    """A way past bodies for JSON; ``planned``: to the tolerance, otherwise on a coarse mesh."""
    return {"way": way.name, "duration": way.duration, "planned": way.is_planned}


def _drawn(scene: Scene, trajectory: Trajectory, verification: Verification) -> Extremal | None:
    """Costates and switching functions for the chart; None if Pontryagin's condition is not met."""
    spread, violation = verification.hamiltonian_spread, verification.sign_violation
    if spread is None or violation is None or max(spread, violation) > MET:
        return None
    return extremal(scene, trajectory)


def caption(verification: Verification) -> str:
    """What the chart's lines do not show of a motion: duty of the motors, nearest singularity."""
    duty, lines = verification.duty, []
    if duty is not None:
        rms = ", ".join(f"{each.rms_torque:.4g}" for each in duty.motors)
        rated = ", ".join(f"{torque:g}" for torque in dict.fromkeys(duty.rated_torque or ()))
        above = f", {exceeding(duty.above_rated)}" if any(duty.above_rated or ()) else ""
        done = sum(each.work_done for each in duty.motors)
        absorbed = sum(each.work_absorbed for each in duty.motors)
        lines.append(
            f"RMS torque {rms} N·m"
            + (f" (rated {rated}{above})" if rated else "")
            + f"; work done {done:.4g} J, absorbed {absorbed:.4g} J; peak power "
            f"{duty.peak_power:.4g} W; largest speed "
            f"{max(each.largest_speed for each in duty.motors):.4g} rad/s"
        )
    if verification.distances:
        least = "; ".join(f"{each.name} {each.least:.2g}" for each in verification.distances)
        lines.append(f"least distance to singularities: {least}")
    return "\n".join(lines)


def schema() -> str:
    """The text of the JSON schema of plan.json."""
    return (files("deltaopt.output") / "plan.schema.json").read_text(encoding="utf-8")


def highest_rate(trajectory: Trajectory) -> float:
    """The rate (Hz) at which the motion fills ``MOST_ROWS`` rows."""
    return (MOST_ROWS - 1) / trajectory.duration


def instants(trajectory: Trajectory, rate: float) -> Array:
    """Times, s, at ``rate`` (Hz) from the start, and the last instant once."""
    before_the_end = int(np.ceil(trajectory.duration * rate * (1 - 1e-12)))
    times = trajectory.knots[0] + np.arange(before_the_end) / rate
    return np.append(times, trajectory.knots[-1])


def frame(trajectory: Trajectory, rate: float = RATE) -> Any:
    """The rows of trajectory.csv, by column: a pandas DataFrame, or a dictionary of arrays, (N,),
    where pandas is not installed. Raises ValueError as ``write_csv``."""
    _require_rows(trajectory, rate)
    rows = rows_at(trajectory, instants(trajectory, rate))
    columns = dict(zip(COLUMNS, rows.T.copy(), strict=True))
    try:
        from pandas import DataFrame
    except ImportError:
        return columns
    return DataFrame(columns)


def rows_at(trajectory: Trajectory, times: Array) -> Array:
    """Rows of trajectory.csv at times (N,), s: (N, len(COLUMNS))."""
    m = trajectory(times)
    return np.hstack([m.t[:, None], m.x, m.v, m.a, m.theta, m.dtheta, m.ddtheta, m.tau])


def _require_rows(trajectory: Trajectory, rate: float) -> None:
    """Raise ValueError if there are more than ``MOST_ROWS`` rows, or none at this rate."""
    require_positive("rate", rate)
    most = highest_rate(trajectory)
    if rate > most:
        raise ValueError(f"rate is {rate:g} Hz; for {MOST_ROWS} rows it may be {most:.6g} at most")


def _rows(trajectory: Trajectory, rate: float) -> Iterator[str]:
    for row in rows_at(trajectory, instants(trajectory, rate)).tolist():
        yield ",".join(map(repr, row)) + "\n"


def _finite(value: object) -> object:
    """The value, or None for infinity and NaN, which JSON does not have."""
    return None if isinstance(value, float) and not isfinite(value) else value


def _version(package: str) -> str | None:
    """The version of an installed package; None if it is used without being installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None
