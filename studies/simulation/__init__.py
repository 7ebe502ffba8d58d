"""Forward simulation of any mechanism: integrators, stabilisation of constraints, motions."""

from studies.simulation.integrators import BDF, Adams, Gauss, Integrator, StabilisedDAE, Work
from studies.simulation.simulation import Motion, simulate
from studies.simulation.stabilisation import (
    Baumgarte,
    NoStabilisation,
    Projection,
    Stabilisation,
)

__all__ = [
    "BDF",
    "Adams",
    "Baumgarte",
    "Gauss",
    "Integrator",
    "Motion",
    "NoStabilisation",
    "Projection",
    "Stabilisation",
    "StabilisedDAE",
    "Work",
    "simulate",
]
