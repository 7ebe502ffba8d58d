"""Multistart, random proportions, tilt of the platform, fast driven motion: what they measure."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

import deltaopt
from deltaopt.compare.dynamics.many_digits import ManyDigits
from deltaopt.compare.dynamics.tasks import TASKS
from deltaopt.dynamics import Multiplier
from deltaopt.files.kept_rows import kept_rows, read_rows
from deltaopt.output.mujoco_replay import InMujoco, of_joints
from deltaopt.robot.model import DeltaModel
from studies import driven, multistart, proportions, tilt
from studies.bar_forces import bar_forces
from studies.bench.random_scenes import random_scenes
from studies.gap_moves import INSIDE, move, move_of_random_robot
from studies.problems import INDUSTRIAL, ORSINO, PROBLEMS
from studies.stability.families import delta_families

ROW = multistart.Row(3, "a, b", INSIDE, 0.2, 0.19, 0.01, 0.08, 2, True, "")


def test_rows_of_a_file_go_on_where_they_were_interrupted(tmp_path):
    file, made = tmp_path / "rows.csv", []

    def of(number):
        made.append(number)
        return replace(ROW, number=number, one=0.1 * number)

    def rows(numbers):
        return kept_rows(file, multistart.Row, numbers, lambda r: r.number, of, lambda _: None)

    first = rows([1, 2])
    text = file.read_text(encoding="utf-8")
    file.write_text(text[:-9], encoding="utf-8")  # in the midst of the second row
    assert rows([1, 2, 3]) == [*first, replace(ROW, number=3, one=0.1 * 3)]
    assert made == [1, 2, 2, 3]
    assert read_rows(file, multistart.Row) == rows([1, 2, 3])


def test_multistart_counts_by_how_much_motions_are_faster():
    assert ROW.saved == pytest.approx(0.05)
    rows = [
        ROW,
        replace(ROW, several=0.2),
        replace(ROW, several=0.1997),
        replace(ROW, several=0.15),
    ]
    assert [multistart.share_faster(rows, by) for by in (1e-3, 1e-2, 1e-1)] == [3, 2, 1]
    numbers = multistart.numbers(3)
    assert [move(7, i).stratum == INSIDE for i in numbers] == 3 * [True, False]
    assert len(set(numbers)) == 6


@pytest.mark.parametrize("file", [ORSINO, PROBLEMS / "robots" / "industrial_drive.yaml"])
def test_forces_of_bars_are_those_of_mujoco(file):
    """MuJoCo has both bars of every parallelogram, and a platform that only they keep level."""
    robot, rng = deltaopt.load_robot(file), np.random.default_rng(5)
    model = DeltaModel(robot, 1.0)
    for scene in random_scenes(robot, 1.0, 2, seed=5):
        x, v, a = np.array(scene.goal), 2.0 * rng.normal(size=3), 100.0 * rng.normal(size=3)
        ours = bar_forces(model, x[None], v[None], a[None])[0]
        theirs = in_mujoco(InMujoco.of(robot, 1.0, scene.start), *model.motion(x, v, a))
        assert ours == pytest.approx(theirs, abs=1e-9 * np.abs(theirs).max())


def in_mujoco(there, q, dq, ddq):
    """Forces of the bars along them, 3 × 2, in a motion of the twelve coordinates."""
    data, model = there.data, there.model
    there.put(q, dq)
    data.qacc[:3] = ddq[:3]
    for k in range(3):
        data.qacc[6 + 5 * k : 11 + 5 * k] = of_joints(ddq[3 + 3 * k : 6 + 3 * k])
    acceleration, force = np.array(data.qacc), np.zeros(model.nv)
    there.mujoco.mj_forward(model, data)
    there.mujoco.mj_mulM(model, data, force, acceleration)
    force += data.qfrc_bias - data.qfrc_passive
    joints = np.array(data.efc_J).reshape(data.nefc, model.nv)
    both = np.vstack([np.eye(model.nv)[6::5], joints]).T
    share, *_ = np.linalg.lstsq(both, force, rcond=None)
    on_bars = -share[3:].reshape(3, 2, 3)
    along = np.array(
        [
            [data.site(f"tip{k}{s}").xpos - data.body(f"bar{k}{s}").xpos for s in "ab"]
            for k in (1, 2, 3)
        ]
    )
    return np.sum(on_bars * along, axis=2) / np.linalg.norm(along, axis=2)


def test_the_platform_tilts_where_its_bars_keep_one_length():
    """At ε → 0 a turn of the platform about its centre is found that changes no bar's length, to
    first order; far from it every turn changes one."""
    robot = deltaopt.load_robot(INDUSTRIAL)
    model = DeltaModel(robot, 1.0)
    before, beyond = tilt._line_through(model, np.random.default_rng(1))

    def least_stretch(distance):
        """Least change of a bar's length over turn and half width, motors held."""
        x = tilt._at(model, before, beyond, distance)
        rows = []
        for chain in chains(model, x):
            radial, sideways, bar = chain
            for side in (1, -1):
                corner = robot.platform_radius * radial + side * sideways
                rows.append(np.concatenate([bar, np.cross(corner, bar)]))
        return np.linalg.svd(np.array(rows), compute_uv=False)[-1]

    assert least_stretch(0.5) > 0.05
    assert least_stretch(1e-6) < 1e-5


def chains(model, x):
    """Radial and sideways directions and the unit vector along the bars, by plain triangles."""
    robot, theta = model.robot, model.inverse_kinematics(x)[3::3]
    for k, angle in enumerate((0, 2 * np.pi / 3, -2 * np.pi / 3)):
        radial = np.array([0, np.cos(angle), np.sin(angle)])
        elbow = (robot.base_radius + robot.upper_arm.length * np.cos(theta[k])) * radial
        elbow -= robot.upper_arm.length * np.sin(theta[k]) * np.array([1.0, 0, 0])
        bar = x - robot.tool_offset + robot.platform_radius * radial - elbow
        yield radial, np.array([0, -np.sin(angle), np.cos(angle)]), bar / np.linalg.norm(bar)


def test_forces_of_bars_grow_without_bound_where_torques_do_not():
    robot = deltaopt.load_robot(INDUSTRIAL)
    found = tilt.approach_of("industrial", robot, np.random.default_rng(1))
    assert tilt.power(tilt.DISTANCES, found.forces) == pytest.approx(-1, abs=0.01)
    assert tilt.power(tilt.DISTANCES, found.torques) == pytest.approx(0, abs=0.01)


def test_a_dip_is_one_motion_of_its_torques():
    """Accelerations by L_I at the torques are the prescribed ones, and ε is reached midway."""
    family = next(f for f in delta_families() if f.name == "stretched")
    dip, m = driven.Dip.of(family, 1e-2), family.mechanism
    f = ca.Function("f", [m.time], [*dip.coordinates(m.time), dip.torques()])
    forward = Multiplier().forward_dynamics(m)
    for t in (0.0, 0.03, 0.07):
        q, dq, ddq, tau = (np.array(each.full()).ravel() for each in f(t))
        found = np.array(forward(t, q, dq, tau, driven.PAPER.values())[0].full()).ravel()
        assert found == pytest.approx(ddq, abs=1e-7 * np.abs(ddq).max())
    assert np.sin(q[3] - q[4]) == pytest.approx(1e-2, rel=1e-9)


def test_models_of_a_random_robot_are_held_against_many_digits():
    """And a model of another payload is told apart."""
    scene = move_of_random_robot(1, 0).scene
    x, v, a = np.array([scene.start]), np.array([[0.5, -0.2, 0.3]]), np.array([[3.0, 5.0, -2.0]])
    model, heavier = (DeltaModel(scene.robot, payload) for payload in (0.5, 0.6))
    states = list(zip(*model.motion(x, v, a), model.inverse_dynamics(x, v, a), strict=True))
    for task in TASKS:
        assert max(proportions.errors_of(model, task, states, ManyDigits(30))) < 1e-12
    wrong = heavier.inverse_dynamics(x, v, a)[0] - states[0][3]
    assert np.abs(wrong).max() > 1e-3 * np.abs(states[0][3]).max()
