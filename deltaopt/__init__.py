"""Verified minimum-time motions of Delta robots, and the closed-chain dynamics behind them."""

from deltaopt.interrupts.imports import end_at_once_if_command

end_at_once_if_command()

from deltaopt.dynamics.kane import Kane
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.virtual_work import VirtualWork
from deltaopt.errors import (
    DeltaOptError,
    Infeasible,
    MissingPackage,
    NotConverged,
    SceneError,
    Singular,
    Unreachable,
)
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.files.version import __version__
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.saved_plan import SavedPlan, UnreadablePlan, load_plan
from deltaopt.planning.comparisons import beside_free_path, timed_line
from deltaopt.planning.first_motions.initial_motion import baseline
from deltaopt.planning.flat.flat_problem import Flat
from deltaopt.planning.formulations.choice import Forward, Redundant
from deltaopt.planning.formulations.loop_closure import (
    AccelerationLevel,
    Baumgarte,
    KnotConstraints,
    Projection,
)
from deltaopt.planning.nlp.problem import InteriorPoint, Ipopt
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration
from deltaopt.planning.plan import Plan
from deltaopt.planning.planner import Planner, plan
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import Robot, load_robot
from deltaopt.scene.moving_ends import Anywhere, Belt, State
from deltaopt.scene.objective import Effort, Time, TimeAndEffort
from deltaopt.scene.path import Corners, Curve, Line, PickAndPlace
from deltaopt.scene.scene import Limits, Scene, load_scene
from deltaopt.verify.verification import Verification, verify

explicit = Explicit()
"""Dynamics by model L_E, eq. (39): Lagrange without multipliers."""
multiplier = Multiplier()
"""Dynamics by model L_I, eq. (37): Lagrange with multipliers."""
virtual_work = VirtualWork()
"""Dynamics by the Principle of Virtual Work, eq. (23)."""
kane = Kane()
"""Dynamics by Kane's equations, eq. (49)."""
flat = Flat()
"""The flat formulation of a plan: the platform's motion and the torques are the unknowns."""
interior_point = InteriorPoint()
"""deltaopt's own interior-point method in compiled C, the default of the flat formulation."""
ipopt = Ipopt()
"""The general solver Ipopt, which solves all formulations."""
forward = Forward()
"""The forward formulation of a plan: torques are controls, forward dynamics is collocated."""

__all__ = [
    "AccelerationLevel",
    "Anywhere",
    "Baumgarte",
    "Belt",
    "Corners",
    "Curve",
    "DeltaModel",
    "DeltaOptError",
    "Effort",
    "Infeasible",
    "InteriorPoint",
    "Ipopt",
    "KnotConstraints",
    "Limits",
    "Line",
    "MissingPackage",
    "NotConverged",
    "PickAndPlace",
    "PiecewiseAcceleration",
    "Plan",
    "Planner",
    "ProgressBar",
    "Projection",
    "Redundant",
    "Robot",
    "SavedPlan",
    "Scene",
    "SceneError",
    "Singular",
    "State",
    "Time",
    "TimeAndEffort",
    "Trajectory",
    "Unreachable",
    "UnreadablePlan",
    "Verification",
    "__version__",
    "baseline",
    "beside_free_path",
    "explicit",
    "flat",
    "forward",
    "interior_point",
    "ipopt",
    "kane",
    "load_plan",
    "load_robot",
    "load_scene",
    "multiplier",
    "plan",
    "timed_line",
    "verify",
    "virtual_work",
]
