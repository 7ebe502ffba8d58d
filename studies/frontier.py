"""Time against gap: what accuracy costs by default and by Ipopt in every formulation.

Plans of scenes at falling tolerances, timed after one at the coarsest, so that nothing is derived
or compiled within them; each is verified. The gap is the plan's duration over that of a
plan with resolved switches (1e-8). By Ipopt with acceleration of degree 1 and 2; of each
formulation the better one is drawn. Beside it other programs, where they are installed
(``frontier_peers``). Draws frontier.png, writes frontier.csv and frontier_peers.csv.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import thread_time

import numpy as np

import deltaopt
from deltaopt.cli.arguments import load_fastest
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.planning.planner import Planner
from deltaopt.scene.scene import Scene
from studies.frontier_peers import (
    PEERS,
    PeerAttempt,
    peer_attempts,
    peer_points,
    peers_table,
)
from studies.problems import PICK_AND_PLACE, PROBLEMS, add_directory
from studies.text_table import csv, paragraph, table

HELP = "what accuracy costs: the default beside Ipopt in every formulation"
SCENES = tuple(
    PROBLEMS / f"{name}.yaml"
    for name in ("pick_and_place", "light_and_fast", "industrial_cross", "long_diagonal")
)
TOLERANCES = (1e-2, 1e-3, 1e-4)
"""Asked of every method; the default is also asked for FINER ones."""
FINER = (1e-5, 1e-6)
REFERENCE = 1e-8
DEFAULT = "default"
FORMULATIONS = ("flat", "forward", "explicit", "multiplier")
SMALL = {
    "scenes": (PICK_AND_PLACE,),
    "tolerances": (1e-2,),
    "finer": (),
    "chosen": ("flat",),
    "peer_settings": 1,
}


@dataclass(frozen=True)
class Attempt:
    """A plan: ``seconds`` of the processor, ``gap`` to the reference, both NaN if there is none;
    ``good``: verified and within its tolerance."""

    scene: str
    method: str
    degree: int
    tolerance: float
    seconds: float
    gap: float
    good: bool


@dataclass(frozen=True)
class Point:
    """A method at a tolerance: medians over the scenes, and how many of the plans are good."""

    method: str
    degree: int
    tolerance: float
    seconds: float
    gap: float
    good: int
    scenes: int


def settings(method: str, degree: int, tolerance: float) -> dict[str, object]:
    """Return what a planner of this method is given."""
    if method == DEFAULT:
        return {"tolerance": tolerance, "resolved_below": 0.0}
    forms = {
        "flat": deltaopt.flat,
        "forward": deltaopt.forward,
        "explicit": deltaopt.explicit,
        "multiplier": deltaopt.multiplier,
    }
    return {
        "tolerance": tolerance,
        "formulation": forms[method],
        "solver": deltaopt.ipopt,
        "transcription": deltaopt.PiecewiseAcceleration(degree),
        "resolved_below": 0.0,
    }


def measure(
    progress: Callable[[float, str], None],
    scenes: tuple[Path, ...],
    tolerances: tuple[float, ...],
    finer: tuple[float, ...],
    chosen: tuple[str, ...],
    peer_settings: int | None = None,
) -> tuple[list[Attempt], list[PeerAttempt]]:
    """Attempt all scenes by all methods at all tolerances, and by other programs, with so many of
    their settings, from the coarsest, or all."""
    tries = [(DEFAULT, 1, t) for t in (*tolerances, *finer)]
    tries += [(method, d, t) for method in chosen for d in (1, 2) for t in tolerances]
    found, peers = [], []
    for i, file in enumerate(scenes):
        scene = load_fastest(file)
        reference = deltaopt.plan(scene, tolerance=REFERENCE).trajectory
        best, share = reference.duration, i / len(scenes)
        told = partial(progress, share)
        peers += list(peer_attempts(told, file.stem, scene, reference, peer_settings))
        for k, (method, degree, tolerance) in enumerate(tries):
            progress((i + k / len(tries)) / len(scenes), f"{file.stem}: {method} {tolerance:g}")
            given = settings(method, degree, tolerance)
            warm = tolerance == tolerances[0]
            seconds, gap, good = _attempt(scene, given, best, tolerance, warm=warm)
            found.append(Attempt(file.stem, method, degree, tolerance, seconds, gap, good))
    progress(1.0, "done")
    return found, peers


def _attempt(
    scene: Scene, given: dict[str, object], best: float, tolerance: float, *, warm: bool
) -> tuple[float, float, bool]:
    """Plan, once more before if what it needs is to be made."""
    planner = Planner(scene.robot, scene.payload, **given)  # type: ignore[arg-type]
    try:
        if warm:
            planner.plan(scene.start, scene.goal)
        begin = thread_time()
        plan = planner.plan(scene.start, scene.goal)
        seconds = thread_time() - begin
    except deltaopt.DeltaOptError:
        return np.nan, np.nan, False
    gap = plan.duration / best - 1
    verified = deltaopt.verify(scene, plan.trajectory).ok
    return seconds, gap, bool(verified and gap <= tolerance)


def points(attempts: list[Attempt]) -> list[Point]:
    """Return the medians over the scenes."""
    found = []
    for key in dict.fromkeys((a.method, a.degree, a.tolerance) for a in attempts):
        own = [a for a in attempts if (a.method, a.degree, a.tolerance) == key]
        seconds, gap = (
            float(np.nanmedian(x)) if np.isfinite(x).any() else np.nan
            for x in (np.array([a.seconds for a in own]), np.array([a.gap for a in own]))
        )
        found.append(Point(*key, seconds, gap, sum(a.good for a in own), len(own)))
    return found


def best_degree(found: list[Point], method: str) -> int:
    """Return the degree with more good plans, and of equals the quicker at the finest tolerance."""

    def merit(degree: int) -> tuple[int, float]:
        own = [p for p in found if (p.method, p.degree) == (method, degree)]
        last = own[-1].seconds if own and np.isfinite(own[-1].seconds) else np.inf
        return -sum(p.good for p in own), last

    return min({p.degree for p in found if p.method == method}, key=merit)


def table_of(found: list[Point]) -> str:
    """Return every method, degree and tolerance."""
    rows = [("method", "degree", "tolerance", "ms", "gap", "good plans")]
    rows += [
        (
            p.method if p.method == DEFAULT else f"{p.method}, Ipopt",
            str(p.degree),
            f"{p.tolerance:.0e}",
            f"{1e3 * p.seconds:.1f}",
            f"{p.gap:.1e}",
            f"{p.good} of {p.scenes}",
        )
        for p in found
    ]
    return table(rows)


def verdict(found: list[Point]) -> str:
    """Say how much longer Ipopt takes at the default tolerance and at the finest common one."""
    told = []
    own = {p.tolerance: p.seconds for p in found if p.method == DEFAULT}
    methods = [m for m in dict.fromkeys(p.method for p in found) if m != DEFAULT]
    for tolerance in dict.fromkeys(p.tolerance for p in found if p.method != DEFAULT):
        ratios = []
        for method in methods:
            degree = best_degree(found, method)
            (p,) = (
                p for p in found if (p.method, p.degree, p.tolerance) == (method, degree, tolerance)
            )
            ratios.append(
                f"{method} {p.seconds / own[tolerance]:.0f} times ({p.good} of {p.scenes} good)"
            )
        told.append(
            f"Within {tolerance:g}: the default takes {1e3 * own[tolerance]:.1f} ms, by Ipopt"
            f" {', '.join(ratios)} that."
        )
    return paragraph(*told)


def csv_of(attempts: list[Attempt]) -> str:
    """Return one line an attempt."""
    return csv(
        "scene,method,degree,tolerance,seconds,gap,good",
        (
            (a.scene, a.method, a.degree, a.tolerance, a.seconds, repr(a.gap), a.good)
            for a in attempts
        ),
    )


def peers_csv(attempts: list[PeerAttempt]) -> str:
    """Return one line an attempt."""
    return csv(
        "scene,program,setting,seconds,gap,good",
        ((a.scene, a.peer, a.setting, a.seconds, repr(float(a.gap)), a.good) for a in attempts),
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_directory(parser, "frontier")
    parser.set_defaults(scenes=SCENES, tolerances=TOLERANCES, finer=FINER, chosen=FORMULATIONS)
    parser.set_defaults(peer_settings=None)


def run(arguments: argparse.Namespace) -> int:
    from deltaopt.files.atomic_write import atomic_write
    from studies.plots.frontier import draw

    a = arguments
    attempts, theirs = measure(
        ProgressBar(), a.scenes, a.tolerances, a.finer, a.chosen, a.peer_settings
    )
    found, peers = points(attempts), peer_points(theirs)
    print(table_of(found), verdict(found), peers_table(peers), sep="\n\n")
    absent = [name for name in PEERS if name not in {p.peer for p in peers}]
    if absent:
        print(f"not installed: {', '.join(absent)}: pip install 'deltaopt[bench]'")
    for name, text in (("frontier", csv_of(attempts)), ("frontier_peers", peers_csv(theirs))):
        with atomic_write(a.directory / f"{name}.csv") as temporary:
            temporary.write_text(text, encoding="utf-8")
    draw(found, peers, a.directory / "frontier.png")
    return 0
