"""What is computed from what: inverse and forward dynamics, as values to be measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.dynamics.formulation import Formulation, affine, state
from deltaopt.dynamics.lagrange import Multiplier
from deltaopt.dynamics.mechanism import SX, Mechanism

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Samples:
    """N states with accelerations and torques that go with them, rounded once.

    ``q``, ``dq``, ``ddq``: N × n; ``tau``: N × m; ``parameters``: those of the mechanism.
    """

    q: Array
    dq: Array
    ddq: Array
    tau: Array
    parameters: Array


class Task(Protocol):
    """A computation whose cost and error are measured, such as inverse dynamics."""

    @property
    def name(self) -> str: ...

    def function(self, formulation: Formulation, mechanism: Mechanism) -> ca.Function:
        """Return the formulation's own function; its first result counts."""
        ...

    def big_system(self, mechanism: Mechanism) -> tuple[list[SX], SX, SX]:
        """Return inputs, A and b of model L_I's linear system, the unknowns sought first."""
        ...

    def inputs(self, samples: Samples) -> list[Array]:
        """Return all inputs but the parameters, (N, size) each."""
        ...

    def truth(self, samples: Samples) -> Array:
        """Return what should come out, (N, size)."""
        ...


@dataclass(frozen=True)
class InverseDynamics:
    """Torques from the motion: q, q̇, q̈ → τ."""

    name: str = "inverse"

    def function(self, formulation: Formulation, mechanism: Mechanism) -> ca.Function:
        return formulation.inverse_dynamics(mechanism)

    def big_system(self, mechanism: Mechanism) -> tuple[list[SX], SX, SX]:
        """Return the system for τ and λ, n × n."""
        m = mechanism
        A, b = affine(Multiplier().equations(m), ca.vertcat(m.controls, m.lam))
        return [*state(m), m.ddq, m.parameters], A, b

    def inputs(self, samples: Samples) -> list[Array]:
        return [np.zeros((len(samples.q), 1)), samples.q, samples.dq, samples.ddq]

    def truth(self, samples: Samples) -> Array:
        return samples.tau


@dataclass(frozen=True)
class ForwardDynamics:
    """Accelerations from torques: q, q̇, τ → q̈."""

    name: str = "forward"

    def function(self, formulation: Formulation, mechanism: Mechanism) -> ca.Function:
        return formulation.forward_dynamics(mechanism)

    def big_system(self, mechanism: Mechanism) -> tuple[list[SX], SX, SX]:
        """Return the system for q̈ and λ, of n + γ equations."""
        m = mechanism
        equations = ca.vertcat(Multiplier().equations(m), m.J @ m.ddq + m.J_bias)
        A, b = affine(equations, ca.vertcat(m.ddq, m.lam))
        return [*state(m), m.controls, m.parameters], A, b

    def inputs(self, samples: Samples) -> list[Array]:
        return [np.zeros((len(samples.q), 1)), samples.q, samples.dq, samples.tau]

    def truth(self, samples: Samples) -> Array:
        return samples.ddq


TASKS: tuple[Task, ...] = (InverseDynamics(), ForwardDynamics())
