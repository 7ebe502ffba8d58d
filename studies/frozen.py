"""Plans of scenes of every kind of task, frozen, so that later versions can be held against them.

``record`` plans every case and writes studies/frozen.csv; ``compare`` plans them again, lists each
case whose cost (duration or effort) differs by more than 1e-9 of itself, and exits 1 if these are
more than one in a hundred, or if one differs by more than the gaps that are told. Random moves are
taken from studies/frozen_moves.csv and frozen_scenes.jsonl, so that they do not depend on the code
that drew them. ``--ulp`` moves every start at rest by one unit in the last place (1e-16 m) first:
what differs then differs by rounding.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import deltaopt
from deltaopt.files.validated_record import Vector3
from deltaopt.interrupts.workers import end_with_parent
from deltaopt.scene.task import given_points
from studies.problems import PROBLEMS, shipped_scenes

SMALL = {"every": 156}

HERE = Path(__file__).parent

MOVES, TABLE = HERE / "frozen_moves.csv", HERE / "frozen.csv"
DRAWN = HERE / "frozen_scenes.jsonl"
"""Four moves of each kind of task, and of some kinds together, as a campaign draws them."""
AGREE = 1e-9
"""Relative difference of two costs that count as the same."""
MOST_AGREE = 0.99
"""Share of the cases that must agree: a rounding may lead to another mesh now and then."""
BEYOND = ", more than the told gaps"
"""Ends a line of a difference that no rounding may make."""

SCENES = (
    "industrial_cross",
    "light_and_fast",
    "long_diagonal",
    "pick_and_place",
    "objectives/industrial_cross_mild",
    "objectives/pick_and_place_gently",
)
FORMULATIONS: dict[str, Any] = {
    "flat": None,  # the default, which a given path has too
    "multiplier": deltaopt.multiplier,
    "explicit": deltaopt.explicit,
    "virtual_work": deltaopt.virtual_work,
    "kane": deltaopt.kane,
    "forward": deltaopt.forward,
    "multiplier, projection": deltaopt.Redundant(deltaopt.multiplier, deltaopt.Projection()),
    "explicit, baumgarte": deltaopt.Redundant(deltaopt.explicit, deltaopt.Baumgarte()),
    "explicit, acceleration": deltaopt.Redundant(deltaopt.explicit, deltaopt.AccelerationLevel()),
}
TOLERANCES = (1e-3, 1e-6)
COLUMNS = (
    "case",
    "duration",
    "cost",
    "gap",
    "iterations",
    "intervals",
    "resolved",
    "hamiltonian_spread",
    "sign_violation",
    "failure",
)


def shipped(name: str) -> deltaopt.Scene:
    """A shipped scene, by its name below problems/."""
    return deltaopt.load_scene(PROBLEMS / f"{name}.yaml")


def between(robot: str, start: Vector3, goal: Vector3) -> deltaopt.Scene:
    """A move of a shipped robot with 1 kg between two points, m."""
    of = deltaopt.load_robot(PROBLEMS / "robots" / f"{robot}.yaml")
    return deltaopt.Scene(robot=of, payload=1.0, start=start, goal=goal)


def drawn(line: str) -> deltaopt.Scene:
    """A scene of one of the kinds that a campaign draws, with its robot, of a line of JSON."""
    keys = json.loads(line)
    del keys["name"]
    return deltaopt.Scene(**keys | {"robot": deltaopt.Robot(**keys["robot"])})


@dataclass(frozen=True)
class Case:
    """One plan: of a scene, in a formulation, to a tolerance. ``scene``: reads it, in the process
    that plans. ``moved``: whether the start is moved by one unit in the last place, to see what
    rounding does to the plan."""

    name: str
    scene: Callable[[], deltaopt.Scene]
    tolerance: float
    formulation: str = "flat"
    moved: bool = False

    def row(self) -> dict[str, str]:
        """Plan it, and return the result as text for the table."""
        row = dict.fromkeys(COLUMNS, "") | {"case": self.name}
        try:
            plan = self._plan()
        except deltaopt.DeltaOptError as error:
            return row | {"failure": f"{type(error).__name__}: {error}"}
        row |= {
            "duration": repr(plan.duration),
            "cost": repr(plan.cost),
            "gap": f"{plan.gap:.6e}",
            "iterations": str(plan.iterations),
            "intervals": str(plan.intervals),
            "resolved": str(int(plan.resolved)),
        }
        if plan.certificate is not None:
            row["hamiltonian_spread"] = f"{plan.certificate.hamiltonian_spread:.3e}"
            row["sign_violation"] = f"{plan.certificate.sign_violation:.3e}"
        return row

    def _plan(self) -> deltaopt.Plan:
        scene = self.scene()
        if self.moved and isinstance(scene.start, tuple):
            x, y, z = given_points(scene.task)[0]
            moved = (math.nextafter(x, math.inf), y, z)
            scene = scene.model_copy(update={"start": moved})
        formulation = FORMULATIONS[self.formulation]
        return deltaopt.plan(scene, tolerance=self.tolerance, formulation=formulation)


def cases() -> Iterator[Case]:
    """Yield all cases that are frozen."""
    for name in SCENES:
        for tolerance in (*TOLERANCES, 1e-8):
            yield Case(f"{name} {tolerance:g}", partial(shipped, name), tolerance)
        for formulation in FORMULATIONS:
            if formulation != "flat":
                yield Case(f"{name} {formulation}", partial(shipped, name), 1e-3, formulation)
    with MOVES.open(newline="") as file:
        for i, row in enumerate(csv.DictReader(file)):
            start = (float(row["sx"]), float(row["sy"]), float(row["sz"]))
            goal = (float(row["gx"]), float(row["gy"]), float(row["gz"]))
            tolerance = float(row["tolerance"])
            move = partial(between, row["robot"], start, goal)
            yield Case(f"{row['robot']} {i} {tolerance:g}", move, tolerance)
    others = (file.relative_to(PROBLEMS).with_suffix("") for file in shipped_scenes())
    for name in sorted(map(Path.as_posix, others)):
        if name not in SCENES:
            yield Case(f"{name} 0.001", partial(shipped, name), 1e-3)
    for i, line in enumerate(DRAWN.read_text(encoding="utf-8").splitlines()):
        yield Case(f"{json.loads(line)['name']} {i} 0.001", partial(drawn, line), 1e-3)


def rows(every: Sequence[Case], workers: int) -> list[dict[str, str]]:
    """Plan cases now, in so many processes; a row of the table each."""
    table = []
    with ProcessPoolExecutor(workers, initializer=end_with_parent) as pool:
        for row in pool.map(Case.row, every, chunksize=4):
            table.append(row)
            if sys.stderr.isatty():
                print(f"\r{len(table)} of {len(every)}", end="", file=sys.stderr)
    return table


def compare(before: list[dict[str, str]], after: list[dict[str, str]]) -> list[str]:
    """Return one line for each case whose cost differs, or that fails now or failed then. A line
    ends in ``BEYOND`` where neither told gap explains the difference."""
    lines = []
    for old, new in zip(before, after, strict=True):
        if bool(old["failure"]) != bool(new["failure"]):
            was, now = (row["failure"] or f"{row['cost']} planned" for row in (old, new))
            lines.append(f"{old['case']}: {was} before, {now} now{BEYOND}")
        elif not old["failure"]:
            was_it, is_it = float(old["cost"]), float(new["cost"])
            if not math.isclose(was_it, is_it, rel_tol=AGREE):
                longer = is_it / was_it - 1
                told = max(float(old["gap"]), float(new["gap"]))
                lines.append(
                    f"{old['case']}: {was_it:.12g} (gap {old['gap']}) before, "
                    f"{is_it:.12g} (gap {new['gap']}) now, {longer:+.1e}"
                    f"{BEYOND if abs(longer) > told else ''}"
                )
    return lines


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("action", nargs="?", default="compare", choices=("record", "compare"))
    parser.add_argument("--workers", type=int, default=2, help="processes (default: 2)")
    parser.add_argument(
        "--every", type=int, default=1, metavar="N", help="compare each Nth case only (default: 1)"
    )
    parser.add_argument(
        "--ulp", action="store_true", help="move every start by one unit in the last place first"
    )


def run(arguments: argparse.Namespace) -> int:
    if arguments.action == "record":
        table = rows(list(cases()), arguments.workers)
        with TABLE.open("w", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            writer.writerows(table)
        print(f"{len(table)} cases recorded in {TABLE}")
        return 0
    with TABLE.open(newline="") as file:
        known = {row["case"]: row for row in csv.DictReader(file)}
    recorded = (case for case in cases() if case.name in known)  # a new scene is none of them
    every = [replace(case, moved=arguments.ulp) for case in recorded][:: arguments.every]
    table = rows(every, arguments.workers)
    lines = compare([known[case.name] for case in every], table)
    print(*lines, sep="\n")
    share, beyond = 1 - len(lines) / len(table), sum(line.endswith(BEYOND) for line in lines)
    print(f"{len(table) - len(lines)} of {len(table)} cases agree to {AGREE:g} ({share:.2%})")
    print(f"{beyond} differ by more than the told gaps")
    return 0 if share >= MOST_AGREE and not beyond else 1
