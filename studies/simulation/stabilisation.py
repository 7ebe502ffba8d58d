"""Ways to keep a simulated motion on its constraints.

Forward dynamics obeys J q̈ + J̇ q̇ + μ̇ = 0 only, so that rounding and the integrator's
error let f grow with t² and J q̇ + μ with t.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Protocol

import casadi as ca

from deltaopt.dynamics.consistency import InertiaMetric, Metric, Projector
from deltaopt.dynamics.mechanism import SX, Mechanism


class Stabilisation(Protocol):
    """What is done against drift."""

    def mechanism(self, mechanism: Mechanism) -> Mechanism:
        """The mechanism whose accelerations are integrated."""
        ...

    def projector(self, mechanism: Mechanism) -> Projector | None:
        """What every reported state goes through before the motion goes on, if anything."""
        ...


@dataclass(frozen=True)
class NoStabilisation:
    """Let it drift."""

    def mechanism(self, mechanism: Mechanism) -> Mechanism:
        return mechanism

    def projector(self, mechanism: Mechanism) -> Projector | None:
        return None


@dataclass(frozen=True)
class Projection:
    """Positions and velocities onto the constraints at every reported time.

    Exact to rounding there; between them the motion drifts as without stabilisation.
    The integrator starts anew each time.
    """

    metric: Metric = field(default_factory=InertiaMetric)

    def mechanism(self, mechanism: Mechanism) -> Mechanism:
        return mechanism

    def projector(self, mechanism: Mechanism) -> Projector | None:
        return Projector(mechanism, self.metric)


@dataclass(frozen=True)
class Baumgarte:
    """Constraints that behave like an oscillator, d²f/dt² + 2 ζ ω df/dt + ω² f = 0.

    ``frequency``: ω, rad/s; errors die out in about 1/ω. ``damping``: ζ, 1 is critical.
    Nonholonomic constraints have no position: their rate decays with 2 ζ ω.
    """

    frequency: float = 50.0
    damping: float = 1.0

    def mechanism(self, mechanism: Mechanism) -> Mechanism:
        given = {x.name: getattr(mechanism, x.name) for x in fields(Mechanism)}
        return _Oscillating(**given, stabilisation=self)

    def projector(self, mechanism: Mechanism) -> Projector | None:
        return None

    def feedback(self, mechanism: Mechanism) -> SX:
        """What is added to J q̈ + J̇ q̇ + μ̇, γ."""
        m = mechanism
        position = ca.vertcat(m.holonomic, SX(m.nonholonomic.numel(), 1))
        spring = self.frequency**2 * position
        return spring + 2 * self.damping * self.frequency * m.constraint_rate


@dataclass(frozen=True)
class _Oscillating(Mechanism):
    """A mechanism whose constraints at acceleration level feed their violation back."""

    stabilisation: Baumgarte = Baumgarte()

    @cached_property
    def J_bias(self) -> SX:
        return super().J_bias + self.stabilisation.feedback(self)
