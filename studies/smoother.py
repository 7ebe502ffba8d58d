"""Three ways to smooth torques: a limit of their rates, a cost of them, or a little more time.

Each way is planned with several numbers on one scene. What a motion then takes more than the
fastest one stands beside its largest torque rate, as the time that motors would take from no torque
to the peak at it, and beside the root of the mean square of its torque rates.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import deltaopt
from deltaopt import Plan, Scene, SmoothMotion, SmoothTorque, TimeAndTorqueRate
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.plots.colours import LINE_COLOURS
from deltaopt.plots.style import figure, name_lines
from deltaopt.scene.objective import Objective
from studies.problems import CROSS, add_directory, add_scenes
from studies.smooth import limited

RAMPS = (1.0, 2.0, 4.0, 8.0, 16.0)
"""Limits: times from no torque to the peak, ms."""
WEIGHTS = (1e-11, 1e-10, 1e-9, 1e-8)
"""Of squared torque rates beside the duration, for a robot of 40 N·m, s²/(N²m²)."""
SHARES = (1.005, 1.01, 1.02, 1.05, 1.1)
"""Durations over that of the fastest motion."""
SMALL = {"few": True}
_PEAK = 40.0
_SAMPLES = 20_000
_TICKS = (0.2, 0.5, 1, 2, 5, 10, 20, 50)


@dataclass(frozen=True)
class Smoothed:
    """A plan, the way it was smoothed, and its largest and its usual torque rate as the time from
    no torque to the peak, ms."""

    way: str
    plan: Plan
    at_most: float
    usually: float


def ways(scene: Scene, few: bool) -> Iterator[tuple[str, Scene]]:
    """A scene smoothed by each way with each number."""
    scale = _PEAK / max(scene.robot.torque_limits)
    objectives: Mapping[str, Sequence[Objective]] = {
        "cost of torque rates": [TimeAndTorqueRate(torque_rate=w * scale**2) for w in WEIGHTS],
        "least torque rates": [SmoothTorque(of_fastest=share) for share in SHARES],
        "least jerk": [SmoothMotion(of_fastest=share) for share in SHARES],
    }
    last = 1 if few else None
    for ramp in RAMPS[:last]:
        yield "limit of torque rates", limited(scene, ramp)
    for way, each in objectives.items():
        for objective in each[:last]:
            yield way, scene.model_copy(update={"objective": objective})


def smoothed(way: str, scene: Scene) -> Smoothed:
    """Plan it, and measure torque rates by differences of its torques."""
    plan = deltaopt.plan(scene)
    times = np.linspace(0, plan.duration, _SAMPLES)
    rates = np.diff(plan.trajectory(times).tau, axis=0) / (times[1] - times[0])
    shares = rates / np.array(scene.robot.torque_limits)
    largest, usual = np.abs(shares).max(), np.sqrt((shares**2).mean())
    return Smoothed(way, plan, 1e3 / float(largest), 1e3 / float(usual))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_scenes(parser, (CROSS,))
    add_directory(parser, "smoother", "smoother.png")
    parser.set_defaults(few=False)


def run(arguments: argparse.Namespace) -> int:
    for file in arguments.scenes:
        scene = deltaopt.load_scene(file)
        fastest, found = deltaopt.plan(scene).duration, list[Smoothed]()
        tried = list(ways(scene, arguments.few))
        progress = ProgressBar().counting(len(tried), "plans")
        for way, smooth in tried:
            found.append(smoothed(way, smooth))
            progress(len(found))
        print(f"{file.stem}: {fastest:.6f} s with torques that jump")
        print(f"{'way':<32}{'T, s':>10}{'longer':>9}{'gap':>9}{'at most':>12}{'usually':>12}")
        for each in found:
            longer = each.plan.duration / fastest - 1
            print(
                f"{each.way:<32}{each.plan.duration:>10.6f}{longer:>9.2%}{each.plan.gap:>9.0e}"
                f"{each.at_most:>9.2f} ms{each.usually:>9.2f} ms"
            )
    arguments.directory.mkdir(parents=True, exist_ok=True)
    draw(found, fastest, arguments.directory / "smoother.png")
    return 0


def draw(found: Sequence[Smoothed], fastest: float, file: Path) -> None:
    """Draw the largest and the usual torque rate by how much longer motions take."""
    measures = {"the largest torque rate": "at_most", "the usual torque rate": "usually"}
    with figure(file, 7.2, 3.2, title(found)) as page:
        panels = page.subplots(1, 2, sharey=True)
        for axes, (what, measure) in zip(panels, measures.items(), strict=True):
            for colour, way in zip(LINE_COLOURS, dict.fromkeys(e.way for e in found), strict=False):
                own = sorted((each for each in found if each.way == way), key=_duration)
                longer = [100 * (each.plan.duration / fastest - 1) for each in own]
                rates = [getattr(each, measure) for each in own]
                axes.plot(longer, rates, "o-", color=colour, markersize=3, label=way)
            axes.set(xscale="log", yscale="log", xlabel="longer than the fastest motion, %")
            axes.set_title(what)
            axes.set_xticks(_TICKS[:-2], [f"{tick:g}" for tick in _TICKS[:-2]])
            axes.set_yticks(_TICKS, [f"{tick:g}" for tick in _TICKS])
            axes.minorticks_off()
            name_lines(axes, room=0.45, apart=0.07)
        panels[0].set_ylabel("from no torque to the peak, ms")


def title(found: Sequence[Smoothed]) -> str:
    """The message: which way lengthens most the time from no torque to the peak, where it is
    shortest and usually."""
    longest = max(found, key=lambda each: each.at_most), max(found, key=lambda each: each.usually)
    return f"Longest ramps: {longest[0].way}; usually: {longest[1].way}"


def _duration(each: Smoothed) -> float:
    return each.plan.duration
