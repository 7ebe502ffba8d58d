"""Moves along the axis of the robot, whose duration follows from energy, as plans find them.

By symmetry the three motors do the same, and the motion has one degree of freedom, the angle θ of
the arms. With torques at ±τ the kinetic energy at θ is the work done so far: of the motors, 3 τ Δθ,
and of gravity. So the angle where the torques switch is known in closed form, and the duration is
an integral of 1/θ̇. Nothing of the package but the numbers of the robot file is used for that.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import pytest

from deltaopt import Plan, Robot, Scene, load_robot, plan, verify

GRAVITY = 9.81
NODES, WEIGHTS = np.polynomial.legendre.leggauss(80)


@dataclass(frozen=True)
class VerticalMove:
    """From one height to another, m below the base; slender arms and bars."""

    robot: Robot
    payload: float
    start: float
    goal: float

    @property
    def scene(self) -> Scene:
        ends = {"start": (self.start, 0.0, 0.0), "goal": (self.goal, 0.0, 0.0)}
        return Scene(robot=self.robot, payload=self.payload, **ends)

    @property
    def torque(self) -> float:
        """N·m, signed: that of the first arc."""
        (limit,) = set(self.robot.torque_limits)
        return limit if self.ends[1] > self.ends[0] else -limit

    @property
    def speed(self) -> float:
        """rad/s, signed; infinite if it is not limited."""
        limits = self.robot.speed_limits
        return np.sign(self.torque) * (np.inf if limits is None else limits[0])

    def elbow(self, theta: np.ndarray) -> np.ndarray:
        """(down, outwards) of an elbow, m."""
        r = self.robot
        inset = r.base_radius - r.platform_radius
        arm = r.upper_arm.length
        return np.array([-arm * np.sin(theta), inset + arm * np.cos(theta)])

    def depth(self, theta: np.ndarray) -> np.ndarray:
        """Of the platform, m."""
        down, out = self.elbow(theta)
        return down + np.sqrt(self.robot.forearm.length**2 - out**2)

    @cached_property
    def ends(self) -> tuple[float, float]:
        """θ at the start and the goal, rad, by bisection: raising the arms raises the platform."""
        angles = []
        for depth in (self.start, self.goal):
            low, high = -1.3, 1.3
            for _ in range(100):
                middle = (low + high) / 2
                low, high = (middle, high) if self.depth(middle) > depth else (low, middle)
            angles.append((low + high) / 2)
        return angles[0], angles[1]

    def inertia(self, theta: np.ndarray) -> np.ndarray:
        """Twice the kinetic energy over θ̇², kg·m². A slender bar whose ends move at u and w has
        the kinetic energy m (u² + u w + w²) / 6."""
        r, (down, out) = self.robot, self.elbow(theta)
        elbow = np.array([-r.upper_arm.length * np.cos(theta), down])
        slope = elbow[0] - out * elbow[1] / np.sqrt(r.forearm.length**2 - out**2)
        platform = np.array([slope, np.zeros_like(slope)])
        arms = r.upper_arm.mass * (elbow**2).sum(axis=0)
        bars = r.forearm.mass * (elbow**2 + elbow * platform + platform**2).sum(axis=0)
        return arms + bars + (r.platform.mass + self.payload) * slope**2

    def gravity_work(self, theta: np.ndarray) -> np.ndarray:
        """Since the start, J."""
        r = self.robot

        def moment(angle):
            elbow, depth = self.elbow(angle)[0], self.depth(angle)
            links = 3 * (r.upper_arm.mass * elbow + r.forearm.mass * (elbow + depth)) / 2
            return links + (r.platform.mass + self.payload) * depth

        return GRAVITY * (moment(theta) - moment(self.ends[0]))

    def rate(self, theta: np.ndarray, torque: float, since: float) -> np.ndarray:
        """|θ̇| on an arc of a torque, before or after rest at the angle ``since``."""
        rest = self.gravity_work(since)
        energy = 3 * torque * (theta - since) + self.gravity_work(theta) - rest
        return np.sqrt(2 * energy / self.inertia(theta))

    def time(self, torque: float, rest: float, to: float) -> float:
        """Of an arc between rest and another angle, s: θ = rest + (to - rest) s²."""
        s = (NODES + 1) / 2
        rates = self.rate(rest + (to - rest) * s**2, torque, rest)
        return float(WEIGHTS / 2 @ (2 * s * abs(to - rest) / rates))

    @property
    def switches(self) -> tuple[float, float]:
        """θ where the first arc ends and where the last one begins: the same, where the work of the
        motors and of gravity is zero in the end, or where the speed is at its limit."""
        first, last = self.ends
        at = (first + last) / 2 - self.gravity_work(last) / (6 * self.torque)
        if self.rate(np.array(at), self.torque, first) <= abs(self.speed):
            return at, at
        return self._at_speed(self.torque, first, at), self._at_speed(-self.torque, last, at)

    def _at_speed(self, torque: float, rest: float, fast: float) -> float:
        """Between rest and an angle where it is exceeded, rad, by bisection."""
        slow = rest
        for _ in range(100):
            middle = (slow + fast) / 2
            if self.rate(np.array(middle), torque, rest) > abs(self.speed):
                fast = middle
            else:
                slow = middle
        return (slow + fast) / 2

    @property
    def times(self) -> list[float]:
        """Lengths of the arcs, s."""
        (first, last), (leaves, comes) = self.ends, self.switches
        begin = self.time(self.torque, first, leaves)
        between = (comes - leaves) / self.speed
        return [begin, between, self.time(-self.torque, last, comes)]

    @property
    def duration(self) -> float:
        return sum(self.times)


ORSINO, INDUSTRIAL = (load_robot(f"problems/robots/{n}.yaml") for n in ("orsino", "industrial"))
MOVES = [
    VerticalMove(ORSINO, 1.0, 0.38, 0.52),
    VerticalMove(ORSINO, 1.0, 0.52, 0.38),
    VerticalMove(INDUSTRIAL, 1.0, 0.62, 0.80),
    VerticalMove(INDUSTRIAL, 0.5, 0.80, 0.55),
]
NAMES = ["down", "up", "down, speed limited", "up, speed limited"]
every_move = pytest.mark.parametrize("move", MOVES, ids=NAMES)


@cache
def planned(number: int) -> Plan:
    return plan(MOVES[number].scene, tolerance=1e-8)


@every_move
def test_the_closed_form_conserves_energy(move: VerticalMove):
    """Both arcs have the same speed where they meet, and the platform stands where it should."""
    (first, last), (leaves, comes) = move.ends, move.switches
    before = move.rate(np.array(leaves), move.torque, first)
    after = move.rate(np.array(comes), -move.torque, last)
    assert before == pytest.approx(after, rel=1e-12)
    assert move.depth(np.array(move.ends)) == pytest.approx([move.start, move.goal], rel=1e-14)


@every_move
def test_duration_to_eight_digits(move: VerticalMove):
    found = planned(MOVES.index(move))
    assert found.resolved
    assert found.gap <= 1e-8
    assert found.duration == pytest.approx(move.duration, rel=1e-8)


@every_move
def test_certificate(move: VerticalMove):
    """What `deltaopt plan` prints, and what verification finds in the motion alone."""
    found = planned(MOVES.index(move))
    assert found.certificate is not None
    assert found.certificate.residual <= 1e-5
    assert verify(move.scene, found.trajectory).ok


@every_move
def test_switches_to_six_digits(move: VerticalMove):
    """Every motor is at its limit of torque until the first switch and after the last, and not
    beyond; in between it is at its limit of speed."""
    motion, limit = planned(MOVES.index(move)).trajectory, abs(move.torque)
    first, between, _ = move.times
    apart = 1e-6 * move.duration
    at = motion([first - apart, first + apart, first + between - apart, first + between + apart])
    share = at.tau / limit
    before, after = (share[i] * np.sign(move.torque) for i in (0, 3))
    np.testing.assert_allclose(before, 1, atol=1e-7)
    np.testing.assert_allclose(after, -1, atol=1e-7)
    if between > 0:
        assert np.abs(share[1:3]).max() < 0.999
        rates = motion.model.motion(at.x, at.v, at.a)[1][1:3, 3::3]
        np.testing.assert_allclose(rates, move.speed, rtol=1e-7)


@every_move
def test_meshes_are_never_faster(move: VerticalMove):
    assert plan(move.scene, tolerance=1e-3).duration > move.duration
