"""The Delta of the paper's sections 4 and 5: twelve coordinates, nine constraints, three motors.

In the base frame x points down, y and z are horizontal. Chain k at azimuth φ_k has the coordinates
q_{k,1} (arm), q_{k,2} and q_{k,3} (bars of the parallelogram).
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import cos, pi, sin

import casadi as ca

from deltaopt.dynamics.constraint_matrix import Partition
from deltaopt.dynamics.mechanism import SX, Body, Effort, Mechanism

AZIMUTHS = (0.0, 2 * pi / 3, -2 * pi / 3)
"""The azimuths φ_k of the chains, rad."""

MOTOR_ANGLES = Partition((3, 6, 9))
"""The constraint matrix with the motor angles as independent coordinates. It keeps torques exact in
serial singularities and does not exist in parallel ones (docs/stability.md)."""


@dataclass(frozen=True)
class DeltaParameters:
    """The parameters of a Delta by the paper's letters, as numbers or symbols.

    Lengths are in m (a₂ and a₃ are halves), masses in kg (m₄ of a pair of bars), principal moments
    of inertia about the centre of mass in kg·m², g in m/s². A parameter that is None is absent from
    the model.
    """

    a1: SX | float
    a2: SX | float
    a3: SX | float
    a4: SX | float
    m1: SX | float
    m3: SX | float
    m4: SX | float
    I33: SX | float
    I41: SX | float
    I43: SX | float
    I42: SX | float | None = None
    m2: SX | float | None = None  # the payload
    g: SX | float | None = None

    def present(self) -> list[str]:
        """Names of the parameters the model has, in the order of ``Mechanism.parameters``."""
        return [f.name for f in fields(self) if getattr(self, f.name) is not None]

    def terms(self) -> DeltaTerms:
        """The terms of a model with these parameters, which must be numbers."""
        return DeltaTerms(tuple(self.present()), self.I42 is None and bool(self.I41 == self.I43))

    def symbols(self) -> DeltaParameters:
        """The same parameters as free symbols."""
        return replace(self, **{name: SX.sym(name) for name in self.present()})

    def values(self) -> list[float]:
        """The values of the parameters the model has."""
        return [float(getattr(self, name)) for name in self.present()]

    def vector(self) -> SX:
        """The parameters the model has, as a column."""
        stacked: SX = ca.vertcat(*(SX(getattr(self, name)) for name in self.present()))
        return stacked


@dataclass(frozen=True)
class DeltaTerms:
    """The terms of a Delta's model: models with the same terms share their equations.

    ``names``: of its parameters, in the order of ``Mechanism.parameters``. ``slender``: whether the
    moments of inertia of the bars are equal about both transverse axes and zero about their own.
    """

    names: tuple[str, ...]
    slender: bool

    def symbols(self) -> DeltaParameters:
        """The parameters as free symbols."""
        return DeltaParameters(**{name: SX.sym(name) for name in self.names})


def delta(parameters: DeltaParameters) -> Mechanism:
    """The mechanism of a Delta with the parameters that are present, left as free symbols."""
    p = parameters.symbols()
    q, dq, tau = SX.sym("q", 12), SX.sym("dq", 12), SX.sym("tau", 3)
    platform = q[:3]

    bodies = [Body("platform", p.m1, platform)]  # eq. (56)
    if p.m2 is not None:
        bodies.append(Body("payload", p.m2, platform))
    efforts, closures = [], []
    for k, azimuth in enumerate(AZIMUTHS):
        qk, dqk = q[3 + 3 * k : 6 + 3 * k], dq[3 + 3 * k : 6 + 3 * k]
        bodies += [_arm(p, k, azimuth, qk, dqk), _bars(p, k, azimuth, qk, dqk)]
        efforts.append(Effort(tau[k], dqk[0]))
        closures.append(platform - _in_base(azimuth, *_tip(p, qk)))

    holonomic = ca.vertcat(*closures)  # eq. (50)-(52)
    return Mechanism(
        name="delta",
        q=q,
        dq=dq,
        bodies=tuple(bodies),
        efforts=tuple(efforts),
        controls=tau,
        holonomic=holonomic,
        gravity=None if p.g is None else ca.vertcat(p.g, 0, 0),
        parameters=p.vector(),
        closed_form=_closed_form(ca.jacobian(holonomic, q)),
    )


def _in_base(azimuth: float, down: SX, outward: SX, sideways: SX) -> SX:
    """A point given in the frame of a chain, in the base frame."""
    c, s = cos(azimuth), sin(azimuth)
    return ca.vertcat(down, c * outward - s * sideways, s * outward + c * sideways)


def _tip(p: DeltaParameters, qk: SX) -> tuple[SX, SX, SX]:
    """Centre of the platform at the end of a chain, in the frame of that chain."""
    c, s = ca.cos(qk), ca.sin(qk)
    return (
        -2 * p.a2 * s[0] - 2 * p.a3 * c[2] * s[1],
        p.a1 - p.a4 + 2 * p.a2 * c[0] + 2 * p.a3 * c[1] * c[2],
        2 * p.a3 * s[2],
    )


def _arm(p: DeltaParameters, k: int, azimuth: float, qk: SX, dqk: SX) -> Body:
    """Body 2k+1, eq. (57) and (60)."""
    c, s = ca.cos(qk), ca.sin(qk)
    centre = _in_base(azimuth, -p.a2 * s[0], p.a1 + p.a2 * c[0], SX(0))
    return Body(f"arm {k + 1}", p.m3, centre, ca.vertcat(0, 0, p.I33), ca.vertcat(0, 0, dqk[0]))


def _bars(p: DeltaParameters, k: int, azimuth: float, qk: SX, dqk: SX) -> Body:
    """Body 2k+2, the pair of bars of a parallelogram, eq. (58) and (61)."""
    c, s = ca.cos(qk), ca.sin(qk)
    centre = _in_base(
        azimuth,
        -2 * p.a2 * s[0] - p.a3 * c[2] * s[1],
        p.a1 + 2 * p.a2 * c[0] + p.a3 * c[1] * c[2],
        p.a3 * s[2],
    )
    inertia = ca.vertcat(p.I41, 0 if p.I42 is None else p.I42, p.I43)
    omega = ca.vertcat(dqk[2], s[2] * dqk[1], c[2] * dqk[1])
    return Body(f"bars {k + 1}", p.m4, centre, inertia, omega)


def _closed_form(J: SX) -> tuple[SX, SX]:
    """C of eq. (55) and its right inverse P, block by block: J C = 0, J P = 1."""
    inverses = [ca.inv_minor(J[3 * k : 3 * k + 3, 3 + 3 * k : 6 + 3 * k]) for k in range(3)]
    C = ca.vertcat(SX.eye(3), *(-inverse for inverse in inverses))
    P = ca.vertcat(SX(3, 9), ca.diagcat(*inverses))
    return C, P
