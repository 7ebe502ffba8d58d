"""Every chart of the documentation: by which command it is drawn, and what it says.

The sentence is what a reader who sees nothing but the picture can say after ten seconds: it was
written down before the caption was read. Where picture and caption said different things the
picture was changed.
"""

from __future__ import annotations

import argparse
import shutil
from dataclasses import dataclass
from pathlib import Path

HELP = "list every chart of the documentation, its command, and what it says"
SMALL: dict[str, object] = {}
STUDY = "python -m studies "


@dataclass(frozen=True)
class Chart:
    """A picture in docs/: ``file``, its ``command``, the file under ``out`` that this draws (empty
    where the command is given the name), and what it ``says``."""

    file: str
    command: str
    drawn: str
    says: str

    @property
    def study(self) -> str:
        """Return the study that draws it; empty for a command of the package."""
        return self.command.removeprefix(STUDY).split()[0] if STUDY in self.command else ""


CHARTS = (
    Chart(
        "benchmarks_integrators.png",
        STUDY + "benchmarks integrators",
        "benchmarks/integrators.png",
        "Adams is cheapest where nothing is stiff, and by far dearest for the stiff governor.",
    ),
    Chart(
        "benchmarks_windows.png",
        STUDY + "benchmarks windows",
        "benchmarks/windows.png",
        "With many bodies L_I with a sparse solver costs least; only it grows as N.",
    ),
    Chart(
        "conventions.png",
        STUDY + "conventions",
        "conventions/conventions.png",
        "Motor 2 is 120° on from motor 1, x points down, an arm above level is positive.",
    ),
    Chart(
        "driven.png",
        STUDY + "driven",
        "driven/driven.png",
        "Fast past a singularity Adams costs least; Gauss's fixed step fails at one of the two.",
    ),
    Chart(
        "dynamics.png",
        "deltaopt compare dynamics",
        "",
        "All models err by a few 1e-16; those in closed form take least time, compiled a tenth.",
    ),
    Chart(
        "frontier.png",
        STUDY + "frontier",
        "frontier/frontier.png",
        "At every gap below 1 % deltaopt's default (blue) is the quickest, by ten times and more.",
    ),
    Chart(
        "gap.png",
        STUDY + "gap",
        "gap/gap.png",
        "Plans tell a little more than their true gap; few of thousands tell too little.",
    ),
    Chart(
        "into_a_box.png",
        "deltaopt plan problems/keep_out/into_a_box.yaml",
        "",
        "0.181 s into a box, over its rim, instead of 0.228 s up, across and down.",
    ),
    Chart(
        "lower_bound.png",
        STUDY + "lower_bound",
        "lower_bound/lower_bound.png",
        "Half the industrial robot's plans are within 5 % of the bound; Orsino's is loose.",
    ),
    Chart(
        "model_terms.png",
        "deltaopt check problems/industrial_drive.yaml --terms",
        "",
        "Without the forearms' mass a plan exceeds limits by a third and misses by 65 mm.",
    ),
    Chart(
        "over_a_wall.png",
        "deltaopt plan problems/keep_out/wall_25_305_25.yaml",
        "",
        "0.147 s over a wall, instead of 0.176 s up, across and down.",
    ),
    Chart(
        "paths_work.png",
        STUDY + "given_paths --work problems/pick_and_place.yaml --plot docs/paths_work.png",
        "",
        "At equal error our sweeps take a hundredth of TOPP-RA's time, and fewer intervals.",
    ),
    Chart(
        "report.png",
        "deltaopt plan problems/pick_and_place.yaml --report",
        "",
        "A page with the moving robot, every limit over time, and what limits the motion.",
    ),
    Chart(
        "resolution.png",
        STUDY + "tolerances",
        "tolerances/resolution.png",
        "Resolving switches gives eight digits in the time in which meshes give four.",
    ),
    Chart(
        "stability_benchmarks.png",
        STUDY + "stability benchmarks",
        "stability/benchmarks.png",
        "A02 projected is solved by all that can be built, free it is not; A04 by a third.",
    ),
    Chart(
        "stability_drift.png",
        STUDY + "stability drift",
        "stability/drift.png",
        "Minimal coordinates drift least for least work; Baumgarte at 300 rad/s is stiff.",
    ),
    Chart(
        "stability_edge.png",
        STUDY + "stability edge",
        "stability/edge.png",
        "Every scene at the edge ends in a verified plan or an error that names the cause.",
    ),
    Chart(
        "stability_singularities_delta.png",
        STUDY + "stability singularities",
        "stability/singularities_delta.png",
        "Which way loses digits depends on the singularity; L_I with pivoting loses least.",
    ),
    Chart(
        "stability_singularities_pendulum.png",
        STUDY + "stability singularities",
        "stability/singularities_pendulum.png",
        "For the pendulum only sparse QR fails; the others keep what rounding leaves.",
    ),
    Chart(
        "tilt.png",
        STUDY + "tilt",
        "tilt/tilt.png",
        "Towards the tilt forces in bars grow without bound while motors feel nothing.",
    ),
    Chart(
        "tutorial_effort.png",
        STUDY + "tutorial",
        "tutorial/tutorial_effort.png",
        "One per cent more time saves a quarter of the effort.",
    ),
    Chart(
        "tutorial_plan.png",
        STUDY + "tutorial",
        "tutorial/tutorial_plan.png",
        "The plan takes less time than the timed straight line; torques are at their limits.",
    ),
    Chart(
        "tutorial_table.png",
        STUDY + "tutorial",
        "tutorial/tutorial_table.png",
        "A cubic table exceeds the torques at switches; a quintic one at the knots does not.",
    ),
    Chart(
        "which_model.png",
        STUDY + "models",
        "models/models.png",
        "Eq. (55) is cheapest and fails at stretched arms; motor angles fail at bars in one plane.",
    ),
)


def copy_charts(study: str, into: Path) -> list[Path]:
    """Copy what a study has drawn under ``out`` to a folder, under the names of docs/; return what
    was copied."""
    found = [c for c in CHARTS if c.study == study and c.drawn and (Path("out") / c.drawn).exists()]
    return [Path(shutil.copyfile(Path("out") / c.drawn, into / c.file)) for c in found]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """It has none."""


def run(arguments: argparse.Namespace) -> int:
    print("| chart | drawn by | what it says |\n|---|---|---|")
    for chart in CHARTS:
        name = f"[{chart.file.removesuffix('.png')}]({chart.file})"
        print(f"| {name} | `{chart.command}` | {chart.says} |")
    return 0
