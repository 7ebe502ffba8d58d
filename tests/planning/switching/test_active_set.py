"""Structures of a closed chain: motors at two limits at once, and wrong ones put right."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest
from tests.posed_scenes import machine_code, random_move, scales_of

from deltaopt import Planner, verify
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.flat.constraint_rows import SPEED_RATE, TORQUE
from deltaopt.planning.switching.active_set import _Repair, patches
from deltaopt.planning.switching.arc_mesh import Held, held_states
from deltaopt.planning.switching.kkt_system import System
from deltaopt.planning.switching.residuals import Examined
from deltaopt.planning.switching.resolution import Settled, settle
from deltaopt.planning.switching.structure import Limit, Stretch, Structure, bearable, changed
from tests import posed_scenes
from tests.oracles.shooting import shoot

UP, DOWN, BOTH = Limit(torque=1), Limit(torque=-1), Limit(torque=1, speed=1)
NUMBER = 6
"""Of a random move of industrial: one of its arcs holds a motor at both of its limits."""


@cache
def resolved(number: int) -> Settled:
    return posed_scenes.resolved(random_move("industrial", number))


def at_once(structure: Structure) -> list[tuple[int, int]]:
    """(arc, motor) where speed and torque are at their limits."""
    return [tuple(each) for each in np.argwhere((structure.speed != 0) & (structure.torque != 0))]


def test_a_speed_is_held_by_a_motor_whose_torque_is_at_no_limit():
    held = Held.of(Structure(np.array([0.4, 0.6]), ((UP, DOWN, UP), (BOTH, Limit(), DOWN))))
    assert held.row[1].tolist() == [TORQUE, SPEED_RATE, TORQUE + 2]
    assert held.value[1].tolist() == [1, 0, -1]
    assert held.free == ()


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
        assert np.abs(motion.tau[:, motor]) == pytest.approx(scene.torque_limits[motor], rel=1e-6)
        dtheta = found.trajectory.model.motion(motion.x, motion.v, motion.a)[1][:, 3 + 3 * motor]
        assert np.abs(dtheta) == pytest.approx(scene.speed_limits[motor], rel=1e-6)


@pytest.mark.parametrize("number", [NUMBER, 13])
def test_shooting_finds_the_same(number):
    """By forward dynamics in twelve coordinates, from lengths that are a little off."""
    scene, found = random_move("industrial", number), resolved(number)
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
def test_a_speed_that_touches_its_limit():
    """At one instant, where the costates jump, and not before or after it."""
    scene, found = random_move("industrial", 13), resolved(13)
    structure = found.conditions.structure
    grazed = np.array([[limit.grazed for limit in arc] for arc in structure.limits])
    (arc, motor) = np.argwhere(grazed)[0]
    ends = np.cumsum(structure.lengths) * found.trajectory.duration
    instant, apart = ends[arc - 1], 0.02 * ends[-1]
    at = [speed(found.trajectory, t)[motor] for t in (instant - apart, instant, instant + apart)]
    limit = scene.speed_limits[motor]
    assert abs(at[1]) == pytest.approx(limit, rel=1e-8)
    assert max(abs(at[0]), abs(at[2])) < limit * (1 - 1e-4)


def speed(trajectory: Trajectory, time: float) -> np.ndarray:
    """θ̇ of the motors, rad/s."""
    motion = trajectory([time])
    return trajectory.model.motion(motion.x, motion.v, motion.a)[1][0, 3::3]


def settled_from(structure: Structure) -> Settled:
    found, scene = resolved(NUMBER), random_move("industrial", NUMBER)
    model = found.trajectory.model
    scales = scales_of(scene)
    return settle(found.conditions.stage, model, structure, found.trajectory, scales, 1e-6)


@pytest.mark.parametrize("longer", [0.6, 1.5])
def test_a_disturbed_structure_is_found_again(longer):
    """One arc shorter or longer: its switches are variables."""
    right = resolved(NUMBER)
    lengths = right.conditions.structure.lengths.copy()
    lengths[3] *= longer
    found = settled_from(replace(right.conditions.structure, lengths=lengths / lengths.sum()))
    assert found.trajectory.duration == pytest.approx(right.trajectory.duration, rel=1e-8)
    assert found.conditions.structure.limits == right.conditions.structure.limits


def test_what_is_missing_is_put_in():
    """An arc where another motor's torque holds the speed, left to the arc before it."""
    right = resolved(NUMBER).conditions.structure
    arc = at_once(right)[0][0]
    lengths = np.delete(right.lengths, arc)
    lengths[arc - 1] += right.lengths[arc]
    found = settled_from(Structure(lengths, right.limits[:arc] + right.limits[arc + 1 :]))
    assert found.trajectory.duration == pytest.approx(
        resolved(NUMBER).trajectory.duration, rel=1e-8
    )
    assert found.conditions.structure.limits == right.limits


def examined(number: int) -> Examined:
    right, scales = resolved(number), scales_of(random_move("industrial", number))
    conditions = right.conditions
    motion = conditions.solve(conditions.guess(right.trajectory, scales)).motion
    return Examined(conditions, motion, 5e-7)


def test_nothing_is_wrong_with_what_is_right():
    assert patches(examined(NUMBER)) == []


@pytest.mark.parametrize("number", [NUMBER, 13])
def test_what_is_held_makes_the_hamiltonian_least(number):
    """By costates, p · (V, A), against a grid of torques within their limits that keep the speeds;
    and it is the vertex that repairs would choose."""
    e = examined(number)
    repair, conditions = _Repair(e), e.conditions
    costates = System(conditions, e.motion).costates[:, 3:]
    grid = np.linspace(-1, 1, 21)
    for i, arc in enumerate(conditions.grid.arc):
        limits = conditions.structure.limits[arc]
        assert repair._vertex(i, 10, limits) == [limit.torque for limit in limits]
        slopes, states = repair._slopes[i, 0], [row for _, row in held_states(limits)]
        by_torque = np.linalg.inv(slopes[TORQUE : TORQUE + 3])
        follow = np.flatnonzero(conditions.held.without_row[arc])
        others = [k for k in range(3) if k not in follow]
        off = np.zeros((len(grid) ** len(others), 3))
        off[:, others] = np.array(list(product(grid, repeat=len(others)))).reshape(len(off), -1)
        off[:, others] -= e.torques[i, 0, others]
        plane = slopes[states] @ by_torque
        off[:, follow] = -np.linalg.solve(plane[:, follow], plane[:, others] @ off[:, others].T).T
        possible = np.abs(e.torques[i, 0] + off).max(axis=1) <= 1
        gained = off[possible] @ (costates[i] @ by_torque)
        assert gained.min(initial=0.0) > -1e-8


def test_a_touch_is_not_repeated_by_what_is_put_over_it():
    touched = Limit(torque=-1, touched=1)
    whole = Structure(np.array([0.5, 0.5]), ((UP,), (touched,)))
    patched = changed(whole, [(0, Stretch(0.6, 0.7, Limit(torque=1, touched=1)))])
    assert patched.limits == ((UP,), (touched,), (UP,), (DOWN,))


@pytest.mark.parametrize("begin", [0.5, 0.5 + 2e-16])
def test_a_touch_remains_where_something_else_is_put_from_there_on(begin):
    whole = Structure(np.array([0.5, 0.5]), ((UP,), (Limit(torque=-1, touched=1),)))
    patched = changed(whole, [(0, Stretch(begin, 0.7, Limit(torque=1, touched=1)))])
    assert patched.limits == ((UP,), (Limit(torque=1, touched=1),), (DOWN,))


def test_what_is_put_in_elsewhere_touches_nothing():
    """A fold is at its margin in the middle, and only there."""
    at_margin = Limit(opening=1)
    whole = Structure(np.array([0.5, 0.3, 0.2]), ((UP,), (at_margin,), (DOWN,)))
    assert changed(whole, [(0, Stretch(0.1, 0.2, DOWN))]).limits == (
        (UP,),
        (DOWN,),
        (UP,),
        (at_margin,),
        (DOWN,),
    )


def test_a_graze_remains_where_its_arc_vanishes():
    arcs = ((UP,), (Limit(torque=1, grazed=1),), (DOWN,))
    left = changed(Structure(np.array([0.5, 0.0, 0.5]), arcs), [])
    assert left.limits == ((UP,), (Limit(torque=-1, grazed=1),))


def test_no_more_is_held_than_there_are_motors():
    """And arcs that are alike then are one."""
    arcs = ((BOTH, DOWN), (Limit(speed=1), DOWN))
    found = bearable(Structure(np.array([0.4, 0.6]), arcs))
    assert found.limits == ((Limit(speed=1), DOWN),)
    assert found.lengths == pytest.approx([1.0])


def test_arcs_that_others_begin_than_end_may_be_reversed():
    arcs = ((UP, UP), (DOWN, UP), (DOWN, DOWN), (DOWN, UP), (DOWN, DOWN))
    assert Structure(np.full(5, 0.2), arcs).reversible.tolist() == [
        False,
        True,
        False,
        False,
        False,
    ]
