"""Ways to keep the loops of a redundant problem closed, as values (Bordalba et al. 2023).

The twelve polynomials obey J q̈ + J̇ q̇ = 0 at the nodes of every interval. Integrated twice
they still leave f = 0 by the error of the transcription, interval after interval: a drift.
What is done about it at the knots differs:

    AccelerationLevel   nothing: all coordinates go on where they are
    Baumgarte           nothing there; errors are fed back, J q̈ + J̇ q̇ + 2 ζ ω ḟ + ω² f = 0
    Projection          the next interval begins at the nearest state with f = 0, J q̇ = 0
    KnotConstraints     ξ and ξ̇ go on, the others obey f = 0 and J q̇ = 0 at the knot

The last two have as many independent rows as unknowns, none follows from another.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import casadi as ca

from deltaopt.dynamics.mechanism import SX
from deltaopt.planning.formulations.scaled_mechanism import ScaledMechanism
from deltaopt.planning.nlp.program import PointFunction


class LoopClosure(Protocol):
    """What a redundant problem does against drift."""

    @property
    def name(self) -> str: ...

    @property
    def drifts(self) -> bool:
        """Whether errors of an interval are passed on to the next."""
        ...

    def continuous(self, system: ScaledMechanism) -> tuple[int, ...]:
        """Coordinates whose position and velocity go on at the knots."""
        ...

    def feedback(self, f: SX, df: SX) -> SX:
        """What is added to d²f, all with time in units of the duration."""
        ...

    def unknowns(self, system: ScaledMechanism) -> int:
        """Further unknowns at every knot."""
        ...

    def at_knots(self, system: ScaledMechanism) -> PointFunction | None:
        """Rows that vanish at every knot: (X, V before, X, V after, unknowns), p -> rows."""
        ...


@dataclass(frozen=True)
class AccelerationLevel:
    """Nothing but J q̈ + J̇ q̇ = 0 at the nodes."""

    name: str = "acceleration level"
    drifts: bool = True

    def continuous(self, system: ScaledMechanism) -> tuple[int, ...]:
        return tuple(range(system.n))

    def feedback(self, f: SX, df: SX) -> SX:
        return SX.zeros(f.numel())

    def unknowns(self, system: ScaledMechanism) -> int:
        return 0

    def at_knots(self, system: ScaledMechanism) -> PointFunction | None:
        return None


@dataclass(frozen=True)
class Baumgarte(AccelerationLevel):
    """Constraints as an oscillator.

    ``frequency``: ω in units of 1/duration, below one radian per interval on meshes of 20 and
    more. ``damping``: ζ.
    """

    name: str = "Baumgarte"
    frequency: float = 20.0
    damping: float = 1.0

    def feedback(self, f: SX, df: SX) -> SX:
        return 2 * self.damping * self.frequency * df + self.frequency**2 * f


@dataclass(frozen=True)
class KnotConstraints:
    """Independent coordinates go on; the loops close at every knot."""

    name: str = "constraints at knots"
    drifts: bool = False

    def continuous(self, system: ScaledMechanism) -> tuple[int, ...]:
        return system.independent

    def feedback(self, f: SX, df: SX) -> SX:
        return SX.zeros(f.numel())

    def unknowns(self, system: ScaledMechanism) -> int:
        return 0

    def at_knots(self, system: ScaledMechanism) -> PointFunction | None:
        y = SX.sym("y", 4 * system.n)
        _, _, X, V = ca.vertsplit(y, system.n)
        f, df, _ = closed(system, X, V)
        rows = ca.vertcat(f, df)
        return PointFunction(
            "loop closure at a knot, constraint and its rate, row",
            ca.Function("knot", [y, system.p], [rows]),
        )


@dataclass(frozen=True)
class Projection:
    """X after = X before + Jᵀ σ, V after = V before + Jᵀ ρ: nearest in the units of q."""

    name: str = "projection at knots"
    drifts: bool = False

    def continuous(self, system: ScaledMechanism) -> tuple[int, ...]:
        return ()

    def feedback(self, f: SX, df: SX) -> SX:
        return SX.zeros(f.numel())

    def unknowns(self, system: ScaledMechanism) -> int:
        return 2 * system.constraints

    def at_knots(self, system: ScaledMechanism) -> PointFunction | None:
        n, gamma = system.n, system.constraints
        y = SX.sym("y", 4 * n + 2 * gamma)
        X_before, V_before, X, V = ca.vertsplit(y[: 4 * n], n)
        sigma, rho = ca.vertsplit(y[4 * n :], gamma)
        f, df, J = closed(system, X, V)
        moved = X - X_before - J.T @ sigma, V - V_before - J.T @ rho
        rows = ca.vertcat(*moved, f, df)
        return PointFunction(
            "projection at a knot, row", ca.Function("knot", [y, system.p], [rows])
        )


def closed(system: ScaledMechanism, X: SX, V: SX) -> tuple[SX, SX, SX]:
    """f, J q̇ and J, in units: time of the duration, so that it does not matter."""
    m, u = system.mechanism, system.units
    constraints = ca.Function(
        "closed", [m.q, m.dq, m.parameters], [m.holonomic, m.constraint_rate, m.J]
    )
    f, df, J = constraints(u.q * X, u.q * V, m.parameters)
    return f / u.closure, df / u.closure, ca.diag(1 / u.closure) @ J @ ca.diag(u.q)
