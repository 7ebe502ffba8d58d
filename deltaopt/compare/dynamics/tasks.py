"""What is computed from what: inverse and forward dynamics, as values to be measured."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.dynamics.formulation import Formulation, affine, state
from deltaopt.dynamics.lagrange import Multiplier
from deltaopt.dynamics.mechanism import SX, Mechanism


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


@dataclass(frozen=True)
class Task:
    """A computation whose cost and error are measured, such as inverse dynamics.

    ``function``: a formulation's own, of a mechanism; its first result counts. ``big_system``: of a
    mechanism inputs, A and b of model L_I's linear system, the unknowns sought first. ``given``:
    the last of its inputs after time and state, ``sought``: what should come out, as `Samples`
    names them.
    """

    name: str
    function: Callable[[Formulation, Mechanism], ca.Function]
    big_system: Callable[[Mechanism], tuple[list[SX], SX, SX]]
    given: str
    sought: str

    def inputs(self, samples: Samples) -> list[Array]:
        """All inputs but the parameters, (N, size) each."""
        given: Array = getattr(samples, self.given)
        return [np.zeros((len(samples.q), 1)), samples.q, samples.dq, given]

    def truth(self, samples: Samples) -> Array:
        """What should come out, (N, size)."""
        sought: Array = getattr(samples, self.sought)
        return sought


def _torques_and_multipliers(m: Mechanism) -> tuple[list[SX], SX, SX]:
    """The system for τ and λ, n × n."""
    A, b = affine(Multiplier().equations(m), ca.vertcat(m.controls, m.lam))
    return [*state(m), m.ddq, m.parameters], A, b


def _accelerations_and_multipliers(m: Mechanism) -> tuple[list[SX], SX, SX]:
    """The system for q̈ and λ, of n + γ equations."""
    equations = ca.vertcat(Multiplier().equations(m), m.J @ m.ddq + m.J_bias)
    A, b = affine(equations, ca.vertcat(m.ddq, m.lam))
    return [*state(m), m.controls, m.parameters], A, b


INVERSE = Task(
    "inverse",
    lambda formulation, mechanism: formulation.inverse_dynamics(mechanism),
    _torques_and_multipliers,
    given="ddq",
    sought="tau",
)
"""Torques from the motion: q, q̇, q̈ → τ."""
FORWARD = Task(
    "forward",
    lambda formulation, mechanism: formulation.forward_dynamics(mechanism),
    _accelerations_and_multipliers,
    given="tau",
    sought="ddq",
)
"""Accelerations from torques: q, q̇, τ → q̈."""
TASKS = INVERSE, FORWARD
