"""Verified minimum-time motions of Delta robots, and the closed-chain dynamics behind them."""

from deltaopt.dynamics.kane import Kane
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.virtual_work import VirtualWork
from deltaopt.errors import (
    DeltaOptError,
    Infeasible,
    NotConverged,
    SceneError,
    Unreachable,
)
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.flat.flat_problem import Flat
from deltaopt.planning.formulations.choice import Forward, Redundant
from deltaopt.planning.formulations.loop_closure import (
    AccelerationLevel,
    Baumgarte,
    KnotConstraints,
    Projection,
)
from deltaopt.planning.initial_motion import baseline
from deltaopt.planning.nlp.problem import InteriorPoint, Ipopt
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration
from deltaopt.planning.planner import Plan, Planner, plan
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import Robot, load_robot
from deltaopt.scene.objective import Effort, Time, TimeAndEffort
from deltaopt.scene.scene import Limits, Scene, load_scene
from deltaopt.verify.verification import Verification, verify

explicit = Explicit()
"""Model L_E, eq. (39)."""
multiplier = Multiplier()
"""Model L_I, eq. (37)."""
virtual_work = VirtualWork()
"""The Principle of Virtual Work, eq. (23)."""
kane = Kane()
"""Kane's equations, eq. (49)."""
flat = Flat()
"""A plan in minimal coordinates."""
interior_point = InteriorPoint()
"""deltaopt's own solver, in compiled C: the default of the flat formulation."""
ipopt = Ipopt()
"""The general solver of all formulations."""
forward = Forward()
"""A plan with the torque as control and forward dynamics as the defect."""

__all__ = [
    "AccelerationLevel",
    "Baumgarte",
    "DeltaModel",
    "DeltaOptError",
    "Effort",
    "Infeasible",
    "InteriorPoint",
    "Ipopt",
    "KnotConstraints",
    "Limits",
    "NotConverged",
    "PiecewiseAcceleration",
    "Plan",
    "Planner",
    "Projection",
    "Redundant",
    "Robot",
    "Scene",
    "SceneError",
    "Time",
    "TimeAndEffort",
    "Trajectory",
    "Unreachable",
    "Verification",
    "baseline",
    "explicit",
    "flat",
    "forward",
    "interior_point",
    "ipopt",
    "kane",
    "load_robot",
    "load_scene",
    "multiplier",
    "plan",
    "verify",
    "virtual_work",
]
