"""Structures of a closed chain: motors at two limits at once, and wrong ones put right."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from deltaopt import Planner, verify
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.switching.active_set import ActiveSetUpdate
from deltaopt.planning.switching.conditions import state_rows
from deltaopt.planning.switching.kkt_system import KKTSystem
from deltaopt.planning.switching.newton import solve_conditions
from deltaopt.planning.switching.residuals import OptimalityResiduals
from deltaopt.planning.switching.resolution import ResolvedMotion, SwitchResolution
from deltaopt.planning.switching.structure import (
    SwitchingStructure,
)
from tests import planned_scenes
from tests.oracles.shooting import shoot
from tests.planned_scenes import machine_code, random_move, scaling_of

NUMBER = 6
"""Of a random move of industrial: one of its arcs holds a motor at both of its limits."""


@cache
def resolved(number: int) -> ResolvedMotion:
    return planned_scenes.resolved(random_move("industrial", number))


def at_once(structure: SwitchingStructure) -> list[tuple[int, int]]:
    """(arc, motor) where velocity and control are at their limits."""
    return [
        tuple(each) for each in np.argwhere((structure.state(1) != 0) & (structure.control != 0))
    ]


def test_a_motor_at_its_limits_of_speed_and_torque():
    """Verified, and as fast as meshes, which know of no structure."""
    scene, found = random_move("industrial", NUMBER), resolved(NUMBER)
    both = at_once(found.conditions.structure)
    assert both
    assert verify(scene, found.trajectory.slowed(found.safe_factor)).ok
    ends = np.concatenate([[0.0], np.cumsum(found.conditions.structure.lengths)])
    for arc, motor in both:
        times = found.trajectory.duration * np.linspace(*ends[arc : arc + 2], 9)[1:-1]
        motion = found.trajectory(times)
        assert np.abs(motion.tau[:, motor]) == pytest.approx(
            scene.robot.torque_limits[motor], rel=1e-6
        )
        dtheta = found.trajectory.model.motion(motion.x, motion.v, motion.a)[1][:, 3 + 3 * motor]
        assert np.abs(dtheta) == pytest.approx(scene.robot.speed_limits[motor], rel=1e-6)


def test_shooting_finds_the_same():
    """By forward dynamics in twelve coordinates, from lengths that are a little off."""
    scene, found = random_move("industrial", NUMBER), resolved(NUMBER)
    structure = found.conditions.structure
    off = 1 + 1e-3 * np.random.default_rng(1).uniform(-1, 1, len(structure.lengths))
    duration = found.trajectory.duration
    shot = shoot(scene, replace(structure, lengths=structure.lengths * off), duration)
    assert shot.duration == pytest.approx(duration, rel=1e-8)


@machine_code
@pytest.mark.parametrize("number", [NUMBER, 13])
def test_meshes_are_not_faster(number):
    scene, found = random_move("industrial", number), resolved(number)
    planner = Planner(scene.robot, 1.0, tolerance=1e-6, resolved_below=0.0)
    on_meshes = planner.plan(scene.start, scene.goal).duration
    assert found.trajectory.duration == pytest.approx(on_meshes, rel=3e-6)


@machine_code
def test_a_velocity_that_touches_its_limit():
    """At one instant, where the costates jump, and not before or after it."""
    scene, found = random_move("industrial", 13), resolved(13)
    structure = found.conditions.structure
    contacts = np.array([[limit.contacts[1] for limit in arc] for arc in structure.limits])
    (arc, motor) = np.argwhere(contacts)[0]
    ends = np.cumsum(structure.lengths) * found.trajectory.duration
    instant, apart = ends[arc - 1], 0.02 * ends[-1]
    at = [speed(found.trajectory, t)[motor] for t in (instant - apart, instant, instant + apart)]
    limit = scene.robot.speed_limits[motor]
    assert abs(at[1]) == pytest.approx(limit, rel=1e-8)
    assert max(abs(at[0]), abs(at[2])) < limit * (1 - 1e-4)


def speed(trajectory: Trajectory, time: float) -> np.ndarray:
    """θ̇ of the motors, rad/s."""
    motion = trajectory([time])
    return trajectory.model.motion(motion.x, motion.v, motion.a)[1][0, 3::3]


def resolved_from(structure: SwitchingStructure) -> ResolvedMotion:
    found, scene = resolved(NUMBER), random_move("industrial", NUMBER)
    resolution = SwitchResolution(found.conditions.rows, scaling_of(scene), 1e-6)
    return resolution.from_structure(structure, found.trajectory)


@pytest.mark.parametrize("longer", [0.6, 1.5])
def test_a_disturbed_structure_is_found_again(longer):
    """One arc shorter or longer: its switches are variables."""
    right = resolved(NUMBER)
    lengths = right.conditions.structure.lengths.copy()
    lengths[3] *= longer
    found = resolved_from(replace(right.conditions.structure, lengths=lengths / lengths.sum()))
    assert found.trajectory.duration == pytest.approx(right.trajectory.duration, rel=1e-8)
    assert found.conditions.structure.limits == right.conditions.structure.limits


def test_what_is_missing_is_put_in():
    """An arc where another motor's torque holds the speed, left to the arc before it."""
    right = resolved(NUMBER).conditions.structure
    arc = at_once(right)[0][0]
    lengths = np.delete(right.lengths, arc)
    lengths[arc - 1] += right.lengths[arc]
    found = resolved_from(SwitchingStructure(lengths, right.limits[:arc] + right.limits[arc + 1 :]))
    assert found.trajectory.duration == pytest.approx(
        resolved(NUMBER).trajectory.duration, rel=1e-8
    )
    assert found.conditions.structure.limits == right.limits


def residuals(number: int) -> OptimalityResiduals:
    right, scaling = resolved(number), scaling_of(random_move("industrial", number))
    conditions = right.conditions
    point = solve_conditions(conditions, right.trajectory, scaling).point
    return OptimalityResiduals(conditions, point, 5e-7)


@pytest.mark.parametrize("number", [NUMBER, 13])
def test_what_is_held_makes_the_hamiltonian_least(number):
    """By costates, p · (V, A), against a grid of torques within their limits that keep the state
    limits; and it is the vertex that an update would choose."""
    e = residuals(number)
    update, conditions = ActiveSetUpdate(e), e.conditions
    rows, costates = conditions.rows, KKTSystem(conditions, e.point).costates[:, 3:]
    grid = np.linspace(-1, 1, 21)
    for i, arc in enumerate(conditions.mesh.arc):
        limits = conditions.structure.limits[arc]
        assert update._vertex(i, 10, limits) == [limit.control for limit in limits]
        slopes, states = update._slopes[i, 0], [row for _, row in state_rows(rows, limits)]
        by_control = np.linalg.inv(slopes[rows.control])
        follow = np.flatnonzero(conditions.active.follows[arc])
        others = [k for k in range(3) if k not in follow]
        off = np.zeros((len(grid) ** len(others), 3))
        off[:, others] = np.array(list(product(grid, repeat=len(others)))).reshape(len(off), -1)
        off[:, others] -= e.control[i, 0, others]
        plane = slopes[states] @ by_control
        off[:, follow] = -np.linalg.solve(plane[:, follow], plane[:, others] @ off[:, others].T).T
        possible = np.abs(e.control[i, 0] + off).max(axis=1) <= 1
        gained = off[possible] @ (costates[i] @ by_control)
        assert gained.min(initial=0.0) > -1e-8
