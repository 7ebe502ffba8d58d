"""Charts of the tutorial: what a little more time saves, and what tables ask of the motors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from deltaopt.plots.colours import BLACK, BLUE, LIGHT_GREY
from deltaopt.plots.style import figure, motor_curves, name_lines, without_box
from studies.tutorial import AskedTorques


def draw_effort(efforts: Mapping[float, float], file: Path) -> None:
    """Draw the effort, by how much longer than the fastest motion one may take (a share)."""
    with figure(file, 4.6, 2.4, title_of_effort(efforts)) as page:
        axes = page.subplots()
        names = [f"+{100 * share:.0f} %" if share else "fastest" for share in efforts]
        fastest = next(iter(efforts.values()))
        percents = [100 * effort / fastest for effort in efforts.values()]
        axes.bar(names, percents, color=[LIGHT_GREY] + [BLUE] * (len(names) - 1), width=0.65)
        for place, percent in enumerate(percents):
            axes.annotate(
                f"{percent:.0f} %",
                (place, percent),
                (0, 2),
                ha="center",
                va="bottom",
                textcoords="offset points",
            )
        axes.set_ylim(0, 115)
        axes.set_xlabel("time")
        axes.set_ylabel("effort (% of the fastest's)")
        axes.grid(False, axis="x")
        without_box(axes)


def title_of_effort(efforts: Mapping[float, float]) -> str:
    """The message: what the least of more time saves."""
    fastest, (share, effort) = efforts[0.0], list(efforts.items())[1]
    return f"{100 * share:.0f} % more time saves {100 * (1 - effort / fastest):.0f} % of the effort"


def draw_tables(asked: Sequence[AskedTorques], file: Path) -> None:
    """Draw the torques that tables ask for, a panel each."""
    with figure(file, 7.2, 2.6, title_of_tables(asked)) as page:
        panels = page.subplots(1, len(asked), sharey=True, squeeze=False)[0]
        for axes, each in zip(panels, asked, strict=True):
            motor_curves(axes, 1e3 * each.t, each.percent)
            for bound in (-100, 100):
                axes.axhline(
                    bound, color=BLACK, linewidth=0.9, linestyle=":", zorder=1, label="_limit"
                )
            axes.set_title(each.name)
            axes.set_xlabel("time (ms)", loc="left")
            name_lines(axes, room=0.25)
        panels[0].set_ylabel("torque, % of the limit")


def title_of_tables(asked: Sequence[AskedTorques]) -> str:
    """The message: what each asks for at most."""
    each = (f"{table.name.split(',')[0]} {100 * table.most:.0f} %" for table in asked)
    return f"What a table asks of the motors at most: {', '.join(each)} of the limit"
