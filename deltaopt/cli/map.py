"""Plan a move at many places of the cell: how fast is the robot where?

FILE is that of a scene or a cycle, which is planned at all places of a grid, or that of a robot,
for the usual test cycle of packaging robots: 25 mm up, 305 mm across, 25 mm down, with 1 kg. With
--moves N it is N random moves instead. --x, --y, --z: where the middle of the move is, m, as one
number, or FROM TO, or FROM TO STEPS; by default where the robot can be. A map that was stopped goes
on when it is started again.
"""

from __future__ import annotations

import argparse
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from deltaopt.cli.arguments import WrongUsage, large_number, seed
from deltaopt.cli.sweep import add_how, filled
from deltaopt.sensitivity.keys import PLACE
from deltaopt.sweeps.cell_map import ENDS, load_cell
from deltaopt.sweeps.findings import quantiles, told

_NEARLY = 1.05
_DRAWN = ("duration", "rms_share", "singularity")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", type=Path, metavar="FILE", help="scene, cycle or robot file")
    for axis, what in zip("xyz", ("depth below the base", "across", "across"), strict=True):
        parser.add_argument(f"--{axis}", type=float, nargs="+", metavar="M", help=f"{what}, m")
    parser.add_argument("--moves", type=large_number, metavar="N", help="N random moves instead")
    parser.add_argument("--seed", type=seed, default=1, help="of random moves (default 1)")
    add_how(parser)


def run(arguments: argparse.Namespace) -> int:
    cell, stem, of_moves = load_cell(arguments.scene), arguments.scene.stem, bool(arguments.moves)
    ranges = {axis: _range(axis, getattr(arguments, axis), of_moves) for axis in "xyz"}
    if of_moves:
        points = cell.moves(arguments.moves, **ranges, seed=arguments.seed)
    else:
        points = cell.places(**ranges)
    file, table = filled(arguments, f"{stem}_{'moves' if of_moves else 'map'}", points)
    print("\n".join(told(table, points.keys, "duration", worst=of_moves)))
    if table["duration"].isna().all():
        return 1
    if of_moves:
        print(quantiles(table))
    message = (_moves_in_words if of_moves else _places_in_words)(table)
    print(f"{message}\nrows and picture: {file.with_suffix('')}.*")
    if not arguments.no_plot:
        from deltaopt.plots.sweeps import draw_map, draw_moves

        picture = file.with_suffix(".png")
        if of_moves:
            start, goal = np.split(table[[*ENDS]].to_numpy(), 2, axis=1)
            draw_moves(picture, message, table["duration"], np.linalg.norm(goal - start, axis=1))
        else:
            drawn = [each for each in _DRAWN if table[each].notna().any()]
            draw_map(picture, message, table, drawn)
    return 0


def _range(axis: str, given: list[float] | None, is_region: bool) -> tuple[float, ...]:
    """Raises WrongUsage for what is no range."""
    if given is None:
        return ()
    known, rises = (2,) if is_region else (1, 2, 3), sorted(set(given[:2])) == given[:2]
    is_known = len(given) in known and all(n in range(2, 1000) for n in given[2:])
    if not (is_known and rises and all(map(isfinite, given))):
        steps = "" if is_region else ", or FROM TO STEPS with 2 to 999 steps, or one number"
        expected = f"FROM TO in m with FROM below TO{steps}"
        raise WrongUsage(f"--{axis} is {' '.join(map(str, given))}; it must be {expected}")
    return tuple(given)


def _places_in_words(table: Any) -> str:
    best = table.loc[table["duration"].idxmin()]
    duration, x, y, z = best[["duration", *PLACE]]
    near = (table["duration"] <= _NEARLY * duration).sum()
    white = ", white: cannot be done" if table["duration"].isna().any() else ""
    return (
        f"Fastest {x:.3g} m below the base at y = {y:.3g}, z = {z:.3g} m: {duration:.3f} s; "
        f"at most 5 % slower at {near} of {len(table)} places{white}"
    )


def _moves_in_words(table: Any) -> str:
    middle, slow = table["duration"].quantile([0.5, 0.9])
    return f"Half of the moves take less than {middle:.3f} s, nine in ten less than {slow:.3f} s"
