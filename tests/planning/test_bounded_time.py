"""What would take hours is refused in a sentence that names what would be right."""

from __future__ import annotations

from math import sin

import pytest

import deltaopt
from deltaopt.cli import main
from deltaopt.errors import Infeasible, SceneError
from deltaopt.planning.flat.flat_problem import FlatProblem
from studies.problems import PROBLEMS

SCENE = deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml")


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"tolerance": 1e-12}, "tolerance is 1e-12; it must be at least 1e-09"),
        ({"tolerance": 1e-300}, "tolerance is 1e-300; it must be at least 1e-09"),
        ({"intervals": 9999}, "intervals is 9999; it must be at most 1000"),
    ],
)
def test_settings_beyond_what_can_be_done(settings, told, capsys):
    with pytest.raises(ValueError, match=f"^{told}$"):
        deltaopt.plan(SCENE, **settings)
    ((name, value),) = settings.items()
    with pytest.raises(SystemExit):
        main(["plan", str(PROBLEMS / "pick_and_place.yaml"), f"--{name}", str(value)])
    assert f"--{name}: '{value}' is " in capsys.readouterr().err


def test_the_least_tolerance_is_met():
    assert deltaopt.plan(SCENE, tolerance=1e-9).gap <= 1e-9


def test_a_thousand_via_points():
    points = [(0.45 + 0.01 * sin(k), -0.05 + 1.5e-4 * k, 0.0) for k in range(1, 1000)]
    with pytest.raises(SceneError, match=r"via is .* expected at most 100 points"):
        SCENE.model_copy(update={"via": points})
    assert len(SCENE.model_copy(update={"via": points[:100]}).via) == 100


def test_hundreds_of_hulls():
    corners = [(0.45, 0.3, 0.3), (0.46, 0.3, 0.3), (0.45, 0.31, 0.3), (0.45, 0.3, 0.31)]
    hull = {"hull": {"points": corners}}
    content = SCENE.model_dump(exclude_none=True)
    with pytest.raises(SceneError, match="keep_out is 65; expected at most 64 pairs"):
        deltaopt.Scene.model_validate({**content, "keep_out": [hull] * 65})


def test_least_effort_in_hours():
    """It was planned for minutes, and then again from other first motions."""
    hours = SCENE.model_copy(update={"objective": deltaopt.Effort(duration=1e3)})
    with pytest.raises(Infeasible, match=r"duration is 1000 s, .*; expected at most 141 s"):
        deltaopt.plan(hours)


def test_other_first_motions_are_not_tried_where_a_motion_waits(monkeypatch):
    """They lead to the same plan: which waits is a first guess whatever the first motion is."""
    monkeypatch.setattr(FlatProblem, "finest", 40)  # few meshes, which miss the tolerance
    long = SCENE.model_copy(update={"objective": deltaopt.Effort(duration=1.0)})
    found = deltaopt.plan(long, tolerance=1e-7)
    assert not found.within_tolerance
    assert len(found.journal) == 1
