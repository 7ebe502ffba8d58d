"""The files of a plan: trajectory.csv, plan.json, two pictures and report.html, all or none."""

from __future__ import annotations

from pathlib import Path

from deltaopt.files.output_folder import all_or_none
from deltaopt.output.facts import Facts, facts
from deltaopt.output.plan_files import RATE, RECORD, TABLE, write_json, write_motion
from deltaopt.planning.plan import Plan


def save_plan(plan: Plan, directory: str | Path, **drawn: bool) -> list[Path]:
    """Verify a plan and write its files; ``drawn``: which beside the first two, as ``save``."""
    return save(Path(directory), facts(plan), **drawn)


def save(
    directory: Path,
    facts: Facts,
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
    written = [TABLE, RECORD]
    with all_or_none(directory) as folder:
        write_motion(folder / TABLE, facts.trajectory, rate)
        write_json(folder / RECORD, facts)
        if chart:
            from deltaopt.plots.plan import draw  # slow to import

            written.append("plan.png")
            lines, duty = facts.straight_lines, facts.verification.duty
            draw(folder / written[-1], facts.scene, facts.trajectory, lines, duty)
        if limits:
            from deltaopt.plots.limits import draw_limits

            written.append("limits.png")
            draw_limits(folder / written[-1], facts)
        if report:
            from deltaopt.report.page import write_report

            written.append("report.html")
            write_report(folder / written[-1], facts)
    return [directory / name for name in written]
