"""How far the gap that a plan estimates can be trusted.

Each scene is planned at several tolerances; the last and smallest of them resolves the switches
and stands for the optimum.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass

import deltaopt
from deltaopt.cli.arguments import load_fastest
from deltaopt.cli.progress import ProgressBar
from studies.problems import PICK_AND_PLACE, add_scenes, add_tolerances

HELP = "hold estimated gaps against true ones"
TOLERANCES = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5)
SMALL = {"scenes": (PICK_AND_PLACE,), "tolerances": (1e-2, 3e-3, 1e-5)}


@dataclass(frozen=True)
class GapStudy:
    """Plans of one scene at several tolerances, and the one they are held against."""

    reference: deltaopt.Plan
    plans: tuple[deltaopt.Plan, ...]

    def true_gap(self, plan: deltaopt.Plan) -> float:
        """Return by what fraction a plan takes longer than the reference."""
        return plan.duration / self.reference.duration - 1


def gap_study(
    scene: deltaopt.Scene, tolerances: tuple[float, ...], progress: Callable[[int], None]
) -> GapStudy:
    """Plan a scene at each tolerance, the reference's last; ``progress``: called after each."""
    plans = []
    for tolerance in tolerances:
        plans.append(deltaopt.plan(scene, tolerance=tolerance))
        progress(len(plans))
    return GapStudy(plans[-1], tuple(plans[:-1]))


def table(name: str, study: GapStudy) -> str:
    """Return a line for each plan, the reference in the last."""
    rows = [
        f"{plan.tolerance:>10.0e}{plan.intervals:>10}{plan.iterations:>11}"
        f"{plan.gap:>14.1e}{study.true_gap(plan):>12.1e}"
        for plan in study.plans
    ]
    reference = study.reference
    header = f"{'tolerance':>10}{'intervals':>10}{'iterations':>11}{'estimated gap':>14}"
    truth = (
        f"true: against {reference.duration:.7f} s, {reference.intervals} intervals, itself "
        f"estimated {reference.gap:.0e} above the optimum"
    )
    return "\n".join([name, f"{header}{'true gap':>12}", *rows, truth])


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_scenes(parser)
    add_tolerances(parser, TOLERANCES)


def run(arguments: argparse.Namespace) -> int:
    tolerances = tuple(arguments.tolerances)
    for file in arguments.scenes:
        progress = ProgressBar().counting(len(tolerances), file.stem)
        print(table(file.stem, gap_study(load_fastest(file), tolerances, progress)), end="\n\n")
    return 0
