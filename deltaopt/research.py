"""For research: formulations of the dynamics and of a plan, constraint matrices, loop closures,
solvers and an integrator of many digits. ``deltaopt`` itself has most of these names too."""

from __future__ import annotations

from deltaopt.dynamics.constraint_matrix import ClosedForm, NullSpace, Partition, RankRevealing
from deltaopt.dynamics.kane import Kane
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.mechanism import Mechanism
from deltaopt.dynamics.precise_integrator import PreciseIntegrator
from deltaopt.dynamics.virtual_work import VirtualWork
from deltaopt.planning.formulations.choice import Flat, Forward, Redundant
from deltaopt.planning.formulations.loop_closure import (
    AccelerationLevel,
    Baumgarte,
    KnotConstraints,
    Projection,
)
from deltaopt.planning.nlp.problem import InteriorPoint, Ipopt
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration

__all__ = ["Explicit", "Kane", "Mechanism", "Multiplier", "PreciseIntegrator", "VirtualWork"]
__all__ += ["ClosedForm", "NullSpace", "Partition", "RankRevealing"]
__all__ += ["AccelerationLevel", "Baumgarte", "KnotConstraints", "Projection"]
__all__ += ["Flat", "Forward", "InteriorPoint", "Ipopt", "PiecewiseAcceleration", "Redundant"]
__all__ += ["explicit", "flat", "forward", "interior_point", "ipopt", "kane", "multiplier"]
__all__ += ["virtual_work"]

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
