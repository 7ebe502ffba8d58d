"""The mechanics of sections 2 and 3 for any mechanism."""

from deltaopt.dynamics.constraint_matrix import (
    ClosedForm,
    ConstraintMatrix,
    NullSpace,
    Partition,
    RankRevealing,
)
from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.kane import GeneralSpeeds, Kane
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.linear import LeastNorm
from deltaopt.dynamics.mechanism import Body, Effort, Mechanism
from deltaopt.dynamics.virtual_work import VirtualWork

__all__ = [
    "Body",
    "ClosedForm",
    "ConstraintMatrix",
    "Effort",
    "Explicit",
    "Formulation",
    "GeneralSpeeds",
    "Kane",
    "LeastNorm",
    "Mechanism",
    "Multiplier",
    "NullSpace",
    "Partition",
    "RankRevealing",
    "VirtualWork",
]
