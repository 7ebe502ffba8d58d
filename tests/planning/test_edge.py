"""Scenes at the edge: each ends in a verified plan or in an error that names the cause."""

from math import isfinite

import pytest

from deltaopt.errors import DeltaOptError
from deltaopt.planning.first_motions.initial_motion import baseline
from deltaopt.planning.planner import plan
from deltaopt.scene.scene import Scene
from deltaopt.verify.verification import verify
from tests.edge_scenes import MIDDLE, ORSINO, cases

TOLERANCE = 1e-2
"""Of the gap: it is failure that is looked for, not the last per mille."""
REFUSED = {
    "goal outside": ("Unreachable", "goal: the platform cannot be at [0.75, 0, 0] m"),
    "start, a chain stretched": ("Singular", "start: arm and bars of chain 2 are in line"),
    "start, a chain folded": ("Singular", "start: arm and bars of chain 1 are in line"),
    "start, bars sideways": ("Singular", "start: the bars of chain 1 lie sideways"),
    "goal, a chain stretched": ("Singular", "goal: arm and bars of chain 2 are in line"),
    "one motor holds with 101.00%": ("Infeasible", "the torque of motor 2 is 2.275 N·m"),
    "all motors hold with 101.00%": ("Infeasible", "the torque of motor 1 is"),
    "1e-15 m apart": ("Infeasible", "start and goal are 1.0e-15 m apart"),
    "zero": ("SceneError", "payload is 0.0; expected a mass in kg, greater than 0"),
    "10 of what can be held": ("Infeasible", "the torque of motor 1 is"),
    "2 200 200 N·m": ("Infeasible", "the torque of motor 1 is 2.239 N·m"),
}
"""All others must be planned."""
FAR_FROM_BEST = ("start 1e-09 m", "all motors hold with 99.99%")
"""Nearer than the mesh can follow: the plan is right but slow, and says so. With a ten-thousandth
of all torques to spare it is 1.2 % slower than plans of finer meshes."""


@pytest.mark.parametrize("case", cases(), ids=lambda case: f"{case.family}: {case.name}")
def test_plan_or_cause(case):
    if case.name in REFUSED:
        error, sentence = REFUSED[case.name]
        with pytest.raises(DeltaOptError) as caught:
            plan(case.make(), tolerance=TOLERANCE)
        assert type(caught.value).__name__ == error
        assert sentence in str(caught.value)
        return
    scene = case.make()
    found = plan(scene, tolerance=TOLERANCE)
    verified = verify(scene, found.trajectory)
    assert verified.ok, verified.failures()
    assert isfinite(found.duration)
    assert found.gap <= TOLERANCE or case.name.startswith(FAR_FROM_BEST)


def test_a_motion_that_stays_is_no_plan_for_a_short_way():
    """1e-8 m are less than what a robot notices, and a plan must cover them all the same."""
    x, y, z = MIDDLE
    near = Scene(robot=ORSINO, start=MIDDLE, goal=(x, y + 1e-8, z))
    motion = baseline(near)
    assert verify(near, motion).ok
    other = near.model_copy(update={"goal": (x, y - 1e-8, z)})
    found = verify(other, motion)
    assert not found.ok
    assert found.failures()[0].startswith("it ends 2e-08 m from the scene's goal")


def test_refinement_ends_when_nothing_more_is_known():
    """Where gravity takes most of a limit, slowing costs more than the excess says."""
    drive = ORSINO.drive.model_copy(update={"torque": (40.0, 20.0, 2.0)})
    robot = ORSINO.model_copy(update={"drive": drive})
    scene = Scene(robot=robot, payload=1.0, start=MIDDLE, goal=(0.45, -0.05, 0.03))
    meshes = plan(scene, tolerance=TOLERANCE, intervals=20).meshes
    assert len(meshes) < 10
