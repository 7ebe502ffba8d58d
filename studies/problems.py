"""The shipped robots and scenes that studies run on, and the arguments that choose others."""

from __future__ import annotations

import argparse
from pathlib import Path

PROBLEMS = Path(__file__).parents[1] / "problems"
SCENES = tuple(
    PROBLEMS / f"{name}.yaml"
    for name in ("industrial_cross", "light_and_fast", "long_diagonal", "pick_and_place")
)
"""The scenes of the documented figures."""
ROBOTS = (PROBLEMS / "robots" / "orsino.yaml", PROBLEMS / "robots" / "industrial.yaml")
"""The two robots of the documented figures."""
CROSS, LIGHT, _, PICK_AND_PLACE = SCENES
ORSINO, INDUSTRIAL = ROBOTS


def shipped_scenes() -> list[Path]:
    """The files of all shipped single motions: no robots, cycles, sweeps and designs."""
    others = tuple(PROBLEMS / name for name in ("robots", "cycles", "sweeps", "design"))
    return [file for file in sorted(PROBLEMS.rglob("*.yaml")) if file.parent not in others]


def add_scenes(parser: argparse.ArgumentParser, default: tuple[Path, ...] = SCENES) -> None:
    """Add SCENE..., ``default`` where none is given."""
    names = " ".join(file.stem for file in default)
    parser.add_argument(
        "scenes",
        nargs="*",
        type=Path,
        default=default,
        metavar="SCENE",
        help=f"scene files (default: {names})",
    )


def add_drawn_again(parser: argparse.ArgumentParser) -> None:
    """Add --drawn-again."""
    parser.add_argument(
        "--drawn-again",
        action="store_true",
        help="draw what an earlier run has written, and compute nothing",
    )


def add_directory(parser: argparse.ArgumentParser, name: str, what: str = "files") -> None:
    """Add -o DIR, the directory of ``what``; ``out/name`` by default."""
    default = Path("out") / name
    parser.add_argument(
        "-o",
        dest="directory",
        type=Path,
        metavar="DIR",
        default=default,
        help=f"directory of {what} (default: {default})",
    )
