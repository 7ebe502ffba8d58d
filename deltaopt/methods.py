"""Values that say how to plan: formulations of the dynamics and of a plan, and solvers."""

from __future__ import annotations

from deltaopt.dynamics.kane import Kane
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.virtual_work import VirtualWork
from deltaopt.planning.formulations.choice import Flat, Forward
from deltaopt.planning.nlp.problem import InteriorPoint, Ipopt

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
