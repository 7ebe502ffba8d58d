"""Moves along the edge of the workspace, each of which once was refused, planned wrong, or missed.

Their robots are of many kinds: a tiny haptic one, one of 2 m, one without masses in a place without
gravity, one with weak motors. The comments in the files are those of the program that failed.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from math import inf

import numpy as np
import pytest

from deltaopt import (
    Cycle,
    Plan,
    Planner,
    Scene,
    load_cycle,
    load_robot,
    load_scene,
    plan,
    plan_cycle,
    verify,
)
from deltaopt.errors import DeltaOptError, Infeasible, Unreachable
from deltaopt.planning.first_motions.initial_motion import detour, line, roughly_fastest
from deltaopt.planning.first_motions.order_of_merit import (
    crosses_singularity,
    in_order_of_merit,
    intervals_for,
)
from deltaopt.planning.first_motions.roadmap import roadmap_motions
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.feasibility import room_at_rest
from studies.bench.statics import Statics
from studies.problems import PROBLEMS
from tests.good_plans import good_plan
from tests.hard_scenes import hard_scene, planned_and_verified

BEST = {
    "01_ver_industrial": 4.72719,
    "03_gap_massless": 0.372567,
    "05_nc_massless": 0.354885,
    "07_ver_haptic": 0.131079,
    "09_nc_big": 0.572664,
    "11_un_industrial": 0.373899,
    "13_nc_haptic": 0.114039,
    "15_nc_industrial": 0.447622,
    "17_nc_orsino": 0.199641,
    "19_nc_big": 0.772577,
    "21_nc_industrial": 0.0652344,
    "23_un_massless": 11.2179,
    "25_un_haptic": 0.285844,
    "27_nc_irb360": 0.356349,
    "31_sing_random": 0.227251,
    "35_ends_industrial": 0.421383,
    "37_ends_massless": 0.305176,
    "39_ends_massless": 0.371587,
    "41_bodies_industrial": 0.27612,
    "43_sing_massless": 0.386139,
    "44_approach_odd": 0.468275,
    "47_bin_industrial": 0.467191,
    "48_bodies_industrial": 0.282836,
    "50_maze_industrial": 0.345685,
    "51_via_wall_industrial": 0.177489,
    "52_approach_shelves_industrial": 0.536322,
    "53_run_up_wall": 0.201048,
    "54_outwards": 0.154988,
}
"""The best duration known, s, of motions that pass through no parallel singularity."""


@pytest.mark.parametrize("name", BEST)
def test_planned_and_verified(name):
    found, verification = planned_and_verified(name)
    assert found.within_tolerance
    assert found.lower_bound < found.duration < BEST[name] * (1 + 2e-3)
    assert verification.failures() == []


def test_effort_is_not_saved_in_a_singularity():
    """Torques on its first motion grow without bound between two points of every mesh."""
    good_plan(hard_scene("33_effort_massless"), tolerance=3e-2)


def test_a_place_on_a_belt_beyond_a_singularity_rules_no_other_out():
    """The motion found to one of the places on its way passes through the singularity."""
    _, verification = planned_and_verified("45_belt_massless")
    assert verification.failures() == []


def test_a_way_that_hardly_keeps_a_limit_at_rest_is_none():
    """The time that it takes grew to 1e49 s, for which no motion can be slowed."""
    found, verification = planned_and_verified("46_belt_industrial")
    assert found.within_tolerance
    assert verification.failures() == []


def test_both_ends_of_a_wall_are_looked_at():
    """Above it there is a way at either end, 0.573 s by the one and 0.421 s by the other."""
    found, verification = planned_and_verified("42_wall_industrial")
    assert found.within_tolerance
    assert found.lower_bound < found.duration < 0.42288 * (1 + 2e-3)
    assert verification.failures() == []


def test_another_way_is_tried_after_a_laborious_plan():
    """One of its plans is a local minimum, a third of a percent longer. From some numbers of
    intervals, others on each processor, all plans are the same."""
    for intervals in (16, 20, 13):
        found = plan(hard_scene("29_min_massless"), intervals=intervals)
        assert found.duration < 15.62 * (1 + 2e-3)  # the best of ten starts takes 15.621 s
        if len(found.optima) > 1:
            break
    assert found.optima[0].duration == found.duration
    assert found.optima[1].duration > found.duration * (1 + 2 * found.optima[1].gap)
    assert sum(each.starts for each in found.optima) > 2


def test_a_path_over_the_grid_where_no_simple_curve_leads():
    """Weak motors: gravity leaves them 2 %, so that neither lines nor curves can be driven."""
    weak = hard_scene("25_un_haptic")
    for simple in (lambda s: roughly_fastest(s, line(s)), detour):
        with pytest.raises(DeltaOptError):
            simple(weak)
    motions = roadmap_motions(weak, 16)
    durations = [motion.duration for motion in motions]
    assert durations == sorted(durations)
    best = motions[0]
    assert not crosses_singularity(problem_of(weak), best)
    points = best(np.linspace(0, best.duration, 301)).x
    np.testing.assert_allclose(points[[0, -1]], [weak.start, weak.goal], atol=1e-12)
    assert room_at_rest(weak, points).min() > 0


def test_the_first_mesh_is_fine_enough_for_the_first_motion():
    """Cubics through 16 states of this motion would leave the workspace between them."""
    big = hard_scene("09_nc_big")
    motion = next(in_order_of_merit(big))
    assert intervals_for(motion, 16) == 32
    assert planned_and_verified("09_nc_big")[0].meshes[0].intervals == 32


def test_first_motions_are_in_order_of_merit():
    """Motor angles straight from start to goal: 280 s, where a curve takes less than one."""
    slow = hard_scene("05_nc_massless")
    first, second, *_ = islice(in_order_of_merit(slow), 3)
    assert first.duration < 1
    assert first.duration < second.duration


def test_the_first_motion_in_a_tube_is_on_its_axis_and_not_slowed(monkeypatch):
    """It takes as long as the fastest along the axis, which is slowed to its limits between points:
    under friction that once took twenty times as long as all else."""
    tube = load_scene("problems/paths/tube.yaml")
    along_axis = plan(tube.on_its_path)
    monkeypatch.setattr(
        "deltaopt.planning.path.path_planning.safe_factor", lambda *_: pytest.fail("slowed")
    )
    motion = next(in_order_of_merit(tube))
    assert motion.duration == pytest.approx(along_axis.duration, rel=2e-3)


def test_a_move_without_a_way_is_refused_with_what_was_searched(monkeypatch):
    monkeypatch.setattr(
        "deltaopt.planning.first_motions.order_of_merit.roadmap_motions", lambda *_: []
    )
    with pytest.raises(Unreachable, match=r"45 curves, nor a path over a grid .* mm apart"):
        plan(hard_scene("25_un_haptic"))


def test_ends_with_a_singularity_between_them_are_refused_with_the_reason():
    robot = load_robot("problems/robots/orsino.yaml")
    below, beside = (0.6014, 0.1192, -0.0402), (-0.0192, 0.5291, -0.0505)
    volumes = [Statics(robot, 0.0).at(np.array([point])).volumes[0] for point in (below, beside)]
    assert volumes[0] * volumes[1] < 0
    with pytest.raises(Infeasible, match="different sides of a parallel singularity"):
        plan(Scene(robot=robot, start=below, goal=beside))


def test_a_cycle_whose_legs_tell_no_gap_is_planned(monkeypatch):
    """Legs that pass fast states under limits of torque rates tell no gap at tight tolerances; that
    was a division by zero."""
    with_gap = Planner.plan_scene

    def without_gap(*given: object, **named: object) -> Plan:
        return replace(with_gap(*given, **named), gap=inf)

    monkeypatch.setattr(Planner, "plan_scene", without_gap)
    legs = load_cycle(PROBLEMS / "cycles" / "there_and_back.yaml").legs
    found = plan_cycle(Cycle(legs=legs))
    assert found.gap == inf
    for leg in found.legs:
        assert verify(leg.scene, leg.trajectory).failures() == []
