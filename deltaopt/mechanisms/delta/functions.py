"""The Delta's kinematics and dynamics as CasADi functions of the platform's motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import ClassVar

import casadi as ca

from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.dynamics.mechanism import SX, Mechanism
from deltaopt.mechanisms.delta.kinematics import (
    forward_kinematics,
    inverse_kinematics,
    serial_distances,
    tilts,
)
from deltaopt.mechanisms.delta.mechanism import DeltaTerms, delta
from deltaopt.mechanisms.delta.singularities import DISTANCES, parallel_margin, tilt_margin
from deltaopt.mechanisms.delta.slender_bars import angle_free_equations, chain_forces
from deltaopt.mechanisms.functions import Functions, SingularityDistance


@dataclass(frozen=True, eq=False)
class DeltaFunctions(Functions):
    """The functions of all Deltas with the same terms, in a formulation of the dynamics.

    Their arguments are x, v, a: position, velocity and acceleration of the platform, 3 each, m,
    m/s, m/s²; tau: motor torques, 3, N·m; p: the parameters of ``terms``.
    """

    terms: DeltaTerms
    formulation: Formulation
    motors: ClassVar[slice] = slice(3, None, 3)
    lengths: ClassVar[tuple[bool, ...]] = (True,) * 3 + (False,) * 9
    distances: ClassVar[Sequence[SingularityDistance]] = DISTANCES
    parallel_margin = staticmethod(parallel_margin)
    tilt_margin = staticmethod(tilt_margin)

    def symbols(self) -> SX:
        """The parameters p as free symbols, in the order of ``terms``."""
        return self.terms.symbols().vector()

    @property
    def payload(self) -> int:
        """Which of the parameters is the payload's mass."""
        return self.terms.names.index("m2")

    def lever(self, p: SX) -> SX:
        """The length of an arm, m."""
        return 2 * p[self.terms.names.index("a2")]

    def layers(self, p: SX) -> Sequence[tuple[SX, SX]]:
        """Speeds (rad/s) and half heights (N·m) of what changes its sign at reversals."""
        symbols = self.terms.symbols()
        found = filter(None, (load.layer() for load in symbols.loads))
        layers = [(SX(speed), SX(strength)) for speed, strength in found]
        if not layers:
            return ()
        f = ca.Function("layers", [symbols.vector()], [each for both in layers for each in both])
        values = f.call([p])
        return tuple(zip(values[::2], values[1::2], strict=True))

    def alignments(self, q: SX) -> SX:
        """sin² (q_{k,1} - q_{k,2}), 3: zero where arm and bars are in line."""
        return ca.sin(q[3::3] - q[4::3]) ** 2

    def tilts(self, q: SX) -> SX:
        """sin q_{k,3}, 3: how far the bars lean out of the plane of their arm."""
        return ca.sin(q[5::3])

    @cached_property
    def mechanism(self) -> Mechanism:
        """The mechanism in twelve coordinates with nine constraints, of the paper's section 4."""
        return delta(self.terms.symbols())

    @cached_property
    def inverse_kinematics(self) -> ca.Function:
        """(x, p) -> q, 12; NaN out of reach."""
        x, p = SX.sym("x", 3), self.terms.symbols()
        return ca.Function("inverse_kinematics", [x, p.vector()], [inverse_kinematics(p, x)])

    @cached_property
    def forward_kinematics(self) -> ca.Function:
        """(motor angles, p) -> x; NaN where the loops cannot close."""
        theta, p = SX.sym("theta", 3), self.terms.symbols()
        x = forward_kinematics(p, theta)
        return ca.Function("forward_kinematics", [theta, p.vector()], [x])

    @cached_property
    def serial_distances(self) -> ca.Function:
        """(x, p) -> squared distances from serial singularities, 6: cos² q_{k,3} of the three
        chains, then sin² (q_{k,1} - q_{k,2})."""
        x, p = SX.sym("x", 3), self.terms.symbols()
        return ca.Function("serial_distances", [x, p.vector()], [ca.vec(serial_distances(p, x))])

    @cached_property
    def tilt(self) -> ca.Function:
        """(x, p) -> sin q_{k,3} of the three chains, linear in the tool's point x."""
        x, p = SX.sym("x", 3), self.terms.symbols()
        return ca.Function("tilt", [x, p.vector()], [tilts(p, x)])

    @cached_property
    def explicit_equations(self) -> ca.Function:
        """(x, v, a, tau, p) -> Cᵀ (Q* + Q), alignment, θ̇, θ̈, 3 each.

        The first is eq. (39) in N, zero where the motion obeys the dynamics. The alignment of a
        chain is sin² (q_{k,1} - q_{k,2}), zero in its serial singularity. For slender bars the
        angle-free form of ``slender_bars`` is evaluated, otherwise the general derivation.
        """
        if not self.terms.slender:
            return super().explicit_equations
        motion = [SX.sym(name, 3) for name in ("x", "v", "a", "tau")]
        terms = self.terms.symbols()
        equations = angle_free_equations(terms, *motion)
        return ca.Function("explicit_equations", [*motion, terms.vector()], list(equations))

    @cached_property
    def explicit_multipliers(self) -> ca.Function:
        """(x, v, a, p) -> λ of eq. (37), 9, N: the force of each chain on the platform."""
        x, v, a = (SX.sym(name, 3) for name in ("x", "v", "a"))
        terms = self.terms.symbols()
        p = terms.vector()
        if self.terms.slender:
            forces = chain_forces(terms, x, v, a, self.explicit_torques(x, v, a, p))
        else:
            inverse = Explicit().inverse_dynamics(self.mechanism).expand()
            _, forces = inverse(0, *self.motion(x, v, a, p), p)
        return ca.Function("explicit_multipliers", [x, v, a, p], [forces])


delta_functions = lru_cache(maxsize=64)(DeltaFunctions)
"""The functions of all models with the same terms, derived once in a process."""
