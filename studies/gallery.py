"""The pictures of docs/gallery.md and of the pages by job: what `deltaopt plan` draws."""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from deltaopt.cli import main
from studies.problems import PROBLEMS, add_directory

SCENES: Mapping[str, Path] = {
    name: PROBLEMS / f"{scene}.yaml"
    for name, scene in {
        "belt": "moving/belt",
        "into_a_box": "keep_out/into_a_box",
        "over_a_wall": "smooth/over_a_wall",
        "approach": "approach/25_305_25",
        "glue_line": "paths/glue_line",
        "tube": "paths/tube",
        "cycle": "cycles/there_and_back",
        "cell": "cycles/cell",
        "platform_speed": "limits/platform_speed",
        "within": "via/within",
        "column": "keep_out/beside_a_column",
        "gently": "objectives/pick_and_place_gently",
    }.items()
}
"""Scenes by the name of their picture."""
SMALL = {"only": ("platform_speed",)}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "only", nargs="*", metavar="NAME", default=tuple(SCENES), help=f"of {', '.join(SCENES)}"
    )
    add_directory(parser, "gallery", "the pictures")


def run(arguments: argparse.Namespace) -> int:
    names: Sequence[str] = arguments.only
    arguments.directory.mkdir(parents=True, exist_ok=True)
    for name in names:
        with TemporaryDirectory() as folder:
            code = main(["plan", str(SCENES[name]), "-o", folder])
            if code != 0:
                return code
            drawn = sorted(Path(folder).glob("*.png"))
            file = arguments.directory / f"gallery_{name}.png"
            shutil.copy(drawn[0], file)
        print(f"written: {file}, {file.stat().st_size / 1e3:.0f} kB")
    return 0
