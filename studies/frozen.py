"""Plans of moves and shipped scenes, frozen, so that later versions can be held against them.

They are those of version 0.1, and were recorded again since the estimate of the gap sees more, for
meshes are split where it says that time is lost.

``record`` plans every case and writes studies/frozen.csv; ``compare`` plans them again, lists each
case whose duration differs by more than 1e-9 of itself, and exits 1 if these are more than one in
a hundred. Random moves are taken from studies/frozen_moves.csv, so that they do not depend on the
code that drew them. ``--ulp`` moves every start by one unit in the last place (1e-16 m) first: what
differs then differs by rounding. ``python -m studies.frozen`` is the same command.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import deltaopt
from deltaopt.scene.task import given_points

HELP = "hold plans against those of version 0.1"
SMALL = {"every": 78}

HERE = Path(__file__).parent
PROBLEMS = HERE.parent / "problems"
MOVES, TABLE = HERE / "frozen_moves.csv", HERE / "frozen.csv"
AGREE = 1e-9
"""Relative difference of two durations that count as the same."""
MOST_AGREE = 0.99
"""Share of the cases that must agree: a rounding may lead to another mesh now and then."""

SCENES = (
    "industrial_cross",
    "light_and_fast",
    "long_diagonal",
    "pick_and_place",
    "objectives/industrial_cross_mild",
    "objectives/pick_and_place_gently",
)
FORMULATIONS: dict[str, Any] = {
    "flat": deltaopt.flat,
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
    "gap",
    "iterations",
    "intervals",
    "resolved",
    "hamiltonian_spread",
    "sign_violation",
    "failure",
)


@dataclass(frozen=True)
class Case:
    """One plan: of a shipped scene or of a random move of a robot, which ``scene`` names then, in
    a formulation, to a tolerance. ``start``, ``goal``: of a random move, m. ``moved``: whether the
    start is moved by one unit in the last place, to see what rounding does to the plan."""

    name: str
    scene: str
    formulation: str
    tolerance: float
    start: tuple[float, float, float] | None = None
    goal: tuple[float, float, float] | None = None
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
        if self.start is None or self.goal is None:
            scene = deltaopt.load_scene(PROBLEMS / f"{self.scene}.yaml")
        else:
            robot = deltaopt.load_robot(PROBLEMS / "robots" / f"{self.scene}.yaml")
            scene = deltaopt.Scene(robot=robot, payload=1.0, start=self.start, goal=self.goal)
        if self.moved:
            x, y, z = given_points(scene.task)[0]
            moved = (math.nextafter(x, math.inf), y, z)
            scene = scene.model_copy(update={"start": moved})
        formulation = FORMULATIONS[self.formulation]
        return deltaopt.plan(scene, tolerance=self.tolerance, formulation=formulation)


def cases() -> Iterator[Case]:
    """Yield all cases that are frozen."""
    for scene in SCENES:
        for tolerance in (*TOLERANCES, 1e-8):
            yield Case(f"{scene} {tolerance:g}", scene, "flat", tolerance)
        for formulation in FORMULATIONS:
            if formulation != "flat":
                yield Case(f"{scene} {formulation}", scene, formulation, 1e-3)
    with MOVES.open(newline="") as file:
        for i, move in enumerate(csv.DictReader(file)):
            start = (float(move["sx"]), float(move["sy"]), float(move["sz"]))
            goal = (float(move["gx"]), float(move["gy"]), float(move["gz"]))
            robot, tolerance = move["robot"], float(move["tolerance"])
            yield Case(f"{robot} {i} {tolerance:g}", robot, "flat", tolerance, start, goal)


def rows(every: Sequence[Case], workers: int) -> list[dict[str, str]]:
    """Plan cases now, in so many processes; a row of the table each."""
    table = []
    with ProcessPoolExecutor(workers) as pool:
        for row in pool.map(Case.row, every, chunksize=4):
            table.append(row)
            if sys.stderr.isatty():
                print(f"\r{len(table)} of {len(every)}", end="", file=sys.stderr)
    return table


def compare(before: list[dict[str, str]], after: list[dict[str, str]]) -> list[str]:
    """Return one line for each case whose duration differs, or that fails now or failed then."""
    lines = []
    for old, new in zip(before, after, strict=True):
        if bool(old["failure"]) != bool(new["failure"]):
            was, now = (row["failure"] or row["duration"] for row in (old, new))
            lines.append(f"{old['case']}: {was} before, {now} now")
        elif not old["failure"]:
            was_s, now_s = float(old["duration"]), float(new["duration"])
            if not math.isclose(was_s, now_s, rel_tol=AGREE):
                lines.append(
                    f"{old['case']}: {was_s:.12g} s (gap {old['gap']}) before, "
                    f"{now_s:.12g} s (gap {new['gap']}) now, {now_s / was_s - 1:+.1e}"
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
        before = list(csv.DictReader(file))[:: arguments.every]
    every = [replace(case, moved=arguments.ulp) for case in cases()][:: arguments.every]
    table = rows(every, arguments.workers)
    lines = compare(before, table)
    print(*lines, sep="\n")
    share = 1 - len(lines) / len(table)
    print(f"{len(table) - len(lines)} of {len(table)} cases agree to {AGREE:g} ({share:.2%})")
    return 0 if share >= MOST_AGREE else 1


if __name__ == "__main__":
    command = argparse.ArgumentParser(prog="python -m studies.frozen", description=__doc__)
    add_arguments(command)
    sys.exit(run(command.parse_args()))
