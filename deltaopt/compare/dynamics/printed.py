"""The paper's Delta, and M, Q̂* and Q as the paper prints them, simplified by hand.

The same values as what is derived from the energies, in fewer operations.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import casadi as ca

from deltaopt.dynamics.mechanism import SX, Mechanism
from deltaopt.mechanisms.delta.mechanism import DeltaParameters

PAPER = DeltaParameters(
    a1=0.20,
    a2=0.10,
    a3=0.25,
    a4=0.10,
    m1=0.30,
    m2=1.00,
    m3=0.40,
    m4=0.25,
    I33=0.40 * 0.10**2 / 3,
    I41=0.25 * 0.25**2 / 3,
    I43=0.25 * 0.25**2 / 3,
    g=9.81,
)
"""Section 5.3; slender bars."""


def as_printed(mechanism: Mechanism, terms: DeltaParameters) -> Mechanism:
    """Return the Delta ``mechanism`` with the paper's expressions for M, Q̂* and Q; ``terms``: the
    parameters it has."""
    given = {x.name: getattr(mechanism, x.name) for x in fields(Mechanism)}
    values = ca.vertsplit(mechanism.parameters)
    symbols: dict[str, Any] = dict(zip(terms.named(), values, strict=True))
    return _Printed(**given, letters=replace(terms, **symbols))


@dataclass(frozen=True)
class _Printed(Mechanism):
    """Equations (66) to (83); an absent term is zero."""

    letters: DeltaParameters = field(kw_only=True)

    @cached_property
    def M(self) -> SX:
        return ca.diagcat(self._platform * SX.eye(3), *(self._M(k) for k in range(3)))

    @cached_property
    def Q_gyr(self) -> SX:
        return ca.vertcat(SX(3, 1), *(self._Q_gyr(k) for k in range(3)))

    @cached_property
    def Q(self) -> SX:
        g = SX(1, 1) if self.letters.g is None else self.letters.g
        weight = ca.vertcat(self._platform * g, SX(2, 1))  # eq. (80)
        return ca.vertcat(weight, *(self._Q(k) for k in range(3)))

    @property
    def _platform(self) -> SX:
        """m₁ + m₂."""
        p = self.letters
        return SX(p.m1) + p.m2

    def _M(self, k: int) -> SX:
        p, (q1, q2, q3) = self.letters, _chain(self.q, k)
        c3, s3 = ca.cos(q3), ca.sin(q3)
        M11 = p.a2**2 * (p.m3 + 4 * p.m4) + p.I33  # eq. (68)
        M22 = c3**2 * (p.a3**2 * p.m4 + p.I43)  # eq. (69)
        if p.I42 is not None:
            M22 += s3**2 * p.I42
        M33 = p.a3**2 * p.m4 + p.I41  # eq. (70)
        M12 = 2 * p.a2 * p.a3 * p.m4 * c3 * ca.cos(q1 - q2)  # eq. (71)
        M13 = 2 * p.a2 * p.a3 * p.m4 * s3 * ca.sin(q1 - q2)  # eq. (72)
        return ca.blockcat([[M11, M12, M13], [M12, M22, SX(1, 1)], [M13, SX(1, 1), M33]])

    def _Q_gyr(self, k: int) -> SX:
        p, (q1, q2, q3) = self.letters, _chain(self.q, k)
        dq1, dq2, dq3 = _chain(self.dq, k)
        c3, s3, c12, s12 = ca.cos(q3), ca.sin(q3), ca.cos(q1 - q2), ca.sin(q1 - q2)
        inertia = p.a3**2 * p.m4 + p.I43
        if p.I42 is not None:
            inertia -= p.I42
        product = p.a2 * p.a3 * p.m4
        return ca.vertcat(
            4 * product * (c12 * s3 * dq2 * dq3 - c3 * s12 * (dq2**2 + dq3**2) / 2),  # eq. (74)
            2 * c3 * (product * s12 * dq1**2 + s3 * inertia * dq2 * dq3),  # eq. (75)
            -s3 * (2 * product * c12 * dq1**2 + c3 * inertia * dq2**2),  # eq. (76)
        )

    def _Q(self, k: int) -> SX:
        p, (q1, q2, q3), torque = self.letters, _chain(self.q, k), self.controls[k]
        if p.g is None:
            return ca.vertcat(torque, SX(2, 1))
        return ca.vertcat(
            -p.g * p.a2 * (p.m3 + 2 * p.m4) * ca.cos(q1) + torque,  # eq. (81)
            -p.g * p.a3 * p.m4 * ca.cos(q2) * ca.cos(q3),  # eq. (82)
            p.g * p.a3 * p.m4 * ca.sin(q2) * ca.sin(q3),  # eq. (83)
        )


def _chain(column: SX, k: int) -> tuple[SX, SX, SX]:
    """The entries of chain k."""
    first, second, third = ca.vertsplit(column[3 + 3 * k : 6 + 3 * k])
    return first, second, third
