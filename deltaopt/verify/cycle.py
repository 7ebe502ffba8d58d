"""Checks a cycle: every leg as a motion of its own, how they follow each other, and RMS torques.

So is every dwell that moves along with a belt. While the robot rests, motors hold it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.files.validated_record import Vector3, vector3
from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.model import model_of
from deltaopt.scene.moving_ends import Belt, End, State
from deltaopt.scene.objective import Time
from deltaopt.scene.scene import Scene
from deltaopt.verify.bounds import BOUNDARY_DISTANCE, BOUNDARY_SPEED, EXCESS
from deltaopt.verify.duty import Duty, one_after_the_other
from deltaopt.verify.measures import Distance
from deltaopt.verify.verification import Verification, verify


@dataclass(frozen=True)
class CycleVerification:
    """The measures of a cycle.

    ``legs``: of each. ``dwells``: of those on belts, by the number of the leg before, from 1 on.
    ``duty``: of the motors over the period; None where that of a leg was not evaluated.
    ``rms_limits``: what the RMS of each motor's torque may be, N·m; None without limits.
    ``jump``: the largest distance, m, between where a leg and its dwell end and where the next
    begins, the first after the last too; ``speed_jump``: likewise of velocities, m/s. ``missed``:
    the largest distance, m, between where a leg ends and where the belt has brought its part by
    then. ``period``: s; ``given_period``: None where it is free.
    """

    legs: tuple[Verification, ...]
    dwells: Mapping[int, Verification]
    duty: Duty | None
    rms_limits: Vector3 | None
    jump: float
    speed_jump: float
    missed: float
    period: float
    given_period: float | None

    @property
    def rms_torque(self) -> Vector3 | None:
        """The root of the mean square of each motor's torque over the period, N·m; None where it
        was not evaluated."""
        if self.duty is None:
            return None
        return vector3(motor.rms_torque for motor in self.duty.motors)

    @property
    def distances(self) -> tuple[Distance, ...]:
        """The least of every leg to each kind of singularity."""
        return tuple(distance for leg in self.legs for distance in leg.distances)

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
        for number, dwell in self.dwells.items():
            yield from (f"dwell after leg {number}: {sentence}" for sentence in dwell.failures())
        pairs = zip(self.rms_torque or (), self.rms_limits or (), strict=False)
        for number, (rms, limit) in enumerate(pairs, 1):
            if not rms <= (1 + EXCESS) * limit:
                told = f"the RMS torque of motor {number} is {rms:.6g} N·m"
                yield f"{told}, and may be {limit:.6g}"
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
    dwells = dict[int, Verification]()
    parts, misses, resting, rest = list[Trajectory](), [0.0], np.zeros(3), 0.0
    for number, ((scene, motion), wait, goal) in enumerate(zip(legs, waits, goals, strict=True), 1):
        parts += [motion] if wait is None else [motion, wait]
        if isinstance(goal, Belt):
            leaves = sum(part.duration for part in parts)
            since = leaves if number < len(legs) else 0.0  # the belt brings a part every period
            place = np.add(goal.at, np.multiply(since, goal.belt))
            misses.append(float(np.linalg.norm(_state(parts[-1], -1)[0] - place)))
        if wait is not None and isinstance(goal, Belt):
            dwells[number] = verify(_riding(scene, wait), wait)
        elif wait is not None:
            rest, resting = rest + wait.duration, resting + wait.duration * _holding(scene, wait)
    period = sum(part.duration for part in parts)
    after = [_state(part, -1) for part in parts]
    before = [_state(part, 0) for part in parts[1:] + parts[:1]]
    jumps = [np.linalg.norm(one - other, axis=1) for one, other in zip(after, before, strict=True)]
    jump, speed_jump = np.max(jumps, axis=0).tolist()
    timed = [(each.duration, each.duty) for each in (*found, *dwells.values())]
    judged = [(seconds, duty) for seconds, duty in timed if duty is not None]
    duty = None
    if len(judged) == len(timed):
        duty = one_after_the_other(judged, resting, rest, legs[0][0].robot)
    return CycleVerification(
        found, dwells, duty, rms_limits, jump, speed_jump, max(misses), period, given_period
    )


def _state(motion: Trajectory, which: int) -> Array:
    """Position and velocity at the first or the last knot, (2, 3)."""
    return np.vstack(motion.position.with_rate_at(motion.knots[[which]]))


def _riding(scene: Scene, wait: Trajectory) -> Scene:
    """What a dwell on a belt is to keep: the limits of the leg before it, and its bodies."""
    (at, velocity), (to, _) = _state(wait, 0).tolist(), _state(wait, -1).tolist()
    ends = {"start": State(at=at, velocity=velocity), "goal": State(at=to, velocity=velocity)}
    others = dict.fromkeys(("via", "approach", "path", "tube", "rotation"))
    return scene.model_copy(update={**others, **ends, "objective": Time()})


def _holding(scene: Scene, wait: Trajectory) -> Array:
    """The squared torques that hold the robot where it waits, (3,), N²m², with the payload of a
    range that makes them larger."""
    x = _state(wait, 0)[:1]
    still = np.zeros_like(x)
    models = (model_of(each.robot, each.payload) for each in (scene, scene.with_least_payload))
    held = [each.inverse_dynamics(x, still, still)[0] ** 2 for each in models]
    return np.asarray(np.max(held, axis=0))
