"""What came of a scene with keep-out bodies, measured by means of its own."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from time import process_time

import numpy as np

import deltaopt
from deltaopt.curves.piecewise import Array
from studies.reproduced import write_scene
from tests.oracles.body_distances import tool_distances
from tests.oracles.clear_grid import ClearGrid

PLANNED, REFUSED, FAILED = "planned", "refused", "failed"
_SAMPLES = 20_000
"""Places of a motion at which its clearance is measured."""
_SHORT = 1e-9
"""m, by which a motion may be nearer to a body than is asked for: what verification allows."""


@dataclass(frozen=True)
class Planned:
    """What came of a scene.

    ``number``: of the scene. ``kinds``: of its bodies. ``outcome``: of the three above; a plan that
    is not verified, or is nearer to a body than it is allowed, has failed, and so has a scene that
    was refused though a grid shows a way. ``clearance``: beyond what is asked for, m. ``duration``,
    ``seconds``: of the motion and of planning it, s. ``ways``: how many were told. ``reason``: why
    there is no plan, or what is wrong with it.
    """

    number: int
    kinds: str
    outcome: str
    clearance: float
    duration: float
    gap: float
    ways: int
    seconds: float
    reason: str


def planned(
    scene: deltaopt.Scene,
    number: int,
    spacing: float,
    folder: Path,
    on_the_way: Array | None = None,
) -> Planned:
    """Plan a scene. A refusal is held against a grid with places ``spacing`` (m) apart and those
    ``on_the_way`` (n, 3), m. What is not planned is written into a folder as a scene."""
    kinds, begin = " ".join(body.kind for body in scene.keep_out or ()), process_time()
    try:
        found = deltaopt.plan(scene)
    except deltaopt.DeltaOptError as error:
        seconds = process_time() - begin
        reason, outcome = f"{type(error).__name__}: {error}", FAILED
        if isinstance(error, deltaopt.Infeasible):
            way = ClearGrid.of(scene, spacing, on_the_way).path()
            outcome = REFUSED if way is None else FAILED
            reason += "" if way is None else f" | a grid has a way: {np.round(way, 5).tolist()}"
        write_scene(folder / f"{outcome}_{number:05d}", scene, reason)
        return Planned(number, kinds, outcome, 0.0, 0.0, 0.0, 0, seconds, reason)
    seconds = process_time() - begin
    clearance = measured_clearance(scene, found)
    problems = list(deltaopt.verify(scene, found.trajectory).failures())
    if clearance < -_SHORT:
        problems.append(f"it is {-clearance:.3g} m nearer to a body than is allowed")
    reason = "; ".join(problems)
    if problems:
        write_scene(folder / f"{FAILED}_{number:05d}", scene, reason)
    return Planned(
        number=number,
        kinds=kinds,
        outcome=FAILED if problems else PLANNED,
        clearance=clearance,
        duration=found.duration,
        gap=found.gap,
        ways=len(found.ways),
        seconds=seconds,
        reason=reason,
    )


def measured_clearance(scene: deltaopt.Scene, found: deltaopt.Plan) -> float:
    """The least distance of a motion from the bodies of a scene beyond what is asked for, m, by a
    dense sampling, and a denser one where it is nearest."""
    position, knots = found.trajectory.position, found.trajectory.knots
    t = np.linspace(knots[0], knots[-1], _SAMPLES)
    distances = tool_distances(scene, position.at(t)).min(axis=1)
    nearest = int(distances.argmin())
    around = np.linspace(t[max(nearest - 1, 0)], t[min(nearest + 1, _SAMPLES - 1)], 1000)
    closest = tool_distances(scene, position.at(around)).min()
    return float(min(distances.min(), closest)) - scene.least_clearance
