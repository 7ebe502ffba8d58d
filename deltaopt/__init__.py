"""Verified minimum-time motions of Delta robots, and the closed-chain dynamics behind them."""

from deltaopt.interrupts.imports import end_at_once_if_command

end_at_once_if_command()

from importlib import import_module
from typing import TYPE_CHECKING, Any

from deltaopt.later import PLACES, loaded

if TYPE_CHECKING:
    from deltaopt.designs.design import design as design
    from deltaopt.errors import (
        DeltaOptError as DeltaOptError,
        DependentConstraints as DependentConstraints,
        EndMoves as EndMoves,
        Inexpressible as Inexpressible,
        Infeasible as Infeasible,
        MissingPackage as MissingPackage,
        NotConverged as NotConverged,
        SceneError as SceneError,
        Singular as Singular,
        Unreachable as Unreachable,
        Unusable as Unusable,
    )
    from deltaopt.files.progress_bar import ProgressBar as ProgressBar
    from deltaopt.files.version import __version__ as __version__
    from deltaopt.motion.trajectory import Motion as Motion, Trajectory as Trajectory
    from deltaopt.output.saved_plan import (
        SavedPlan as SavedPlan,
        UnreadablePlan as UnreadablePlan,
        load_plan as load_plan,
    )
    from deltaopt.planning.cycles.cycle_plan import CyclePlan as CyclePlan
    from deltaopt.planning.cycles.cycle_planning import plan_cycle as plan_cycle
    from deltaopt.planning.comparisons import (
        beside_free_path as beside_free_path,
        timed_line as timed_line,
    )
    from deltaopt.planning.first_motions.initial_motion import baseline as baseline
    from deltaopt.planning.plan import Plan as Plan
    from deltaopt.planning.planner import Planner as Planner, plan as plan
    from deltaopt.research import (
        AccelerationLevel as AccelerationLevel,
        Baumgarte as Baumgarte,
        InteriorPoint as InteriorPoint,
        Ipopt as Ipopt,
        KnotConstraints as KnotConstraints,
        PiecewiseAcceleration as PiecewiseAcceleration,
        Projection as Projection,
        Redundant as Redundant,
        explicit as explicit,
        flat as flat,
        forward as forward,
        interior_point as interior_point,
        ipopt as ipopt,
        kane as kane,
        multiplier as multiplier,
        virtual_work as virtual_work,
    )
    from deltaopt.robot.model import DeltaModel as DeltaModel
    from deltaopt.robot.robot import Robot as Robot, load_robot as load_robot
    from deltaopt.robot.tool import Box as Box, Sphere as Sphere, Tool as Tool
    from deltaopt.scene.bodies import (
        Body as Body,
        Cylinder as Cylinder,
        HalfSpace as HalfSpace,
        Hull as Hull,
    )
    from deltaopt.scene.moving_ends import Anywhere as Anywhere, Belt as Belt, State as State
    from deltaopt.scene.objective import (
        Effort as Effort,
        SmoothMotion as SmoothMotion,
        SmoothTorque as SmoothTorque,
        Time as Time,
        TimeAndEffort as TimeAndEffort,
        TimeAndEfforts as TimeAndEfforts,
        TimeAndJerk as TimeAndJerk,
        TimeAndTorqueRate as TimeAndTorqueRate,
    )
    from deltaopt.scene.path import (
        Corners as Corners,
        Curve as Curve,
        Line as Line,
        PickAndPlace as PickAndPlace,
    )
    from deltaopt.scene.known_limits import Limits as Limits
    from deltaopt.scene.scene import Scene as Scene
    from deltaopt.scene.cycle import Cycle as Cycle
    from deltaopt.scene.scene_file import load_cycle as load_cycle, load_scene as load_scene
    from deltaopt.sensitivity.sensitivity import Sensitivity as Sensitivity
    from deltaopt.sweeps.cell_map import load_cell as load_cell
    from deltaopt.sweeps.sweep import sweep as sweep
    from deltaopt.sweeps.sweep_file import Sweep as Sweep
    from deltaopt.verify.verification import Verification as Verification, verify as verify

_PUBLIC = {
    "deltaopt.designs.design": ("design",),
    "deltaopt.errors": (
        "DeltaOptError",
        "DependentConstraints",
        "EndMoves",
        "Inexpressible",
        "Infeasible",
        "MissingPackage",
        "NotConverged",
        "SceneError",
        "Singular",
        "Unreachable",
        "Unusable",
    ),
    "deltaopt.files.progress_bar": ("ProgressBar",),
    "deltaopt.files.version": ("__version__",),
    "deltaopt.motion.trajectory": ("Motion", "Trajectory"),
    "deltaopt.output.saved_plan": ("SavedPlan", "UnreadablePlan", "load_plan"),
    "deltaopt.planning.cycles.cycle_plan": ("CyclePlan",),
    "deltaopt.planning.cycles.cycle_planning": ("plan_cycle",),
    "deltaopt.planning.comparisons": ("beside_free_path", "timed_line"),
    "deltaopt.planning.first_motions.initial_motion": ("baseline",),
    "deltaopt.planning.plan": ("Plan",),
    "deltaopt.planning.planner": ("Planner", "plan"),
    "deltaopt.robot.model": ("DeltaModel",),
    "deltaopt.robot.robot": ("Robot", "load_robot"),
    "deltaopt.robot.tool": ("Box", "Sphere", "Tool"),
    "deltaopt.scene.bodies": ("Body", "Cylinder", "HalfSpace", "Hull"),
    "deltaopt.scene.moving_ends": ("Anywhere", "Belt", "State"),
    "deltaopt.scene.objective": (
        "Effort",
        "SmoothMotion",
        "SmoothTorque",
        "Time",
        "TimeAndEffort",
        "TimeAndEfforts",
        "TimeAndJerk",
        "TimeAndTorqueRate",
    ),
    "deltaopt.scene.path": ("Corners", "Curve", "Line", "PickAndPlace"),
    "deltaopt.scene.known_limits": ("Limits",),
    "deltaopt.scene.scene": ("Scene",),
    "deltaopt.scene.cycle": ("Cycle",),
    "deltaopt.scene.scene_file": ("load_cycle", "load_scene"),
    "deltaopt.sensitivity.sensitivity": ("Sensitivity",),
    "deltaopt.sweeps.cell_map": ("load_cell",),
    "deltaopt.sweeps.sweep": ("sweep",),
    "deltaopt.sweeps.sweep_file": ("Sweep",),
    "deltaopt.verify.verification": ("Verification", "verify"),
}
"""Public names by their module, which is read when one of them is first used: ``import deltaopt``
takes no longer than Python itself. The imports above say the same to type checkers."""
_RESEARCH = (
    *("AccelerationLevel", "Baumgarte", "InteriorPoint", "Ipopt", "KnotConstraints"),
    *("PiecewiseAcceleration", "Projection", "Redundant", "explicit", "flat", "forward"),
    *("interior_point", "ipopt", "kane", "multiplier", "virtual_work"),
)
"""Names of ``deltaopt.research`` that are found here too, though not listed."""
_METHODS = {
    "save_plan": "deltaopt.report.plan_folder",
    "frame": "deltaopt.output.plan_files",
    "plot_limit": "deltaopt.plots.limits",
    "sensitivity": "deltaopt.sensitivity.sensitivity",
}
"""What a plan offers that is the work of other rooms."""

PLACES |= {name: module for module, names in _PUBLIC.items() for name in names} | _METHODS
PLACES |= dict.fromkeys(_RESEARCH, "deltaopt.research")
__all__ = sorted(name for names in _PUBLIC.values() for name in names)

import_module("deltaopt.verify")  # now, for Python then names the room in this one's namespace
del globals()["verify"]  # in which the function is to be found


def __getattr__(name: str) -> Any:
    """A public name, or a room such as ``deltaopt.errors``: found without this from then on."""
    if name in __all__ or name in _RESEARCH:
        globals()[name] = found = loaded(name)
        return found
    room = f"{__name__}.{name}"
    try:
        if not name.startswith("_"):
            return import_module(room)
    except ModuleNotFoundError as error:
        if error.name != room:
            raise
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
