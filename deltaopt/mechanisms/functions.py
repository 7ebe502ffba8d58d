"""What planning and verification ask of a robot's kinematics and dynamics, as CasADi functions.

A robot has a platform that translates, and as many actuators as the platform has coordinates. It
gives a `Mechanism`, closed-form kinematics and the distances from its singularities; what follows
from these by the general derivation stands here, and a robot may replace it by a shorter form. The
independent coordinates ξ of eq. (55) are the platform's position, so that q̇ = C v and q̈ = C a - P
J̇ q̇. The parameters p stay an argument: one function serves every robot with the same terms.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import casadi as ca

from deltaopt.dynamics.constraint_matrix import ClosedForm
from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.dynamics.linear import solve_affine
from deltaopt.dynamics.mechanism import SX, Mechanism


@dataclass(frozen=True)
class SingularityDistance:
    """A distance without unit of a position from a kind of singularity: 0 in it and 1 at best.

    ``name``: of the singularity. ``formula``: of the distance, for people. ``per_chain``: whether
    every chain has a distance of its own. ``of``: makes the distance, 3 or 1, an expression of all
    coordinates.
    """

    name: str
    formula: str
    per_chain: bool
    of: Callable[[SX], SX]


class Functions(ABC):
    """The functions of all robots with the same terms, in a formulation of the dynamics.

    Their arguments are x, v, a: position, velocity and acceleration of the platform, 3 each, m,
    m/s, m/s²; tau: forces or torques of the actuators, 3, N or N·m; p: the parameters. Caches are
    looked up by it: there is one object for robots with the same terms.

    ``formulation``: of the dynamics. ``motors``: which of all coordinates q are the actuators'.
    ``lengths``: which of q are lengths, (n,); the others are angles. ``distances``: from all kinds
    of singularities.
    """

    formulation: Formulation
    motors: ClassVar[slice]
    lengths: ClassVar[tuple[bool, ...]]
    distances: ClassVar[Sequence[SingularityDistance]]

    @abstractmethod
    def symbols(self) -> SX:
        """The parameters p as free symbols, a column."""

    @property
    @abstractmethod
    def mechanism(self) -> Mechanism:
        """The mechanism in all coordinates q with its constraints; it has a closed form for δx."""

    @property
    @abstractmethod
    def inverse_kinematics(self) -> ca.Function:
        """(x, p) -> q; NaN out of reach."""

    @property
    @abstractmethod
    def forward_kinematics(self) -> ca.Function:
        """(actuators' positions, p) -> x; NaN where the loops cannot close."""

    @property
    @abstractmethod
    def serial_distances(self) -> ca.Function:
        """(x, p) -> squared distances from serial singularities, 6; the last 3 are the alignments:
        one of each chain that is 0 where the platform's position does not say the chain's."""

    @property
    @abstractmethod
    def tilt(self) -> ca.Function:
        """(x, p) -> sines of the angles by which the bars lean out of the plane of their chain,
        3."""

    @abstractmethod
    def alignments(self, q: SX) -> SX:
        """Squared distances of the chains from their serial singularity, 3, of all coordinates."""

    @abstractmethod
    def tilts(self, q: SX) -> SX:
        """What ``tilt`` is, 3, of all coordinates."""

    @abstractmethod
    def parallel_margin(self, q: SX) -> SX:
        """A volume without unit, at most 1, that is 0 in a parallel singularity; with a sign."""

    @abstractmethod
    def tilt_margin(self, q: SX) -> SX:
        """A volume without unit, at most 1, that is 0 where the platform can tilt; with a sign."""

    @abstractmethod
    def lever(self, p: SX) -> SX:
        """About how far the platform moves while an actuator moves by its unit, m (per rad or m):
        the unit of forces at the platform follows from it."""

    @property
    @abstractmethod
    def payload(self) -> int:
        """Which of the parameters is the payload's mass."""

    def layers(self, p: SX) -> Sequence[tuple[SX, SX]]:
        """Of each part of the actuators' forces that changes its sign within a moment, as Coulomb
        friction does: within ± which speed, and half by how much; none unless stated."""
        return ()

    @cached_property
    def velocity(self) -> ca.Function:
        """(x, v, p) -> q, q̇."""
        x, v, p = self._platform("x", "v")
        q = self.inverse_kinematics(x, p)
        C, _ = ClosedForm().function(self.mechanism)(0, q, p)
        return ca.Function("velocity", [x, v, p], [q, C @ v]).expand()

    @cached_property
    def motion(self) -> ca.Function:
        """(x, v, a, p) -> q, q̇, q̈."""
        m = self.mechanism
        x, v, a, p = self._platform("x", "v", "a")
        q, dq = self.velocity(x, v, p)
        C, P = ClosedForm().function(m)(0, q, p)
        bias = ca.Function("bias", [m.q, m.dq, m.parameters], [m.J_bias])(q, dq, p)
        return ca.Function("motion", [x, v, a, p], [q, dq, C @ a - P @ bias]).expand()

    @cached_property
    def explicit_equations(self) -> ca.Function:
        """(x, v, a, tau, p) -> Cᵀ (Q* + Q), alignments, speeds and accelerations of the actuators,
        3 each.

        The first is eq. (39) in N, zero where the motion obeys the dynamics.
        """
        inputs = [*(SX.sym(name, 3) for name in ("x", "v", "a", "tau")), self.symbols()]
        return ca.Function("explicit_equations", inputs, list(self.general_equations(*inputs)))

    def general_equations(self, x: SX, v: SX, a: SX, tau: SX, p: SX) -> tuple[SX, ...]:
        """The results of ``explicit_equations`` by the general derivation in all coordinates."""
        q, dq, ddq = self.motion(x, v, a, p)
        force = Explicit().residual(self.mechanism).expand()(0, q, dq, ddq, tau, p)
        return force, self.serial_distances(x, p)[3:], dq[self.motors], ddq[self.motors]

    @cached_property
    def explicit_torques(self) -> ca.Function:
        """(x, v, a, p) -> τ, 3, the solution of ``explicit_equations`` for the torques."""
        x, v, a, tau, p, force = self.affine_equations()
        return ca.Function("explicit_torques", [x, v, a, p], [solve_affine(force, tau)])

    @cached_property
    def explicit_acceleration(self) -> ca.Function:
        """(x, v, tau, p) -> a, 3, the solution of ``explicit_equations`` for the acceleration."""
        x, v, a, tau, p, force = self.affine_equations()
        return ca.Function("explicit_acceleration", [x, v, tau, p], [solve_affine(force, a)])

    def affine_equations(self) -> tuple[SX, ...]:
        """Symbols x, v, a, tau, p, and eq. (39), which is affine in τ and in a."""
        x = [SX.sym(name, 3) for name in ("x", "v", "a", "tau")]
        p = self.symbols()
        return *x, p, self.explicit_equations(*x, p)[0]

    @cached_property
    def inverse_dynamics(self) -> ca.Function:
        """(x, v, a, p) -> τ, 3, λ of all constraints, in this formulation."""
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
        p = ca.MX.sym("p", self.symbols().numel())
        return [*(ca.MX.sym(name, 3) for name in names), p]
