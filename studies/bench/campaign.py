"""A campaign: moves of robots of all kinds planned and verified, results by stratum.

Every move is a row of a CSV file, which is appended to as results come, so that a campaign that was
interrupted goes on where it ended. Every failure is written as a scene that reproduces it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from time import process_time

import numpy as np

from deltaopt.errors import DeltaOptError
from deltaopt.interrupts.workers import end_with_parent
from deltaopt.planning.planner import plan
from deltaopt.scene.moving_ends import Belt
from deltaopt.scene.scene import Scene
from deltaopt.verify.verification import verify
from studies.bench.hard_moves import Move, move
from studies.bench.met_belts import of_belt
from studies.bench.possible import Possibility, possibility
from studies.bench.strata import STRATA
from studies.kept_rows import kept_rows
from studies.reproduced import write_scene

_THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
"""Variables that say how many threads a process uses for linear algebra."""


@dataclass(frozen=True)
class Row:
    """What came of a move: a row of the CSV file.

    ``seconds``: of the processor, for planning. ``duration``: of the plan, s; 0 if there is none.
    ``possible``: of a move without a plan, whether an independent path is found; no if there is a
    plan. ``problem``: why it has failed, or why it was refused if it is not known to be possible.
    ``impossible``: of a move without a plan, what an independent check has against it.
    """

    number: int
    robot: str
    stratum: str
    seconds: float
    duration: float = 0.0
    gap: float = 0.0
    lower_bound: float = 0.0
    possible: bool = False
    problem: str = ""
    impossible: str = ""

    @property
    def failed(self) -> bool:
        """Whether it has no plan though it is possible, or a plan that is wrong or not good."""
        return bool(self.problem) and (self.possible or self.duration > 0)

    @property
    def is_impossible(self) -> bool:
        """Whether it has no plan, and an independent check finds no way either."""
        return bool(self.problem) and not self.failed and bool(self.impossible)

    @property
    def refused(self) -> bool:
        """Whether it has no plan, and whether it is possible is not known."""
        return bool(self.problem) and not self.failed and not self.impossible


def row_of(each: Move, tolerance: float) -> Row:
    """Plan a move to a tolerance of its gap and verify the plan. Whatever goes wrong is told."""
    row = partial(Row, number=each.number, robot=each.scene.robot.name, stratum=each.stratum)
    begin = process_time()
    try:
        found = plan(each.scene, tolerance=tolerance)
    except Exception as error:  # a fault of the program is what a campaign looks for
        seconds = process_time() - begin
        is_foreseen = isinstance(error, DeltaOptError)
        checked = _checked(each.scene) if is_foreseen else Possibility(True)
        return row(
            seconds=seconds,
            possible=checked.found,
            problem=f"{type(error).__name__}: {error}",
            impossible=checked.against,
        )
    seconds = process_time() - begin
    try:
        problems = list(verify(each.scene, found.trajectory).failures())
    except Exception as error:
        problems = [f"verification: {type(error).__name__}: {error}"]
    if not found.within_tolerance:
        problems.append(f"the gap is {found.gap:.1e}")
    if found.duration < found.lower_bound:
        problems.append(f"shorter than the lower bound, {found.lower_bound:.6g} s")
    return row(
        seconds=seconds,
        duration=found.duration,
        gap=found.gap,
        lower_bound=found.lower_bound,
        problem="; ".join(problems),
    )


def _checked(scene: Scene) -> Possibility:
    """What an independent check tells of a scene without a plan."""
    return of_belt(scene) if isinstance(scene.goal, Belt) else possibility(scene)


def row_of_number(folder: Path, seed: int, tolerance: float, number: int) -> Row:
    """Draw the move of a number, plan and verify it; what fails or is refused is written as a scene
    into a folder."""
    each = move(seed, number)
    row = row_of(each, tolerance)
    if row.failed or row.refused:
        name = f"{number:05d}_{row.robot}_{row.stratum.replace(' ', '_')}"
        name = "".join(letter for letter in name if letter.isalnum() or letter == "_")
        write_scene(folder / name, each.scene, f"{row.stratum}: {row.problem}")
    return row


def campaign(
    folder: Path,
    number: int,
    seed: int,
    workers: int,
    tolerance: float,
    progress: Callable[[int], None],
) -> list[Row]:
    """Plan so many moves, but for those that the folder's file of the same seed and tolerance has,
    and return all rows."""
    pool = ProcessPoolExecutor(workers, get_context("spawn"), end_with_parent)
    with _one_thread_each(), pool:
        return kept_rows(
            folder / f"moves_{seed}_{tolerance:g}.csv",
            Row,
            range(number),
            lambda row: row.number,
            partial(row_of_number, folder, seed, tolerance),
            progress,
            pool,
        )


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Let processes that begin meanwhile use one thread for linear algebra: matrices are small, and
    threads of several processes wait for each other."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name)
            if value is not None:
                os.environ[name] = value


def table(rows: Iterable[Row]) -> str:
    """A line for each stratum, one for all, and the share of the possible that is good."""
    rows = list(rows)
    lines = [
        f"{'stratum':<22}{'moves':>6}{'good':>6}{'failed':>8}{'refused':>9}{'impossible':>12}"
        f"{'median s':>10}{'99 % s':>9}{'bound/T':>9}"
    ]
    for stratum in [*STRATA, "all"]:
        own = [row for row in rows if stratum in (row.stratum, "all")]
        if own:
            lines.append(_line(stratum, own))
    possible = [row for row in rows if not row.is_impossible]
    good = sum(not row.problem for row in possible) / len(possible) if possible else np.nan
    last = f"of the {len(possible)} that are not known to be impossible {100 * good:.2f} % are good"
    return "\n".join([*lines, last])


def told(rows: Iterable[Row]) -> list[str]:
    """A line for each move that is not good: what is wrong, or what the independent check says."""
    found = []
    for row in rows:
        if row.problem:
            name = "failed" if row.failed else "refused" if row.refused else "impossible"
            why = row.impossible if row.is_impossible else row.problem
            found.append(f"  {name}: move {row.number} ({row.robot}, {row.stratum}): {why}")
    return sorted(found)


def _line(stratum: str, rows: list[Row]) -> str:
    seconds = [row.seconds for row in rows]
    ratios = [row.lower_bound / row.duration for row in rows if row.duration]
    failed, refused = sum(row.failed for row in rows), sum(row.refused for row in rows)
    impossible = sum(row.is_impossible for row in rows)
    good = len(rows) - failed - refused - impossible
    return (
        f"{stratum:<22}{len(rows):>6}{good:>6}{failed:>8}{refused:>9}{impossible:>12}"
        f"{np.median(seconds):>10.3f}{np.percentile(seconds, 99):>9.2f}"
        f"{np.median(ratios) if ratios else float('nan'):>9.2f}"
    )
