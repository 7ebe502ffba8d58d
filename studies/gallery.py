"""The pictures of docs/gallery.md and of the pages by job: what `deltaopt plan` draws, made small.

Each shipped scene is planned by the command itself; its picture is drawn for print and would be
four times as large as pages need.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from deltaopt.cli import main
from deltaopt.files.atomic_write import atomic_write
from studies.problems import PROBLEMS, add_directory

HELP = "draw the gallery: the pictures of a dozen shipped scenes"
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
_WIDTH, _COLOURS = 1080, 128
"""Pixels, and colours, of a picture: some 100 kB."""


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
            _make_small(drawn[0], file)
        print(f"written: {file}, {file.stat().st_size / 1e3:.0f} kB")
    return 0


def _make_small(source: Path, file: Path) -> None:
    """Write a picture with fewer pixels and colours."""
    with Image.open(source) as picture:
        height = round(picture.height * _WIDTH / picture.width)
        smaller = picture.convert("RGB").resize((_WIDTH, height), Image.Resampling.LANCZOS)
    method = Image.Quantize.MAXCOVERAGE  # thin lines keep their colours
    few = smaller.quantize(_COLOURS, method, dither=Image.Dither.NONE)
    with atomic_write(file) as temporary:
        few.save(temporary, format="PNG", optimize=True)
