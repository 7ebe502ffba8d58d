"""Sensitivities beside differences of plans, for each number of robots, scenes and a cycle.

A number is changed to and fro, and the scene is planned again each time. Where switches are
resolved the differences are of fourth order and known to about 1e-7 of the duration; elsewhere of
second order, between plans on meshes, and known as their gaps say.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import isfinite, log

import deltaopt
from deltaopt.sensitivity.keys import Content, changed
from deltaopt.sensitivity.numbers import Job, content_of, job_of
from deltaopt.sensitivity.sensitivity import Sensitivity
from studies.problems import PROBLEMS
from studies.text_table import table

HELP = "hold sensitivities to every number against differences of plans"
_FINE, _STEP = 1e-9, 1e-3
"""Tolerance of plans with resolved switches, and the share by which their numbers are changed."""
_ON_MESHES, _WIDE = 1e-5, 1e-2
"""The same of plans on meshes."""
_OF_CYCLES = 1e-8
_LEAST = 1e-3
"""Share of the duration for a change by the whole number below which nothing is compared on
meshes: differences do not tell it."""


def _resolved_viscous() -> deltaopt.Scene:
    scene = deltaopt.load_scene(PROBLEMS / "industrial_drive.yaml")
    content = content_of(scene)
    content["robot"]["drive"]["friction"] = {"viscous": 0.3}
    return deltaopt.Scene.model_validate(content)


def _orsino() -> deltaopt.Scene:
    scene = deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml")
    return scene.model_copy(update={"limits": None})


def _at_the_kink() -> deltaopt.Scene:
    """The motor's and the gear's peak torque are the same at the arm."""
    content = content_of(deltaopt.load_scene(PROBLEMS / "hornet/1_kg.yaml"))
    gear, motor = (content["robot"]["drive"][part] for part in ("gear", "motor"))
    gear["peak_torque"] = gear["ratio"] * gear["efficiency"] * motor["peak_torque"]
    return deltaopt.Scene.model_validate(content)


def _shipped(name: str) -> Callable[[], Job]:
    file = PROBLEMS / f"{name}.yaml"
    return lambda: deltaopt.load_cycle(file) if "cycles" in name else deltaopt.load_scene(file)


RESOLVED: dict[str, Callable[[], Job]] = {
    "pick_and_place, limits of the drive": _orsino,
    "hornet/1_kg, motor and gear": _shipped("hornet/1_kg"),
    "industrial_drive, viscous friction": _resolved_viscous,
    "payload/range": _shipped("payload/range"),
    "hornet/1_kg, motor and gear equal": _at_the_kink,
    "cycles/there_and_back": _shipped("cycles/there_and_back"),
}
MESHES = {
    name: _shipped(name)
    for name in (
        "via/within",
        "via/onto_a_belt",
        "moving/passed_state",
        "approach/25_305_25",
        "keep_out/into_a_box",
        "limits/smooth",
        "industrial_drive",
    )
}
SMALL = {"cases": ["hornet/1_kg, motor and gear"], "most": 3}


@dataclass(frozen=True)
class Compared:
    """What plans tell of one number: d ln duration for a change by itself, to both sides; and how
    well that is known."""

    one: Sensitivity
    below: float
    above: float
    known: float

    def off(self, other: Sensitivity) -> float:
        """By how much a sensitivity differs, on the side that is worse."""
        if not self.one.is_one_sided:
            return abs(self.above - other.exponent)
        size = other.number.value / other.duration
        pairs = (self.below, other.below), (self.above, other.above)
        return max(abs(a - b * size) for a, b in pairs if isfinite(a) and isfinite(b))


def _planned(job: Job, tolerance: float) -> deltaopt.Plan | deltaopt.CyclePlan:
    if isinstance(job, deltaopt.Cycle):
        return deltaopt.plan_cycle(job, tolerance=tolerance)
    return deltaopt.plan(job, tolerance=tolerance)


def _duration(content: Content, tolerance: float) -> tuple[float, float]:
    """The duration or the period of a plan, s, and its gap."""
    found = _planned(job_of(content), tolerance)
    return found.period if isinstance(found, deltaopt.CyclePlan) else found.duration, found.gap


def _by_plans(job: Job, one: Sensitivity, tolerance: float, step: float) -> Compared:
    """The differences of plans for one number."""
    content, number = content_of(job), one.number

    @cache
    def told(k: int) -> tuple[float, float]:
        value = number.value * (1 + k * step)
        try:
            duration, gap = _duration(changed(content, {number.key: value}), tolerance)
        except deltaopt.SceneError:
            return float("nan"), 0.0
        return log(duration), gap

    if one.is_one_sided:
        below, above = (
            (4 * told(sign)[0] - told(2 * sign)[0] - 3 * told(0)[0]) / (2 * sign * step)
            for sign in (-1, 1)
        )
        return Compared(one, below, above, max(told(1)[1], told(-1)[1]) / step)
    slope = (told(1)[0] - told(-1)[0]) / (2 * step)
    if tolerance <= _OF_CYCLES:
        wide = (told(2)[0] - told(-2)[0]) / (4 * step)
        slope += (slope - wide) / 3
    return Compared(one, slope, slope, (told(1)[1] + told(-1)[1]) / (2 * step))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "cases", nargs="*", metavar="CASE", help=f"of {', '.join([*RESOLVED, *MESHES])}"
    )
    parser.add_argument("--most", type=int, default=1000, help="numbers of each (default: all)")
    parser.add_argument("--each", action="store_true", help="print every number")


def run(arguments: argparse.Namespace) -> int:
    rows: list[tuple[str, ...]] = [
        ("scene", "numbers", "fine: off by", "default: off by", "its error", "within it")
    ]
    for name in arguments.cases or [*RESOLVED, *MESHES]:
        row = _row(name, arguments.most, each=arguments.each)
        rows.append(row)
        print(", ".join(row), flush=True)
    print(table(rows))
    return 0


def _row(name: str, most: int, *, each: bool) -> tuple[str, ...]:
    """What is compared of one scene, for the table."""
    job = (RESOLVED | MESHES)[name]()
    is_fine = name in RESOLVED
    tolerance, step = (_FINE, _STEP) if is_fine else (_ON_MESHES, _WIDE)
    tolerance = _OF_CYCLES if isinstance(job, deltaopt.Cycle) else tolerance
    fine = _planned(job, tolerance).sensitivity()
    usual = {one.number.key: one for one in _planned(job, 1e-3).sensitivity()}
    chosen = [one for one in fine if one.number.value and (is_fine or abs(one.exponent) > _LEAST)]
    off, off_usual, stated, within = 0.0, 0.0, 0.0, 0
    for one in chosen[:most]:
        found, other = _by_plans(job, one, tolerance, step), usual[one.number.key]
        size = abs(one.number.value) / one.duration
        differs = found.off(other)
        off, off_usual = max(off, found.off(one)), max(off_usual, differs)
        stated = max(stated, other.error * size)
        within += differs <= other.error * size + (0 if is_fine else found.known)
        if each:
            print(
                f"  {one.number.key}: {one.exponent:.6f}, by plans {found.above:.6f} "
                f"(known to {found.known:.0e}), by default {other.exponent:.6f} ± "
                f"{other.error * size:.0e}"
            )
    count = len(chosen[:most])
    return name, str(count), *(f"{x:.1e}" for x in (off, off_usual, stated)), f"{within} of {count}"
