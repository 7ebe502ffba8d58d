"""Compile the C of the default model into a folder, for a wheel: ``default_model.py DIR``.

Lengths, masses and limits are data: what is compiled for one robot serves every robot with the same
terms. So a move is planned and verified for each usual choice of terms, by CasADi's interpreter,
and the C of which machine code is asked for meanwhile is what a wheel carries. Bars with moments of
inertia of their own, which no shipped robot has, are left out: their C takes a compiler minutes. A
wheel carries what lies in ``deltaopt/codegen/prebuilt`` when it is built (``.ci/wheel``).
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import deltaopt
from deltaopt.codegen.c_compiler import compiler
from deltaopt.codegen.compile import recording
from deltaopt.codegen.prebuilt import prebuild
from deltaopt.robot.robot import Drive
from deltaopt.scene.objective import Effort, Objective, Time

PROBLEMS = Path(__file__).parents[1] / "problems"


def scenes() -> Iterator[deltaopt.Scene]:
    """The shipped scenes of usual terms, and one move with and without a payload and limits of
    speed, for time and for effort."""
    files = (*PROBLEMS.glob("*.yaml"), *PROBLEMS.glob("objectives/*.yaml"))
    yield from map(deltaopt.load_scene, sorted(files))
    shipped = deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml")
    objectives: tuple[Objective, ...] = (Time(), Effort(duration=0.28))
    for payload, speed, objective in product((1.0, None), (None, 20.0), objectives):
        robot = shipped.robot.model_copy(update={"drive": Drive(torque=10.0, speed=speed)})
        yield shipped.model_copy(
            update={"robot": robot, "payload": payload, "objective": objective}
        )


def sources(scene: deltaopt.Scene) -> list[str]:
    """The C that planning a scene, verifying the plan and drawing it ask for, and the timing of the
    straight line that it is compared with."""
    with recording() as asked, TemporaryDirectory() as folder:
        deltaopt.plan(scene).save(folder)
        if scene.path is None and isinstance(scene.objective, Time):
            deltaopt.timed_line(scene)
    return list(asked)


def main() -> None:
    """Compile into the folder that the command line names, on all cores."""
    folder, found = Path(sys.argv[1]), compiler()
    if found is None:
        sys.exit("no C compiler")
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        asked = dict.fromkeys(text for texts in pool.map(sources, scenes()) for text in texts)
    prebuild(sorted(asked, key=len, reverse=True), folder, found)
    print(f"{len(asked)} libraries for each level, by {found.version}")


if __name__ == "__main__":
    main()
