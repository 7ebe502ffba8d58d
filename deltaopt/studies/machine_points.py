"""A pose's point functions with derivatives in machine code, to plug into the same problem."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import casadi as ca

from deltaopt.planning.chain import Equations
from deltaopt.planning.nlp import PointFunction
from deltaopt.studies.machine_code import compiled


@dataclass(frozen=True)
class MachinePointFunction(PointFunction):
    """The same r(y, p), its derivatives by functions from a library.

    ``code``: (y, p) -> r, nonzeros of ∂r/∂y; and (y, p, λ) -> nonzeros of ∂²(λ·r)/∂y².
    """

    code: tuple[ca.Function, ca.Function]
    sparsities: tuple[ca.Sparsity, ca.Sparsity]

    @property
    def jacobian(self) -> tuple[ca.Function, ca.Sparsity]:
        return self.code[0], self.sparsities[0]

    @property
    def hessian(self) -> tuple[ca.Function, ca.Sparsity]:
        return self.code[1], self.sparsities[1]


def in_machine_code(equations: Equations, compiler: str) -> Equations:
    """The same equations, every point function compiled."""
    points = {
        f.name: getattr(equations, f.name)
        for f in fields(equations)
        if isinstance(getattr(equations, f.name), PointFunction)
    }
    sources = []
    for name, point in points.items():
        for kind, (function, _) in (("jacobian", point.jacobian), ("hessian", point.hessian)):
            inputs = function.sx_in()
            sources.append(ca.Function(f"{name}_{kind}", inputs, function.call(inputs)))
    code = compiled(sources, compiler)
    fast: dict[str, Any] = {
        name: MachinePointFunction(
            point.name,
            point.function,
            (code[2 * i], code[2 * i + 1]),
            (point.jacobian[1], point.hessian[1]),
        )
        for i, (name, point) in enumerate(points.items())
    }
    return replace(equations, **fast)
