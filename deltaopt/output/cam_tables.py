"""Cam tables for PLCs: each motor as a slave whose position is a function of a master's.

The master is a virtual axis that runs at constant speed, so that its position stands for time. A
cam is quintic between points that give position, velocity and acceleration of the slave by the
master's position: what TwinCAT calls motion function points with POLYNOM5_MM, CODESYS an XYVA cam.
Accelerations of a fast motion jump, but a point has only one. So a jump at time t is drawn out over
``BLEND``, as one piece in which acceleration is linear in time.

Formats: Beckhoff, TF5050 NC Camming, ``MC_MotionFunctionPoint`` and ``MC_CAM_REF``; CODESYS
SoftMotion, ``MC_CAM_REF`` of type XYVA, ``SMC_CAMXYVA``.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from deltaopt.files.output_folder import write_texts
from deltaopt.output.joint_table import Interpolation, JointTable, pieces_between
from deltaopt.output.table_files import UNITS

BLEND = 1e-6
"""Longest time, s, in which an acceleration goes from one side of a jump to the other. PLCs have
cycles a hundred times as long. A shorter one makes the acceleration of that piece less exact: its
rounding error is some 1e-15 rad over the square of it."""
_LEAST_SHARE = 0.1
"""Of the shortest time between rows that such a piece may take."""
POINTS, PIECES, TWINCAT, CODESYS = "points.csv", "pieces.csv", "twincat.st", "codesys.st"
"""Names of the files."""


def without_jumps(table: JointTable) -> JointTable:
    """A table in which no two rows have the same time.

    Two such rows, before and after a jump from a₁ to a₂, move apart by half of ``BLEND`` each. The
    second is where acceleration that is linear in between leads to: that quintic piece is a cubic.
    """
    lengths = np.diff(table.t)
    before = np.flatnonzero(lengths == 0)
    if not len(before):
        return table
    blend = min(BLEND, _LEAST_SHARE * float(lengths[lengths > 0].min()))
    after, half = before + 1, blend / 2
    t, theta = table.t.copy(), table.theta.copy()
    dtheta, a = table.dtheta.copy(), table.ddtheta
    t[before] -= half
    t[after] += half
    theta[before] += half * (half / 2 * a[before] - table.dtheta[before])
    dtheta[before] -= half * a[before]
    dtheta[after] += half * a[after]
    drawn_out = blend * (2 * a[before] + a[after]) / 6
    theta[after] = theta[before] + blend * (dtheta[before] + drawn_out)
    return JointTable(t, theta, dtheta, a)


CAM = Interpolation("cam", lambda table: without_jumps(table).quintic())
"""Quintic pieces through the points of a cam."""


class Cams:
    """The cams of the three motors: N points, the first at master position 0.

    ``master``: its positions, (N,), in units of its own. ``slaves``: positions of the motors,
    (N, 3), and their first and second derivatives by the master's position, in ``unit``.
    ``remarks``: as of the table.
    """

    def __init__(self, table: JointTable, unit: str, speed: float) -> None:
        """Of a table in the controller's angles; ``speed``: of the master, its units per second."""
        smooth = without_jumps(table)
        columns = (smooth.theta, smooth.dtheta, smooth.ddtheta)
        self.slaves = [UNITS[unit] * each / speed**k for k, each in enumerate(columns)]
        self.master = speed * (smooth.t - smooth.t[0])
        self.unit, self.remarks = unit, table.remarks


def write_cams(directory: Path, cams: Cams, name: str) -> list[Path]:
    """Write the cams of a robot, called ``name``, into a directory, made if need be.

    points.csv has the points, pieces.csv the polynomials between them, twincat.st and codesys.st
    the points as structured text. All of them appear there at once, or none; returns their paths.
    Raises OSError, naming the file, if one cannot be written.
    """
    lines = {
        POINTS: _points(cams),
        PIECES: _pieces(cams),
        TWINCAT: _twincat(cams, _in_comment(name)),
        CODESYS: _codesys(cams, _in_comment(name)),
    }
    texts = {}
    for file, own in lines.items():
        comment = "# {}" if file.endswith(".csv") else "(* {} *)"
        texts[file] = "\n".join([*map(comment.format, cams.remarks), *own]) + "\n"
    return write_texts(directory, texts)


def _points(cams: Cams) -> Iterator[str]:
    names = [f"{what}{k}" for k in (1, 2, 3) for what in ("position", "velocity", "acceleration")]
    yield ",".join(["master", *names])
    by_motor = np.stack(cams.slaves, axis=2).reshape(len(cams.master), 9)
    for row in np.hstack([cams.master[:, None], by_motor]).tolist():
        yield ",".join(map(repr, row))


def _pieces(cams: Cams) -> Iterator[str]:
    """c0 to c5 of the master's position since ``begin``."""
    yield ",".join(["motor", "begin", "end", *(f"c{power}" for power in range(6))])
    pieces = pieces_between(cams.master, *cams.slaves)
    for k in range(3):
        for i, (begin, end) in enumerate(zip(pieces.knots[:-1], pieces.knots[1:], strict=True)):
            numbers = [begin.item(), end.item(), *pieces.coefficients[i, :, k].tolist()]
            yield ",".join([str(k + 1), *map(repr, numbers)])


def _twincat(cams: Cams, name: str) -> Iterator[str]:
    number = len(cams.master)
    yield f"(* Cams of {name}, slaves in {cams.unit}. Written by deltaopt."
    yield "   To load one, for example of motor 1:"
    yield "   table.pArray := ADR(aMotor1); table.ArraySize := SIZEOF(aMotor1);"
    yield "   table.TableType := MC_TABLETYPE_MOTIONFUNCTION;"
    yield f"   table.NoOfRows := {number}; table.NoOfColumns := 1;   with table : MC_CAM_REF,"
    yield "   then MC_CamTableSelect and MC_CamIn. *)"
    yield "VAR_GLOBAL"
    for k in range(3):
        yield f"  aMotor{k + 1} : ARRAY[1..{number}] OF MC_MotionFunctionPoint := ["
        for i, (x, y, v, a) in enumerate(_rows(cams, k), 1):
            yield (
                f"    (PointIndex := {i}, FunctionType := MOTIONFUNCTYPE_POLYNOM5_MM, "
                "PointType := MOTIONPOINTTYPE_MOTION, RelIndexNextPoint := 1, "
                f"MasterPos := {x}, SlavePos := {y}, SlaveVelo := {v}, SlaveAcc := {a}, "
                f"SlaveJerk := 0.0){'' if i == number else ','}"
            )
        yield "  ];"
    yield "END_VAR"


def _codesys(cams: Cams, name: str) -> Iterator[str]:
    number = len(cams.master)
    yield f"(* Cams of {name}, slaves in {cams.unit}. Written by deltaopt."
    yield "   Before use, for each motor: camMotor1.pce := ADR(aMotor1);"
    yield "   then MC_CamTableSelect and MC_CamIn. *)"
    yield "VAR_GLOBAL"
    for k in range(3):
        yield f"  aMotor{k + 1} : ARRAY[0..{number - 1}] OF SMC_CAMXYVA := ["
        for i, (x, y, v, a) in enumerate(_rows(cams, k), 1):
            end = "" if i == number else ","
            yield f"    (dX := {x}, dY := {y}, dV := {v}, dA := {a}){end}"
        yield "  ];"
        yield (
            f"  camMotor{k + 1} : MC_CAM_REF := (byType := 3, nElements := {number}, "
            f"xStart := 0.0, xEnd := {_literal(cams.master[-1])});"
        )
    yield "END_VAR"


def _rows(cams: Cams, k: int) -> Iterator[tuple[str, str, str, str]]:
    """Master, position, velocity and acceleration of motor k + 1, as literals."""
    columns = [cams.master, *(each[:, k] for each in cams.slaves)]
    for x, y, v, a in zip(*columns, strict=True):
        yield _literal(x), _literal(y), _literal(v), _literal(a)


def _literal(number: np.float64) -> str:
    """A number of type LREAL as IEC 61131-3 writes it: always with a decimal point."""
    mantissa, mark, exponent = repr(float(number)).partition("e")
    return f"{mantissa}{'' if '.' in mantissa else '.0'}{mark.upper()}{exponent}"


def _in_comment(name: str) -> str:
    """A name that neither ends the comment that it stands in nor begins another."""
    return name.replace("*)", "* )").replace("(*", "( *")
