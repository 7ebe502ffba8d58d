"""What a scene needs to be modelled: what leaving out each term of a robot does, scene by scene.

As ``deltaopt check SCENE --terms`` for one scene: a motion is planned without a term and measured
with it. Writes terms.csv and draws terms.png; --drawn-again draws it from the file.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import inf
from pathlib import Path

from deltaopt.cli.arguments import load_fastest
from deltaopt.compare.model_terms import effects_of_terms
from deltaopt.files.progress_bar import ProgressBar
from studies.kept_rows import read_rows, rewrite_rows
from studies.problems import PICK_AND_PLACE, PROBLEMS, add_directory, add_drawn_again

SCENES = tuple(
    PROBLEMS / f"{name}.yaml"
    for name in (
        "pick_and_place",
        "industrial_cross",
        "hornet/1_kg",
        "rl5/1_kg",
        "industrial_drive",
    )
)
SMALL = {"scenes": (PICK_AND_PLACE,)}
MATTERS = 0.01
"""Share of a limit or of the duration from which a term matters."""


@dataclass(frozen=True)
class Effect:
    """What leaving out a ``term`` does to a ``scene``: the larger of the share by which a limit is
    exceeded and that by which the duration is wrong; infinite without a plan."""

    scene: str
    term: str
    size: float


def measure(scenes: tuple[Path, ...], progress: Callable[[float, str], None]) -> Iterator[Effect]:
    """Leave out every term of every scene."""
    for file in scenes:
        name = str(file.relative_to(PROBLEMS).with_suffix("")) if PROBLEMS in file.parents else ""
        for effect in effects_of_terms(load_fastest(file), progress):
            size = inf if effect.problem else effect.size
            yield Effect(name or file.stem, effect.term.name, size)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_directory(parser, "terms")
    add_drawn_again(parser)
    parser.set_defaults(scenes=SCENES)


def run(arguments: argparse.Namespace) -> int:
    from studies.plots.terms import draw, title  # slow to import

    file = arguments.directory / "terms.csv"
    if not arguments.drawn_again:
        rewrite_rows(file, measure(arguments.scenes, ProgressBar()))
    effects = read_rows(file, Effect)
    print(title(effects))
    draw(effects, file.with_suffix(".png"))
    return 0
