"""Integration to twelve digits, for motions that have to be followed exactly."""

from __future__ import annotations

from threading import local
from typing import Any

import casadi as ca
import numpy as np

from deltaopt.dynamics.linear import Array
from deltaopt.interrupts.requests import requests_held

_PRECISE: dict[str, Any] = {
    "reltol": 1e-12,
    "abstol": 1e-13,
    "linear_multistep_method": "adams",
    "nonlinear_solver_iteration": "functional",
    "max_num_steps": 20_000,  # an interval of a mesh takes about 20
    "disable_internal_warnings": True,
    "show_eval_warnings": False,  # a failure is not a number, and told by the caller
}


class PreciseIntegrator:
    """An integrator by CVODES to 12 digits, for motions that have to be followed exactly.

    It advances a state over a stretch of time of a ``length`` in which the state's derivative
    ``rate`` is smooth and not stiff; state and time are in units in which they are of the order of
    one. ``u``: the fraction of the stretch that has passed. Any number of threads may call it.
    """

    def __init__(
        self, u: ca.MX, state: ca.MX, rate: ca.MX, length: ca.MX, parameters: ca.MX
    ) -> None:
        self._problem = {"t": u, "x": state, "p": parameters, "ode": length * rate}
        self._of_thread = local()

    def __call__(self, state: Array, parameters: Array) -> Array:
        """The state after a stretch of time; not a number where CVODES fails."""
        with requests_held():
            integrator = self._integrator
            try:
                after = integrator(x0=state, p=parameters)["xf"]
            except RuntimeError:  # CasADi's only word for it
                return np.full(len(state), np.nan)
        return np.asarray(after.full()).ravel()

    @property
    def _integrator(self) -> ca.Function:
        """That of this thread. A CasADi function may be called by several threads at once, but the
        integrators of SUNDIALS then write into each other's memory: results are wrong, or the
        process ends."""
        own = self._of_thread
        if not hasattr(own, "integrator"):
            own.integrator = ca.integrator("stretch", "cvodes", self._problem, 0, 1, _PRECISE)
        integrator: ca.Function = own.integrator
        return integrator
