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
from deltaopt.model import DeltaModel
from deltaopt.planning.baseline import baseline
from deltaopt.planning.flat import Flat
from deltaopt.planning.plan import Plan, Planner, plan
from deltaopt.planning.transcription import PiecewiseAcceleration
from deltaopt.robot import Robot, load_robot
from deltaopt.scene import Limits, Scene, load_scene
from deltaopt.trajectory import Trajectory
from deltaopt.verify import Verification, verify

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

__all__ = [
    "DeltaModel",
    "DeltaOptError",
    "Infeasible",
    "Limits",
    "NotConverged",
    "PiecewiseAcceleration",
    "Plan",
    "Planner",
    "Robot",
    "Scene",
    "SceneError",
    "Trajectory",
    "Unreachable",
    "Verification",
    "baseline",
    "explicit",
    "flat",
    "kane",
    "load_robot",
    "load_scene",
    "multiplier",
    "plan",
    "verify",
    "virtual_work",
]
