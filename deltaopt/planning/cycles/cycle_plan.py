"""The plan of a cycle: a plan for each leg, and what the motors do in all of it."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from typing import Any

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.files.validated_record import Vector3, vector3
from deltaopt.later import loaded
from deltaopt.motion.motion_sequence import MotionSequence, waiting
from deltaopt.motion.running_cost import squared_torques
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.plan import Plan
from deltaopt.robot.model import model_of
from deltaopt.scene.cycle import Cycle


@dataclass(frozen=True)
class CyclePlan:
    """A planned cycle.

    ``legs``: the plan of each. ``dwells``: how long the robot waits after each, s. ``gap``:
    estimated relative excess of the period over the least possible with such ways, or of the heat
    in a given period; with belts, whose places depend on when they are met, as if each leg had to
    begin when it does. ``tolerance``: what was asked for. ``prices``: of each motor's RMS torque:
    one per cent more of it would make the period, or the heat in a given one, less by so many per
    cent. ``rounds``: how often all legs were planned, without those for the least period where
    another is given.

    Examples:
        >>> plan = deltaopt.plan_cycle(deltaopt.load_cycle("problems/cycles/there_and_back.yaml"))
        >>> [round(each, 2) for each in plan.phases]
        [0.16, 0.05, 0.12, 0.05]
        >>> max(plan.rms_torque) < 22.0 + 1e-9
        True
    """

    cycle: Cycle
    legs: tuple[Plan, ...]
    dwells: tuple[float, ...]
    gap: float = inf
    tolerance: float = 1e-3
    prices: Vector3 = (0.0, 0.0, 0.0)
    rounds: int = 1

    def __repr__(self) -> str:
        return f"<CyclePlan of {len(self.legs)} legs: {self.in_words}, gap {self.gap:.1e}>"

    @cached_property
    def waits(self) -> tuple[Trajectory | None, ...]:
        """What the robot does after each leg; None where the next follows at once."""
        waits = enumerate(self.dwells)
        return tuple(self.wait_after(k, dwell) if dwell > 0 else None for k, dwell in waits)

    def wait_after(self, index: int, dwell: float) -> Trajectory:
        """A wait of so many seconds after a leg, with its payload; on a belt it moves along."""
        plan = self.legs[index]
        velocity = self.cycle.velocity_after(index)
        return waiting(plan.trajectory.model, plan.reached, velocity, dwell)

    @cached_property
    def trajectory(self) -> MotionSequence:
        """The motion of a period, dwells included: a function of time."""
        pairs = zip(self.legs, self.waits, strict=True)
        parts = (each for plan, wait in pairs for each in (plan.trajectory, wait))
        return MotionSequence(tuple(each for each in parts if each is not None))

    @property
    def period(self) -> float:
        """Of the cycle, s."""
        return sum(self.phases)

    @property
    def at_work(self) -> float:
        """How long the legs take, and the dwells that the cycle asks for, s."""
        return sum(plan.duration for plan in self.legs) + sum(self.cycle.least_dwells)

    @property
    def phases(self) -> tuple[float, ...]:
        """Durations of legs and dwells in turn, s; dwells of no duration among them."""
        pairs = zip(self.legs, self.dwells, strict=True)
        return tuple(each for plan, dwell in pairs for each in (plan.duration, dwell))

    @property
    def parts_per_minute(self) -> float:
        """How many parts are moved in a minute."""
        return 60 * self.cycle.parts / self.period

    @property
    def durations(self) -> Array:
        """Of the legs, (legs,), s."""
        return np.array([plan.duration for plan in self.legs])

    @cached_property
    def squares_of_legs(self) -> Array:
        """∫ τ² dt of each motor over each leg, (legs, 3), N²m²s; of a range of payloads the larger
        of those with its ends, which no mass in between exceeds."""
        return np.array([self.squares_with(k, leg.trajectory) for k, leg in enumerate(self.legs)])

    @cached_property
    def squares(self) -> Array:
        """∫ τ² dt of each motor over the period, (3,), N²m²s, with payloads as in the legs."""
        waits = [self.squares_with(k, wait) for k, wait in enumerate(self.waits) if wait]
        return np.asarray(np.sum([*self.squares_of_legs, *waits], axis=0))

    def squares_with(self, index: int, motion: Trajectory) -> Array:
        """∫ τ² dt of each motor over a motion with the payload of a leg, (3,), N²m²s."""
        scene, squares = self.legs[index].scene, squared_torques(motion)
        if scene.least_payload is None:
            return squares
        light = model_of(scene.robot, scene.with_least_payload.payload)
        return np.maximum(squares, squared_torques(replace(motion, model=light)))

    @property
    def rms_torque(self) -> Vector3:
        """The root of the mean square of each motor's torque over the period, N·m."""
        return vector3(np.sqrt(self.squares / self.period))

    @property
    def in_words(self) -> str:
        """Period and RMS torques in a sentence."""
        rms = ", ".join(f"{each:.4g}" for each in self.rms_torque)
        return f"{self.period:.6f} s, RMS torques {rms} N·m"

    def sensitivity(self, keys: Collection[str] | None = None) -> Any:
        """How the period depends on each number of the cycle and its robot, or on those with some
        ``keys`` alone: a tuple of `Sensitivity`, those first of which a small step changes it most.

        Raises SceneError where that is not known, as on belts, and NotConverged.
        """
        return loaded("sensitivity")(self, keys)

    @property
    def within_tolerance(self) -> bool:
        """Whether the estimated gap is at most the tolerance that was asked for."""
        return self.gap <= self.tolerance
