"""The files of a plan, and of a cycle with a folder of each leg: tables, records, pictures and the
page, all or none."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from deltaopt.files.atomic_write import write_text
from deltaopt.files.output_folder import all_or_none
from deltaopt.output import cycle_files, plan_files
from deltaopt.output.facts import Facts, facts
from deltaopt.output.plan_files import RATE, TABLE
from deltaopt.planning.cycles.cycle_plan import CyclePlan
from deltaopt.planning.plan import Plan
from deltaopt.scene.cycle import MOST_LEGS
from deltaopt.verify.cycle import CycleVerification

_CHART, _CHART_OF_CYCLE, _LIMITS, _REPORT = "plan.png", "cycle.png", "limits.png", "report.html"
_OF_PLAN, _OF_CYCLE = (plan_files.RECORD, _CHART), (cycle_files.RECORD, _CHART_OF_CYCLE)
_NAMES = (TABLE, *_OF_PLAN, *_OF_CYCLE, _LIMITS, _REPORT)
"""Of all files that a plan or a cycle may have."""


@dataclass(frozen=True)
class Drawn:
    """What is drawn beside tables and records.

    ``chart``: plan.png, a plan beside straight lines, which takes longer than all else; or
    cycle.png. ``limits``: limits.png, every limit over time and the switching functions; of a cycle
    in the folder of every leg. ``report``: report.html.
    """

    chart: bool = True
    limits: bool = False
    report: bool = False


def save_plan(plan: Plan, directory: str | Path, **drawn: bool) -> list[Path]:
    """Verify a plan and write its files; ``drawn``: as of `Drawn`."""
    return save(Path(directory), facts(plan), RATE, Drawn(**drawn))


def save(directory: Path, facts: Facts, rate: float, drawn: Drawn) -> list[Path]:
    """Write the files of a plan into a directory, made if need be, and return their paths.

    All of them appear there at once, or none. The files of an earlier plan or cycle leave; what
    else is there stays. ``rate``: instants per second in trajectory.csv, Hz. Raises OSError, naming
    the file, if one cannot be written.
    """
    with all_or_none(directory, _earlier) as folder:
        written = _write(folder, facts, rate, drawn)
    return [directory / name for name in written]


def _write(folder: Path, facts: Facts, rate: float, drawn: Drawn) -> list[str]:
    """Write the files of a plan, and return their names."""
    written = [TABLE, plan_files.RECORD]
    plan_files.write_motion(folder / TABLE, facts.plan.trajectory, rate)
    plan_files.write_json(folder / plan_files.RECORD, facts)
    if drawn.chart:
        from deltaopt.plots.plan import draw  # slow to import

        written.append(_CHART)
        lines, duty = facts.straight_lines, facts.verification.duty
        draw(folder / _CHART, facts.plan.scene, facts.plan.trajectory, lines, duty)
    if drawn.limits:
        from deltaopt.plots.limits import draw_limits

        written.append(_LIMITS)
        draw_limits(folder / _LIMITS, facts)
    if drawn.report:
        from deltaopt.report.page import report

        written.append(_REPORT)
        write_text(folder / _REPORT, report(facts))
    return written


def _earlier(directory: Path) -> list[str]:
    """Names of the files that a directory may have from before and that are not to stay: those of a
    plan or a cycle that was saved there, and of its legs. A page is that of another motion."""
    is_cycle = (directory / cycle_files.RECORD).exists()
    places = [f"{cycle_files.folder_of(index)}/" for index in range(MOST_LEGS)] if is_cycle else []
    places += [""] if is_cycle or (directory / plan_files.RECORD).exists() else []
    return [f"{place}{name}" for place in places for name in _NAMES]


def save_cycle(
    directory: Path, plan: CyclePlan, verification: CycleVerification, rate: float, drawn: Drawn
) -> list[Path]:
    """Write the files of a planned cycle into a directory, made if need be; return their paths.

    Each leg has a folder there, as a plan of its own has, from which all commands on plans work.
    All of them appear there at once, or none. The files of an earlier plan or cycle leave.
    ``rate``: instants per second in tables, Hz. Raises OSError, naming the file, if one cannot be
    written.
    """
    written, legs = [TABLE, cycle_files.RECORD], list[str]()
    record = cycle_files.content_of_cycle(plan, verification)
    with all_or_none(directory, _earlier) as folder:
        for index, (leg, measures) in enumerate(zip(plan.legs, verification.legs, strict=True)):
            facts = Facts(leg, measures)
            own, of_leg = cycle_files.folder_of(index), Drawn(chart=False, limits=drawn.limits)
            (folder / own).mkdir()
            legs += [f"{own}/{name}" for name in _write(folder / own, facts, rate, of_leg)]
        cycle_files.write_cycle(folder / TABLE, plan, rate)
        plan_files.write_record(folder / cycle_files.RECORD, record)
        if drawn.chart:
            from deltaopt.plots.cycle import draw_cycle  # slow to import

            written.append(_CHART_OF_CYCLE)
            draw_cycle(folder / _CHART_OF_CYCLE, plan)
        if drawn.report:
            from deltaopt.report.page import cycle_report

            written.append(_REPORT)
            write_text(folder / _REPORT, cycle_report(plan, verification))
    return [directory / name for name in (*written, *legs)]
