"""Loop closure: how drift is prevented in redundant coordinates (Bordalba et al. 2023).

The polynomials of all coordinates obey J q̈ + J̇ q̇ = 0 at the nodes of every interval. The error of
the transcription still makes them violate f = 0, more from interval to interval: they drift. The
loop closures differ in what they do about it:

    AccelerationLevel   nothing: all coordinates are continuous at the knots
    Baumgarte           nothing at the knots; feedback, J q̈ + J̇ q̇ + 2 ζ ω ḟ + ω² f = 0, at the nodes
    Projection          the next interval begins at the nearest state with f = 0 and J q̇ = 0
    KnotConstraints     ξ and ξ̇ are continuous, the others obey f = 0 and J q̇ = 0 at the knot

The last two have as many rows as unknowns, and the rows are linearly independent.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from deltaopt.dynamics.mechanism import SX
from deltaopt.planning.formulations.scaled_mechanism import ScaledMechanism
from deltaopt.planning.nlp.points import PointFunction


@dataclass(frozen=True)
class LoopClosure:
    """A way to prevent drift in redundant coordinates.

    ``drifts``: whether violations of loop closure are passed on from an interval to the next.
    """

    name: str
    drifts: bool = False

    def continuous(self, system: ScaledMechanism) -> tuple[int, ...]:
        """Indices of the coordinates whose position and velocity are continuous at the knots."""
        raise NotImplementedError

    def feedback(self, f: SX, df: SX) -> SX:
        """The term that is added to d²f, from f and df; time is in units of the duration."""
        return SX.zeros(f.numel())

    def unknowns(self, system: ScaledMechanism) -> int:
        """Number of further unknowns at every knot."""
        return 0

    def at_knots(self, system: ScaledMechanism) -> PointFunction | None:
        """Rows that must vanish at every knot: (X, V before, X, V after, unknowns), p -> rows;
        None if there are none."""
        return None


@dataclass(frozen=True)
class AccelerationLevel(LoopClosure):
    """Loop closure by J q̈ + J̇ q̇ = 0 at the nodes alone: the loops drift.

    Examples:
        >>> deltaopt.Redundant(deltaopt.explicit, deltaopt.AccelerationLevel()).name
        'explicit, acceleration level'
    """

    name: str = "acceleration level"
    drifts: bool = True

    def continuous(self, system: ScaledMechanism) -> tuple[int, ...]:
        return tuple(range(system.n))


@dataclass(frozen=True)
class Baumgarte(AccelerationLevel):
    """Baumgarte's stabilisation: violations of loop closure decay like a damped oscillator.

    ``frequency``: ω in radians per duration. A higher one reduces drift more, but must stay below
    about one radian per interval: this one does on meshes of 20 intervals and more. ``damping``:
    the damping ratio ζ.

    Examples:
        >>> deltaopt.Redundant(deltaopt.explicit, deltaopt.Baumgarte(frequency=10.0)).name
        'explicit, Baumgarte'
    """

    name: str = "Baumgarte"
    frequency: float = 20.0
    damping: float = 1.0

    def feedback(self, f: SX, df: SX) -> SX:
        return 2 * self.damping * self.frequency * df + self.frequency**2 * f


@dataclass(frozen=True)
class KnotConstraints(LoopClosure):
    """Exact loop closure at every knot, where only the independent coordinates are continuous.

    Examples:
        >>> deltaopt.Redundant(deltaopt.explicit, deltaopt.KnotConstraints()).name
        'explicit, constraints at knots'
    """

    name: str = "constraints at knots"

    def continuous(self, system: ScaledMechanism) -> tuple[int, ...]:
        return system.independent

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
class Projection(LoopClosure):
    """Projection onto the constraints at every knot: the nearest state in the units of q.

    X after = X before + Jᵀ σ and V after = V before + Jᵀ ρ, with unknowns σ and ρ.

    Examples:
        >>> deltaopt.Redundant(deltaopt.explicit, deltaopt.Projection()).name
        'explicit, projection at knots'
    """

    name: str = "projection at knots"

    def continuous(self, system: ScaledMechanism) -> tuple[int, ...]:
        return ()

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
    """f, J q̇ and J in units of the constraints and of q, time in units of the duration."""
    m, u = system.mechanism, system.units
    constraints = ca.Function(
        "closed", [m.q, m.dq, m.parameters], [m.holonomic, m.constraint_rate, m.J]
    )
    f, df, J = constraints(u.q * X, u.q * V, m.parameters)
    return f / u.closure, df / u.closure, ca.diag(1 / u.closure) @ J @ ca.diag(u.q)
