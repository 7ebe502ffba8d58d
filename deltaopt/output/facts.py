"""The facts of a motion, collected once: terminal, JSON, pictures and page tell them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from deltaopt.motion.active_limits import ActiveLimit, active_limits
from deltaopt.motion.limit_sensitivity import limits_in_words
from deltaopt.planning.comparisons import straight_lines
from deltaopt.planning.plan import Plan
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.task import Task
from deltaopt.verify.duty import Duty, exceeding
from deltaopt.verify.verification import Verification, verify

ASSUMPTION = "a part is moved and the way back takes as long; gripping and letting go take no time"
"""What the number of parts supposes."""


@dataclass(frozen=True)
class MotorFact:
    """What a motion asks of each motor, or what a motor is rated for: numbers in a ``unit``.

    ``rating``: whether it is what the quantity before it may be in the long run. ``above``: the
    motors that are above it, in words.
    """

    name: str
    unit: str
    values: tuple[float, ...]
    rating: bool = False
    above: str = ""


@dataclass(frozen=True)
class Facts:
    """All that is told of a plan. ``verification``: its measures."""

    plan: Plan
    verification: Verification

    @property
    def too_warm(self) -> str:
        """What happens where a motion is driven there and back without a pause; empty unless motors
        exceed their rated torques then."""
        duty = self.verification.duty
        if duty is None or (duty.rms_share or 0.0) <= 1:
            return ""
        return (
            "motors overheat if this goes on there and back without a pause: "
            f"{duty.rms_share:.2g} times their rated torque; --rated plans it so that they do not"
        )

    @cached_property
    def active(self) -> tuple[ActiveLimit, ...]:
        """The limits that the motion is at, those of most time first."""
        return active_limits(problem_of(self.plan.scene), self.plan.trajectory)

    @cached_property
    def limits(self) -> list[str]:
        """A sentence on each limit that matters: which motor's what, how much of the time, and what
        more of it would save."""
        return limits_in_words(self.active, self.plan.sensitivities)

    @cached_property
    def straight_lines(self) -> dict[str, float]:
        """Durations, s, of what the motion is compared with, by what they are of."""
        return straight_lines(self.plan.scene)


def facts(plan: Plan) -> Facts:
    """The facts of a plan, which is verified now."""
    return Facts(plan, verify(plan.scene, plan.trajectory))


def motor_facts(duty: Duty) -> list[MotorFact]:
    """What is known of each motor's duty at its arm, each rating after what it is of."""
    gear = duty.nominal_torque

    def each(name: str, unit: str, field: str) -> MotorFact:
        values = (getattr(motor, field) for motor in duty.motors)
        return MotorFact(name, unit, tuple(value for value in values if value is not None))

    told = [
        each("RMS torque", "N·m", "rms_torque"),
        MotorFact(
            "rated torque", "N·m", duty.rated_torque or (), True, exceeding(duty.above_rated)
        ),
        each("RMS torque at the motor", "N·m", "motor_rms_torque"),
        each("cubic mean of the gear's torque", "N·m", "gear_torque"),
        MotorFact(
            "nominal torque of the gear",
            "N·m",
            () if gear is None else (gear,) * 3,
            True,
            exceeding(duty.above_nominal),
        ),
        each("work done", "J", "work_done"),
        each("work absorbed", "J", "work_absorbed"),
        each("peak power", "W", "peak_power"),
        each("largest speed", "rad/s", "largest_speed"),
    ]
    return [fact for fact in told if fact.values]


def together(duty: Duty) -> str:
    """Power and work of all motors in words, and what is drawn."""
    done = sum(motor.work_done for motor in duty.motors)
    absorbed = sum(motor.work_absorbed for motor in duty.motors)
    return (
        f"peak power {duty.peak_power:.4g} W; work done {done:.4g} J, absorbed {absorbed:.4g} J; "
        f"drawn {done:.4g} J, or {duty.work_drawn:.4g} J where motors that brake feed the others"
    )


def above_nominal(duty: Duty | None) -> str:
    """Which motors' gears are above their nominal torque; empty where none is, or it is not
    known."""
    if duty is None or not any(duty.above_nominal or ()):
        return ""
    above = exceeding(duty.above_nominal)
    return f"the cubic mean of a gear's torque is above its nominal torque: {above}"


def headline(duration: float) -> str:
    """A duration in s, and how many parts a minute it permits at most: there and back each."""
    rate = 30 / duration
    parts = f"{rate:.0f}" if rate >= 10 else f"{rate:.2g}"
    return f"{_seconds(duration)}, {parts} parts per minute"


def title(task: Task, duration: float) -> str:
    """The headline; the duration alone of a motion that cannot be driven there and back, because
    an end moves."""
    return _seconds(duration) if task.moves_at_ends else headline(duration)


def assumption(task: Task) -> str:
    """What the title supposes; empty where it counts no parts."""
    return "" if task.moves_at_ends else ASSUMPTION


def _seconds(duration: float) -> str:
    return f"{duration:.3f} s" if duration >= 0.1 else f"{duration:.3g} s"
