"""The Delta of the paper's sections 4 and 5: twelve coordinates, nine constraints, three motors.

In the base frame x points down, y and z are horizontal. Chain k at azimuth φ_k has the coordinates
q_{k,1} (arm), q_{k,2} and q_{k,3} (bars of the parallelogram).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import cos, pi, sin

import casadi as ca

from deltaopt.dynamics.constraint_matrix import Partition
from deltaopt.dynamics.mechanism import SX, Body, Effort, Mechanism, Most, by_chains
from deltaopt.mechanisms.delta.arm_loads import ArmLoad

AZIMUTHS = (0.0, 2 * pi / 3, -2 * pi / 3)
"""The azimuths φ_k of the chains, rad."""

MOTOR_ANGLES = Partition((3, 6, 9))
"""The constraint matrix with the motor angles as independent coordinates. It keeps torques exact in
serial singularities and does not exist in parallel ones (docs/where-methods-fail.md)."""


@dataclass(frozen=True)
class DeltaParameters:
    """The parameters of a Delta by the paper's letters, as numbers or symbols.

    Lengths are in m (a₂ and a₃ are halves), masses in kg (m₄ of a pair of bars), principal moments
    of inertia about the centre of mass in kg·m², g in m/s². A parameter that is None is absent from
    the model.

    Beyond the paper: ``b1``, ``b2``: centre of mass of the arm, along the line from shaft to elbow
    and across it, positive where a positive turn moves it, m; None for a₂ and 0. ``g_y``, ``g_z``:
    horizontal components of gravity, m/s². ``loads``: of every arm, with parameters of their own.
    ``tool_x``, ``tool_y``, ``tool_z``: from the platform's centre to the tool's point, m; then x is
    the tool's point.
    """

    a1: SX | float
    a2: SX | float
    a3: SX | float
    a4: SX | float
    m1: SX | float
    m2: SX | float  # the payload, 0 without one
    m3: SX | float
    m4: SX | float
    I33: SX | float
    I41: SX | float
    I43: SX | float
    I42: SX | float | None = None
    g: SX | float | None = None
    g_y: SX | float | None = None
    g_z: SX | float | None = None
    b1: SX | float | None = None
    b2: SX | float | None = None
    loads: tuple[ArmLoad, ...] = ()
    tool_x: SX | float | None = None
    tool_y: SX | float | None = None
    tool_z: SX | float | None = None

    @property
    def gravity(self) -> SX | None:
        """Acceleration of gravity in the base frame, 3, m/s²; None if there is none."""
        return _vector(self.g, self.g_y, self.g_z)

    @property
    def tool(self) -> SX | None:
        """The tool's point seen from the platform's centre, 3, m; None if it is the centre."""
        return _vector(self.tool_x, self.tool_y, self.tool_z)

    def platform_at(self, x: SX) -> SX:
        """Position of the platform's centre, 3, m, with the tool's point at x."""
        return x if self.tool is None else x - self.tool

    def load(self, angle: SX, speed: SX) -> SX | None:
        """Torque that is taken at an arm's angle and speed, N·m; None if there is none."""
        parts = [load.torque(angle, speed) for load in self.loads]
        return sum(parts, SX(0)) if parts else None

    def terms(self) -> DeltaTerms:
        """The terms of a model with these parameters, which must be numbers."""
        slender = self.I42 is None and bool(self.I41 == self.I43)
        return DeltaTerms(tuple(self.named()), slender, tuple(map(type, self.loads)))

    def symbols(self) -> DeltaParameters:
        """These parameters as free symbols."""
        return DeltaTerms(tuple(self.named()), False, tuple(map(type, self.loads))).symbols()

    def values(self) -> list[float]:
        """The values of the parameters the model has."""
        return [float(value) for value in self.named().values()]

    def vector(self) -> SX:
        """The parameters the model has, as a column."""
        return ca.vertcat(*map(SX, self.named().values()))

    def named(self) -> dict[str, SX | float]:
        """The parameters the model has, by name, in the order of ``Mechanism.parameters``."""
        named = dict[str, SX | float]()
        for name, value in ((each.name, getattr(self, each.name)) for each in fields(self)):
            if name == "loads":
                named |= {own: getattr(load, own) for load in value for own in load.names()}
            elif value is not None:
                named[name] = value
        return named


def _vector(*components: SX | float | None) -> SX | None:
    """A vector of components of which some are absent; None if all are."""
    if all(c is None for c in components):
        return None
    return ca.vertcat(*(0 if c is None else c for c in components))


@dataclass(frozen=True)
class DeltaTerms:
    """The terms of a Delta's model: models with the same terms share their equations.

    ``names``: of its parameters, in the order of ``Mechanism.parameters``. ``slender``: whether the
    moments of inertia of the bars are equal about both transverse axes and zero about their own.
    ``loads``: of the arms.
    """

    names: tuple[str, ...]
    slender: bool
    loads: tuple[type[ArmLoad], ...] = ()

    def symbols(self) -> DeltaParameters:
        """The parameters as free symbols."""
        of_loads = {name for load in self.loads for name in load.names()}
        own = {name: SX.sym(name) for name in self.names if name not in of_loads}
        return DeltaParameters(**own, loads=tuple(load.symbols() for load in self.loads))


def delta(parameters: DeltaParameters) -> Mechanism:
    """The mechanism of a Delta with the parameters that are present, left as free symbols."""
    p = parameters.symbols()
    q, dq, tau = SX.sym("q", 12), SX.sym("dq", 12), SX.sym("tau", 3)
    platform = q[:3]

    bodies = [Body("platform", p.m1, platform), Body("payload", p.m2, platform)]  # eq. (56)
    efforts, closures = [], []
    most = sum((load.most() for load in p.loads), Most())  # that loads give to an arm and take
    for k, azimuth in enumerate(AZIMUTHS):
        qk, dqk = q[3 + 3 * k : 6 + 3 * k], dq[3 + 3 * k : 6 + 3 * k]
        bodies += [_arm(p, k, azimuth, qk, dqk), _bars(p, k, azimuth, qk, dqk)]
        load = p.load(qk[0], dqk[0])
        value = tau[k] if load is None else tau[k] - load
        efforts.append(Effort(value, dqk[0], most))
        closures.append(p.platform_at(platform) - in_base(azimuth, *_tip(p, qk)))

    holonomic = ca.vertcat(*closures)  # eq. (50)-(52)
    return Mechanism(
        name="delta",
        q=q,
        dq=dq,
        bodies=tuple(bodies),
        efforts=tuple(efforts),
        controls=tau,
        holonomic=holonomic,
        gravity=p.gravity,
        parameters=p.vector(),
        closed_form=by_chains(ca.jacobian(holonomic, q)),
    )


def in_base(azimuth: float, down: SX, outward: SX, sideways: SX) -> SX:
    """A vector given in the frame of a chain, in the base frame."""
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
    along, across = p.a2 if p.b1 is None else p.b1, 0 if p.b2 is None else p.b2
    centre = in_base(
        azimuth,
        -along * s[0] - across * c[0],
        p.a1 + along * c[0] - across * s[0],
        SX(0),
    )
    return Body(f"arm {k + 1}", p.m3, centre, ca.vertcat(0, 0, p.I33), ca.vertcat(0, 0, dqk[0]))


def _bars(p: DeltaParameters, k: int, azimuth: float, qk: SX, dqk: SX) -> Body:
    """Body 2k+2, the pair of bars of a parallelogram, eq. (58) and (61)."""
    c, s = ca.cos(qk), ca.sin(qk)
    centre = in_base(
        azimuth,
        -2 * p.a2 * s[0] - p.a3 * c[2] * s[1],
        p.a1 + 2 * p.a2 * c[0] + p.a3 * c[1] * c[2],
        p.a3 * s[2],
    )
    inertia = ca.vertcat(p.I41, 0 if p.I42 is None else p.I42, p.I43)
    omega = ca.vertcat(dqk[2], s[2] * dqk[1], c[2] * dqk[1])
    return Body(f"bars {k + 1}", p.m4, centre, inertia, omega)
