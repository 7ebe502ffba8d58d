"""Plans the points of a sweep on any executor: processes here, or a cluster of machines."""

from __future__ import annotations

import os
import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent import futures
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from multiprocessing import parent_process
from multiprocessing.connection import wait as wait_for
from threading import Thread

from deltaopt.errors import DeltaOptError, installed
from deltaopt.sweeps.points import Task
from deltaopt.sweeps.row import Row, row_of

_AHEAD = 2
"""How many points for each worker are under way, so that none waits for the next."""


class NoCluster(DeltaOptError):
    """There is no cluster at an address, or not any more."""


@dataclass(frozen=True)
class Workers:
    """What plans points: an ``executor``, and how many it plans at once. ``ended``: its error of a
    point whose planning ends the workers, again and again."""

    executor: futures.Executor
    number: int
    ended: tuple[type[Exception], ...] = ()


Start = Callable[[], AbstractContextManager[Workers]]
"""Starts workers, again where they are broken, and ends them."""


@contextmanager
def processes(number: int | None = None) -> Iterator[Workers]:
    """So many processes on this machine; one for each of its processors by default."""
    many = number or (os.cpu_count() or 1)
    pool = futures.ProcessPoolExecutor(many, initializer=_begin)
    try:
        yield Workers(pool, many, (futures.BrokenExecutor,))
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def cluster(address: str) -> Iterator[Workers]:
    """The workers of a Dask cluster, by the address of its scheduler, such as "tcp://host:8786".

    Raises MissingPackage without the package ``distributed``, and NoCluster.
    """
    distributed = installed("distributed", "cluster")
    try:
        client = distributed.Client(address)
    except (OSError, ValueError) as error:
        raise NoCluster(f"{address}: no Dask scheduler answers there: {error}") from None
    with client:
        threads = sum(client.nthreads().values())
        if not threads:
            raise NoCluster(f"{address} has no workers; dask worker {address} starts some")
        yield Workers(client.get_executor(), threads, (distributed.KilledWorker,))


@contextmanager
def on(executor: futures.Executor, number: int) -> Iterator[Workers]:
    """An executor that is there already, with so many points at once."""
    yield Workers(executor, number)


def rows(tasks: Iterable[Task], start: Start) -> Iterator[Row]:
    """The row of each point as it comes.

    Points whose worker ended are planned again, one at a time where it is not known whose fault
    that was; the row of one whose fault it is says so. What is no error of ours is raised when all
    others are done. Raises NoCluster where that ends.
    """
    upcoming, again, faults = iter(tasks), deque[Task](), list[BaseException]()
    under_way, broken = dict[futures.Future[Row], Task](), False
    with ExitStack() as running:
        workers = running.enter_context(start())
        while True:
            if broken and not under_way:
                running.close()
                workers, broken = running.enter_context(start()), False
            most = 0 if broken else 1 if again else _AHEAD * workers.number
            while len(under_way) < most:
                task = again.popleft() if again else next(upcoming, None)
                if task is None:
                    break
                under_way[workers.executor.submit(row_of, task)] = task
            if not under_way:
                break
            alone = len(under_way) == 1 and not broken
            for future in futures.wait(under_way, return_when=futures.FIRST_COMPLETED).done:
                if future.cancelled():
                    raise NoCluster("the cluster has ended; started again, the sweep goes on")
                task, error = under_way.pop(future), future.exception()
                broken = broken or isinstance(error, futures.BrokenExecutor)
                if error is None:
                    yield future.result()
                elif not isinstance(error, workers.ended):
                    faults.append(error)
                elif broken and not alone:
                    again.append(task)
                else:
                    yield {**task.head, "error": "whatever process plans it ends"}
    if faults:
        raise faults[0]


def _begin() -> None:
    """What a process does first: it leaves Ctrl-C to the one that started it, and ends with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        wait_for([parent.sentinel])
        os._exit(1)
