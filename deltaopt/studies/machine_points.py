"""A pose's point functions with derivatives in machine code, to plug into the same problem."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
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


@dataclass
class MachineCode:
    """Compiles point functions with the C compiler ``command``, each that is alike once:
    poses share theirs between loop closures, and scenes of one kind of robot share all."""

    command: str
    known: dict[str, MachinePointFunction] = field(default_factory=dict)

    def __call__(self, equations: Equations) -> Equations:
        """The same equations, every point function compiled."""
        fast: dict[str, Any] = {}
        for f in fields(equations):
            value = getattr(equations, f.name)
            if isinstance(value, PointFunction):
                fast[f.name] = replace(self._compiled(value), name=value.name)
        return replace(equations, **fast)

    def _compiled(self, point: PointFunction) -> MachinePointFunction:
        key = point.function.serialize()
        if key not in self.known:
            sources = []
            for kind, (function, _) in (("jacobian", point.jacobian), ("hessian", point.hessian)):
                inputs = function.sx_in()
                sources.append(ca.Function(f"point_{kind}", inputs, function.call(inputs)))
            jacobian, hessian = compiled(sources, self.command)
            sparsities = point.jacobian[1], point.hessian[1]
            self.known[key] = MachinePointFunction(
                point.name, point.function, (jacobian, hessian), sparsities
            )
        return self.known[key]
