"""What notices a feature that does not run: each is taken away once, and its tests must fail.

This module is also the plugin of pytest that takes one away, before any test is collected.
"""

from __future__ import annotations

import argparse
import inspect
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

from deltaopt.verify.forward_replay import Replay

HELP = "take each feature away once, and name the tests that notice"
SMALL: Mapping[str, object] = {"names": ("jumps at knots are measured",)}

_ROOT = Path(__file__).parents[1]
_NAME = "DELTAOPT_TAKEN_AWAY"
"""The variable of the environment by which the plugin is told what to take away."""
_FAILED = "FAILED "

Change = Callable[[Any], Any]
"""A function or property of the package -> what it is replaced by."""


@dataclass(frozen=True)
class Mutation:
    """A feature that is taken away: ``target``, a module and a name in it, is changed by
    ``change``. ``tests``: of the feature, a file of the tests, and ``named`` those of it, by -k."""

    target: str
    change: Change
    tests: str
    named: str = ""


def _always(value: object) -> Change:
    """To what returns a value, whatever it is asked."""

    def change(original: Any) -> Any:
        def instead(*_: object, **__: object) -> object:
            return value

        return property(instead) if isinstance(original, property) else instead

    return change


def _zeros(original: Any) -> Any:
    """To what returns the same measures, all of them zero."""
    return lambda *given, **options: dict.fromkeys(original(*given, **options), 0.0)


def _the(number: int) -> Change:
    """To what returns what it is given as one of its arguments."""
    return lambda original: lambda *given, **options: given[number]


def _untightened(_: Any) -> Any:
    """To what leaves limits as they are for the next mesh."""
    return lambda self, mesh, faces=None: replace(self.scaling.untightened, faces=faces)


def _from_one_start(_: Any) -> Any:
    """To what plans as if one start had been asked for."""
    return lambda self, scene, motions, report: self._search(scene, report)


def _replayed(_: Any) -> Any:
    """To what says that torques lead where they should."""
    return lambda scene, trajectory: Replay(1.0, 0.0, 0.0)


def _links_as_they_come(_: Any) -> Any:
    """To what plans as if links need not keep clear."""
    return lambda scene, planned, *_: (planned(scene), 0.0)


_PLANNING, _LIMITS = "deltaopt.planning.", "deltaopt.limits."
_FIRST, _VERIFY = "deltaopt.planning.first_motions.", "deltaopt.verify.verification:"
_SCENE = "deltaopt.scene."
_COMBINED, _BODIES = "planning/test_combinations.py", "planning/test_bodies.py"
_PLANNED, _VERIFICATION = "limits/test_planned_limits.py", "verify/test_verification.py"
MUTATIONS: dict[str, Mutation] = {
    "ways for moving ends": Mutation(
        _PLANNING + "planner:Planner._moving_past_bodies",
        _always(None),
        _COMBINED,
        "where_an_end_moves",
    ),
    "bands past bodies": Mutation(_FIRST + "around_bodies:clear_bands", _always(()), _BODIES),
    "bows past bodies": Mutation(_FIRST + "around_bodies:bows", _always(()), _BODIES),
    "passages between bodies": Mutation(
        _FIRST + "around_bodies:shortest_path", _always(None), _BODIES
    ),
    "bodies hit are added": Mutation(
        _PLANNING + "ways:with_those_hit", _always(None), "planning/test_near_bodies.py"
    ),
    "phases over edges": Mutation(
        _PLANNING + "refinement:Refinement._faces",
        _always(None),
        "planning/mesh/test_edges.py",
        "crossed_on_its_edge",
    ),
    "links keep clear": Mutation(
        _PLANNING + "planner:keeping_links_clear",
        _links_as_they_come,
        "planning/test_links_clear.py",
        "led_around",
    ),
    "via points": Mutation(
        "deltaopt.scene.task:_gates", _always(()), "planning/test_via_points.py", "test_verified"
    ),
    "heights of an approach": Mutation(
        _SCENE + "scene:Scene.columns", _always(()), "planning/test_approach.py", "test_verified"
    ),
    "cylinders of an approach": Mutation(
        _LIMITS + "workspace:Approach.items",
        _always(()),
        "planning/test_approach.py",
        "test_verified",
    ),
    "the tube": Mutation(
        _LIMITS + "tube:Tube.items", _always(()), "limits/test_tube.py", "narrow or free_motion"
    ),
    "the payload's range": Mutation(
        _LIMITS + "torque:WithLeastPayload.items",
        _always(()),
        "limits/test_torque.py",
        "alone or shipped",
    ),
    "depth of the workspace": Mutation(
        _LIMITS + "workspace:WorkspaceDepth.items", _always(()), _PLANNED, "refused or example"
    ),
    "radius of the workspace": Mutation(
        _LIMITS + "workspace:WorkspaceRadius.items", _always(()), _PLANNED, "refused or example"
    ),
    "tilt": Mutation(
        _LIMITS + "singularities:TiltSingularity.items",
        _always(()),
        "limits/test_singularities.py",
        "motions",
    ),
    "the parallel singularity": Mutation(
        _LIMITS + "singularities:ParallelSingularity.items",
        _always(()),
        "limits/test_singularities.py",
        "motions",
    ),
    "ranges of arms": Mutation(
        _LIMITS + "joint_ranges:ArmRange.items", _always(()), _PLANNED, "refused or example"
    ),
    "ranges of ball joints": Mutation(
        _LIMITS + "joint_ranges:BallJoint.items", _always(()), _PLANNED, "refused or example"
    ),
    "the torque curve": Mutation(
        _LIMITS + "torque_curve:TorqueCurve.items", _always(()), _PLANNED, "falls_with_speed"
    ),
    "specific force": Mutation(
        _LIMITS + "specific_force:SpecificForce.items", _always(()), _PLANNED, "specific_force"
    ),
    "the platform's speed": Mutation(
        _LIMITS + "platform_motion:PlatformSpeed.items", _always(()), _PLANNED, "platform_speed"
    ),
    "the platform's acceleration": Mutation(
        _LIMITS + "platform_motion:Acceleration.items",
        _always(()),
        "limits/test_platform_motion.py",
        "told or textbook",
    ),
    "rotation": Mutation(
        _SCENE + "scene:Scene.least_duration", _always(0.0), _PLANNED, "waits_for_the_rotation"
    ),
    "slowing": Mutation(
        _PLANNING + "trajectory_optimiser:_safe", _the(1), "planning/test_planner.py"
    ),
    "limits kept at moving ends": Mutation(
        _PLANNING + "trajectory_optimiser:kept", _the(1), "planning/test_moving_ends.py", "verified"
    ),
    "tightening": Mutation(
        _PLANNING + "mesh.mesh_solution:MeshSolution.tightened",
        _untightened,
        "planning/test_planner.py",
    ),
    "knots at reversals": Mutation(
        _PLANNING + "refinement:with_reversals", _the(0), "planning/mesh/test_reversals.py"
    ),
    "softer friction": Mutation(
        _PLANNING + "trajectory_optimiser:softer_scenes",
        _always(()),
        "planning/mesh/test_reversals.py",
    ),
    "the gap": Mutation(
        _PLANNING + "trajectory_optimiser:gap_of", _always(1e-9), "planning/mesh/test_told_gap.py"
    ),
    "several starts": Mutation(
        _PLANNING + "planner:Planner._best",
        _from_one_start,
        "planning/first_motions/test_multistart.py",
    ),
    "finishing a motion under way": Mutation(
        _PLANNING + "planner:finished_first",
        _always(None),
        "planning/test_moving_ends.py",
        "finishing or very_end",
    ),
    "places that a belt passes": Mutation(
        _PLANNING + "belt_places:PlacesOnBelt.motions", _always(()), "planning/test_belts.py"
    ),
    "jumps at knots are measured": Mutation(_VERIFY + "_jumps", _zeros, _VERIFICATION, "jumping"),
    "ends are measured": Mutation(
        _VERIFY + "_ends", _zeros, _VERIFICATION, "another_goal or another_start"
    ),
    "dynamics are measured": Mutation(
        _VERIFY + "_errors", _zeros, _VERIFICATION, "wrong_payload or wrong_robot"
    ),
    "optimality is measured": Mutation(_VERIFY + "_optimality", _always({}), "verify"),
    "clearance is measured": Mutation(
        _VERIFY + "clearance_excess", _always(None), "verify/test_clearance.py"
    ),
    "the tube is measured": Mutation(
        _VERIFY + "tube_excess", _always(None), "limits/test_tube.py", "verification"
    ),
    "links are measured": Mutation(
        _VERIFY + "sure_robot_clearance", _always(1.0), "verify/test_links.py"
    ),
    "the least payload is measured": Mutation(
        _VERIFY + "_with_least_payload", _always({}), "limits/test_torque.py", "alone or shipped"
    ),
    "paths are measured": Mutation(
        _VERIFY + "off_path", _always(0.0), "verify/test_planted_faults.py", "micrometre_off"
    ),
    "via points are measured": Mutation(
        _VERIFY + "off_via_points", _always(0.0), "planning/test_via_points.py", "verification_sees"
    ),
    "form is measured": Mutation(
        _VERIFY + "_malformed", _always(None), "verify/test_planted_faults.py", "functions_of_time"
    ),
    "torques are followed": Mutation(_VERIFY + "replay", _replayed, _VERIFICATION, "followed"),
}
"""Every feature by what it is: without the change these tests pass."""


def pytest_configure() -> None:
    """Take away what the environment names, in every module that has it by name."""
    mutation = MUTATIONS[os.environ[_NAME]]
    module, _, path = mutation.target.partition(":")
    owner: Any = import_module(module)
    *outer, last = path.split(".")
    for name in outer:
        owner = getattr(owner, name)
    original = inspect.getattr_static(owner, last)
    changed = mutation.change(original)
    setattr(owner, last, changed)
    for each in [each for name, each in sys.modules.items() if name.startswith("deltaopt.")]:
        for name in [name for name, value in vars(each).items() if value is original]:
            setattr(each, name, changed)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--names",
        nargs="+",
        choices=sorted(MUTATIONS),
        default=tuple(MUTATIONS),
        metavar="FEATURE",
        help="take these away alone (default: each in turn)",
    )


def run(arguments: argparse.Namespace) -> int:
    unnoticed = 0
    for name in arguments.names:
        noticed = noticed_by(name)
        unnoticed += noticed is None
        print(f"{name}: {noticed or 'no test notices'}", flush=True)
    print(f"{len(arguments.names)} features taken away, {unnoticed} of them unnoticed")
    return int(unnoticed > 0)


def noticed_by(name: str) -> str | None:
    """The first test that fails without a feature; None if none does."""
    mutation = MUTATIONS[name]
    command = [sys.executable, "-m", "pytest", "-p", "studies.mutations", "-x", "-q", "-n", "0"]
    done = subprocess.run(
        [
            *command,
            "-rf",
            "-p",
            "no:cacheprovider",
            f"tests/{mutation.tests}",
            "-k",
            mutation.named,
        ],
        cwd=_ROOT,
        env={**os.environ, _NAME: name},
        capture_output=True,
        text=True,
    )
    failed = [line for line in done.stdout.splitlines() if line.startswith(_FAILED)]
    if failed:
        return failed[0].removeprefix(_FAILED).partition(" - ")[0]
    return None if done.returncode == 0 else f"{done.stdout[-400:]}{done.stderr[-400:]}"
