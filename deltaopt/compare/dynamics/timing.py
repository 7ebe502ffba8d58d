"""Times of functions, measured side by side."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from deltaopt.compare.dynamics.samples import relative_error
from deltaopt.compare.dynamics.tasks import Samples, Task
from deltaopt.curves.piecewise import Array


@dataclass(frozen=True)
class Time:
    """Median ``seconds`` per evaluation, and median ``ratio`` to a reference beside it."""

    seconds: float
    ratio: float

    @property
    def microseconds(self) -> float:
        """Per evaluation."""
        return 1e6 * self.seconds

    @staticmethod
    def of(own: Array, reference: Array) -> Time:
        """Compare the times in every round with those of the reference."""
        return Time(float(np.median(own)), float(np.median(own / reference)))


class Run:
    """A function evaluated on all samples in one call, without Python between them."""

    def __init__(self, function: ca.Function, task: Task, samples: Samples) -> None:
        self.count = len(samples.q)
        parameters = np.tile(samples.parameters, (self.count, 1))
        self._inputs = [np.ascontiguousarray(x) for x in [*task.inputs(samples), parameters]]
        self._truth = task.truth(samples)
        self._result = np.zeros_like(self._truth)
        self._many = function.map(self.count)
        self._buffer: Any
        self._buffer, self._evaluate = self._many.buffer()
        for i, x in enumerate(self._inputs):
            self._buffer.set_arg(i, x.data)
        self._buffer.set_res(0, self._result.data)

    def seconds(self) -> float:
        """Return the seconds per evaluation, once the processor's caches hold what it needs."""
        self._evaluate()
        start = time.perf_counter()
        self._evaluate()
        return (time.perf_counter() - start) / self.count

    def error(self) -> Array:
        """Return the relative error at every sample, (N,)."""
        self._evaluate()
        return relative_error(self._result, self._truth)


def interleaved(runs: list[Run], rounds: int, progress: Callable[[float], None]) -> Array:
    """Return seconds per evaluation, runs × rounds; in every round each runs once, in turn, so that
    load falls on all alike."""
    times = np.zeros((len(runs), rounds))
    for k in range(rounds):
        progress(k / rounds)
        times[:, k] = [run.seconds() for run in runs]
    return times
