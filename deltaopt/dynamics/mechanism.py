"""A mechanism described once, symbolically; everything else is derived from it.

What a user writes down: coordinates, bodies, efforts, constraints.
What follows by differentiation (the paper's letters):

    T, V          kinetic and potential energy                       eq. (62)-(64), (77)-(79)
    M, Q_gyr      Q* = -M q̈ + Q_gyr, inertia matrix and gyroscopic   eq. (33), (65)
    Q             active generalized force                           eq. (31)
    J, mu         J q̇ + μ = 0, all constraints at velocity level     eq. (1)-(4)
    J_bias        J q̈ + J_bias = 0, the same at acceleration level
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import inf

import casadi as ca

SX = ca.SX


def by_chains(J: SX) -> tuple[SX, SX]:
    """C of eq. (55) and its right inverse P, J C = 0, J P = 1, block by block.

    The first coordinates are the independent ones, and each loop has as many more and as many rows,
    which depend on no other loop's.
    """
    m, n = J.shape[0], J.shape[1] - J.shape[0]
    inverses = [ca.inv_minor(J[k : k + n, n + k : 2 * n + k]) for k in range(0, m, n)]
    C = ca.vertcat(SX.eye(n), *(-inverse for inverse in inverses))
    return C, ca.vertcat(SX(n, m), ca.diagcat(*inverses))


def none() -> SX:
    """A column without rows, for what a mechanism does not have."""
    return SX(0, 1)


@dataclass(frozen=True)
class Body:
    """A rigid body, or a particle if it has no inertia.

    ``position``: r* of the centre of mass in inertial axes, 3, m.
    ``inertia``: principal moments about the centre of mass, 3, kg·m².
    ``angular_velocity``: ω in the body's principal axes, 3, rad/s, linear in q̇.
    """

    name: str
    mass: SX | float
    position: SX
    inertia: SX = field(default_factory=none)
    angular_velocity: SX = field(default_factory=none)


@dataclass(frozen=True)
class Most:
    """The most that an effort can give beside its motor: ``pushing`` along its rate, ``braking``
    against it, and ``by_speed`` more braking for each unit of that speed; N or N·m."""

    pushing: SX | float = 0.0
    braking: SX | float = 0.0
    by_speed: SX | float = 0.0

    def __add__(self, other: Most) -> Most:
        pushing, braking = self.pushing + other.pushing, self.braking + other.braking
        return Most(pushing, braking, self.by_speed + other.by_speed)


UNBOUNDED = Most(inf, inf)
"""Of what does not say how much it can give."""


@dataclass(frozen=True)
class Effort:
    """An active force or torque ``value`` that does the power value · ``rate``.

    ``rate`` is the conjugate speed (m/s or rad/s), linear in q̇: for a motor the
    relative angular velocity of the two bodies it turns against each other.
    ``most``: of what it is beside its motor's control.
    """

    value: SX
    rate: SX
    most: Most = UNBOUNDED


@dataclass(frozen=True)
class Mechanism:
    """n coordinates q under γ constraints, ν = n − γ degrees of freedom.

    What a mechanism does not have is left out.

    ``q``, ``dq``: symbols, n. ``controls``: symbols τ of the motors, m.
    ``gravity``: acceleration of gravity in inertial axes, 3, m/s².
    ``potential``: potential energy other than gravity's, J.
    ``holonomic``: f(q, t), h, eq. (1). ``nonholonomic``: J q̇ + μ of simple
    nonholonomic constraints, γ − h, linear in q̇, eq. (3).
    ``parameters``: symbols that stay free, so that one compiled function serves many
    robots. ``time``: the symbol t.
    ``closed_form``: a constraint matrix C (n × ν) of its own, as eq. (55), with a right
    inverse P (n × γ): J C = 0, J P = 1.
    """

    name: str
    q: SX
    dq: SX
    bodies: tuple[Body, ...]
    efforts: tuple[Effort, ...] = ()
    controls: SX = field(default_factory=none)
    holonomic: SX = field(default_factory=none)
    nonholonomic: SX = field(default_factory=none)
    gravity: SX | None = None
    potential: SX = field(default_factory=lambda: SX(0))
    parameters: SX = field(default_factory=none)
    time: SX = field(default_factory=lambda: SX.sym("t"))
    closed_form: tuple[SX, SX] | None = None

    @cached_property
    def ddq(self) -> SX:
        """Symbols q̈, n."""
        return SX.sym("ddq", self.q.numel())

    @cached_property
    def lam(self) -> SX:
        """Symbols of the multipliers λ, γ."""
        return SX.sym("lam", self.mu.numel())

    def rate_of_change(self, expression: SX) -> SX:
        """d/dt of an expression in q, q̇ and t, with q̈ where q̇ varies."""
        state, rate = ca.vertcat(self.q, self.dq, self.time), ca.vertcat(self.dq, self.ddq, 1)
        return ca.jtimes(expression, state, rate)

    def velocity(self, body: Body) -> SX:
        """v* of a centre of mass in inertial axes, 3, m/s."""
        return self.rate_of_change(body.position)

    @cached_property
    def T(self) -> SX:
        """Kinetic energy, J."""
        energy = SX(0)
        for body in self.bodies:
            v, omega = self.velocity(body), body.angular_velocity
            energy += (body.mass * ca.dot(v, v) + ca.dot(omega, body.inertia * omega)) / 2
        return energy

    @cached_property
    def V(self) -> SX:
        """Potential energy, J."""
        if self.gravity is None:
            return self.potential
        return self.potential - sum(b.mass * ca.dot(self.gravity, b.position) for b in self.bodies)

    @cached_property
    def M(self) -> SX:
        """Inertia matrix, n × n, eq. (65)."""
        return ca.simplify(ca.hessian(self.T, self.dq)[0])

    @cached_property
    def Q_gyr(self) -> SX:
        """Q̂*, n, eq. (33) and (65): what is left of Q* when q̈ = 0."""
        momentum = ca.gradient(self.T, self.dq)
        state, rate = ca.vertcat(self.q, self.time), ca.vertcat(self.dq, 1)
        return ca.gradient(self.T, self.q) - ca.jtimes(momentum, state, rate)

    @cached_property
    def Q(self) -> SX:
        """Active generalized force, n, eq. (31): potentials and efforts."""
        force = -ca.gradient(self.V, self.q)
        for effort in self.efforts:
            force += effort.value * ca.gradient(effort.rate, self.dq)
        return force

    @cached_property
    def constraint_rate(self) -> SX:
        """J q̇ + μ, γ, eq. (4): the holonomic constraints' rate, then the nonholonomic ones."""
        return ca.vertcat(self.rate_of_change(self.holonomic), self.nonholonomic)

    @cached_property
    def J(self) -> SX:
        """Jacobian of the constraints, γ × n, eq. (4)."""
        return ca.jacobian(self.constraint_rate, self.dq)

    @cached_property
    def mu(self) -> SX:
        """μ, γ, eq. (4)."""
        return ca.substitute(self.constraint_rate, self.dq, SX.zeros(self.dq.numel()))

    @cached_property
    def J_bias(self) -> SX:
        """J̇ q̇ + μ̇, γ."""
        state, rate = ca.vertcat(self.q, self.time), ca.vertcat(self.dq, 1)
        return ca.jtimes(self.constraint_rate, state, rate)

    @property
    def Q_star(self) -> SX:
        """Q* = -M q̈ + Q̂*, n, generalized inertia force, eq. (33) and (65)."""
        return self.Q_gyr - self.M @ self.ddq
