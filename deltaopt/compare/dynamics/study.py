"""The paper's Table I and its 83 %, measured: what each model of the Delta costs and errs.

Tasks: inverse dynamics (q, q̇, q̈ → τ) and forward dynamics (q, q̇, τ → q̈), without the
multipliers. The same function is timed in CasADi's interpreter and as machine code, on
many states in one call, each model in turn in every round.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import casadi as ca
import numpy as np

from deltaopt.codegen.c_compiler import Compiler
from deltaopt.codegen.compile import in_machine_code
from deltaopt.compare.dynamics.many_digits import ManyDigits
from deltaopt.compare.dynamics.models import TASKS, Computation, StateSamples, models
from deltaopt.compare.dynamics.printed import PAPER
from deltaopt.compare.dynamics.samples import exact_samples, relative_error, rounding_error
from deltaopt.curves.piecewise import Array
from deltaopt.files.progress_bar import Progress
from deltaopt.mechanisms.delta.mechanism import delta

REFERENCE = ("L_E", "closed form")
"""The model whose time is 1."""


@dataclass(frozen=True)
class Timing:
    """Median ``seconds`` per evaluation, and median ``ratio`` to a reference beside it."""

    seconds: float
    ratio: float

    @property
    def microseconds(self) -> float:
        """Per evaluation."""
        return 1e6 * self.seconds

    @staticmethod
    def of(own: Array, reference: Array) -> Timing:
        """Compare the times in every round with those of the reference."""
        return Timing(float(np.median(own)), float(np.median(own / reference)))


class TimedFunction:
    """A function evaluated on all samples in one call, without Python between them."""

    def __init__(self, function: ca.Function, task: Computation, samples: StateSamples) -> None:
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
        start = perf_counter()
        self._evaluate()
        return (perf_counter() - start) / self.count

    def error(self) -> Array:
        """Return the relative error at every sample, (N,)."""
        self._evaluate()
        return relative_error(self._result, self._truth)


def interleaved(runs: list[TimedFunction], rounds: int, progress: Callable[[float], None]) -> Array:
    """Return seconds per evaluation, runs × rounds; in every round each runs once, in turn, so that
    load falls on all alike."""
    times = np.zeros((len(runs), rounds))
    for k in range(rounds):
        progress(k / rounds)
        times[:, k] = [run.seconds() for run in runs]
    return times


@dataclass(frozen=True)
class ModelRow:
    """Cost and error of one model at one task.

    ``operations``: elementary ones, see ``operations``. ``error``: largest over the
    components, relative to the largest component; median and maximum over the states.
    """

    task: str
    model: str
    variant: str
    systems: str
    operations: int
    interpreted: Timing
    compiled: Timing | None
    median_error: float
    largest_error: float

    @property
    def seconds(self) -> float:
        """Of one evaluation: compiled, where it can be."""
        return (self.compiled or self.interpreted).seconds


@dataclass(frozen=True)
class Study:
    """All rows, and the sizes of the study they come from.

    ``floor``: per task, the median error that rounding the state alone makes.
    """

    rows: list[ModelRow]
    floor: dict[str, float]
    states: int
    rounds: int
    digits: int

    def row(self, task: str, model: str, variant: str) -> ModelRow:
        """Return the row of a model."""
        wanted = (task, model, variant)
        return next(r for r in self.rows if (r.task, r.model, r.variant) == wanted)


def compare_dynamics(
    states: int, rounds: int, compiler: Compiler | None, progress: Progress
) -> Study:
    """Measure all models at both tasks on ``states`` random states of the paper's Delta.

    ``compiler``: the C compiler of this machine; None leaves compiled times out.
    """
    mechanism, exact = delta(PAPER), ManyDigits()
    progress(0.0, f"{states} states in {exact.digits} digits")
    samples = exact_samples(mechanism, states, exact)
    floor = {
        task.name: float(np.median(rounding_error(mechanism, task, samples, exact)))
        for task in TASKS
    }
    progress(0.2, "deriving the models")
    cases = [(task, model) for task in TASKS for model in models()]
    functions = [
        renamed(model.build(mechanism, task), f"model{i}") for i, (task, model) in enumerate(cases)
    ]
    progress(0.3, "compiling")
    in_c = [i for i, (_, model) in enumerate(cases) if model.compilable and compiler]
    machine = (in_machine_code([functions[i] for i in in_c]) if in_c else None) or []
    progress(0.5, "timing")
    runs = {(i, False): TimedFunction(f, cases[i][0], samples) for i, f in enumerate(functions)}
    in_machine = zip(in_c, machine, strict=False)
    runs |= {(i, True): TimedFunction(f, cases[i][0], samples) for i, f in in_machine}
    each = interleaved([*runs.values()], rounds, lambda done: progress(0.5 + done / 2, "timing"))
    times = dict(zip(runs, each, strict=True))
    references = {
        task: i for i, (task, each) in enumerate(cases) if (each.name, each.variant) == REFERENCE
    }
    rows = []
    for i, (task, model) in enumerate(cases):
        first, error, is_in_c = references[task], runs[i, False].error(), (i, True) in runs
        rows.append(
            ModelRow(
                task=task.name,
                model=model.name,
                variant=model.variant,
                systems=model.systems(mechanism, task),
                operations=operations(functions[i]),
                interpreted=Timing.of(times[i, False], times[first, False]),
                compiled=Timing.of(times[i, True], times[first, True]) if is_in_c else None,
                median_error=float(np.median(error)),
                largest_error=float(np.max(error)),
            )
        )
    progress(1.0, "done")
    return Study(rows, floor, states, rounds, exact.digits)


def operations(function: ca.Function) -> int:
    """Count the elementary operations of an evaluation, one for each +, ×, √, sin, comparison …

    A linear system of n equations solved at run time counts as a dense LU factorisation
    with two substitutions, 2/3 n³ + 2 n². CasADi's sparse QR does less where the matrix has
    zeros.
    """
    count = 0
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        if operation == ca.OP_CALL:
            count += operations(function.instruction_MX(k).which_function())
        elif operation == ca.OP_SOLVE:
            n = function.instruction_MX(k).dep(1).shape[0]
            count += round(2 / 3 * n**3 + 2 * n**2)
        elif function.is_a("SXFunction"):
            count += operation not in (ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST, ca.OP_ASSIGN)
    return count


def renamed(function: ca.Function, name: str) -> ca.Function:
    """A copy of a function with another name."""
    x = function.sx_in() if function.is_a("SXFunction") else function.mx_in()
    return ca.Function(name, x, [function(*x)])
