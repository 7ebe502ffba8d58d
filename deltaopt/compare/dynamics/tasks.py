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
    """What is computed from what."""

    @property
    def name(self) -> str: ...

    def function(self, formulation: Formulation, mechanism: Mechanism) -> ca.Function:
        """The formulation's own; the first result counts."""
        ...

    def big_system(self, mechanism: Mechanism) -> tuple[list[SX], SX, SX]:
        """Model L_I: inputs, A and b of its linear system, the unknowns sought first."""
        ...

    def inputs(self, samples: Samples) -> list[Array]:
        """N × each input but the parameters."""
        ...

    def truth(self, samples: Samples) -> Array:
        """N × what should come out."""
        ...


@dataclass(frozen=True)
class InverseDynamics:
    """q, q̇, q̈ → τ."""

    name: str = "inverse"

    def function(self, formulation: Formulation, mechanism: Mechanism) -> ca.Function:
        return formulation.inverse_dynamics(mechanism)

    def big_system(self, mechanism: Mechanism) -> tuple[list[SX], SX, SX]:
        """n × n."""
        m = mechanism
        A, b = affine(Multiplier().equations(m), ca.vertcat(m.controls, m.lam))
        return [*state(m), m.ddq, m.parameters], A, b

    def inputs(self, samples: Samples) -> list[Array]:
        return [np.zeros((len(samples.q), 1)), samples.q, samples.dq, samples.ddq]

    def truth(self, samples: Samples) -> Array:
        return samples.tau


@dataclass(frozen=True)
class ForwardDynamics:
    """q, q̇, τ → q̈."""

    name: str = "forward"

    def function(self, formulation: Formulation, mechanism: Mechanism) -> ca.Function:
        return formulation.forward_dynamics(mechanism)

    def big_system(self, mechanism: Mechanism) -> tuple[list[SX], SX, SX]:
        """n + γ."""
        m = mechanism
        equations = ca.vertcat(Multiplier().equations(m), m.J @ m.ddq + m.J_bias)
        A, b = affine(equations, ca.vertcat(m.ddq, m.lam))
        return [*state(m), m.controls, m.parameters], A, b

    def inputs(self, samples: Samples) -> list[Array]:
        return [np.zeros((len(samples.q), 1)), samples.q, samples.dq, samples.tau]

    def truth(self, samples: Samples) -> Array:
        return samples.ddq


TASKS: tuple[Task, ...] = (InverseDynamics(), ForwardDynamics())
