"""Cycles of least period by Ipopt: all legs and pauses at once, in another transcription.

The platform's acceleration is a parabola in each interval and may jump between two; positions and
velocities follow by exact integration. Torques are those of the Principle of Virtual Work at both
ends and in the middle of each interval; limits hold for the parabola through the three, Simpson's
rule integrates their squares. Where a motor switches inside of an interval the discrete motion is
then slower than the true one, so that intervals are divided there. It shares no mesh, no equations
of motion, no limits and no solver with the planner.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.files.validated_record import per_motor
from deltaopt.robot.model import DeltaModel, delta_model
from deltaopt.robot.robot import Robot
from tests.oracles.motor_loads import asked_of_motors
from tests.oracles.sparse_program import SparseProgram

Array = NDArray[np.float64]
Point = tuple[float, float, float]

JUMP, FINER = 0.5, 4
"""Change of a torque within an interval that is taken for a jump, in units of the largest, and into
how many that interval is divided."""
STILL = (0.0, 0.0, 0.0)
INSTANTS = (0.0, 0.5, 1.0)
SIMPSON = (1 / 6, 4 / 6, 1 / 6)
GAUSS = ((1 - np.sqrt(0.6)) / 2, 0.5, (1 + np.sqrt(0.6)) / 2), (5 / 18, 8 / 18, 5 / 18)
"""Fractions of a pause on a belt at which torques are evaluated, and their weights."""


@dataclass(frozen=True)
class Leg:
    """A motion to ``goal``, m, with ``payload``, kg, and the ``dwell`` there, s, still with it.

    ``belt``: the velocity, m/s, of a goal that moves; ``goal`` is where it is when the cycle
    begins, it is met at that velocity and stayed with while the dwell lasts.
    """

    goal: Point
    payload: float | None = None
    dwell: float = 0.0
    belt: Point = STILL


@dataclass(frozen=True)
class Cycle:
    """``period``, ``durations`` of the legs, ``dwells``: s. ``rms``: of each motor over the period,
    N·m. ``heat``: the integral over the period of the sum of (τ / rated)², s; None without rated
    torques."""

    period: float
    durations: Array
    dwells: Array
    rms: Array
    heat: float | None


@dataclass(frozen=True)
class Asked:
    """Of a cycle: ``robot``, ``start``, m, and ``legs``. It begins at rest.

    ``peak``: the largest torques, N·m, those of the drive unless given; speeds, and torques at
    speed, are limited as the drive says. ``rated``: the largest RMS torques over the period, N·m,
    dwells included, without ``is_limited`` but the weights of the heat. ``period``: s; then the
    heat is the cost.
    """

    robot: Robot
    start: Point
    legs: tuple[Leg, ...]
    peak: float | Point | None = None
    rated: float | Point | None = None
    is_limited: bool = True
    period: float | None = None

    @property
    def most(self) -> Array:
        return np.array(self.robot.torque_limits if self.peak is None else per_motor(self.peak))


def best_cycle(asked: Asked, intervals: int = 20, refinements: int = 2) -> Cycle:
    """The cycle of least period, or of least heat in a given period.

    ``intervals``: of each leg. They are equal at first; those in which torques jump, and their
    neighbours, are divided as often as ``refinements`` says.
    """
    meshes = [np.full(intervals, 1 / intervals)] * len(asked.legs)
    cycle, motors = _Transcription(asked, meshes).best()
    for _ in range(refinements):
        finer = [_divided(*each, asked.most) for each in zip(meshes, motors, strict=True)]
        if all(len(new) == len(old) for new, old in zip(finer, meshes, strict=True)):
            break
        meshes = finer
        cycle, motors = _Transcription(asked, meshes).best()
    return cycle


def _divided(mesh: Array, motors: Array, most: Array) -> Array:
    """Shares of a leg's duration, from those of intervals and from what it asks of motors in these,
    (intervals, 3, 6)."""
    change = np.ptp(motors[:, :, :3] / most, axis=1).max(axis=1)
    jumps = np.pad(change > JUMP, 1)
    times = np.where(jumps[:-2] | jumps[1:-1] | jumps[2:], FINER, 1)
    return np.repeat(mesh / times, times)


class _Transcription:
    def __init__(self, asked: Asked, meshes: Sequence[Array]) -> None:
        self.asked, self.meshes = asked, meshes
        places = [np.array(each) for each in (asked.start, *(leg.goal for leg in asked.legs))]
        self.ways = list(pairwise(places))
        self.lines = [
            _duration_of_line(delta_model(asked.robot, leg.payload), asked.most, *way)
            for leg, way in zip(asked.legs, self.ways, strict=True)
        ]
        if asked.period is not None:
            still = sum(leg.dwell for leg in asked.legs)
            share = (asked.period - still) / sum(self.lines)
            self.lines = [share * line for line in self.lines]
        self.way = max(float(np.linalg.norm(end - begin)) for begin, end in self.ways)
        self.unit = float(np.mean(self.lines))
        self.program = SparseProgram()

    def best(self) -> tuple[Cycle, list[Array]]:
        """The cycle, and what each leg asks of motors at three instants of each interval,
        (intervals, 3, 6)."""
        asked, program, way, unit = self.asked, self.program, self.way, self.unit
        speed = way / unit
        x = program.unknown(np.array(asked.start), way)
        v = program.unknown(np.zeros(3), speed)
        program.equal(x, asked.start, way)
        program.equal(v, STILL, speed)
        now, squares = ca.SX(0), ca.SX.zeros(3)
        durations, dwells, all_motors = [], [], []
        for number, leg in enumerate(asked.legs):
            x, v, T, used, motors = self._leg(number, x, v)
            all_motors.append(motors)
            now, squares, belt = now + T, squares + used, ca.DM(leg.belt)
            program.equal(x, ca.DM(leg.goal) + now * belt, way)
            pause = ca.SX(leg.dwell)
            program.equal(v, leg.belt, speed)
            squares += self._pause(leg, x, pause)
            x, now = x + pause * belt, now + pause
            durations.append(T)
            dwells.append(pause)
        rated = None if asked.rated is None else np.array(per_motor(asked.rated))
        heat = ca.SX.zeros(3) if rated is None else squares / rated**2
        if rated is not None and asked.is_limited:
            program.limit((heat - now) / unit, -np.inf, 0)
        if asked.period is not None:
            assert rated is not None
            program.equal(now, asked.period, unit)
        cost = now if asked.period is None else ca.sum1(heat)
        wanted = ca.vertcat(*durations), ca.vertcat(*dwells), squares, *all_motors
        long, pauses, used, *found = program.solved(cost / unit, wanted)
        period = float(long.sum() + pauses.sum())
        total = None if rated is None else float((used / rated**2).sum())
        cycle = Cycle(period, long, pauses, np.sqrt(used / period), total)
        return cycle, [each.reshape(-1, 3, 6) for each in found]

    def _leg(self, number: int, x: ca.SX, v: ca.SX) -> tuple[ca.SX, ...]:
        """The position and velocity after a leg, its duration, the integrals of τ², and all that is
        asked of motors, from the state before it."""
        program, way, unit = self.program, self.way, self.unit
        speed, line = way / unit, self.lines[number]
        begin, end = self.ways[number]
        T = program.unknown(np.array([line]), line, 0.05 * line)
        mesh, squares, all_motors = self.meshes[number], ca.SX.zeros(3), []
        for left, length in zip(np.cumsum(mesh) - mesh, mesh, strict=True):
            h, s = length * T, left + length * np.array(INSTANTS)
            bend = (60 * s - 180 * s**2 + 120 * s**3) / line**2
            a = [program.unknown(each * (end - begin), way / unit**2) for each in bend]
            slope, twice = -3 * a[0] + 4 * a[1] - a[2], 2 * a[0] - 4 * a[1] + 2 * a[2]
            before, velocity, motors = x, v, list[ca.SX]()
            for f, share, weight, here in zip(INSTANTS, s, SIMPSON, a, strict=True):
                if f > 0:
                    rise = share**3 * (10 - 15 * share + 6 * share**2)
                    rate = 30 * share**2 * (1 - share) ** 2 / line
                    x = program.unknown(begin + rise * (end - begin), way)
                    v = program.unknown(rate * (end - begin), speed)
                    gained = f * a[0] + f**2 / 2 * slope + f**3 / 3 * twice
                    shift = f**2 / 2 * a[0] + f**3 / 6 * slope + f**4 / 12 * twice
                    program.equal(v, velocity + h * gained, speed)
                    program.equal(x, before + h * f * velocity + h**2 * shift, way)
                motor = self._asked(self.asked.legs[number], x, v, here)
                squares += h * weight * motor[:3] ** 2
                motors.append(motor)
            self._limit(motors)
            all_motors += motors
        return x, v, T, squares, ca.vertcat(*all_motors)

    def _asked(self, leg: Leg, x: ca.SX, v: ca.SX, a: ca.SX) -> ca.SX:
        """Torques and speeds of the motors, 6."""
        asked = asked_of_motors(delta_model(self.asked.robot, leg.payload))
        return self.program.asked(asked, (x, v, a), self.asked.most)

    def _limit(self, motors: Sequence[ca.SX]) -> None:
        """At most what the drive gives: torques and speeds at the beginning, in the middle and at
        the end of an interval. Torques are kept by the parabola through the three, not by these
        alone: what it is nowhere beyond is the control polygon of Bézier's form."""
        drive, program, (begin, middle, end) = self.asked.robot.drive, self.program, motors
        polygon = begin, 2 * middle - (begin + end) / 2, end
        curve = drive.torque_curve or ()
        for each in polygon:
            program.limit(each[:3] / self.asked.most, -1, 1)
            for (slow, more), (fast, less) in pairwise(curve):
                if more > less:
                    slope = (more - less) / (fast - slow)
                    at_rest = more + slope * slow
                    program.limit((each[:3] + slope * each[3:]) / at_rest, -1, 1)
        if drive.speed is not None:
            for each in (middle, end):  # those of the beginning are of the interval before
                program.limit(each[3:] / np.array(per_motor(drive.speed)), -1, 1)

    def _pause(self, leg: Leg, x: ca.SX, pause: ca.SX) -> ca.SX:
        """The integrals of τ² while the platform stays where it is, or with the belt."""
        if leg.belt == STILL:
            asked = asked_of_motors(delta_model(self.asked.robot, leg.payload))
            return pause * asked(leg.goal, STILL, STILL)[0] ** 2
        total, belt = ca.SX.zeros(3), ca.DM(leg.belt)
        for fraction, weight in zip(*GAUSS, strict=True):
            motor = self._asked(leg, x + fraction * pause * belt, ca.SX(belt), ca.SX.zeros(3))
            total += weight * pause * motor[:3] ** 2
        return total


def _duration_of_line(model: DeltaModel, most: Array, begin: Array, end: Array) -> float:
    """The time that a quintic on the straight line takes without friction, s."""
    s, way = np.linspace(0, 1, 21), end - begin
    x = begin[:, None] + np.outer(way, s**3 * (10 - 15 * s + 6 * s**2))
    v = np.outer(way, 30 * s**2 * (1 - s) ** 2)
    a = np.outer(way, 60 * s - 180 * s**2 + 120 * s**3)
    asked = asked_of_motors(model).map(len(s))
    held = asked(x, 0 * x, 0 * x)[0].full()
    moved = asked(x, v, a)[0].full()
    return float(np.sqrt((np.abs(moved - held) / (most[:, None] - np.abs(held))).max()))
