"""Arguments that several commands share."""

from __future__ import annotations

import argparse
from functools import partial
from math import isfinite
from pathlib import Path

from deltaopt.errors import SceneError, Unusable
from deltaopt.files.output_folder import require_writable
from deltaopt.files.units import MASS, Misread
from deltaopt.scene.objective import Time
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import load_scene
from deltaopt.settings import MOST, MOST_INTERVALS, TOLERANCES


class WrongUsage(Unusable):
    """An argument contradicts another one or asks for what no file can hold."""


def add_flag(parser: argparse.ArgumentParser, name: str, words: str) -> None:
    """Add an option without a value: False, or True where it is given."""
    parser.add_argument(name, action="store_true", help=words)


def add_json(parser: argparse.ArgumentParser, of_several: str = "") -> None:
    """Add the option --json, for machines; ``of_several``: what it prints of several files."""
    words = f"print one JSON object{of_several} and no tables; SI units"
    add_flag(parser, "--json", words)


def add_output(
    parser: argparse.ArgumentParser,
    default: Path | None = None,
    kind: str = "DIR",
    words: str = "directory to write to, made if need be (default: out/ and the scene's name)",
) -> None:
    """Add the option -o, what to write to: a ``kind`` of thing, in these words if there is no
    single default."""
    said = words if default is None else f"default: {default}"
    parser.add_argument("-o", "--output", type=folder, default=default, metavar=kind, help=said)


def load_fastest(file: Path) -> Scene:
    """Read a scene for a study that compares durations.

    Raises SceneError if it cannot be used or its objective is not time.
    """
    scene = load_scene(file)
    if not isinstance(scene.objective, Time):
        expected = "the word time: this command compares durations"
        problem = f"is {scene.objective}"
        raise SceneError(file, "objective", scene.objective, expected, problem)
    return scene


def output_directory(arguments: argparse.Namespace) -> Path:
    """The directory to write to, checked now so that an error comes before any work.

    Raises OSError if it cannot be made or written to.
    """
    scene: Path = arguments.scene
    directory: Path = arguments.output or Path("out") / scene.stem
    require_writable(directory)
    return directory


def folder(text: str) -> Path:
    """A path that is not empty, for argparse: a shell's variable may be unset."""
    if not text:
        raise argparse.ArgumentTypeError("the name of the directory is empty")
    return Path(text)


def positive(text: str) -> float:
    """A finite number greater than 0, for argparse."""
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not (isfinite(number) and number > 0):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number greater than 0")
    return number


def optimality_gap(text: str) -> float:
    """A tolerance of plans, for argparse."""
    least, most = TOLERANCES
    if not least <= positive(text) <= most:
        expected = f"from {least:g} to {most:g}, such as 0.01 for one per cent"
        raise argparse.ArgumentTypeError(f"{text!r} is no share {expected}")
    return positive(text)


def kilograms(text: str) -> float:
    """A mass greater than 0 in kg, for argparse: a number, or a text with a unit such as 500 g."""
    try:
        return positive(str(MASS.in_si(text)))
    except Misread as error:
        raise argparse.ArgumentTypeError(f"{text!r} {error}") from None
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a mass greater than 0") from None


def _whole(text: str, least: int, most: int) -> int:
    """A whole number between two others, for argparse."""
    is_short = text.isascii() and text.isdigit() and len(text) <= len(str(most))
    if not (is_short and least <= int(text) <= most):
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from {least} to {most}")
    return int(text)


one_or_more = partial(_whole, least=1, most=MOST)
large_number = partial(_whole, least=1, most=999_999)
"""Of moves or places of a campaign."""
seed = partial(_whole, least=0, most=2**63 - 1)
first_intervals = partial(_whole, least=2, most=MOST_INTERVALS)
"""Of a first mesh."""


def output_folders(arguments: argparse.Namespace) -> dict[Path, Path]:
    """The directory to write to of each scene's file, checked before any work.

    Raises WrongUsage where two scenes would share one, and OSError where one cannot be written to.
    """
    scenes: list[Path] = arguments.scenes
    output: Path | None = arguments.output
    found: dict[Path, Path] = {}
    for file in scenes:
        if output is None:
            directory = Path("out") / file.stem
            directory = directory / "baseline" if arguments.baseline else directory
        else:
            directory = output if len(scenes) == 1 else output / file.stem
        if directory in found.values():
            other = next(scene for scene, taken in found.items() if taken == directory)
            raise WrongUsage(
                f"{other} and {file} would both be written to {directory}: plan them one by one, "
                "with --output"
            )
        found[file] = directory
    return found
