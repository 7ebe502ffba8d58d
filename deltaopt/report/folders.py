"""The files of a plan, and of a cycle with a folder of each leg: tables, records, pictures and the
page, all or none."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from deltaopt.files.output_folder import all_or_none
from deltaopt.output import cycle_files, plan_files
from deltaopt.output.facts import Facts, facts
from deltaopt.output.plan_files import RATE, TABLE
from deltaopt.planning.cycles.cycle_plan import CyclePlan
from deltaopt.planning.plan import Plan
from deltaopt.verify.cycle import CycleVerification


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

    All of them appear there at once, or none; what else is there stays. ``rate``: instants per
    second in trajectory.csv, Hz. Raises OSError, naming the file, if one cannot be written.
    """
    written = [TABLE, plan_files.RECORD]
    with all_or_none(directory) as folder:
        plan_files.write_motion(folder / TABLE, facts.plan.trajectory, rate)
        plan_files.write_json(folder / plan_files.RECORD, facts)
        if drawn.chart:
            from deltaopt.plots.plan import draw  # slow to import

            written.append("plan.png")
            lines, duty = facts.straight_lines, facts.verification.duty
            draw(folder / written[-1], facts.plan.scene, facts.plan.trajectory, lines, duty)
        if drawn.limits:
            from deltaopt.plots.limits import draw_limits

            written.append("limits.png")
            draw_limits(folder / written[-1], facts)
        if drawn.report:
            from deltaopt.report.page import write_report

            written.append("report.html")
            write_report(folder / written[-1], facts)
    return [directory / name for name in written]


def save_cycle(
    directory: Path, plan: CyclePlan, verification: CycleVerification, rate: float, drawn: Drawn
) -> list[Path]:
    """Write the files of a planned cycle into a directory, made if need be; return their paths.

    Each leg has a folder there, as a plan of its own has, from which all commands on plans work.
    ``rate``: instants per second in tables, Hz. Raises OSError, naming the file, if one cannot be
    written.
    """
    legs = list[Path]()
    for index, (leg, measures) in enumerate(zip(plan.legs, verification.legs, strict=True)):
        facts = Facts(leg, measures)
        of_leg = Drawn(chart=False, limits=drawn.limits)
        legs += save(directory / cycle_files.folder_of(index), facts, rate, of_leg)
    written = [TABLE, cycle_files.RECORD]
    record = cycle_files.content_of_cycle(plan, verification)
    with all_or_none(directory) as folder:
        cycle_files.write_cycle(folder / TABLE, plan, rate)
        plan_files.write_record(folder / cycle_files.RECORD, record)
        if drawn.chart:
            from deltaopt.plots.cycle import draw_cycle  # slow to import

            written.append("cycle.png")
            draw_cycle(folder / written[-1], plan)
        if drawn.report:
            from deltaopt.report.page import cycle_report

            written.append("report.html")
            text = cycle_report(plan, verification)
            (folder / written[-1]).write_text(text, encoding="utf-8")
    return [*(directory / name for name in written), *legs]
