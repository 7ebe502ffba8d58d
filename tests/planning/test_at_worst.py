"""Plans where the method fails from every first motion: a motion that is right is still a plan."""

from __future__ import annotations

import re

import numpy as np
import pytest

from deltaopt import SmoothMotion, load_scene, plan, verify
from deltaopt.errors import NotConverged
from deltaopt.planning.attempts import Attempt
from deltaopt.planning.first_motions.initial_motion import line
from deltaopt.planning.first_motions.moving_ends import from_state_to_state
from deltaopt.planning.journal import Journal
from deltaopt.planning.loop import Loop
from deltaopt.planning.trajectory_optimiser import TrajectoryOptimiser
from studies.bench.statics import Statics
from studies.problems import PROBLEMS
from tests.hard_scenes import hard_scene

SCENES = (
    "pick_and_place",
    "limits/rotation",
    "via/three_points",
    "via/onto_a_belt",
    "approach/25_305_25",
    "moving/passed_state",
    "moving/stop",
    "moving/belt",
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


@pytest.mark.parametrize(
    "name", ["limits/rotation", "via/onto_a_belt", "moving/stop", "keep_out/wall_25_305_25"]
)
def test_it_is_improved_where_the_method_succeeds_from_it(name, monkeypatch):
    """Of attempts those alone fail that do not begin on the mesh of a motion."""
    scene, planned = load_scene(PROBLEMS / f"{name}.yaml"), TrajectoryOptimiser.plan
    best = plan(scene)

    def fails(optimiser, attempt, report):
        if attempt.on_twice_its_mesh:
            return planned(optimiser, attempt, report)
        raise NotConverged("a solver that fails from elsewhere", "Broken", None)

    monkeypatch.setattr(TrajectoryOptimiser, "plan", fails)
    found = plan(scene)
    assert verify(scene, found.trajectory).ok
    assert best.duration / (1 + best.gap) <= found.duration < 1.01 * best.duration


def test_a_share_of_the_fastest_is_not_one_of_a_slow_motion():
    """Hardly slower than the fastest there is no time for the ramps of a coarse mesh."""
    fastest = load_scene(PROBLEMS / "long_diagonal.yaml")
    objective = SmoothMotion(of_fastest=1.00001)
    found = plan(fastest.model_copy(update={"objective": objective}), intervals=4, tolerance=1e-2)
    assert found.duration == pytest.approx(plan(fastest).duration, rel=3e-3)
    assert found.within_tolerance


def test_the_gap_that_is_told_is_not_too_small(monkeypatch, request):
    scene = load_scene(PROBLEMS / "via" / "three_points.yaml")
    best = plan(scene)
    request.getfixturevalue("broken")
    worst = plan(scene)
    assert best.duration < worst.duration
    assert worst.duration / (1 + worst.gap) <= best.duration


def refusal(scene, motion) -> str:
    """What is said where the one attempt that was made began with a motion."""
    attempts = [Attempt(scene, motion, 16, "the motion")]
    with pytest.raises(NotConverged) as error:
        Loop(TrajectoryOptimiser(), Journal(lambda _: None), attempts).at_worst(scene, failing)
    said = str(error.value)
    assert said.startswith("no motion was found")
    assert said.endswith("may lead to one, for no search is complete")
    assert "one attempt was made" in said
    assert "interior-point" not in said
    return said


def failing(_: object) -> None:
    raise NotConverged("the interior-point method does not converge", "No_Progress", None)


def numbers(said: str, pattern: str) -> list[float]:
    found = re.search(pattern, said)
    assert found, said
    return [float(number) for group in found.groups() for number in group.split(", ")]


def test_a_torque_that_gravity_exceeds_is_named_with_its_place():
    """Against the robot at rest written out anew."""
    scene = hard_scene("25_un_haptic")
    pattern = r"the motion: at rest at \[(.*)\] m the torque of motor (.) is (.*) N·m, where"
    x, y, z, motor, torque = numbers(refusal(scene, line(scene)), pattern)
    expected = Statics(scene.robot, scene.payload or 0.0).at(np.array([[x, y, z]])).torques[0]
    np.testing.assert_allclose(torque, expected[int(motor) - 1], rtol=2e-3)
    assert abs(torque) > scene.robot.torque_limits[int(motor) - 1]


def test_a_place_out_of_reach_is_named_with_the_chain():
    scene = hard_scene("05_nc_massless")
    pattern = r"the motion: the platform cannot be at \[(.*)\] m: arm and bars of chain (.) cannot"
    x, y, z, chain = numbers(refusal(scene, line(scene)), pattern)
    angles = Statics(scene.robot, 0.0).at(np.array([[x, y, z]])).angles[0]
    assert np.isnan(angles[int(chain) - 1])


def test_a_motion_that_may_not_be_slowed_is_named_with_how_slow_it_would_have_to_be(monkeypatch):
    """By the limits of the motors, at samples of the motion and of the slowed one."""
    monkeypatch.setattr("deltaopt.planning.loop.slow_motions", lambda _: ())
    scene = load_scene(PROBLEMS / "moving" / "passed_state.yaml")
    motion = from_state_to_state(scene, 2.0)
    (factor,) = numbers(refusal(scene, motion), r"the motion would have to take (.*) times as long")
    assert 1.2 < factor < 2.0
    model, most = motion.model, np.array(scene.robot.torque_limits)
    for slowed, expected in ((1.0, 1.2), (factor, 1.0)):
        x, v, a = motion.slowed(slowed).path_inside(np.linspace(0.0, 1.0, 400))
        _, rates, _ = model.motion(x, v, a)
        torques = np.abs(model.inverse_dynamics(x, v, a) / most).max()
        speeds = np.abs(rates[:, model.functions.motors]).max() / scene.robot.drive.speed
        worst = max(torques, speeds)
        assert worst > expected if slowed == 1.0 else worst == pytest.approx(1.0, abs=6e-3)


def test_what_is_not_known_is_not_told():
    """A motion that keeps all limits but for its ends: only what was tried and may help is said."""
    scene = load_scene(PROBLEMS / "pick_and_place.yaml")
    x, y, z = scene.goal
    elsewhere = line(scene.model_copy(update={"goal": (x, y, z + 0.01)}))
    said = refusal(scene, elsewhere)
    assert said.count(";") == 2
    assert "the motion" not in said


def test_a_motion_from_rest_to_rest_is_not_blamed_for_ends_that_move(monkeypatch):
    """Ways past bodies are such: slowed, it would still not begin in motion."""
    monkeypatch.setattr("deltaopt.planning.loop.slow_motions", lambda _: ())
    scene = load_scene(PROBLEMS / "moving" / "passed_state.yaml")
    start, goal = (tuple(point) for point in scene.given_points)
    at_rest = line(scene.model_copy(update={"start": start, "goal": goal}))
    assert "times as long" not in refusal(scene, at_rest)
