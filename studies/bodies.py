"""Plans past keep-out bodies: random scenes, with clearances measured by a dense sampling."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import deltaopt
from deltaopt.scene.feasibility import check_feasible
from deltaopt.verify.clearance import distance_from
from deltaopt.verify.verification import verify
from studies.bench.random_scenes import random_scenes
from studies.problems import INDUSTRIAL
from studies.timed import attempted, timed

SMALL = {"number": 1}
_SAMPLES = 20_000
"""Places of a motion at which its clearance is measured."""
_SIZES = (0.05, 0.25)
"""Least and largest half size of a body, as shares of the way from start to goal."""
_ASIDE = 0.12
"""How far bodies are from the straight line, as a standard deviation, of the same way."""
_RADII = (0.0, 0.01, 0.03)
"""Of the tool, m: a third of the scenes each."""


@dataclass(frozen=True)
class Outcome:
    """Of one scene with ``bodies`` bodies: least clearance, m, processor time of the plan and of
    the plan without bodies, s, how much longer it takes than that, its gap, and whether it is
    verified; None where it is refused, with the ``reason``."""

    bodies: int
    clearance: float | None
    seconds: float
    seconds_without: float
    longer: float
    gap: float
    verified: bool
    reason: str = ""


def scenes(robot: deltaopt.Robot, number: int, seed: int) -> Iterator[deltaopt.Scene]:
    """Random moves of 1 kg with one to five bodies about the straight line, in turn, whose start
    and goal are clear of them."""
    rng, made = np.random.default_rng(seed), 0
    for move in random_scenes(robot, 1.0, 100 * number, seed):
        radius = float(rng.choice(_RADII))
        tool = {"radius": radius} if radius else None
        bodies = [_body(rng, move) for _ in range(1 + made % 5)]
        own = move.robot.model_copy(update={"tool": tool})
        scene = move.model_copy(update={"robot": own, "keep_out": bodies})
        try:
            check_feasible(scene)
        except deltaopt.DeltaOptError:
            continue
        made += 1
        yield scene
        if made == number:
            return


def _body(rng: np.random.Generator, move: deltaopt.Scene) -> dict[str, Any]:
    """A box, sphere or cylinder about a place beside the straight line."""
    start, goal = (np.array(point) for point in move.given_points)
    way = float(np.linalg.norm(goal - start))
    place = start + rng.uniform(0.15, 0.85) * (goal - start) + rng.normal(0, _ASIDE * way, 3)
    low, high = _SIZES[0] * way, _SIZES[1] * way
    kind = rng.integers(3)
    if kind == 0:
        return {"sphere": {"centre": place.tolist(), "radius": rng.uniform(low, high)}}
    if kind == 1:
        half = rng.uniform(low, high, 3)
        return {"box": {"from": (place - half).tolist(), "to": (place + half).tolist()}}
    along = rng.normal(size=3)
    along *= rng.uniform(low, high) / np.linalg.norm(along)
    ends = {"from": (place - along).tolist(), "to": (place + along).tolist()}
    return {"cylinder": ends | {"radius": rng.uniform(low, high)}}


def outcome(scene: deltaopt.Scene) -> Outcome:
    """Plan a scene with and without its bodies."""
    number = len(scene.keep_out or ())
    alone = scene.model_copy(update={"keep_out": None})
    without, seconds_without = timed(partial(deltaopt.plan, alone))
    found, reason, seconds = attempted(partial(deltaopt.plan, scene))
    if found is None:
        return Outcome(number, None, 0.0, seconds_without, 0.0, 0.0, False, reason)
    x = found.trajectory.position.at(np.linspace(0.0, found.duration, _SAMPLES))
    least = min(float(distance_from(body, x)[0].min()) for body in scene.kept_out)
    verified = verify(scene, found.trajectory).ok
    longer = found.duration / without.duration - 1
    return Outcome(number, least, seconds, seconds_without, longer, found.gap, verified)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--number", type=int, default=200, help="random scenes (default: 200)")
    parser.add_argument("--seed", type=int, default=1, help="of the random numbers")
    parser.add_argument("--robot", type=Path, default=INDUSTRIAL, metavar="ROBOT")


def run(arguments: argparse.Namespace) -> int:
    """Print one line for each number of bodies, and every refusal."""
    robot = deltaopt.load_robot(arguments.robot)
    for scene in scenes(robot, min(5, arguments.number), arguments.seed + 1):
        outcome(scene)  # what is compiled once is not counted
    found = [outcome(scene) for scene in scenes(robot, arguments.number, arguments.seed)]
    for each in found:
        if each.clearance is None:
            print(f"refused, {each.bodies} bodies: {each.reason}")
    for number in range(1, 6):
        own = [each for each in found if each.bodies == number and each.clearance is not None]
        if own:
            print(f"{number} bodies: {_summary(own)}", flush=True)
    clear = [each.clearance for each in found if each.clearance is not None]
    print(
        f"{len(clear)} of {len(found)} planned, {sum(each.verified for each in found)} verified, "
        f"least clearance {min(clear):.1e} m"
    )
    return 0


def _summary(own: list[Outcome]) -> str:
    times = np.array([each.seconds for each in own])
    plain = np.array([each.seconds_without for each in own])
    return (
        f"median {1e3 * np.median(times):.1f} ms, {np.median(times / plain):.1f} times a plan "
        f"without; nine in ten within {1e3 * np.quantile(times, 0.9):.0f} ms; "
        f"{np.median([each.longer for each in own]):.1%} longer, at most "
        f"{max(each.longer for each in own):.0%}; "
        f"{sum(each.gap > 1e-3 for each in own)} of {len(own)} miss a gap of 1e-3"
    )
