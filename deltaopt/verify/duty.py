"""The duty of the motors in a motion: RMS torque, mechanical work, power, speed.

All of it is at the arm and of the torque that limits bound: that of the drive, which accelerates
its own rotor too where the robot names its inertia. A gear transmits the rest of that torque, and
is rated by a mean of its third power, weighted with speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from operator import attrgetter

import numpy as np

from deltaopt.curves.piecewise import Array, Index
from deltaopt.files.validated_record import Vector3
from deltaopt.robot.catalogue import gain
from deltaopt.robot.machine import Machine
from deltaopt.verify.resolved_curves import WEIGHTS, Cells, Curves, ResolvedCurves

_POWER, _TOTAL, _SPEED = slice(0, 3), 3, slice(4, 7)
_TORQUE, _PASSED = slice(7, 10), slice(10, 13)
"""Columns of the curves: each motor's power (W), that of all (W), each speed (rad/s), torque of the
drive and torque that passes its gear (N·m)."""
_NEGLIGIBLE = 1e-12
"""Share of the largest torque below which a torque changes its sign by rounding alone."""


@dataclass(frozen=True)
class MotorDuty:
    """What a motion asks of one motor, at its arm.

    ``rms_torque``: N·m, of a range of payloads the larger with one of its ends, which no mass in
    between exceeds; all else is of the largest. ``motor_rms_torque``: the same at the motor, None
    where the robot does not name motor and gear. ``work_done``: mechanical work in J while its
    power is positive, and ``work_absorbed`` while it is negative, counted positive.
    ``peak_power``: the largest, W. ``largest_speed``: rad/s. ``gear_torque``: N·m, the cubic mean
    of the torque that passes the gear, weighted with speed, (∫ |τ|³ |θ̇| dt / ∫ |θ̇| dt)^(1/3); None
    without a gear, or if the motor stands still. ``travel``: ∫ |θ̇| dt, rad.
    """

    rms_torque: float
    motor_rms_torque: float | None
    work_done: float
    work_absorbed: float
    peak_power: float
    largest_speed: float
    gear_torque: float | None
    travel: float


def exceeding(above: tuple[bool, ...] | None) -> str:
    """The motors that are above a rating in words, such as "above in motors 1 and 3"; empty if
    none is."""
    which = [str(k) for k, is_above in enumerate(above or (), 1) if is_above]
    if not which:
        return ""
    names = " and ".join(filter(None, [", ".join(which[:-1]), which[-1]]))
    return f"above in motor{'s' if len(which) > 1 else ''} {names}"


@dataclass(frozen=True)
class Duty:
    """What a motion asks of all motors.

    ``motors``: of each. ``peak_power``: the largest of all motors together, W. ``work_drawn``: that
    they do while the power of all together is positive, J: all that is drawn where those that brake
    feed those that drive. ``rated_torque``: of each motor for its RMS, and ``nominal_torque`` of a
    gear for its cubic mean, N·m at the arm; None where the robot does not name them.
    """

    motors: tuple[MotorDuty, ...]
    peak_power: float
    work_drawn: float
    rated_torque: Vector3 | None
    nominal_torque: float | None

    @property
    def above_rated(self) -> tuple[bool, ...] | None:
        """Whether each motor's RMS torque is above the rated one, so that the motion can only be
        repeated with a pause; None where the robot does not name it."""
        if self.rated_torque is None:
            return None
        pairs = zip(self.motors, self.rated_torque, strict=True)
        return tuple(motor.rms_torque > rated for motor, rated in pairs)

    @property
    def rms_share(self) -> float | None:
        """The RMS torque of the motor that is warmest, over what it is rated for; None where that
        is not known."""
        if self.rated_torque is None:
            return None
        pairs = zip(self.motors, self.rated_torque, strict=True)
        return max(motor.rms_torque / rated for motor, rated in pairs)

    @property
    def above_nominal(self) -> tuple[bool, ...] | None:
        """Whether the cubic mean of each gear's torque is above the nominal one; None where the
        robot does not name it."""
        nominal = self.nominal_torque
        if nominal is None:
            return None
        return tuple((motor.gear_torque or 0.0) > nominal for motor in self.motors)

    def with_larger_rms(self, other: Duty) -> Duty:
        """This duty, with the RMS torque of each motor in ``other``, the same motion with another
        payload, where that is larger."""
        pairs = zip(self.motors, other.motors, strict=True)
        hotter = (max(pair, key=attrgetter("rms_torque")) for pair in pairs)
        motors = (
            replace(own, rms_torque=most.rms_torque, motor_rms_torque=most.motor_rms_torque)
            for own, most in zip(self.motors, hotter, strict=True)
        )
        return replace(self, motors=tuple(motors))

    def as_dict(self) -> dict[str, object]:
        """All numbers, and what is above its rating, by name."""
        above = {"above_rated": self.above_rated, "above_nominal": self.above_nominal}
        return asdict(self) | above


def duty(motors: Curves, cells: Cells, lengths: Array, robot: Machine) -> Duty:
    """The duty of a motion.

    ``motors``: θ̇, θ̈ and τ of the motors, (N, 9), at (piece (N,), fraction of it (N,)).
    ``cells``: parts of the pieces in which these are smooth and no motor turns back. ``lengths``:
    of the pieces, s. Integrals are by Clenshaw and Curtis's rule in cells that end where a torque
    changes its sign, so that no integrand has a kink inside of one.
    """
    inertia = robot.drive.inertia or 0.0

    def curves(pieces: Index, fractions: Array) -> Array:
        speed, acceleration, torque = np.split(motors(pieces, fractions), 3, axis=1)
        power = torque * speed
        total, passed = power.sum(axis=1, keepdims=True), torque - inertia * acceleration
        return np.hstack([power, total, np.abs(speed), torque, passed])

    sampled = ResolvedCurves.sampled(curves, cells)
    for column in (_TOTAL, *range(7, 10), *(range(10, 13) if inertia else ())):
        least = _NEGLIGIBLE * float(np.abs(sampled.values[..., column]).max())
        cells = cells.cut(*sampled.roots(column, least))
    sampled = ResolvedCurves.sampled(curves, cells)
    values, seconds = sampled.values, lengths[cells.piece] * (cells.end - cells.begin)

    def integral(of: Array) -> Array:
        """Over time, of values (M, n, 3) in cells."""
        return np.asarray(np.einsum("m,j,mjc->c", seconds, WEIGHTS, of))

    work = seconds[:, None] * np.einsum("j,mjc->mc", WEIGHTS, values[..., _POWER])
    together = work.sum(axis=1)
    rms = np.sqrt(integral(values[..., _TORQUE] ** 2) / lengths.sum())
    peaks = sampled.highest(_SPEED.stop).values
    travel = integral(values[..., _SPEED])
    cubes = integral(np.abs(values[..., _PASSED]) ** 3 * values[..., _SPEED])
    motor, gear = robot.drive.motor, robot.drive.gear
    each = (
        MotorDuty(
            rms_torque=float(rms[k]),
            motor_rms_torque=float(rms[k]) / gain(gear) if motor else None,
            work_done=float(work[:, k].clip(min=0.0).sum()),
            work_absorbed=float((-work[:, k]).clip(min=0.0).sum()),
            peak_power=float(peaks[_POWER][k]),
            largest_speed=float(peaks[_SPEED][k]),
            gear_torque=float(np.cbrt(cubes[k] / travel[k])) if gear and travel[k] > 0 else None,
            travel=float(travel[k]),
        )
        for k in range(3)
    )
    return Duty(
        motors=tuple(each),
        peak_power=float(peaks[_TOTAL]),
        work_drawn=float(together.clip(min=0.0).sum()),
        rated_torque=robot.rms_torque,
        nominal_torque=gear.nominal_torque if gear else None,
    )


def one_after_the_other(
    parts: Sequence[tuple[float, Duty]], resting: Array, rest: float, robot: Machine
) -> Duty:
    """The duty of motions of a robot one after the other.

    ``parts``: how long each takes, s, and its duty. ``resting``: the integral of each motor's
    squared torque while the robot waits for ``rest`` s beside that, (3,), N²m²s.
    """
    motor, gear = robot.drive.motor, robot.drive.gear
    duties, period = [each for _, each in parts], rest + sum(seconds for seconds, _ in parts)
    motors = list[MotorDuty]()
    for k in range(3):
        of = [each.motors[k] for each in duties]
        squares = sum(seconds * each.motors[k].rms_torque ** 2 for seconds, each in parts)
        rms, travel = float(np.sqrt((squares + resting[k]) / period)), sum(m.travel for m in of)
        cubes = sum(m.travel * (m.gear_torque or 0.0) ** 3 for m in of)
        motors.append(
            MotorDuty(
                rms_torque=rms,
                motor_rms_torque=rms / gain(gear) if motor else None,
                work_done=sum(m.work_done for m in of),
                work_absorbed=sum(m.work_absorbed for m in of),
                peak_power=max(m.peak_power for m in of),
                largest_speed=max(m.largest_speed for m in of),
                gear_torque=float(np.cbrt(cubes / travel)) if gear and travel > 0 else None,
                travel=travel,
            )
        )
    peak, drawn = max(e.peak_power for e in duties), sum(e.work_drawn for e in duties)
    return replace(duties[0], motors=tuple(motors), peak_power=peak, work_drawn=drawn)
