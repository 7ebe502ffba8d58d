"""The picture of docs/theory.md, of one scene: bang-bang torques, meshes, slowing, gaps.

The best motion is the plan with resolved switches. Of a coarse mesh the motion is drawn
as it was solved, by as much faster as it had to be slowed until its torques keep their
limits between the points too. Gaps are those that plans of falling tolerances tell, and by how much
longer than the best they are.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

import deltaopt
from deltaopt.curves.piecewise import Array
from deltaopt.motion.trajectory import Trajectory
from studies.problems import PICK_AND_PLACE, add_directory

SMALL: Mapping[str, object] = {"tolerances": (1e-2, 1e-3)}
_COARSE, _FINE, _BEST = 0.1, 1e-4, 1e-8
"""Tolerances of the motions that are drawn: the first is met on a coarse mesh."""


@dataclass(frozen=True)
class Facts:
    """``best``: instants, s, and shares of the torque limits, (N, 3); ``coarse`` and ``fine``: and
    the knots, s. ``excess``: the largest share of the coarse motion, before and after it is
    ``slowing`` times as slow. ``told`` and ``true``: gaps, by ``intervals``."""

    best: tuple[Array, Array]
    coarse: tuple[Array, Array, Array]
    fine: tuple[Array, Array, Array]
    slowing: float
    excess: tuple[Array, Array]
    intervals: Array
    told: Array
    true: Array


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--tolerances", nargs="+", type=float, default=(1e-1, 1e-2, 1e-3, 3e-4, 1e-4)
    )
    add_directory(parser, "theory", "theory.png")


def run(arguments: argparse.Namespace) -> int:
    from studies.plots.theory import draw

    scene = deltaopt.load_scene(PICK_AND_PLACE)
    best = deltaopt.plan(scene, tolerance=_BEST)
    coarse, fine = (deltaopt.plan(scene, tolerance=each) for each in (_COARSE, _FINE))
    plans = [deltaopt.plan(scene, tolerance=each) for each in arguments.tolerances]
    last = coarse.meshes[-1]
    slowing = last.safe_duration / last.duration
    as_solved, drawn = coarse.trajectory.slowed(1 / slowing), coarse.trajectory
    found = Facts(
        _torques(best.trajectory, scene),
        (*_torques(drawn, scene), drawn.knots),
        (*_torques(fine.trajectory, scene), fine.trajectory.knots),
        slowing,
        (_largest(as_solved, scene), _largest(drawn, scene)),
        np.array([plan.intervals for plan in plans]),
        np.array([plan.gap for plan in plans]),
        np.array([plan.duration / best.duration - 1 for plan in plans]),
    )
    for n, told, true in zip(found.intervals, found.told, found.true, strict=True):
        print(f"{n:4} intervals: gap told {told:.1e}, true {true:.1e}")
    print(f"the coarse mesh, of {coarse.intervals} intervals, is slowed by {slowing - 1:.2%}")
    file = arguments.directory / "theory.png"
    draw(found, file)
    print("written:", file)
    return 0


def _torques(motion: Trajectory, scene: deltaopt.Scene) -> tuple[Array, Array]:
    """Instants, and the torques at them as shares of the limits."""
    t = np.linspace(0, motion.duration, 2001)
    return t, np.asarray(motion(t).tau / np.array(scene.robot.torque_limits[0]))


def _largest(motion: Trajectory, scene: deltaopt.Scene) -> Array:
    return np.asarray(np.abs(_torques(motion, scene)[1]).max(axis=1))
