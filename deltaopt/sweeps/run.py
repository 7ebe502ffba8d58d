"""Plans the points of a sweep, a row each, on any executor: processes here, or a cluster of
machines."""

from __future__ import annotations

import os
import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent import futures
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from time import thread_time
from typing import Any

import numpy as np

from deltaopt.errors import DeltaOptError, installed
from deltaopt.interrupts.workers import end_with_parent
from deltaopt.motion.active_limits import active_limits, share_curves
from deltaopt.output.cycle_files import verified
from deltaopt.planning.cycles.cycle_planning import plan_cycle
from deltaopt.planning.plan import Plan
from deltaopt.planning.planner import plan
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.cycle import Cycle
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import made_of
from deltaopt.sensitivity.keys import changed
from deltaopt.sweeps.points import Task
from deltaopt.verify.cycle import CycleVerification
from deltaopt.verify.verification import Verification, verify

_WITHIN = np.linspace(0.0, 1.0, 17)
"""Of each interval: where torques are looked at for the largest."""
_AHEAD = 2
"""How many points for each worker are under way, so that none waits for the next."""

Row = dict[str, Any]
"""Of a table: what is told of the plan of a point, or why there is none, by column."""


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
    end_with_parent()


def row_of(task: Task) -> Row:
    """The row of a point by the names of its columns, without facts that there are none of."""
    begin = thread_time()
    try:
        job = made_of(changed(task.base.content, task.changes), task.base.file)
        tolerance = task.tolerance
        told = _of_cycle(job, tolerance) if isinstance(job, Cycle) else _of_motion(job, tolerance)
    except DeltaOptError as error:
        told = {"error": str(error)}
    return {**task.head, **told, "seconds": thread_time() - begin}


def _of_motion(scene: Scene, tolerance: float) -> Row:
    found = plan(scene, tolerance=tolerance)
    judged = verify(found.scene, found.trajectory)
    parts = None if scene.moves_at_ends else 30 / found.duration
    row = {"duration": found.duration, "parts_per_minute": parts, "gap": found.gap}
    return _of_legs((found,), (judged,)) | _judged(judged) | row


def _of_cycle(cycle: Cycle, tolerance: float) -> Row:
    found = plan_cycle(cycle, tolerance=tolerance)
    judged, parts = verified(found), found.parts_per_minute
    row: Row = {"duration": found.period, "parts_per_minute": parts, "gap": found.gap}
    if max(found.prices) > 0:
        row["limited_by"] = f"RMS torque of motor {int(np.argmax(found.prices)) + 1}"
    return _of_legs(found.legs, judged.legs) | _judged(judged) | row


def _of_legs(legs: tuple[Plan, ...], judged: tuple[Verification, ...]) -> Row:
    """What is largest, nearest or longest in any of some motions."""
    shares, seconds = list[float](), dict[str, float]()
    for leg in legs:
        problem, motion = problem_of(leg.scene), leg.trajectory
        curves = share_curves(problem, motion, _WITHIN)
        shares += [np.abs(own).max() for (limit, _), own in curves.items() if limit == "torque"]
        for each in active_limits(problem, motion):
            name = f"{each.limit} of {each.subject}"
            seconds[name] = seconds.get(name, 0.0) + each.share * motion.duration
    distances = (each.least for one in judged for each in one.distances)
    return {
        "torque_share": float(max(shares)),
        "singularity": min(distances, default=None),
        "limited_by": max(seconds, key=lambda name: seconds[name], default=None),
    }


def _judged(verification: Verification | CycleVerification) -> Row:
    duty, failures = verification.duty, verification.failures()
    row: Row = {"verified": "no" if failures else "yes"}
    if failures:
        row["error"] = f"verification failed: {'; '.join(failures)}"
    if duty is not None and duty.rms_share is not None:
        row["rms_share"] = duty.rms_share
    return row
