"""The equations of the flat problem at one point of a motion, in scaled variables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache

import casadi as ca
import numpy as np

from deltaopt.limits.constraints import Constraints
from deltaopt.limits.running_cost import Running
from deltaopt.mechanisms.functions import Functions
from deltaopt.mechanisms.instant import PlatformInstant
from deltaopt.planning.flat.point_problem import PointProblem
from deltaopt.planning.nlp.problem import Cost, effort_of
from deltaopt.planning.nlp.scaling import Parameters


@dataclass(frozen=True, eq=False)
class PointEquations:
    """The equations of motion and the constraint rows at a point, scaled to the order of one.

    ``y``: the 13 unknowns: position from the start, velocity and acceleration in units of the
    scene's length and of the duration (X, V, A; 3 each), torques in units of their limits (3), and
    the duration in units of the scene's time. With limits of order 3 there are 3 more: jerk J after
    A; with limits of torque rates 3 more, in units of the torques' limits over the duration, after
    the torques. ``force``: eq. (39) in units of the largest torque over an arm's length, 3, zero
    where the torques produce the motion; with limits of torque rates also its derivative by time.
    ``rows``: normalised rows of the limits. ``rates``: of running costs, in units of `Cost`.
    ``saturating``, ``strengths``, ``covers``: of Coulomb friction, as of `PointProblem`: θ̇ over the
    width of its change of sign, and c in units of the torque limits. Torques are kept from their
    limits by what a width that is not friction's own may hide: see `Softening`.
    """

    constraints: Constraints
    y: ca.SX
    parameters: Parameters
    force: ca.SX
    rows: ca.SX
    rates: Mapping[Running, ca.SX]
    saturating: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    strengths: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    covers: ca.SX = field(default_factory=lambda: ca.SX(0, 0))

    @property
    def rates_peak(self) -> bool:
        """Whether torque rates are limited that peak where Coulomb friction changes its sign."""
        return self.constraints.has_torque_rates and self.saturating.numel() > 0

    @classmethod
    def of(cls, functions: Functions, constraints: Constraints) -> PointEquations:
        """Derive them for a mechanism and the limits of a scene."""
        parameters = Parameters.symbols(constraints, functions, functions.symbols())
        order, p = constraints.order, parameters
        end, has_rates = 3 * (order + 1), constraints.has_torque_rates
        y = ca.SX.sym("y", end + 3 * (1 + has_rates) + 1)
        T, controls = p.time * y[-1], y[end : end + 3]
        tau = p.torque * controls
        rate = p.torque * y[-4:-1] / T if has_rates else None
        motion = PlatformInstant(
            functions,
            p.origin + p.length * y[:3],
            p.length * y[3:6] / T,
            p.length * y[6:9] / T**2,
            p.mechanism,
            tau,
            jerk=p.length * y[9:12] / T**3 if order == 3 else None,
            given_torque_rate=rate,
        )
        rows = constraints.rows(motion, p.limits)
        control = np.flatnonzero(constraints.is_control).tolist()
        rows[control] = controls  # in units of their limits
        mechanism, load, load_rate = p.mechanism, ca.SX.zeros(3), ca.SX.zeros(3)
        saturating, strengths, covers = ca.SX(0, 1), ca.SX(0, 1), ca.SX(rows.numel(), 0)
        for speed, strength in functions.layers(p.mechanism):
            wide, share = ca.fmax(speed, p.widths), strength / p.torque
            u, by = motion.dtheta / wide, ca.SX.sym("u", 3)
            mechanism = ca.substitute(mechanism, strength, 0)
            load += strength * ca.tanh(u)
            load_rate += strength * (1 - ca.tanh(u) ** 2) / wide * motion.ddtheta
            room = 1 - p.cover * (1 - (speed / wide) ** 2) * share * (1 - ca.tanh(by) ** 2)
            changed = rows[control] + share * (ca.tanh(by) - ca.tanh(u))
            bent = ca.SX(rows.numel(), 3)
            bent[control, :] = _twice(changed / room, by) - _twice(changed, by)
            rows[control] /= ca.substitute(room, by, u)
            saturating = ca.vertcat(saturating, u)
            strengths = ca.vertcat(strengths, share)
            covers = ca.horzcat(covers, ca.substitute(bent, by, u))
        moved = motion
        if saturating.numel():  # what moves the mechanism beside friction as soft as it is here
            rate = None if rate is None else rate - load_rate
            moved = replace(motion, p=mechanism, given_torque=tau - load, given_torque_rate=rate)
        force = moved.force
        if has_rates:
            force = ca.vertcat(force, T * moved.equation_rates[0])
        rates = dict.fromkeys((Running.EFFORT, Running.WEIGHTED_EFFORT), effort_of(tau, p.motors))
        if order == 3:
            rates[Running.JERK] = ca.sumsqr(y[9:12] / y[-1] ** 3)
        if has_rates:
            rates[Running.TORQUE_RATE] = ca.sumsqr(p.torque * y[-4:-1] / T)
        force = force * functions.lever(p.mechanism) / ca.mmax(p.torque)
        if saturating.numel():  # shared before they are derived, or much is derived twice
            force, rows, saturating, covers = ca.cse([force, rows, saturating, covers])
        return cls(
            constraints=constraints,
            y=y,
            parameters=parameters,
            force=force,
            rows=rows,
            rates=rates,
            saturating=saturating,
            strengths=strengths,
            covers=covers,
        )

    def point_problem(self, cost: Cost) -> PointProblem:
        """These equations for the interior-point method, which eliminates the torques, and their
        rates."""
        order, end = self.constraints.order, 3 * (self.constraints.order + 1)
        p = self.parameters
        x = p.origin + p.length * self.y[:3]
        sides = [(upper, lower) for lower, upper in self.constraints.closed_sides.tolist()]
        return PointProblem(
            coordinates=3,
            derivatives=order,
            y=ca.vertcat(self.y[:end], self.y[-1]),
            tau=self.y[end:-1],
            p=p.vector,
            force=self.force,
            rows=self.rows,
            sides=tuple(sides),
            straight=3 * self.constraints.has_torque_rates,
            running=self.rates[cost.rate] if cost.running else ca.SX(0, 1),
            saturating=self.saturating,
            strengths=self.strengths,
            covers=self.covers,
            own=p.widths,
            alike=tuple(self.constraints.alike(x, p.units.numel())),
        )


def _twice(values: ca.SX, by: ca.SX) -> ca.SX:
    """Second derivatives of values, each by its own of as many variables, as a diagonal matrix."""
    return ca.diag(ca.diag(ca.jacobian(ca.diag(ca.jacobian(values, by)), by)))


point_equations = lru_cache(maxsize=64)(PointEquations.of)
"""The equations of a mechanism and its limits, derived once in a process."""
