"""Checks a cycle: every leg as a motion of its own, how they follow each other, and RMS torques.

Squared torques are integrated over legs as the duty of a motion is, in twelve coordinates, and over
dwells by Simpson's rule.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.files.validated_record import Vector3
from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.model import model_of
from deltaopt.scene.moving_ends import Belt, End
from deltaopt.scene.scene import Scene
from deltaopt.verify.bounds import BOUNDARY_DISTANCE, BOUNDARY_SPEED, EXCESS
from deltaopt.verify.verification import Verification, verify

_SAMPLES = 201
"""Of a dwell on a belt: torques change slowly there."""


@dataclass(frozen=True)
class CycleVerification:
    """The measures of a cycle.

    ``legs``: of each. ``rms_torque``: of each motor over the period, N·m; ``rms_limits``: what it
    may be, None without limits. ``jump``: the largest distance, m, between where a leg and its
    dwell end and where the next begins, the first after the last too; ``speed_jump``: likewise of
    velocities, m/s. ``missed``: the largest distance, m, between where a leg ends and where the
    belt has brought its part by then. ``period``: s; ``given_period``: None where it is free.
    """

    legs: tuple[Verification, ...]
    rms_torque: Vector3
    rms_limits: Vector3 | None
    jump: float
    speed_jump: float
    missed: float
    period: float
    given_period: float | None

    @property
    def ok(self) -> bool:
        """Whether the cycle passes."""
        return not self.failures()

    def failures(self) -> list[str]:
        """What is wrong with the cycle, one sentence each; empty if it passes."""
        return list(self._failures())

    def _failures(self) -> Iterator[str]:
        for number, leg in enumerate(self.legs, 1):
            yield from (f"leg {number}: {sentence}" for sentence in leg.failures())
        for motor, (rms, limit) in enumerate(
            zip(self.rms_torque, self.rms_limits or self.rms_torque, strict=True), 1
        ):
            if not rms <= (1 + EXCESS) * limit:
                yield f"the RMS torque of motor {motor} is {rms:.6g} N·m, and may be {limit:.6g}"
        arm = self.legs[0].arm
        if not self.jump <= len(self.legs) * BOUNDARY_DISTANCE * arm:
            yield f"a leg begins {self.jump:.2e} m from where the one before ends"
        if not self.speed_jump <= BOUNDARY_SPEED * arm / min(leg.duration for leg in self.legs):
            yield f"a leg begins {self.speed_jump:.2e} m/s off the velocity before it"
        if not self.missed <= len(self.legs) * BOUNDARY_DISTANCE * arm:
            yield f"a leg ends {self.missed:.2e} m from where the belt has brought its part"
        if self.given_period is not None and abs(self.period - self.given_period) > EXCESS:
            yield f"the period is {self.period:.9g} s, and {self.given_period:.9g} s was asked for"


def verify_cycle(
    legs: Sequence[tuple[Scene, Trajectory]],
    waits: Sequence[Trajectory | None],
    goals: Sequence[End],
    rms_limits: Vector3 | None,
    given_period: float | None,
) -> CycleVerification:
    """Check a cycle.

    ``legs``: the scene of each and its motion. ``waits``: what follows each, None where the next
    leg does at once. ``goals``: where each is to end, on belts at the start of the cycle.
    ``rms_limits``: of the motors' RMS torques, N·m.
    """
    found = tuple(verify(scene, motion) for scene, motion in legs)
    squares = np.zeros(3)
    for leg in found:
        if leg.duty is not None:
            squares += leg.duration * np.square([motor.rms_torque for motor in leg.duty.motors])
    parts, misses = list[Trajectory](), [0.0]
    for (scene, motion), wait, goal in zip(legs, waits, goals, strict=True):
        if isinstance(goal, Belt):
            arrives = sum(part.duration for part in parts) + motion.duration
            place = np.add(goal.at, np.multiply(arrives, goal.belt))
            misses.append(float(np.linalg.norm(_state(motion, -1)[0] - place)))
        parts += [motion] if wait is None else [motion, wait]
        squares += np.zeros(3) if wait is None else _squares(scene, wait)
    period = sum(part.duration for part in parts)
    after = [_state(part, -1) for part in parts]
    before = [_state(part, 0) for part in parts[1:] + parts[:1]]
    jumps = [np.linalg.norm(one - other, axis=1) for one, other in zip(after, before, strict=True)]
    a, b, c = np.sqrt(squares / period).tolist()
    jump, speed_jump = np.max(jumps, axis=0).tolist()
    return CycleVerification(
        found, (a, b, c), rms_limits, jump, speed_jump, max(misses), period, given_period
    )


def _state(motion: Trajectory, which: int) -> Array:
    """Position and velocity at the first or the last knot, (2, 3)."""
    return np.vstack(motion.position.with_rate_at(motion.knots[[which]]))


def _squares(scene: Scene, wait: Trajectory) -> Array:
    """The integral of each motor's squared torque while the robot waits, (3,), N²m²s."""
    x, v = wait.position.with_rate_at(wait.instants(_SAMPLES))
    tau = model_of(scene.robot, scene.payload).inverse_dynamics(x, v, np.zeros_like(x))
    weights = np.ones(_SAMPLES)
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    return np.asarray(wait.duration / (3 * (_SAMPLES - 1)) * (weights @ tau**2))
