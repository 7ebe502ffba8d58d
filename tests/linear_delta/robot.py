"""A linear Delta: three carriages on vertical guides, each with a parallelogram to the platform.

Guide k stands at azimuth φ_k and radius R, its carriage is s_k below the base. A pair of slender
bars of length L leads from there to the platform's pin at radius r. Carriages are pushed along
their guides: forces in N, positions in m. The coordinates are q = [x (3); s_k, o_k, w_k], twelve
with nine constraints: o and w are components of a bar's direction, outwards and sideways. A slender
bar moves like particles at its ends and its middle, a sixth, two thirds and a sixth of its mass.

Everything but kinematics follows from the package's mechanism by eq. (39).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from math import cos, pi, sin

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.mechanism import SX, Body, Effort, Mechanism, Most
from deltaopt.errors import Unreachable, in_words
from deltaopt.files.validated_record import Positive
from deltaopt.mechanisms.functions import Functions, SingularityDistance
from deltaopt.robot.drive import Drive
from deltaopt.robot.joints import Joints
from deltaopt.robot.machine import Energies, Machine, Model, Workspace
from deltaopt.robot.model import new_model
from deltaopt.robot.tool import Tool

Array = NDArray[np.float64]

AZIMUTHS = (0.0, 2 * pi / 3, -2 * pi / 3)
NAMES = ("offset", "bar", "platform", "carriage", "bars", "g", "payload")
DIMENSIONS = ((1, 0, 0), (1, 0, 0), (0, 1, 0), (0, 1, 0), (0, 1, 0), (1, 0, -2), (0, 1, 0))


class LinearDelta(Machine):
    """``guides``: R, ``pins``: r, ``bar``: L, m; masses of ``platform``, one ``carriage`` and one
    pair of ``bars``, kg. ``drive``: forces in N and speeds in m/s; ``joints.arm``: the range of
    the carriages, m."""

    name: str = Field(description="a name")
    guides: Positive = Field(description="a radius in m")
    pins: Positive = Field(description="a radius in m")
    bar: Positive = Field(description="a length in m")
    platform: Positive = Field(description="a mass in kg")
    carriage: Positive = Field(description="a mass in kg")
    bars: Positive = Field(description="a mass in kg")
    drive: Drive = Field(description="a drive")
    tool: Tool | None = Field(default=None, description="no tool")
    joints: Joints | None = Field(default=None, description="ranges of the carriages")
    workspace: Workspace | None = Field(default=None, description="a workspace")
    gravity: float = Field(default=9.81, description="an acceleration in m/s²")

    @property
    def units(self) -> dict[str, str]:
        return {"N·m": "N", "rad": "m", "rad/s": "m/s", "N·m·s/rad": "N·s/m"}

    @property
    def gravity_vector(self) -> tuple[float, float, float]:
        return self.gravity, 0.0, 0.0

    @property
    def size(self) -> float:
        return self.bar

    lever = property(lambda self: 1.0)

    @property
    def reach(self) -> float:
        return self.farthest

    @property
    def farthest(self) -> float:
        lowest = 0.0 if self.joints is None or self.joints.arm is None else self.joints.arm[1]
        return lowest + self.bar + self.guides

    @property
    def width(self) -> float:
        return self.guides - self.pins

    @property
    def platform_mass(self) -> float:
        return self.platform

    def on_axis(self, depth: float) -> Array:
        range_of = (0.0, 1.0) if self.joints is None else self.joints.arm or (0.0, 1.0)
        carriage = range_of[0] + depth * (range_of[1] - range_of[0])
        return np.array([carriage + (self.bar**2 - self.width**2) ** 0.5, 0.0, 0.0])


@dataclass(frozen=True, eq=False)
class LinearFunctions(Functions):
    """Kinematics, closed form and distances of all linear Deltas."""

    formulation: Formulation
    motors = slice(3, None, 3)
    lengths = (True,) * 3 + (True, False, False) * 3
    payload = NAMES.index("payload")

    def symbols(self) -> SX:
        return ca.vertcat(*map(SX.sym, NAMES))

    @cached_property
    def mechanism(self) -> Mechanism:
        p = self.symbols()
        offset, bar, platform, carriage, bars, g, payload = ca.vertsplit(p)
        q, dq, tau = SX.sym("q", 12), SX.sym("dq", 12), SX.sym("tau", 3)
        bodies = [Body("platform", platform, q[:3]), Body("payload", payload, q[:3])]
        efforts, closures = [], []
        for k, azimuth in enumerate(AZIMUTHS):
            joint = ca.vertcat(q[3 + 3 * k], offset * cos(azimuth), offset * sin(azimuth))
            along = bar * _in_base(azimuth, *_direction(q[3 + 3 * k : 6 + 3 * k]))
            bodies += [
                Body(f"carriage {k + 1} and bars' upper ends", carriage + bars / 6, joint),
                Body(f"bars' middle {k + 1}", 2 * bars / 3, joint + along / 2),
                Body(f"bars' lower ends {k + 1}", bars / 6, q[:3]),
            ]
            efforts.append(Effort(tau[k], dq[3 + 3 * k], Most()))
            closures.append(q[:3] - joint - along)
        holonomic = ca.vertcat(*closures)
        J = ca.jacobian(holonomic, q)
        inverses = [ca.inv_minor(J[3 * k : 3 * k + 3, 3 + 3 * k : 6 + 3 * k]) for k in range(3)]
        C = ca.vertcat(SX.eye(3), *(-inverse for inverse in inverses))
        P = ca.vertcat(SX(3, 9), ca.diagcat(*inverses))
        gravity = ca.vertcat(g, 0, 0)
        return Mechanism(
            name="linear delta",
            q=q,
            dq=dq,
            bodies=tuple(bodies),
            efforts=tuple(efforts),
            controls=tau,
            holonomic=holonomic,
            gravity=gravity,
            parameters=p,
            closed_form=(C, P),
        )

    @cached_property
    def inverse_kinematics(self) -> ca.Function:
        x, p = SX.sym("x", 3), self.symbols()
        q = [x]
        for outward, sideways in (_across(x, p, azimuth) for azimuth in AZIMUTHS):
            height = ca.sqrt(p[1] ** 2 - outward**2 - sideways**2)  # carriages above the platform
            q += [x[0] - height, outward / p[1], sideways / p[1]]
        return ca.Function("inverse_kinematics", [x, p], [ca.vertcat(*q)])

    @cached_property
    def forward_kinematics(self) -> ca.Function:
        """Where three spheres of radius L about the joints meet, the lower of both points."""
        s, p = SX.sym("s", 3), self.symbols()
        a, b, c = (
            ca.vertcat(s[k], p[0] * cos(azimuth), p[0] * sin(azimuth))
            for k, azimuth in enumerate(AZIMUTHS)
        )
        u, w = b - a, c - a
        normal = ca.cross(u, w)
        square = ca.dot(normal, normal)
        centre = ca.cross(ca.dot(u, u) * w - ca.dot(w, w) * u, normal) / (2 * square)
        height = ca.sqrt((p[1] ** 2 - ca.dot(centre, centre)) / square)
        x = a + centre + ca.sign(normal[0]) * height * normal
        return ca.Function("forward_kinematics", [s, p], [x])

    @cached_property
    def serial_distances(self) -> ca.Function:
        x, p = SX.sym("x", 3), self.symbols()
        across = [_across(x, p, azimuth) for azimuth in AZIMUTHS]
        aside = [1 - (sideways / p[1]) ** 2 for _, sideways in across]
        upright = [1 - (outward**2 + sideways**2) / p[1] ** 2 for outward, sideways in across]
        return ca.Function("serial_distances", [x, p], [ca.vertcat(*aside, *upright)])

    @cached_property
    def tilt(self) -> ca.Function:
        x, p = SX.sym("x", 3), self.symbols()
        sines = [_across(x, p, azimuth)[1] / p[1] for azimuth in AZIMUTHS]
        return ca.Function("tilt", [x, p], [ca.vertcat(*sines)])

    def alignments(self, q: SX) -> SX:
        return 1 - q[4::3] ** 2 - q[5::3] ** 2

    def tilts(self, q: SX) -> SX:
        return q[5::3]

    def parallel_margin(self, q: SX) -> SX:
        return _volume([_direction(q[3 + 3 * k : 6 + 3 * k]) for k in range(3)])

    def tilt_margin(self, q: SX) -> SX:
        bars = [_direction(q[3 + 3 * k : 6 + 3 * k]) for k in range(3)]
        sizes = [ca.sqrt(down**2 + outward**2) for down, outward, _ in bars]
        pairs = zip(bars, sizes, strict=True)
        return _volume([(out / size, -down / size, SX(0)) for (down, out, _), size in pairs])

    def lever(self, p: SX) -> SX:
        return SX(1)

    @property
    def distances(self) -> Sequence[SingularityDistance]:
        return (
            SingularityDistance("bars across the guide", "1 - o² - w²", True, self.alignments),
            SingularityDistance("parallel", "volume of the bars", False, self.parallel_margin),
        )


def _across(x: SX, p: SX, azimuth: float) -> tuple[SX, SX]:
    """From a carriage's joint to the pin, outwards and sideways."""
    c, s = cos(azimuth), sin(azimuth)
    return c * x[1] + s * x[2] - p[0], c * x[2] - s * x[1]


def _direction(chain: SX) -> tuple[SX, SX, SX]:
    """Of a bar, down, outwards and sideways."""
    return ca.sqrt(1 - chain[1] ** 2 - chain[2] ** 2), chain[1], chain[2]


def _in_base(azimuth: float, down: SX, outward: SX, sideways: SX) -> SX:
    c, s = cos(azimuth), sin(azimuth)
    return ca.vertcat(down, c * outward - s * sideways, s * outward + c * sideways)


def _volume(vectors: Sequence[tuple[SX, SX, SX]]) -> SX:
    each = [_in_base(azimuth, *own) for azimuth, own in zip(AZIMUTHS, vectors, strict=True)]
    return ca.det(ca.horzcat(*each))


@lru_cache
def linear_functions(formulation: Formulation) -> LinearFunctions:
    return LinearFunctions(formulation)


@dataclass(frozen=True)
class LinearModel(Model):
    """The functions above as functions of numbers."""

    robot: LinearDelta
    payload: float | None = None
    formulation: Formulation = field(default_factory=Explicit)

    def __reduce__(self) -> tuple[object, ...]:
        return LinearModel, (self.robot, self.payload, self.formulation)

    functions = property(lambda self: linear_functions(self.formulation))
    dimensions = property(lambda self: np.array(DIMENSIONS))

    @cached_property
    def parameters(self) -> Array:
        r = self.robot
        payload = self.payload or 0.0
        return np.array([r.width, r.bar, r.platform, r.carriage, r.bars, r.gravity, payload])

    @property
    def mass(self) -> float:
        return self.robot.platform + self.robot.carriage + self.robot.bars + (self.payload or 0.0)

    @property
    def energies(self) -> Energies:
        r = self.robot
        weight = np.full(3, (r.carriage + r.bars / 2) * r.gravity)
        mass = r.platform + (self.payload or 0.0)
        return Energies(r.carriage, 1.0, mass, r.bars / 4, r.bars / 12, 3 * r.bars, weight)

    def with_multipliers(self) -> LinearModel:
        return LinearModel(self.robot, self.payload, Multiplier())

    def inverse_kinematics(self, x: ArrayLike) -> Array:
        return self._of("inverse_kinematics", x)[0]

    def forward_kinematics(self, theta: ArrayLike) -> Array:
        return self._of("forward_kinematics", theta)[0]

    def alignments(self, x: ArrayLike) -> Array:
        (distances,) = _rows("serial_distances")(x, parameters=self.parameters)
        return distances[..., 3:]

    def motion(self, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> tuple[Array, Array, Array]:
        q, dq, ddq = self._of("motion", x, v, a)
        return q, dq, ddq

    def inverse_dynamics(self, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        return self._of("explicit_torques", x, v, a)[0]

    def _of(self, name: str, *arguments: ArrayLike) -> tuple[Array, ...]:
        found = _rows(name)(*arguments, parameters=self.parameters)
        failed = ~np.isfinite(np.atleast_2d(found[0])).all(axis=1)
        if failed.any():
            place = np.atleast_2d(np.asarray(arguments[0], dtype=float))[np.argmax(failed)]
            raise Unreachable(f"the bars do not reach {in_words(place)}", np.flatnonzero(failed))
        return found


@lru_cache
def _rows(name: str) -> RowFunction:
    return RowFunction(getattr(linear_functions(Explicit()), name))


new_model.register(LinearDelta, LinearModel)
