"""The functions of a Delta's model as machine code that also tells where results need care.

Each returns, after its results, guards: numbers that are negative, or not numbers, near
singularities and out of reach. They follow from expressions that the results need anyway, and
where they fail the model looks closer.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca

from deltaopt.codegen.simplify import simplified
from deltaopt.codegen.vectorised import RowFunction
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.dynamics.mechanism import SX
from deltaopt.dynamics.virtual_work import VirtualWork
from deltaopt.mechanisms.delta.functions import DeltaFunctions
from deltaopt.mechanisms.delta.mechanism import MOTOR_ANGLES
from deltaopt.mechanisms.delta.singularities import margins, parallel_margin
from deltaopt.robot.singular_points import NEAR

_CAREFUL = 2 * NEAR
"""Distance from a singularity below which guards fail. It need only be larger than any distance
where the model does something else, by more than rounding; points between cost a second look."""
_FINITE = 1e300
"""Square of a distance, m², that no mechanism has."""


@dataclass(frozen=True)
class GuardedFunctions:
    """The functions of a model for many points, compiled when first called.

    Formulations whose equations cannot be written out in scalars (model L_I, and constraint
    matrices by decomposition) are interpreted.
    """

    functions: DeltaFunctions

    @cached_property
    def inverse_kinematics(self) -> RowFunction:
        """(x, p) -> q; guarded against being out of reach."""
        return _guarded(self.functions.inverse_kinematics, self.functions.serial_distances)

    @cached_property
    def forward_kinematics(self) -> RowFunction:
        """(motor angles, p) -> x; guarded against loops that do not close."""
        function = self.functions.forward_kinematics
        return _guarded(function, lambda theta, p: _FINITE - ca.sumsqr(function(theta, p)))

    @cached_property
    def serial_distances(self) -> RowFunction:
        """(x, p) -> cos² q_{k,3}, sin² (q_{k,1} - q_{k,2}) of the chains, without guards."""
        return RowFunction(self.functions.serial_distances)

    @cached_property
    def motion(self) -> RowFunction:
        """(x, v, a, p) -> q, q̇, q̈; guarded against serial singularities."""
        return _guarded(self.functions.motion, self._serial)

    @cached_property
    def torques(self) -> RowFunction:
        """(x, v, a, p) -> τ; guarded against all singularities."""
        if self.functions.formulation == Explicit():
            return _guarded(self.functions.explicit_torques, self._explicit)
        return _guarded(_result(self.functions.inverse_dynamics, 0), self._any)

    @cached_property
    def multipliers(self) -> RowFunction:
        """(x, v, a, p) -> λ; guarded against all singularities."""
        if self.functions.formulation == Explicit():
            return _guarded(self.functions.explicit_multipliers, self._explicit)
        return _guarded(_result(self.functions.inverse_dynamics, 1), self._any)

    @cached_property
    def accelerations(self) -> RowFunction:
        """(x, v, τ, p) -> a; guarded against serial singularities."""
        if self.functions.formulation == Explicit():
            return _guarded(self.functions.explicit_acceleration, lambda *x: self._explicit(*x)[:6])
        return _guarded(self.functions.forward_dynamics, self._serial)

    @cached_property
    def joint_torques(self) -> RowFunction:
        """(q, q̇, q̈, p) -> τ by virtual work with the motor angles as independent coordinates;
        guarded against parallel singularities."""
        inverse = VirtualWork(MOTOR_ANGLES).inverse_dynamics(self.functions.mechanism)
        _, q, dq, ddq, p = inverse.mx_in()
        tau, _ = inverse(0, q, dq, ddq, p)
        function = ca.Function("joint_torques", [q, dq, ddq, p], [tau])
        return _guarded(function, lambda q, *_: parallel_margin(q) ** 2 - _CAREFUL**2)

    @cached_property
    def _squares(self) -> ca.Function:
        """(x, p) -> squares of the seven ``margins``; NaN out of reach."""
        x, p = self.functions.inverse_kinematics.sx_in()
        distances = margins(self.functions.inverse_kinematics(x, p))
        return ca.Function("squares", [x, p], [distances**2])

    def _explicit(self, x: SX, v: SX, a: SX, p: SX) -> SX:
        """Guards, 7, of what eq. (39) needs anyway: ∂θ̇/∂v is the bar's direction divided by
        2 a₂ cos q_{k,3} sin (q_{k,1} - q_{k,2})."""
        tau = SX.sym("tau", 3)
        force, in_line, *_ = self.functions.explicit_equations(x, v, a, tau, p)
        sideways = self.functions.serial_distances(x, p)[:3]
        arm = 2 * p[self.functions.terms.names.index("a2")]
        divisors = [arm**2 * sideways[k] * in_line[k] for k in range(3)]
        volume = ca.det(ca.jacobian(force, tau)) ** 2 * divisors[0] * divisors[1] * divisors[2]
        return ca.vertcat(sideways, in_line, volume) - _CAREFUL**2

    def _any(self, *inputs: SX) -> SX:
        return self._squares(inputs[0], inputs[-1]) - _CAREFUL**2

    def _serial(self, *inputs: SX) -> SX:
        return self._any(*inputs)[:6]


def _guarded(function: ca.Function, guards: Callable[..., Any]) -> RowFunction:
    """A function for many points, with guards that are found from the same inputs."""
    with suppress(RuntimeError):  # it calls LAPACK or a sparse solver: then it stays as it is
        function = function.expand()
    scalar = function.is_a("SXFunction")
    inputs: list[Any] = list(function.sx_in() if scalar else function.mx_in())
    results: list[Any] = [*function.call(inputs), guards(*inputs)]
    whole = ca.Function(function.name(), inputs, results)
    return RowFunction(simplified(whole) if scalar else whole, guarded=True)


def _result(function: ca.Function, i: int) -> ca.Function:
    """One of the results of a function of matrix expressions."""
    inputs = function.mx_in()
    return ca.Function(function.name_out(i), inputs, [function.call(inputs)[i]])


guarded_functions = lru_cache(maxsize=64)(GuardedFunctions)
"""The guarded functions of all models with the same functions, compiled once in a process."""
