"""From a plan to a controller's table, and what the table will ask for.

A controller interpolates between the rows of a table. Where torques jump between two rows, that
asks for more than the plan; so the interpolated table is measured before it is written, and slowed
if it must be.
"""

import sys
from pathlib import Path

import deltaopt
from deltaopt.cli import main as command

SCENE = Path(__file__).parents[1] / "problems/pick_and_place.yaml"


def main(folder="out/pick_and_place"):
    folder = Path(folder)
    deltaopt.plan(deltaopt.load_scene(SCENE)).save(folder)
    again = deltaopt.load_plan(folder)  # to the last bit
    print(f"planned: {again.duration:.6f} s")
    every_millisecond = ["--cycle", "1ms", "--keep-limits", "-o", str(folder / "table.csv")]
    command(["export", "table", str(folder), *every_millisecond])
    command(["export", "c", str(folder), "-o", str(folder / "c")])


if __name__ == "__main__":
    main(*sys.argv[1:])
