"""The table of a sweep: a CSV file to which the row of each point is added as it is planned."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from functools import partial
from io import StringIO
from pathlib import Path
from time import monotonic
from typing import Any

from deltaopt.errors import Unusable, installed, on_one_line
from deltaopt.files.atomic_write import atomic_write, require_replaceable
from deltaopt.files.csv_table import csv_text
from deltaopt.files.output_folder import locked, require_writable
from deltaopt.files.progress_bar import Progress
from deltaopt.sweeps.points import FACTS, SweepPoints
from deltaopt.sweeps.run import Row, Start, Workers, processes, rows
from deltaopt.sweeps.sweep_file import Sweep, load_sweep

PARQUET = ".parquet"
ELSEWHERE = "remove it, or write to another file with -o"


class OtherTable(Unusable):
    """A file is the table of another sweep, or is being written."""


def sweep(
    what: Sweep | SweepPoints | str | Path,
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
    if isinstance(what, Sweep):
        what = what.points_from(Path())
    points = what if isinstance(what, SweepPoints) else load_sweep(what)[1]
    if executor is None:
        return fill(Path(file), points, partial(processes, workers), progress)
    there = nullcontext(Workers(executor, workers or 1))
    return fill(Path(file), points, lambda: there, progress)


def fill(file: Path, points: SweepPoints, start: Start, progress: Progress | None = None) -> Any:
    """Add the row of each point that has none to a table, and return it, a pandas DataFrame. Raises
    OtherTable where its rows are of other points than these, and MissingPackage."""
    installed("pandas", "sweep")  # before any work
    if file.suffix == PARQUET:
        installed("pyarrow", "parquet")  # before any work
    with _table(_csv_of(file), points.columns) as (there, add):
        heads = ((task.index, _told(task.head)) for task in points if there)
        same = sum(there.get(index, {}).items() >= head.items() for index, head in heads)
        if same < len(there):
            raise OtherTable(
                f"{_csv_of(file)}: {len(there) - same} of its {len(there)} rows are of other "
                f"points than this sweep has, or were edited, or files have changed; {ELSEWHERE}"
            )
        missing, begun = len(points) - len(there), monotonic()
        left = (task for task in points if task.index not in there)
        for number, row in enumerate(rows(left, start) if missing else (), 1):
            add(row)
            seconds = (missing - number) * (monotonic() - begun) / number
            if progress is not None:
                time = f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"
                done = len(there) + number
                progress(done / len(points), f"{done} of {len(points)} points, {time} left")
    table = read(file)
    if file.suffix == PARQUET:
        with atomic_write(file) as temporary:
            table.to_parquet(temporary)
    return table


def read(file: Path) -> Any:
    """The rows of a table in the order of its points, as a pandas DataFrame. Raises
    MissingPackage."""
    rows = installed("pandas", "sweep").read_csv(_csv_of(file))
    return rows.sort_values("point", ignore_index=True)


def _csv_of(file: Path) -> Path:
    """The CSV file to which rows are added of the table that is to be ``file`` in the end."""
    return file.with_suffix(".csv") if file.suffix == PARQUET else file


@contextmanager
def _table(
    file: Path, columns: Sequence[str]
) -> Iterator[tuple[dict[int, dict[str, str]], Callable[[Row], None]]]:
    """The table of a file, made if need be, for one process at a time: the entries of each row, but
    for the facts, by the number of its point, and a function that adds a row.

    Rows are added whole: what a process that was killed left half written is not there any more.
    Raises OtherTable for the table of another sweep, and OSError.
    """
    require_writable(file.parent)
    file.parent.mkdir(parents=True, exist_ok=True)
    require_replaceable(file)
    with file.open("a", encoding="utf-8", newline="") as out, ExitStack() as held:
        try:
            held.enter_context(locked(file, wait=False))
        except BlockingIOError:
            raise OtherTable(f"{file}: another sweep is writing it") from None
        header, content = csv_text(columns, ()).encode(), file.read_bytes()
        if not header.startswith(content[: len(header)]):
            raise OtherTable(f"{file} is not a table with the columns of this sweep; {ELSEWHERE}")
        whole = content[: content.rfind(b"\n") + 1] or header
        out.truncate(len(whole) if content.startswith(header) else 0)
        rows = csv.DictWriter(out, columns, lineterminator="\n")

        def add(row: Row) -> None:
            try:
                rows.writerow(_told(row))
                out.flush()
            except OSError as error:  # which names no file where a disk is full
                with suppress(OSError):
                    out.close()
                raise OSError(error.errno, error.strerror, str(file)) from error

        if not content.startswith(header):
            rows.writeheader()
        lines = csv.DictReader(StringIO(whole.decode()))
        heads = ({k: v for k, v in line.items() if k not in FACTS} for line in lines)
        yield {int(head["point"]): head for head in heads}, add


def _told(row: Row) -> dict[str, str]:
    """The entries of a row as they are in the file."""
    words = {k: "" if v is None else str(v) for k, v in row.items()}
    return {k: on_one_line(v) for k, v in words.items()}
