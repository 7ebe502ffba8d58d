"""Errors that are caught and passed over: what is expected is told, and nothing else is caught.

A handler that raises again translates an error, and is none of these.
"""

from __future__ import annotations

import ast
import logging
from pathlib import Path

import numpy as np
import pytest

from deltaopt import load_scene
from deltaopt.errors import EndMoves, Unreachable
from deltaopt.planning import comparisons
from deltaopt.planning.first_motions import (
    around_bodies,
    initial_motion,
    roadmap,
    through_gates,
)
from deltaopt.planning.journal import Journal
from deltaopt.planning.run import Run
from deltaopt.planning.trajectory_optimiser import TrajectoryOptimiser

PACKAGE = Path(__file__).parents[1] / "deltaopt"
EVERY = {"DeltaOptError", "Exception", "BaseException", None}
WHOLE_RESULTS = {
    "cli/__init__.py": 1,
    "cli/check.py": 1,
    "cli/plan.py": 1,
    "compare/model_terms.py": 1,
    "planning/planner.py": 1,
    "sweeps/run.py": 1,
}
"""How many handlers of a file catch every error: each writes it into a result or a report."""


def catching_every(file: Path) -> int:
    """How many handlers of a file go on after whatever error of ours, or any."""
    found = 0
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        caught: list[ast.expr | None] = []
        if isinstance(node, ast.ExceptHandler) and not isinstance(node.body[-1], ast.Raise):
            caught = [*node.type.elts] if isinstance(node.type, ast.Tuple) else [node.type]
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("suppress", "if_possible"):
            caught = [*node.args]
        names = {None if each is None else ast.unparse(each) for each in caught}
        found += bool(names & EVERY)
    return found


def test_no_other_place_goes_on_after_every_error():
    counted = {str(f.relative_to(PACKAGE)): catching_every(f) for f in PACKAGE.rglob("*.py")}
    assert {name: number for name, number in counted.items() if number} == WHOLE_RESULTS


MOVE = load_scene("problems/pick_and_place.yaml")
LINE = initial_motion.line(MOVE)
RUN = Run(TrajectoryOptimiser(), Journal(lambda _: None))
BAND = np.linspace(MOVE.start, MOVE.goal, 65)
VIA = load_scene("problems/via/three_points.yaml")
PLACES = {
    "a curve": (initial_motion, "_fastest", lambda: list(initial_motion.drivable(MOVE, [LINE]))),
    "a band": (around_bodies, "roughly_fastest", lambda: around_bodies.driven(MOVE, BAND) or []),
    "a grid": (roadmap, "roughly_fastest", lambda: list(roadmap._driven(MOVE, BAND))),
    "splines": (
        through_gates,
        "_spline_at_rest",
        lambda: list(through_gates.through_gates(VIA))[1:],
    ),
    "comparisons": (comparisons, "baseline", lambda: list(comparisons.straight_lines(MOVE))[1:]),
    "a rough duration": (
        TrajectoryOptimiser,
        "on_first_mesh",
        lambda: [each for each in [RUN.roughly(MOVE)] if each],
    ),
}
"""Where one possibility of several may be ruled out: what makes it there, and what is found."""


@pytest.mark.parametrize("name", PLACES)
def test_what_is_ruled_out_is_passed_over_and_told(name, monkeypatch, caplog):
    place, made, found = PLACES[name]

    def ruled_out(*_, **__):
        raise Unreachable("the point is on the moon")

    monkeypatch.setattr(place, made, ruled_out)
    with caplog.at_level(logging.DEBUG, logger="deltaopt.planning"):
        assert list(found()) == []
    assert "set aside: the point is on the moon" in caplog.messages


@pytest.mark.parametrize("name", PLACES)
def test_what_nobody_expects_is_not_passed_over(name, monkeypatch):
    """As a distance that was asked of ends that move once was."""
    place, made, found = PLACES[name]

    def unexpected(*_, **__):
        raise EndMoves("an end of the motion moves")

    monkeypatch.setattr(place, made, unexpected)
    with pytest.raises(EndMoves):
        list(found())
