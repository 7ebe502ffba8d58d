"""Time against gap: what accuracy costs by default, by Ipopt in every formulation, and by others.

Plans of scenes at falling tolerances, timed after one at the coarsest, so that nothing is derived
or compiled within them; each is verified. The gap is the plan's duration over that of a plan with
resolved switches (1e-8), past bodies over that of the finest tolerance. By Ipopt with acceleration
of degree 1 and 2, of each formulation the better one is drawn; past bodies it is given the problem
of the default alone, for the others take it a minute a plan. Beside it other programs, where they
are installed (``frontier_peers``). Writes frontier.csv and draws frontier.png; --drawn-again draws
it from the file.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from time import thread_time

import numpy as np

import deltaopt
from deltaopt.cli.arguments import load_fastest
from deltaopt.errors import DeltaOptError, MissingPackage
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.planner import Planner
from deltaopt.scene.scene import Scene
from studies.frontier_peers import peers_of
from studies.kept_rows import read_rows, rewrite_rows
from studies.problems import PICK_AND_PLACE, PROBLEMS, add_directory, add_drawn_again, add_scenes
from studies.text_table import paragraph, table

SCENES = tuple(
    PROBLEMS / f"{name}.yaml"
    for name in (
        "pick_and_place",
        "light_and_fast",
        "industrial_cross",
        "long_diagonal",
        "keep_out/wall_25_305_25",
        "keep_out/into_a_box",
    )
)
TOLERANCES = (1e-2, 1e-3, 1e-4)
"""Asked of every method; the default is also asked for FINER ones."""
FINER = (1e-5, 1e-6)
REFERENCE = 1e-8
DEFAULT = "default"
FORMULATIONS = {
    "flat": deltaopt.flat,
    "forward": deltaopt.forward,
    "explicit": deltaopt.explicit,
    "multiplier": deltaopt.multiplier,
}
SMALL = {
    "scenes": (PICK_AND_PLACE,),
    "tolerances": (1e-2,),
    "finer": (),
    "chosen": ("flat",),
    "peer_settings": 1,
}


@dataclass(frozen=True)
class Attempt:
    """A plan of ours, or a peer's motion.

    ``setting``: our tolerance, or the peer's number of intervals. ``seconds`` of the processor and
    ``gap`` to the reference are both NaN if there is none. ``good``: it is verified and within its
    tolerance, or keeps the torques and arrives.
    """

    scene: str
    past_bodies: bool
    method: str
    degree: int
    setting: float
    seconds: float
    gap: float
    good: bool


@dataclass(frozen=True)
class Point:
    """A method at a setting: medians over the scenes, and how many of the motions are good."""

    past_bodies: bool
    method: str
    degree: int
    setting: float
    seconds: float
    gap: float
    good: int
    scenes: int


def settings(method: str, degree: int, tolerance: float) -> dict[str, object]:
    """Return what a planner of this method is given."""
    found: dict[str, object] = {"tolerance": tolerance, "resolved_below": 0.0}
    if method == DEFAULT:
        return found
    return found | {
        "formulation": FORMULATIONS[method],
        "solver": deltaopt.ipopt,
        "transcription": deltaopt.PiecewiseAcceleration(degree),
    }


def measure(
    progress: Callable[[float, str], None],
    scenes: tuple[Path, ...],
    tolerances: tuple[float, ...],
    finer: tuple[float, ...],
    chosen: tuple[str, ...],
    peer_settings: int | None = None,
) -> Iterator[Attempt]:
    """Attempt all scenes by all methods at all tolerances, and by other programs, with so many of
    their settings, from the coarsest, or all."""
    for i, file in enumerate(scenes):
        scene = load_fastest(file)
        past_bodies = bool(scene.keep_out)
        best = deltaopt.plan(scene, tolerance=1e-6 if past_bodies else REFERENCE).trajectory
        tries = [(DEFAULT, 1, t) for t in (*tolerances, *(t for t in finer if not past_bodies))]
        tries += [
            (method, degree, tolerance)
            for method in (chosen[:1] if past_bodies else chosen)
            for degree in (1, 2)
            for tolerance in tolerances
        ]
        for k, (method, degree, tolerance) in enumerate(tries):
            progress((i + k / len(tries)) / len(scenes), f"{file.stem}: {method} {tolerance:g}")
            given = settings(method, degree, tolerance)
            found = _attempt(scene, given, best, tolerance, warm=tolerance == tolerances[0])
            yield Attempt(file.stem, past_bodies, method, degree, tolerance, *found)
        for program, (attempt, every) in peers_of(scene).items():
            for setting in every[:peer_settings]:
                progress((i + 1) / len(scenes), f"{file.stem}: {program} {setting}")
                try:
                    duration, seconds, good = attempt(scene, best, setting)
                except MissingPackage:
                    break
                except DeltaOptError:
                    duration, seconds, good = np.nan, np.nan, False
                gap = duration / best.duration - 1
                yield Attempt(file.stem, past_bodies, program, 0, setting, seconds, gap, good)
    progress(1.0, "done")


def _attempt(
    scene: Scene, given: dict[str, object], best: Trajectory, tolerance: float, *, warm: bool
) -> tuple[float, float, bool]:
    """Plan, once more before if what it needs is to be made."""
    planner = Planner(scene.robot, scene.payload, **given)  # type: ignore[arg-type]
    try:
        if warm:
            planner.plan_scene(scene)
        begin = thread_time()
        plan = planner.plan_scene(scene)
        seconds = thread_time() - begin
    except DeltaOptError:
        return np.nan, np.nan, False
    gap = plan.duration / best.duration - 1
    verified = deltaopt.verify(scene, plan.trajectory).ok
    return seconds, gap, bool(verified and gap <= tolerance)


def points(attempts: list[Attempt]) -> list[Point]:
    """Return the medians over the scenes."""
    found = []
    for key in dict.fromkeys((a.past_bodies, a.method, a.degree, a.setting) for a in attempts):
        own = [a for a in attempts if (a.past_bodies, a.method, a.degree, a.setting) == key]
        seconds, gap = (
            float(np.nanmedian(x)) if np.isfinite(x).any() else np.nan
            for x in (np.array([a.seconds for a in own]), np.array([a.gap for a in own]))
        )
        found.append(Point(*key, seconds, gap, sum(a.good for a in own), len(own)))
    return found


def best_degrees(found: list[Point]) -> list[Point]:
    """The points of each method's degree with more good plans, and of equals of the quicker one at
    the finest tolerance."""

    def merit(own: list[Point]) -> tuple[int, float]:
        last = own[-1].seconds if np.isfinite(own[-1].seconds) else np.inf
        return -sum(p.good for p in own), last

    kept = []
    for kind in dict.fromkeys((p.past_bodies, p.method) for p in found):
        own = [p for p in found if (p.past_bodies, p.method) == kind]
        degrees = [[p for p in own if p.degree == d] for d in dict.fromkeys(p.degree for p in own)]
        kept += sorted(degrees, key=merit)[0]
    return kept


def table_of(found: list[Point]) -> str:
    """Return every method, degree and setting."""
    rows = [("scenes", "method", "degree", "setting", "ms", "gap", "good")]
    rows += [
        (
            "past bodies" if p.past_bodies else "free",
            f"{p.method}, Ipopt" if p.method in FORMULATIONS else p.method,
            str(p.degree or ""),
            f"{p.setting:g}",
            f"{1e3 * p.seconds:.1f}",
            f"{p.gap:.1e}",
            f"{p.good} of {p.scenes}",
        )
        for p in found
    ]
    return table(rows)


def times_longer(found: list[Point], *, past_bodies: bool) -> dict[float, dict[str, float]]:
    """By how much longer than the default Ipopt takes, by tolerance and formulation."""
    own = [p for p in best_degrees(found) if p.past_bodies == past_bodies]
    default = {p.setting: p.seconds for p in own if p.method == DEFAULT}
    others = [p for p in own if p.method in FORMULATIONS]
    return {
        t: {p.method: p.seconds / default[t] for p in others if p.setting == t}
        for t in dict.fromkeys(p.setting for p in others)
    }


def verdict(found: list[Point]) -> str:
    """Say how much longer Ipopt takes at each tolerance."""
    told = []
    for past_bodies in dict.fromkeys(p.past_bodies for p in found):
        where = "Past bodies" if past_bodies else "On free moves"
        for tolerance, ratios in times_longer(found, past_bodies=past_bodies).items():
            each = ", ".join(f"{method} {ratio:.0f} times" for method, ratio in ratios.items())
            told.append(f"{where} within {tolerance:g} by Ipopt {each} the default's time.")
    return paragraph(*told)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_scenes(parser, SCENES)
    add_directory(parser, "frontier")
    add_drawn_again(parser)
    parser.set_defaults(tolerances=TOLERANCES, finer=FINER, chosen=tuple(FORMULATIONS))
    parser.set_defaults(peer_settings=None)


def run(arguments: argparse.Namespace) -> int:
    from studies.plots.frontier import draw

    a = arguments
    file = a.directory / "frontier.csv"
    if not a.drawn_again:
        sizes = a.scenes, a.tolerances, a.finer, a.chosen, a.peer_settings
        rewrite_rows(file, measure(ProgressBar(), *sizes))
    found = points(read_rows(file, Attempt))
    print(table_of(found), verdict(found), sep="\n\n")
    absent = {name for p in a.scenes for name in peers_of(load_fastest(p))} - {
        p.method for p in found
    }
    if absent:
        print(f"not installed: {', '.join(sorted(absent))}: pip install -e '.[bench]'")
    draw(found, file.with_suffix(".png"))
    return 0
