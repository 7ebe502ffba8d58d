"""Terms of the model that load every arm beside its motor: friction.

A term is a class of this file. Its parameters are its fields, which become parameters of the
mechanism. It says what torque it takes and the most that this can be; what the general equations,
the angle-free ones, slowing, the lower bound, units and descriptions do with it follows from that.
What cannot express a term that it does not know, such as another program's format, refuses it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import ClassVar

import casadi as ca

from deltaopt.dynamics.mechanism import SX, UNBOUNDED, Most

Dimension = tuple[int, int, int]
"""Powers of length, mass and time."""


@dataclass(frozen=True)
class ArmLoad:
    """A torque that is taken from every arm, by its angle and speed.

    Fields: the parameters of the term, numbers or symbols. ``words``: what it is. ``dimensions``:
    of each parameter, by its name.
    """

    words: ClassVar[str]
    dimensions: ClassVar[Mapping[str, Dimension]]

    def torque(self, angle: SX, speed: SX) -> SX:
        """What it takes at an arm's angle (rad) and speed (rad/s), N·m: with the sign of the speed
        if it brakes."""
        raise NotImplementedError

    def most(self) -> Most:
        """The most that it can give to an arm, or take; without bound unless that is stated."""
        return UNBOUNDED

    def layer(self) -> tuple[SX | float, SX | float] | None:
        """The speed within ± of which it changes its sign (rad/s), and half by how much it changes
        (N·m), a parameter of its own, as a tanh does; None where it does not change within a
        moment."""
        return None

    @classmethod
    def names(cls) -> list[str]:
        """Of its parameters."""
        return [each.name for each in fields(cls)]

    @classmethod
    def symbols(cls) -> ArmLoad:
        """This term with its parameters as free symbols."""
        return cls(**{name: SX.sym(name) for name in cls.names()})


@dataclass(frozen=True)
class ViscousFriction(ArmLoad):
    """viscous · θ̇; N·m·s/rad."""

    viscous: SX | float
    words: ClassVar[str] = "viscous friction"
    dimensions: ClassVar[Mapping[str, Dimension]] = {"viscous": (2, 1, -1)}

    def torque(self, angle: SX, speed: SX) -> SX:
        return self.viscous * speed

    def most(self) -> Most:
        return Most(by_speed=self.viscous)


@dataclass(frozen=True)
class CoulombFriction(ArmLoad):
    """coulomb · tanh (θ̇ / coulomb_speed); N·m, rad/s."""

    coulomb: SX | float
    coulomb_speed: SX | float
    words: ClassVar[str] = "Coulomb friction"
    dimensions: ClassVar[Mapping[str, Dimension]] = {
        "coulomb": (2, 1, -2),
        "coulomb_speed": (0, 0, -1),
    }

    def torque(self, angle: SX, speed: SX) -> SX:
        return self.coulomb * ca.tanh(speed / self.coulomb_speed)

    def most(self) -> Most:
        return Most(braking=self.coulomb)

    def layer(self) -> tuple[SX | float, SX | float]:
        return self.coulomb_speed, self.coulomb


FRICTION: tuple[type[ArmLoad], ...] = (ViscousFriction, CoulombFriction)
"""The terms that a robot's file can name."""
