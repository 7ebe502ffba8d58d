"""The files of a planned cycle: its table, what is told of it, a picture, a folder of each leg."""

from __future__ import annotations

from pathlib import Path

from deltaopt.files.output_folder import all_or_none
from deltaopt.output.cycle_files import RECORD, content_of_cycle, folder_of, write_cycle
from deltaopt.output.facts import Facts
from deltaopt.output.plan_files import RATE, TABLE, write_record
from deltaopt.planning.cycles.cycle_plan import CyclePlan
from deltaopt.report.plan_folder import save
from deltaopt.verify.cycle import CycleVerification


def save_cycle(
    directory: Path,
    plan: CyclePlan,
    verification: CycleVerification,
    rate: float = RATE,
    *,
    chart: bool = True,
    limits: bool = False,
    report: bool = False,
) -> list[Path]:
    """Write the files of a planned cycle into a directory, made if need be; return their paths.

    Each leg has a folder there, as a plan of its own has, from which all commands on plans work.
    ``rate``: instants per second in tables, Hz. ``chart``: whether cycle.png is drawn. ``limits``:
    whether every leg's folder has limits.png.
    ``report``: whether report.html is written. Raises OSError, naming the file, if one cannot be
    written.
    """
    legs = list[Path]()
    for index, (leg, measures) in enumerate(zip(plan.legs, verification.legs, strict=True)):
        facts = Facts(leg.scene, leg.trajectory, leg, measures)
        legs += save(directory / folder_of(index), facts, rate, chart=False, limits=limits)
    written = [TABLE, RECORD]
    with all_or_none(directory) as folder:
        write_cycle(folder / TABLE, plan, rate)
        write_record(folder / RECORD, content_of_cycle(plan, verification))
        if chart:
            from deltaopt.plots.cycle import draw_cycle  # slow to import

            written.append("cycle.png")
            draw_cycle(folder / written[-1], plan)
        if report:
            from deltaopt.report.page import cycle_report

            written.append("report.html")
            text = cycle_report(plan, verification)
            (folder / written[-1]).write_text(text, encoding="utf-8")
    return [*(directory / name for name in written), *legs]
