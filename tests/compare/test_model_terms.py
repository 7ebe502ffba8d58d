"""What leaving out terms of a model does, against what follows from the terms alone."""

from __future__ import annotations

import numpy as np
import pytest

import deltaopt
from deltaopt.compare import model_terms
from deltaopt.compare.model_terms import MODEL_TERMS, effects_of_terms, terms_table
from deltaopt.robot.robot import Robot, load_robot
from studies.problems import PROBLEMS

INERTIA = 0.02


def scene(**drive):
    plain = deltaopt.load_scene(PROBLEMS / "industrial_cross.yaml")
    own = plain.robot.drive.model_copy(update=drive)
    return plain.model_copy(update={"robot": plain.robot.model_copy(update={"drive": own})})


def test_what_a_drives_inertia_does(monkeypatch):
    chosen = tuple(t for t in MODEL_TERMS if t.name in ("drive.inertia", "gravity, its tilt"))
    monkeypatch.setattr(model_terms, "MODEL_TERMS", chosen)
    reports = []
    full, plain = scene(inertia=INERTIA), scene()
    (effect,) = effects_of_terms(full, lambda done, what: reports.append((done, what)))
    assert effect.term.name == "drive.inertia"  # straight gravity has no tilt to leave out
    assert reports == [(0.0, "drive.inertia"), (1.0, "")]

    motion = deltaopt.plan(plain, tolerance=1e-4).trajectory
    _, _, ddq = motion.coordinates_inside(np.linspace(0.0, 1.0, 201))
    found = motion.inside_intervals(np.linspace(0.0, 1.0, 201)).tau + INERTIA * ddq[:, 3::3]
    expected = np.abs(found).max() / full.robot.torque_limits[0] - 1
    assert effect.excess == pytest.approx(expected, rel=1e-4)
    longer = deltaopt.plan(full, tolerance=1e-4).duration
    assert effect.shorter == pytest.approx(1 - motion.duration / longer, abs=3e-4)
    assert 5e-3 < effect.miss < 0.3
    header, row = terms_table([effect])
    assert header.startswith("left out")
    assert row.split()[:2] == ["drive.inertia", "none"]


@pytest.mark.parametrize("term", MODEL_TERMS, ids=lambda term: term.name)
def test_every_term_is_left_out_once(term):
    """A robot with all terms has each, a robot without a term is not changed by leaving it out."""
    full = load_robot(PROBLEMS / "robots/industrial_drive.yaml")
    full = full.model_copy(
        update={
            "gravity": (9.0, 1.0, 0.0),
            "forearm": full.forearm.model_copy(update={"inertia": (2e-2, 1e-3, 2e-2)}),
        }
    )
    without = term.without(full)
    assert without != full
    assert term.without(without) == without
    assert isinstance(without, Robot)


def test_a_plan_that_cannot_be_made_is_said(monkeypatch):
    def impossible(robot: Robot) -> Robot:
        drive = robot.drive.model_copy(update={"torque": 1e-3})
        return robot.model_copy(update={"drive": drive})

    term = model_terms.ModelTerm("strength", "hardly any", impossible)
    monkeypatch.setattr(model_terms, "MODEL_TERMS", (term,))
    (effect,) = effects_of_terms(scene(), lambda done, what: None)
    assert "at rest" in effect.problem
    assert "no plan: start: at rest" in list(terms_table([effect]))[1]
