"""The Delta's kinematics and dynamics as CasADi functions of the platform's motion.

The independent coordinates ξ of eq. (55) are the platform's position, so that q̇ = C v and q̈ = C a -
P J̇ q̇. The parameters p stay an argument: one function serves every robot with the same terms.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import casadi as ca

from deltaopt.dynamics.constraint_matrix import ClosedForm
from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.dynamics.linear import solve_affine
from deltaopt.dynamics.mechanism import SX, Mechanism
from deltaopt.mechanisms.delta.kinematics import (
    forward_kinematics,
    inverse_kinematics,
    serial_distances,
    tilts,
)
from deltaopt.mechanisms.delta.mechanism import DeltaTerms, delta
from deltaopt.mechanisms.delta.singularities import (
    alignment_margins,
    parallel_margin,
    sideways_margins,
)
from deltaopt.mechanisms.delta.slender_bars import angle_free_equations, chain_forces


@dataclass(frozen=True)
class DeltaFunctions:
    """The functions of all Deltas with the same terms, in a formulation of the dynamics.

    Their arguments are x, v, a: position, velocity and acceleration of the platform, 3 each, m,
    m/s, m/s²; tau: motor torques, 3, N·m; p: the parameters of ``terms``.
    """

    terms: DeltaTerms
    formulation: Formulation

    @cached_property
    def mechanism(self) -> Mechanism:
        """The mechanism in twelve coordinates with nine constraints, of the paper's section 4."""
        return delta(self.terms.symbols())

    @cached_property
    def inverse_kinematics(self) -> ca.Function:
        """(x, p) -> q, 12; NaN out of reach."""
        x, p = SX.sym("x", 3), self.terms.symbols()
        return ca.Function("inverse_kinematics", [x, p.vector()], [inverse_kinematics(p, x)])

    @cached_property
    def forward_kinematics(self) -> ca.Function:
        """(motor angles, p) -> x; NaN where the loops cannot close."""
        theta, p = SX.sym("theta", 3), self.terms.symbols()
        x = forward_kinematics(p, theta)
        return ca.Function("forward_kinematics", [theta, p.vector()], [x])

    @cached_property
    def serial_distances(self) -> ca.Function:
        """(x, p) -> squared distances from serial singularities, 6: cos² q_{k,3} of the three
        chains, then sin² (q_{k,1} - q_{k,2})."""
        x, p = SX.sym("x", 3), self.terms.symbols()
        return ca.Function("serial_distances", [x, p.vector()], [ca.vec(serial_distances(p, x))])

    @cached_property
    def tilt(self) -> ca.Function:
        """(x, p) -> sin q_{k,3} of the three chains, linear in the tool's point x."""
        x, p = SX.sym("x", 3), self.terms.symbols()
        return ca.Function("tilt", [x, p.vector()], [tilts(p, x)])

    @cached_property
    def margins(self) -> ca.Function:
        """q -> signed distances from singularities, 7: cos q_{k,3} and sin (q_{k,1} - q_{k,2}) of
        the three chains, then the volume spanned by the bars' directions."""
        q = SX.sym("q", 12)
        margins = ca.vertcat(sideways_margins(q), alignment_margins(q), parallel_margin(q))
        return ca.Function("margins", [q], [margins])

    @cached_property
    def velocity(self) -> ca.Function:
        """(x, v, p) -> q, q̇, 12 each."""
        x, v, p = self._platform("x", "v")
        q = self.inverse_kinematics(x, p)
        C, _ = ClosedForm().function(self.mechanism)(0, q, p)
        return ca.Function("velocity", [x, v, p], [q, C @ v]).expand()

    @cached_property
    def motion(self) -> ca.Function:
        """(x, v, a, p) -> q, q̇, q̈, 12 each."""
        m = self.mechanism
        x, v, a, p = self._platform("x", "v", "a")
        q, dq = self.velocity(x, v, p)
        C, P = ClosedForm().function(m)(0, q, p)
        bias = ca.Function("bias", [m.q, m.dq, m.parameters], [m.J_bias])(q, dq, p)
        return ca.Function("motion", [x, v, a, p], [q, dq, C @ a - P @ bias]).expand()

    @cached_property
    def explicit_equations(self) -> ca.Function:
        """(x, v, a, tau, p) -> Cᵀ (Q* + Q), alignment, θ̇, θ̈, 3 each.

        The first is eq. (39) in N, zero where the motion obeys the dynamics. The alignment of a
        chain is sin² (q_{k,1} - q_{k,2}), zero in its serial singularity. For slender bars the
        angle-free form of ``slender_bars`` is evaluated, otherwise the general derivation.
        """
        x, v, a, tau = (SX.sym(name, 3) for name in ("x", "v", "a", "tau"))
        terms = self.terms.symbols()
        if self.terms.slender:
            results: tuple[SX, ...] = angle_free_equations(terms, x, v, a, tau)
        else:
            results = self._general_equations(x, v, a, tau, terms.vector())
        inputs = [x, v, a, tau, terms.vector()]
        return ca.Function("explicit_equations", inputs, list(results))

    @cached_property
    def explicit_torques(self) -> ca.Function:
        """(x, v, a, p) -> τ, 3, N·m, the solution of ``explicit_equations`` for the torques."""
        x, v, a, tau, p, force = self._affine_equations()
        return ca.Function("explicit_torques", [x, v, a, p], [solve_affine(force, tau)])

    @cached_property
    def explicit_multipliers(self) -> ca.Function:
        """(x, v, a, p) -> λ of eq. (37), 9, N: the force of each chain on the platform."""
        x, v, a = (SX.sym(name, 3) for name in ("x", "v", "a"))
        terms = self.terms.symbols()
        p = terms.vector()
        if self.terms.slender:
            forces = chain_forces(terms, x, v, a, self.explicit_torques(x, v, a, p))
        else:
            inverse = Explicit().inverse_dynamics(self.mechanism).expand()
            _, forces = inverse(0, *self.motion(x, v, a, p), p)
        return ca.Function("explicit_multipliers", [x, v, a, p], [forces])

    @cached_property
    def explicit_loads(self) -> ca.Function:
        """(x, v, a, p) -> τ, θ̇, 3 each, by ``explicit_equations``."""
        x, v, a = (SX.sym(name, 3) for name in ("x", "v", "a"))
        p = self.terms.symbols().vector()
        rates = self.explicit_equations(x, v, a, SX.zeros(3), p)[2]
        loads = [self.explicit_torques(x, v, a, p), rates]
        return ca.Function("explicit_loads", [x, v, a, p], loads, {"cse": True})

    @cached_property
    def explicit_acceleration(self) -> ca.Function:
        """(x, v, tau, p) -> a, 3, the solution of ``explicit_equations`` for the acceleration."""
        x, v, a, tau, p, force = self._affine_equations()
        return ca.Function("explicit_acceleration", [x, v, tau, p], [solve_affine(force, a)])

    def _affine_equations(self) -> tuple[SX, ...]:
        """Symbols x, v, a, tau, p, and eq. (39), which is affine in τ and in a."""
        x = [SX.sym(name, 3) for name in ("x", "v", "a", "tau")]
        p = self.terms.symbols().vector()
        return *x, p, self.explicit_equations(*x, p)[0]

    def _general_equations(self, x: SX, v: SX, a: SX, tau: SX, p: SX) -> tuple[SX, ...]:
        """The results of ``explicit_equations`` by the general derivation in twelve coordinates."""
        q, dq, ddq = self.motion(x, v, a, p)
        force = Explicit().residual(self.mechanism).expand()(0, q, dq, ddq, tau, p)
        return force, self.serial_distances(x, p)[3:], dq[3::3], ddq[3::3]

    @cached_property
    def inverse_dynamics(self) -> ca.Function:
        """(x, v, a, p) -> τ, 3, λ, 9, in this formulation."""
        x, v, a, p = self._platform("x", "v", "a")
        inverse = self.formulation.inverse_dynamics(self.mechanism)
        tau, lam = inverse(0, *self.motion(x, v, a, p), p)
        return ca.Function("inverse_dynamics", [x, v, a, p], [tau, lam])

    @cached_property
    def forward_dynamics(self) -> ca.Function:
        """(x, v, tau, p) -> a, 3, in this formulation."""
        x, v, tau, p = self._platform("x", "v", "tau")
        forward = self.formulation.forward_dynamics(self.mechanism)
        ddq, _ = forward(0, *self.velocity(x, v, p), tau, p)
        return ca.Function("forward_dynamics", [x, v, tau, p], [ddq[:3]])

    def _platform(self, *names: str) -> list[ca.MX]:
        p = ca.MX.sym("p", len(self.terms.names))
        return [*(ca.MX.sym(name, 3) for name in names), p]


@lru_cache(maxsize=64)
def delta_functions(terms: DeltaTerms, formulation: Formulation) -> DeltaFunctions:
    """The functions of all models with these terms, derived once in a process."""
    return DeltaFunctions(terms, formulation)
