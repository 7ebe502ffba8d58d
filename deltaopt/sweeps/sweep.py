"""Fills the table of a sweep: plans the points that have no row yet, and adds their rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import nullcontext
from pathlib import Path
from time import monotonic
from typing import Any

from deltaopt.errors import installed
from deltaopt.sweeps.points import Points
from deltaopt.sweeps.row import Task
from deltaopt.sweeps.run import Start, Workers, processes, rows
from deltaopt.sweeps.sweep_file import Sweep, load_sweep
from deltaopt.sweeps.table import (
    ELSEWHERE,
    PARQUET,
    OtherTable,
    Table,
    csv_of,
    read,
    table,
    write_parquet,
)

Progress = Callable[[float, str], None]
"""Is called with the share that is done, 0 to 1, and a text."""


def sweep(
    what: Sweep | Points | str | Path,
    file: str | Path,
    *,
    executor: Executor | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Any:
    """Plan all points of a sweep, of its file, or of a map, such as ``load_cell(file).places()``,
    and return the table of the plans.

    ``file``: the CSV file to which rows are added as they come; where it ends in .parquet, the CSV
    file beside it, from which it is made in the end. Points that have a row there already are not
    planned again. ``executor``: plans the points, such as ``Client(address).get_executor()`` of a
    Dask cluster, ``workers`` of them at once; by default so many processes of this machine, one for
    each of its processors. ``progress``: such as ``ProgressBar()``.

    The table is a pandas DataFrame. A point without a plan is a row with its ``error``. Raises
    SceneError for a sweep, and OtherTable for a file, that cannot be used, and MissingPackage.

    Examples:
        >>> from tempfile import TemporaryDirectory
        >>> stronger = "problems/sweeps/stronger_motor.yaml"
        >>> with TemporaryDirectory() as folder:
        ...     table = deltaopt.sweep(stronger, f"{folder}/rows.csv", workers=1)
        >>> table["verified"].tolist()
        ['yes', 'yes', 'yes', 'yes', 'yes']
    """
    installed("pandas", "sweep")  # before any work
    if isinstance(what, Sweep):
        what = what.points_from(Path())
    points = what if isinstance(what, Points) else load_sweep(what)[1]
    start = processes(workers)
    if executor is not None:
        given = Workers(executor, workers or 1)
        start = lambda: nullcontext(given)  # noqa: E731  # it has no name of its own
    fill(Path(file), points, start, progress)
    return read(Path(file))


def fill(file: Path, points: Points, start: Start, progress: Progress | None = None) -> None:
    """Add the row of each point that has none to a table. Raises OtherTable where its rows are of
    other points than these."""
    with table(csv_of(file), points.columns) as found:
        _require_same(file, found, points)
        heads, tell = dict[int, dict[str, Any]](), _told(len(points), len(found.done), progress)

        def left() -> Iterator[Task]:
            for task, head in points:
                if task.index not in found.done:
                    heads[task.index] = head
                    yield task

        for row in rows(left(), start) if len(found.done) < len(points) else ():
            found.add(heads.pop(row["point"]) | row)
            tell()
    if file.suffix == PARQUET:
        write_parquet(file)


def _require_same(file: Path, found: Table, points: Points) -> None:
    if not found.done:
        return
    same = sum(found.done.get(task.index) == head["inputs"] for task, head in points)
    if same < len(found.done):
        raise OtherTable(
            f"{csv_of(file)}: {len(found.done) - same} of its {len(found.done)} rows are of other "
            f"points than this sweep has now, or of files that have changed; {ELSEWHERE}"
        )


def _told(total: int, before: int, progress: Progress | None) -> Callable[[], None]:
    """A function to call after each row, which tells how many there are and how long it takes."""
    begun, done = monotonic(), before

    def tell() -> None:
        nonlocal done
        done += 1
        left = (total - done) * (monotonic() - begun) / (done - before)
        if progress is not None:
            progress(done / total, f"{done} of {total} points, {_in_words(left)} left")

    return tell


def _in_words(seconds: float) -> str:
    minutes = seconds / 60
    return f"{seconds:.0f} s" if minutes < 2 else f"{minutes:.0f} min"
