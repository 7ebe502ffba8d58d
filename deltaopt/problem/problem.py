"""A problem: what is optimised, whatever scene it comes from.

Solvers, meshes, slowing and gaps know the problem, and no scene, key or task.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import dist

from deltaopt.limits.running_cost import LEAST_TIME, CostFunctional
from deltaopt.limits.scene_limits import SceneLimits
from deltaopt.problem.boundary import Boundary
from deltaopt.robot.machine import Model

_ROUNDING = 1e-9
"""Relative difference of two durations that are the same but for rounding."""


@dataclass(frozen=True, eq=False)
class Problem:
    """What is optimised: a motion in phases between boundaries, under limits, at least cost.

    ``model``: of the robot with its payload. ``limits``: quantities of the motion with their
    bounds. ``boundaries``: one more than there are phases. ``objective``: what is least.
    ``least_duration``: that the motion takes at least, s, whatever its limits are.
    """

    model: Model
    limits: SceneLimits
    boundaries: tuple[Boundary, ...]
    objective: CostFunctional = LEAST_TIME
    least_duration: float = 0.0

    @cached_property
    def start(self) -> Boundary:
        """Where the motion begins."""
        return self.boundaries[0]

    @cached_property
    def goal(self) -> Boundary:
        """Where it ends."""
        return self.boundaries[-1]

    @cached_property
    def gates(self) -> tuple[Boundary, ...]:
        """Where its phases meet."""
        return self.boundaries[1:-1]

    @cached_property
    def is_at_rest(self) -> bool:
        """Whether the motion is at rest at both ends, at places that are known, so that slowed
        uniformly it still solves the problem."""
        return self.start.is_rest_at_a_point and self.goal.is_rest_at_a_point

    @property
    def together(self) -> int:
        """How many intervals of a mesh after each other are of equal length: three where
        acceleration is continuous, in which it is linear, and one elsewhere."""
        return 3 if self.limits.constraints.order == 3 else 1

    @property
    def may_be_slowed(self) -> bool:
        """Whether a motion that exceeds a limit may be slowed until it keeps it, at no other cost
        than time: not where rates of torques peak, for they cancel peaks of friction, which shrink
        less than they do."""
        return self.is_at_rest and not self.objective.running and not self.rates_peak

    @property
    def rates_peak(self) -> bool:
        """Whether rates of torques are limited that peak where an arm turns back, since Coulomb
        friction changes its sign there."""
        return self.limits.constraints.has_torque_rates and bool(self.model.layers)

    @property
    def may_switch(self) -> bool:
        """Whether the fastest motion is one of arcs that hold limits, from rest to rest, at whose
        ends torques jump: not where their rates are limited, nor in several phases."""
        jumps = self.limits.constraints.order < 3
        return jumps and self.may_be_slowed and not self.gates

    def is_least_duration(self, duration: float) -> bool:
        """Whether a motion of this duration, s, is as fast as any, whatever its limits are."""
        return duration <= self.least_duration * (1 + _ROUNDING)

    @property
    def distance(self) -> float:
        """The straight distance from start to goal, m, where both are known."""
        return dist(self.goal.position, self.start.position)
