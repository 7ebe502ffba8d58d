"""Errors of the Delta's models towards singularities, and what an evaluation costs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from deltaopt.codegen.c_compiler import compiler
from deltaopt.codegen.compile import in_machine_code
from deltaopt.compare.dynamics.many_digits import ManyDigits
from deltaopt.compare.dynamics.models import TASKS as TASKS_OF
from deltaopt.compare.dynamics.models import StateSamples, models
from deltaopt.compare.dynamics.printed import PAPER
from deltaopt.compare.dynamics.samples import exact_samples
from deltaopt.compare.dynamics.study import TimedFunction, interleaved, operations, renamed
from deltaopt.curves.piecewise import Array
from deltaopt.dynamics.mechanism import Mechanism
from deltaopt.mechanisms.delta.mechanism import delta
from studies.models.families import delta_families
from studies.models.singularities import METHODS, Truth, motions_into
from studies.text_table import paragraph, table

FAMILIES = {
    "stretched": "arm and bars in line",
    "sideways": "bars sideways",
    "coplanar": "bars in one plane",
    "upright": "bars upright",
}
"""Two serial singularities and two parallel ones."""
TOLD = (1e-2, 1e-4, 1e-6, 1e-8, 1e-12)
"""Distances at which the digits that are left are told."""
TASKS = {"inverse": "torques", "forward": "accelerations"}
TRUSTED = 1e-9
"""Relative error up to which a model is trusted."""


@dataclass(frozen=True)
class Cost:
    """Of one evaluation: operations, and ns interpreted and compiled, NaN if it cannot be."""

    operations: int
    interpreted: float
    compiled: float


@dataclass(frozen=True)
class Models:
    """``errors``: by (family, task, name), over the ``distances``. ``floors``: what rounding the
    state alone makes, by (family, task). ``costs``: by (task, name)."""

    distances: Array
    errors: dict[tuple[str, str, str], Array]
    floors: dict[tuple[str, str], Array]
    costs: dict[tuple[str, str], Cost]

    def trusted_to(self, family: str, task: str, name: str) -> float:
        """Return the least ε up to which the error stays below ``TRUSTED`` or ten times what
        rounding the state makes; 1 if it never does."""
        errors = self.errors[family, task, name]
        bad = ~(errors <= np.maximum(TRUSTED, 10 * self.floors[family, task]))
        first = int(np.argmax(bad)) if bad.any() else len(bad)
        return float(self.distances[first - 1]) if first else 1.0


def measure(
    progress: Callable[[float, str], None],
    motions: int,
    digits: int,
    states: int,
    rounds: int,
    distances: tuple[float, ...],
) -> Models:
    """Measure errors at random ``motions`` a state, and costs at so many regular ``states``."""
    exact, families = ManyDigits(digits), delta_families()
    errors, floors = {}, {}
    for i, family in enumerate(families):
        progress(0.7 * i / len(families), FAMILIES[family.name])
        states_at = motions_into(family, exact, motions, distances)
        for task in TASKS_OF:
            truth = Truth.of(task, family, states_at, exact)
            floors[family.name, task.name] = truth.conditioning()
            for name, method in METHODS.items():
                errors[family.name, task.name, name] = truth.errors(method.formulation)
    progress(0.7, "cost")
    mechanism = delta(PAPER)
    costs = _costs(mechanism, exact_samples(mechanism, states, exact), rounds)
    progress(1.0, "done")
    return Models(np.array(distances), errors, floors, costs)


def _costs(m: Mechanism, samples: StateSamples, rounds: int) -> dict[tuple[str, str], Cost]:
    """Count and time the models in turn, interpreted and, given a compiler, compiled."""
    every = {(model.name, model.variant): model for model in models()}
    chosen = {name: every[method.model, method.variant] for name, method in METHODS.items()}
    built = {
        (task.name, name): (task, model.build(m, task), model.compilable)
        for task in TASKS_OF
        for name, model in chosen.items()
    }
    runs = {(key, False): TimedFunction(f, task, samples) for key, (task, f, _) in built.items()}
    named = {
        key: renamed(f, f"model{i}") for i, (key, (_, f, can)) in enumerate(built.items()) if can
    }
    fast = in_machine_code(list(named.values())) if compiler() else None
    for key, function in zip(named, fast or [], strict=fast is not None):
        runs[key, True] = TimedFunction(function, built[key][0], samples)
    times = interleaved(list(runs.values()), rounds, lambda done: None)
    ns = dict(zip(runs, 1e9 * times.min(axis=1), strict=True))  # load only ever adds
    return {
        key: Cost(operations(f), float(ns[key, False]), float(ns.get((key, True), np.nan)))
        for key, (_, f, _) in built.items()
    }


def table_of(found: Models) -> str:
    """Return cost and the least distance at which each model is trusted."""
    rows = [
        (
            *("task", "model", "operations", "interp. ns", "compiled ns"),
            *(f"trusted to ε: {title}" for title in FAMILIES.values()),
        )
    ]
    for task, told in TASKS.items():
        for name in METHODS:
            cost = found.costs[task, name]
            compiled = "-" if np.isnan(cost.compiled) else f"{cost.compiled:.0f}"
            trusted = (f"{found.trusted_to(f, task, name):.0e}" for f in FAMILIES)
            figures = (f"{cost.operations:,}", f"{cost.interpreted:.0f}", compiled)
            rows.append((told, name, *figures, *trusted))
    return table(rows)


def digits_table(found: Models) -> str:
    """Return the correct digits of each model on the way into each singularity; ``-`` for none."""
    told = [k for k, distance in enumerate(found.distances) if distance in TOLD]
    rows = [("digits of", "towards", "model", *(f"{found.distances[k]:.0e}" for k in told))]
    for task, what in TASKS.items():
        for family, title in FAMILIES.items():
            curves = {name: found.errors[family, task, name] for name in METHODS}
            curves["(rounding of the state)"] = found.floors[family, task]
            for name, errors in curves.items():
                digits = [digits_of(float(errors[k])) for k in told]
                rows.append((what, title, name, *(f"{d}" if d else "-" for d in digits)))
    return table(rows)


def digits_of(error: float) -> int:
    """Return how many digits a relative error leaves, 16 at most; none without a result."""
    return int(np.clip(np.nan_to_num(-np.log10(max(error, 1e-16))), 0, 16))


def verdict(found: Models) -> str:
    """Say which model takes the fewest operations, and which cannot be trusted near what."""
    told, nearest = [], found.distances[-1]
    for task, what in TASKS.items():
        cheapest = min(METHODS, key=lambda name: found.costs[task, name].operations)
        told.append(f"For {what} {cheapest} takes the fewest operations.")
        for family, title in FAMILIES.items():
            reach = {name: found.trusted_to(family, task, name) for name in METHODS}
            short = [f"{n} (down to {e:.0e} only)" for n, e in reach.items() if e > nearest]
            told.append(
                f"Towards {title} all can be trusted down to ε = {nearest:.0e}"
                + (f" but {', '.join(short)}." if short else ".")
            )
    return paragraph(*told)


@dataclass(frozen=True)
class Error:
    """Relative error of a model near a singularity; of ``ROUNDING`` what rounding the state alone
    makes, whatever the model."""

    family: str
    task: str
    model: str
    distance: float
    error: float


ROUNDING = "rounding of the state"


def errors_of(found: Models) -> list[Error]:
    """Every error, and what rounding makes."""
    floors = {(*key, ROUNDING): errors for key, errors in found.floors.items()}
    return [
        Error(*key, float(distance), float(error))
        for key, errors in {**found.errors, **floors}.items()
        for distance, error in zip(found.distances, errors, strict=True)
    ]
