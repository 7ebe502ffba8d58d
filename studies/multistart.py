"""How often a search from several first guesses finds a faster motion than one alone.

Seeded moves of many robots, half inside the workspace and half at its edge, each planned from one
first guess and from eight (distinct ways, then random curves). Both to 1e-4, so that a duration
smaller by 1e-3 is another local optimum and no matter of tolerances. Rows are appended to
multistart.csv after every move; a campaign that was interrupted goes on where it ended.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count, islice
from math import sqrt

import numpy as np

import deltaopt
from deltaopt.cli.arguments import one_or_more, seed
from deltaopt.files.progress_bar import ProgressBar
from studies.bench.hard_moves import Move
from studies.gap_moves import INSIDE, move, stratum_of
from studies.kept_rows import kept_rows
from studies.problems import add_directory
from studies.text_table import paragraph, table
from studies.timed import attempted

SMALL = {"number": 1, "starts": 2}
TOLERANCE = 1e-4
BETTER = (1e-3, 1e-2, 1e-1)
"""Shares of the duration by which a motion from several guesses is faster."""


@dataclass(frozen=True)
class Row:
    """A move: durations from one first guess and from several (s, NaN without a plan), processor
    time of both (s), how many distinct local optima the several led to, whether the faster motion
    is verified, and why there is no plan, if there is none."""

    number: int
    robot: str
    stratum: str
    one: float
    several: float
    seconds_one: float
    seconds_several: float
    optima: int
    verified: bool
    failure: str

    @property
    def saved(self) -> float:
        """Share of the duration that several guesses save; NaN if either has no plan."""
        return 1 - self.several / self.one


def row_of(each: Move, starts: int) -> Row:
    """Plan a move from one first guess and from several, and verify the faster plan."""
    one, failed_one, seconds_one = _planned(each, 1)
    several, failed_several, seconds_several = _planned(each, starts)
    found = [plan for plan in (one, several) if plan]
    best = min(found, key=lambda plan: plan.duration, default=None)
    return Row(
        each.number,
        each.scene.robot.name,
        each.stratum,
        one.duration if one else np.nan,
        several.duration if several else np.nan,
        seconds_one,
        seconds_several,
        len(several.optima) if several else 0,
        best is not None and bool(deltaopt.verify(each.scene, best.trajectory).ok),
        "; ".join(filter(None, (failed_one, failed_several))),
    )


def _planned(each: Move, starts: int) -> tuple[deltaopt.Plan | None, str, float]:
    """The plan if there is one, why there is none, and seconds of the processor."""
    plan, failure, seconds = attempted(
        lambda: deltaopt.plan(each.scene, tolerance=TOLERANCE, starts=starts)
    )
    return plan, failure and f"{starts} starts: {failure}", seconds


def numbers(how_many: int) -> list[int]:
    """Return the numbers of so many moves inside the workspace and so many at its edge, in turn."""
    inside = (i for i in count() if stratum_of(i) == INSIDE)
    edge = (i for i in count() if stratum_of(i) != INSIDE)
    return [i for pair in islice(zip(inside, edge, strict=True), how_many) for i in pair]


def where(row: Row) -> str:
    """Return the half of the moves that a row belongs to."""
    return "inside" if row.stratum == INSIDE else "at the edge"


def share_faster(rows: Sequence[Row], by: float) -> int:
    """Return how many moves several guesses make faster by more than this share."""
    return sum(row.saved > by for row in rows)


def table_of(rows: Sequence[Row]) -> str:
    """Return a line for each half."""
    head = ("moves", "number", "no plan: one, several", "verified", "more optima")
    lines = [
        (*head, *(f"> {by:g} faster" for by in BETTER), "largest", "ms: one", "several", "times")
    ]
    for half in dict.fromkeys(where(row) for row in rows):
        own = [row for row in rows if where(row) == half]
        one, several = (
            np.array([getattr(row, name) for row in own])
            for name in ("seconds_one", "seconds_several")
        )
        without = [sum(np.isnan(getattr(row, name)) for row in own) for name in ("one", "several")]
        lines.append(
            (
                half,
                str(len(own)),
                f"{without[0]}, {without[1]}",
                str(sum(row.verified for row in own)),
                str(sum(row.optima > 1 for row in own)),
                *(str(share_faster(own, by)) for by in BETTER),
                f"{np.nanmax([row.saved for row in own]):.1%}",
                f"{1e3 * np.median(one):.0f}",
                f"{1e3 * np.median(several):.0f}",
                f"{np.median(several / one):.1f}",
            )
        )
    return table(lines)


def verdict(rows: Sequence[Row], starts: int) -> str:
    """Say how often several guesses pay, with the uncertainty of the share."""
    told = []
    for half in dict.fromkeys(where(row) for row in rows):
        own = [row for row in rows if where(row) == half and not np.isnan(row.saved)]
        shares = (
            f"{found} by more than {by:g} ({_percent(found, len(own))})"
            for by in BETTER
            for found in (share_faster(own, by),)
        )
        slower = sum(row.saved < -BETTER[0] for row in own)
        told.append(
            f"Of {len(own)} moves {half} {starts} first guesses make faster: {', '.join(shares)};"
            f" slower by more than {BETTER[0]:g}: {slower}."
        )
    return paragraph(*told, "In brackets 95 % intervals (Wilson).")


def _percent(found: int, of: int) -> str:
    low, high = wilson(found, of)
    return f"{low:.1%} to {high:.1%}"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--number", type=one_or_more, default=200, metavar="N", help="moves of each half (200)"
    )
    parser.add_argument(
        "--starts", type=one_or_more, default=8, metavar="N", help="first guesses (8)"
    )
    parser.add_argument("--seed", type=seed, default=7, metavar="N", help="of the moves (7)")
    add_directory(parser, "multistart", "multistart.csv")


def run(arguments: argparse.Namespace) -> int:
    a = arguments
    wanted = numbers(a.number)
    rows = kept_rows(
        a.directory / f"multistart_{a.seed}_{a.starts}.csv",
        Row,
        wanted,
        lambda row: row.number,
        lambda number: row_of(move(a.seed, number), a.starts),
        ProgressBar().counting(len(wanted), "moves"),
    )
    print(table_of(rows), verdict(rows, a.starts), sep="\n\n")
    for row in rows:
        if row.failure or row.saved > BETTER[1] or not row.verified:
            saved = f"{row.saved:.1%} faster, {row.optima} optima"
            print(f"move {row.number} ({row.robot}, {row.stratum}): {row.failure or saved}")
    return 0


def wilson(found: int, trials: int) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a share."""
    z = 1.96
    middle = (found + z**2 / 2) / (trials + z**2)
    half = z / (trials + z**2) * sqrt(found * (trials - found) / trials + z**2 / 4)
    return max(middle - half, 0.0), min(middle + half, 1.0)
