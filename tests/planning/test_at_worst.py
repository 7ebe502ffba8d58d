"""Plans where the method fails from every first motion: a motion that is right is still a plan."""

from __future__ import annotations

import pytest

from deltaopt import load_scene, plan, verify
from deltaopt.errors import NotConverged
from deltaopt.planning.trajectory_optimiser import TrajectoryOptimiser
from studies.problems import PROBLEMS

SCENES = (
    "pick_and_place",
    "limits/rotation",
    "via/three_points",
    "via/onto_a_belt",
    "approach/25_305_25",
    "moving/passed_state",
    "moving/stop",
    "moving/belt",
    "keep_out/inclined",
    "keep_out/wall_25_305_25",
    "keep_out/beside_a_column",
    "smooth/over_a_wall",
)


@pytest.fixture
def broken(monkeypatch):
    """Every solve fails."""

    def fails(*_: object) -> None:
        raise NotConverged("a solver that always fails", "Broken", None)

    monkeypatch.setattr(TrajectoryOptimiser, "plan", fails)
    monkeypatch.setattr(TrajectoryOptimiser, "on_first_mesh", fails)


@pytest.mark.parametrize("name", SCENES)
def test_a_first_motion_that_is_right_is_the_plan(name, broken):
    scene = load_scene(PROBLEMS / f"{name}.yaml")
    found = plan(scene)
    assert verify(scene, found.trajectory).ok
    assert not found.within_tolerance


@pytest.mark.parametrize("name", [*SCENES[:8], "keep_out/wall_25_305_25"])
def test_it_is_improved_where_the_method_succeeds_from_it(name, monkeypatch):
    """Of attempts those alone fail that do not begin on the mesh of a motion."""
    scene, planned = load_scene(PROBLEMS / f"{name}.yaml"), TrajectoryOptimiser.plan
    best = plan(scene)

    def fails(optimiser, attempt, report):
        if attempt.on_its_mesh:
            return planned(optimiser, attempt, report)
        raise NotConverged("a solver that fails from elsewhere", "Broken", None)

    monkeypatch.setattr(TrajectoryOptimiser, "plan", fails)
    found = plan(scene)
    assert verify(scene, found.trajectory).ok
    assert best.duration / (1 + best.gap) <= found.duration < 1.01 * best.duration


def test_the_gap_that_is_told_is_not_too_small(monkeypatch, request):
    scene = load_scene(PROBLEMS / "via" / "three_points.yaml")
    best = plan(scene)
    request.getfixturevalue("broken")
    worst = plan(scene)
    assert best.duration < worst.duration
    assert worst.duration / (1 + worst.gap) <= best.duration
