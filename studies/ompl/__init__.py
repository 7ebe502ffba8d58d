"""OMPL, TOPP-RA and Ipopt past bodies, in a chain as an expert would make it, beside deltaopt.

OMPL finds a path of the tool among boxes, with several seeds and margins beyond what is asked for,
and shortens it; its corners are rounded as widely as the boxes allow; TOPP-RA times it under the
limits of torque and speed, which hold at both ends of each step, and the motion is slowed for what
is exceeded between. Of these the fastest that verification finds right is taken. From it, or from
the first of RRTConnect, collocation goes on: the default's problem, by Ipopt or the method in C.
Times are of the processor, of a chain as a whole; what is compiled or prepared once for a cell is
not counted, nor is verification.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

import deltaopt
from deltaopt.cli.arguments import one_or_more, seed
from deltaopt.curves.piecewise import Array
from deltaopt.errors import installed
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.attempts import Attempt
from deltaopt.planning.trajectory_optimiser import TrajectoryOptimiser
from deltaopt.scene.scene import Scene
from studies.kept_rows import kept_rows
from studies.ompl.geometric import Clear, path_of
from studies.ompl.rounded import rounded, timed_motion
from studies.ompl.scenes import KINDS, scene_of
from studies.problems import INDUSTRIAL, add_directory
from studies.text_table import table
from studies.timed import attempted, timed

SMALL = {"each": 1, "kinds": ("eight boxes",), "seeds": 1, "margins": (0.004,), "prepares": False}
MARGINS = (0.004, 0.0005, 0.012, 0.035)
"""m, beyond what is asked for, in the order in which they are tried: a wider one leaves room for
rounding, a narrower one for passages."""
CHECKS = {"RRTConnect": 50_000, "BITstar": 6_000}
"""Checked lines and places after which a planner of OMPL stops: some 0.2 s of each."""
OURS, FIRST = "deltaopt", "RRTConnect, first motion"
IPOPT, OWN = TrajectoryOptimiser(solver=deltaopt.ipopt), TrajectoryOptimiser()
GOING_ON = {
    "first, then deltaopt's": ((FIRST,), OWN),
    "best, then deltaopt's": (tuple(CHECKS), OWN),
    "best, then Ipopt": (tuple(CHECKS), IPOPT),
}
"""Collocation from the fastest motion of some methods."""
METHODS = (OURS, FIRST, *CHECKS, *GOING_ON)
_BY_KIND = ("BITstar", "best, then Ipopt")
_BEGINNINGS = ((1.0, 16, True), (1.5, 16, False), (1.0, 32, True), (1.5, 32, False))
"""How collocation begins, until a plan is right: by how much the motion is slowed, on how many
intervals, and whether with the settings for a guess that is near the best motion."""
_SHORTER = 1e-3
"""By which a motion is to be shorter than deltaopt's to count as such: the tolerance of plans."""


@dataclass(frozen=True)
class Row:
    """What a method has for a scene: ``duration`` and ``seconds`` of the processor, s; without a
    motion that is verified the duration is NaN, and ``failure`` says why."""

    scene: str
    method: str
    duration: float
    seconds: float
    failure: str


@dataclass(frozen=True)
class Outcome:
    """A motion, None where there is a ``failure``, and the seconds that it took."""

    motion: Trajectory | None
    seconds: float
    failure: str = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--each", type=one_or_more, default=8, help="scenes of a kind (8)")
    parser.add_argument("--seed", type=seed, default=1, help="of the scenes (1)")
    parser.add_argument("--seeds", type=one_or_more, default=2, help="of OMPL in a scene (2)")
    add_directory(parser, "ompl", "the results of each scene")
    parser.set_defaults(kinds=KINDS, margins=MARGINS, prepares=True)


def run(arguments: argparse.Namespace) -> int:
    """Print the table. Raises MissingPackage."""
    for package in ("ompl", "toppra"):
        installed(package, "ompl")
    robot, settings = deltaopt.load_robot(INDUSTRIAL), (arguments.seeds, arguments.margins)
    scenes = {
        f"{kind} {i}": (kind, arguments.seed, i)
        for kind in arguments.kinds
        for i in range(arguments.each)
    }

    @lru_cache(maxsize=1)
    def found(name: str) -> dict[str, Outcome]:
        scene = scene_of(robot, *scenes[name])
        if arguments.prepares:
            _prepare(scene)
        return outcomes(scene, *settings)

    def made(key: tuple[str, str]) -> Row:
        own = found(key[0])[key[1]]
        duration = own.motion.duration if own.motion else np.nan
        return Row(*key, duration, own.seconds, "" if own.motion else own.failure)

    keys = [(name, method) for name in scenes for method in METHODS]
    rows = kept_rows(
        arguments.directory / f"ompl_{arguments.seed}.csv",
        Row,
        keys,
        lambda row: (row.scene, row.method),
        made,
        ProgressBar().counting(len(keys), "attempts"),
    )
    print(table_of(rows))
    return 0


def outcomes(scene: Scene, seeds: int, margins: Sequence[float]) -> dict[str, Outcome]:
    """What all methods have for a scene."""
    found = {OURS: _planned(scene, partial(deltaopt.plan, scene))}
    for planner, most in CHECKS.items():
        tried = [
            _timed(scene, partial(path_of, Clear(scene, margin), planner, number, most))
            for number in range(1, seeds + 1)
            for margin in margins
        ]
        if FIRST not in found:
            so_far = (_fastest(scene, tried[: i + 1]) for i in range(len(tried)))
            found[FIRST] = next((each for each in so_far if each.motion), _fastest(scene, tried))
        found[planner] = _fastest(scene, tried)
    for name, (before, optimiser) in GOING_ON.items():
        found[name] = _gone_on(scene, [found[each] for each in before], optimiser)
    return found


_PREPARED = set[tuple[int, bool]]()


def _prepare(scene: Scene) -> None:
    """Plan once before where others with as many bodies, and a tool or none, were not planned yet:
    what is compiled and built then is not in the time."""
    kind = len(scene.keep_out or ()), scene.robot.tool is None
    if kind not in _PREPARED:
        _PREPARED.add(kind)
        first = _planned(scene, partial(deltaopt.plan, scene))
        _gone_on(scene, [first], IPOPT)


def _timed(scene: Scene, path: Callable[[], Array | None]) -> Outcome:
    """TOPP-RA's motion on a path of OMPL, not verified yet."""
    corners, seconds = timed(path)
    if corners is None:
        return Outcome(None, seconds, "no path")
    clear = Clear(scene)
    motion, timing = timed(lambda: timed_motion(scene, rounded(clear, corners)))
    return Outcome(motion, seconds + timing, "not timed")


def _fastest(scene: Scene, tried: Sequence[Outcome]) -> Outcome:
    """The fastest motion that verification finds right, and the seconds of all."""
    motions = sorted((o.motion for o in tried if o.motion), key=lambda motion: motion.duration)
    right = (motion for motion in motions if deltaopt.verify(scene, motion).ok)
    failure = "not verified" if motions else max(each.failure for each in tried)
    return Outcome(next(right, None), sum(each.seconds for each in tried), failure)


def _planned(scene: Scene, plan: Callable[[], deltaopt.Plan]) -> Outcome:
    found, failure, seconds = attempted(plan)
    if found is None:
        return Outcome(None, seconds, failure.partition(":")[0])
    is_right = deltaopt.verify(scene, found.trajectory).ok
    return Outcome(found.trajectory if is_right else None, seconds, "not verified")


def _gone_on(scene: Scene, before: Sequence[Outcome], optimiser: TrajectoryOptimiser) -> Outcome:
    """What collocation makes of the fastest motion, from the first beginning that leads to a plan;
    the seconds are those of the whole chain."""
    seconds = sum(each.seconds for each in before)
    motions = [each.motion for each in before if each.motion]
    last = Outcome(None, 0.0, "nothing to begin with")
    for slowed, intervals, is_near in _BEGINNINGS if motions else ():
        motion = min(motions, key=lambda motion: motion.duration).slowed(slowed)
        begun = Attempt(scene, motion, intervals, is_near=is_near)
        last = _planned(scene, partial(optimiser.plan, begun, lambda _: None))
        seconds += last.seconds
        if last.motion:
            break
    return replace(last, seconds=seconds)


def table_of(rows: Sequence[Row]) -> str:
    """Durations and seconds over those of deltaopt, by method, and of some by kind of scene too."""
    ours = {row.scene: row for row in rows if row.method == OURS}
    heads = ("scenes", "method", "good", "duration", "90 %", "most", "shorter", "time", "90 %")
    told: list[tuple[str, ...]] = [(*heads, "why not")]
    kinds = dict.fromkeys(row.scene.rpartition(" ")[0] for row in rows)
    for kind, methods in [("", METHODS), *((kind, _BY_KIND) for kind in kinds)]:
        for method in methods:
            own = [
                r
                for r in rows
                if r.scene.startswith(kind + " " * bool(kind)) and r.method == method
            ]
            both = [r for r in own if r.duration > 0 and ours[r.scene].duration > 0]
            pairs = [
                (r.duration / ours[r.scene].duration, r.seconds / ours[r.scene].seconds)
                for r in both
            ]
            longer, slower = np.array(pairs or [(np.nan, np.nan)]).T
            failed = Counter(row.failure for row in own if not row.duration > 0)
            told.append(
                (
                    kind or "all",
                    method,
                    f"{sum(row.duration > 0 for row in own)} of {len(own)}",
                    *(f"{np.quantile(longer, share):.3f}" for share in (0.5, 0.9, 1)),
                    str(sum(longer < 1 - _SHORTER)),
                    *(f"{np.quantile(slower, share):.2f}" for share in (0.5, 0.9)),
                    ", ".join(f"{number} {failure}" for failure, number in failed.items()),
                )
            )
    seconds = np.median([row.seconds for row in ours.values()])
    return f"{table(told)}\n\ndeltaopt takes {1e3 * seconds:.0f} ms, median"
