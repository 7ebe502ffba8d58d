"""The shipped scenes and the five-bar as cases of the comparison, built once."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import deltaopt
from deltaopt.compare.plans.cases import FiveBarTask, delta_case

PROBLEMS = Path(__file__).parents[1] / "problems"


@cache
def case(scene):
    """By the name of its file, or five_bar."""
    if scene == "five_bar":
        return FiveBarTask().case
    return delta_case(scene, deltaopt.load_scene(PROBLEMS / f"{scene}.yaml"))
