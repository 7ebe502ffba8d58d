"""Values that others published for the benchmarks, with where they stand.

IFToMM: the reference solutions of the library of computational benchmark problems (González,
Dopico, Lugrís and Cuadrado, 2006), as the vector graphics of Tagliapietra, Vivian, Ceseracciu and
Reggiani's *MBS benchmarks in OpenSim* hold them, six digits. The library's own site could not be
reached.
IVP: the test set for initial value problems (Lioen, de Swart, Mazzia), problem Andrews' squeezing
mechanism, sixteen digits at t = 0.03 s.
Exudyn: results noted in its example ``fourBarMechanismIftomm`` (Gerstmayr, 2021).
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Published:
    """A published number: of which ``quantity`` (an index of what a case reports), when (s)."""

    time: float
    quantity: str
    value: float
    source: str


def _rows(
    source: str, quantities: tuple[str, ...], *rows: tuple[float, tuple[float, ...]]
) -> tuple[Published, ...]:
    return tuple(
        Published(time, quantity, value, source)
        for time, values in rows
        for quantity, value in zip(quantities, values, strict=True)
    )


PENDULUM = _rows(
    "IFToMM",
    ("x", "y"),
    (0.5, (-0.391049, -0.920370)),
    (1.0, (0.986292, -0.165011)),
    (2.0, (-0.793566, -0.608484)),
    (5.0, (-0.942305, -0.334754)),
    (9.5, (-0.999992, -0.0040211)),
    (10.0, (-0.275087, -0.961419)),
)
FOUR_BARS = (
    *_rows("IFToMM", ("x", "y"), (0.1, (0.101676, 0.994818)), (0.2, (0.213388, 0.976967))),
    *_rows("IFToMM", ("x", "y"), (10.0, (0.180513, 0.983573))),
    *_rows("Exudyn, step 0.25 ms", ("x", "y"), (10.0, (0.3284552113, 0.9445195467))),
    *_rows("Exudyn, step 0.125 ms", ("x", "y"), (10.0, (0.3284573768, 0.9445187937))),
)
ANGLES = ("β", "Θ", "γ", "Φ", "δ", "Ω", "ε")
ANDREWS = (
    *_rows(
        "IVP",
        ANGLES,
        (
            0.03,
            (
                0.1581077119629904e2,
                -0.1575637105984298e2,
                0.4082224013073101e-1,
                -0.5347301163226948,
                0.5244099658805304,
                0.5347301163226948,
                0.1048080741042263e1,
            ),
        ),
    ),
    *_rows(
        "IVP",
        tuple(f"d{name}" for name in ANGLES),
        (
            0.03,
            (
                0.1139920302151208e4,
                -0.1424379294994111e4,
                0.1103291221937134e2,
                0.1929337464421385e2,
                0.5735699284790808,
                -0.1929337464421385e2,
                0.3231791658026955,
            ),
        ),
    ),
)
ANDREWS_MULTIPLIERS = (
    0.1991753333731910e3,
    -0.2975531228015052e2,
    0.2306654119098399e2,
    0.3145271365475927e2,
    0.2264249232082739e2,
    0.1161740700019673e2,
)
"""λ₁ … λ₆ of the test set at t = 0.03 s, whose sign is opposite to eq. (37)'s."""
BRICARD = _rows(
    "IFToMM",
    ("x", "y", "z"),
    (0.2, (0.961273, -0.999279, -0.0379769)),
    (1.0, (0.273334, -0.886544, -0.462644)),
    (2.0, (-0.779947, -0.980636, -0.195841)),
    (10.0, (0.999265, -1.000000, -0.0007351)),
)
GOVERNOR = _rows(
    "IFToMM",
    ("s",),
    *(
        (time, (s,))
        for time, s in (
            (0.1, 0.523836),
            (0.5, 0.743249),
            (1.0, 0.501420),
            (1.5, 0.740684),
            (2.0, 0.505909),
            (2.5, 0.735602),
            (3.0, 0.513246),
        )
    ),
)
