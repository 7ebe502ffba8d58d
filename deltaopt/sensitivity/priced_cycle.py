"""Cycles at their prices: how the least period depends on the numbers of a cycle's file.

With the prices λ of the motors' RMS torques (``planning.cycles``) the Lagrangian of the period P =
Σ T + D of legs and dwells, with S = ∫ τ² dt and the limits r,

    (1 - Σ λ) (Σ T + D) + Σ λ S / r²

does not change to first order with any motion that its limits allow. Of each leg it holds the cost
that the leg has the least of; its dwells are held by torques that are known.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import SceneError
from deltaopt.files.validated_record import vector3
from deltaopt.motion.running_cost import squared_torques
from deltaopt.planning.cycles.cycle_plan import CyclePlan
from deltaopt.planning.plan import Plan
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.cycle import Cycle
from deltaopt.scene.objective import TimeAndEfforts
from deltaopt.scene.scene import Scene
from deltaopt.sensitivity.priced_motion import PricedMotion, priced_motions


@dataclass(frozen=True, eq=False)
class PricedCycle:
    """The legs of a planned cycle at the prices ``of_motors``, λ (3,)."""

    found: CyclePlan
    of_motors: Array
    legs: tuple[PricedMotion, ...]

    def of_job(self, cycle: Cycle) -> float:
        """ln P of the best cycle that differs from this by little, but for a constant: to first
        order in what differs."""
        time, before = 1 - float(self.of_motors.sum()), _squared_limits(self.found.cycle)
        total = 0.0
        pairs = zip(self.legs, cycle.legs, self.found.legs, cycle.least_dwells, strict=True)
        for leg, scene, plan, dwell in pairs:
            priced = scene.model_copy(update={"objective": plan.scene.objective})
            total += time * (leg.cost * leg.of_job(priced) + dwell)
            total += dwell * float(self.of_motors @ (_holding(priced) ** 2 / before))
        allowed = self.found.squares @ (self.of_motors / _squared_limits(cycle))
        return float(total + allowed) / self.found.period

    @property
    def accuracy(self) -> float:
        """A share of the period to which its dependence is known: as the legs are, and as motors
        whose limits have a price use them at these prices."""
        waits = (squared_torques(each) for each in self.found.waits if each is not None)
        squares = sum([*waits, *(squared_torques(leg.motion) for leg in self.legs)])
        period = sum(leg.motion.duration for leg in self.legs) + sum(self.found.dwells)
        unused = np.abs(squares / (_squared_limits(self.found.cycle) * period) - 1)
        of_prices = float(unused[self.of_motors > 0].max(initial=0.0))
        return max(of_prices, *(leg.accuracy for leg in self.legs))


def _holding(scene: Scene) -> Array:
    """The torques that hold the robot at the goal of a scene at rest, (3,), N·m."""
    rest = np.zeros((1, 3))
    goal = np.array([problem_of(scene).goal.position])
    return np.asarray(problem_of(scene).model.inverse_dynamics(goal, rest, rest)[0])


def _squared_limits(cycle: Cycle) -> Array:
    """Of each motor's mean square torque, (3,), N²m²; infinite without a limit."""
    return np.square(np.full(3, np.inf) if cycle.rms_limits is None else cycle.rms_limits)


def priced_cycles(found: CyclePlan) -> list[PricedCycle]:
    """A planned cycle at its prices, with the motions of its legs on two meshes, the second twice
    as fine.

    Raises SceneError for a cycle of a given period or with legs that end moving, and NotConverged.
    """
    if found.cycle.period is not None:
        expected = "none, for sensitivities: then the period is the least"
        raise SceneError(None, "period", found.cycle.period, expected)
    for index, leg in enumerate(found.legs):
        if not problem_of(leg.scene).is_at_rest:
            expected = "a point at rest, for sensitivities: a belt is met when legs before are done"
            raise SceneError(None, f"cycle[{index}].goal", None, expected, "moves")
    prices = np.array(found.prices) / 2
    legs = [_at(prices, found, leg) for leg in found.legs]
    pairs = zip(*(priced_motions(leg) for leg in legs), strict=True)
    return [PricedCycle(found, prices, pair) for pair in pairs]


def _at(prices: Array, found: CyclePlan, leg: Plan) -> Plan:
    """A leg's plan for what it has the least of at some prices."""
    if not prices.any():
        return leg
    effort = vector3(prices / _squared_limits(found.cycle) / (1 - prices.sum()))
    scene = leg.scene.model_copy(update={"objective": TimeAndEfforts(effort=effort)})
    return replace(leg, scene=scene, gap=leg.gap + found.gap)
