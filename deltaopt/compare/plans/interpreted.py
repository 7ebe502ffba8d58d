"""The point functions of a formulation kept in CasADi's interpreter, to plug into the same
problem."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import casadi as ca

from deltaopt.planning.formulations.collocation import Equations
from deltaopt.planning.nlp.points import PointFunction


@dataclass(frozen=True)
class InterpretedPointFunction(PointFunction):
    """A point function r(y, p) whose derivatives are not compiled."""

    @cached_property
    def derivatives(self) -> list[tuple[ca.Function, ca.Sparsity]]:
        return self.derived


def interpreted(equations: Equations) -> Equations:
    """Return the same equations with no point function compiled."""
    points: dict[str, Any] = {}
    for f in fields(equations):
        value = getattr(equations, f.name)
        if isinstance(value, PointFunction):
            points[f.name] = InterpretedPointFunction(value.name, value.function)
    return replace(equations, **points)
