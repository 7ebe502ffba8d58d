"""A function without the trigonometric functions of angles that it has from arc functions.

Kinematics in closed form finds an angle as atan2(y, x) or asin(s); dynamics then asks for its sine
and cosine, which are y/r and x/r with r = √(x² + y²). A function that goes through the angles costs
ten times as much as one that does not.
"""

from __future__ import annotations

import casadi as ca

SX = ca.SX


_Angle = tuple[SX, SX]
"""The sine and cosine of an expression that is an angle."""


def simplified(function: ca.Function) -> ca.Function:
    """An equal function of scalar expressions, in which no sine or cosine is taken of an angle that
    was found by atan2 or asin, nor of a difference of two such angles.

    Angles that are results themselves are still found. Common subexpressions are shared.
    """
    inputs = function.sx_in()
    outputs = [SX(function.sparsity_out(i)) for i in range(function.n_out())]
    work: dict[int, SX] = {}
    angles: dict[int, _Angle | None] = {}
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        to, by = function.instruction_output(k), function.instruction_input(k)
        if operation == ca.OP_OUTPUT:
            outputs[to[0]].nz[to[1]] = work[by[0]]
            continue
        if operation == ca.OP_INPUT:
            value, angle = inputs[by[0]].nz[by[1]], None
        elif operation == ca.OP_CONST:
            value, angle = SX(function.instruction_constant(k)), None
        else:
            given, of_angles = [work[i] for i in by], [angles[i] for i in by]
            value = _value(operation, given, of_angles)
            angle = _angle(operation, given, of_angles)
        work[to[0]], angles[to[0]] = value, angle
    return ca.Function(function.name(), inputs, outputs, {"cse": True})


def _value(operation: int, arguments: list[SX], angles: list[_Angle | None]) -> SX:
    if angles[0] is not None and operation in (ca.OP_SIN, ca.OP_COS):
        return angles[0][0 if operation == ca.OP_SIN else 1]
    if len(arguments) == 1:
        return SX.unary(operation, arguments[0])
    return SX.binary(operation, *arguments)


def _angle(operation: int, arguments: list[SX], angles: list[_Angle | None]) -> _Angle | None:
    if operation == ca.OP_ATAN2:
        y, x = arguments
        r = ca.sqrt(y * y + x * x)
        return y / r, x / r
    if operation == ca.OP_ASIN:
        (s,) = arguments
        return s, ca.sqrt((1 - s) * (1 + s))
    if operation == ca.OP_SUB and angles[0] is not None and angles[1] is not None:
        (s, c), (sine, cosine) = angles[0], angles[1]
        return s * cosine - c * sine, c * cosine + s * sine
    return None
