"""A robot's kinematics and dynamics as C for a controller, which needs nothing but ``math.h``."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import numpy as np

from deltaopt.codegen.simd_c import SCALAR, c_function
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.dynamics.mechanism import SX
from deltaopt.dynamics.virtual_work import VirtualWork
from deltaopt.errors import on_one_line
from deltaopt.files.output_folder import all_or_none
from deltaopt.mechanisms.delta.functions import DeltaFunctions, delta_functions
from deltaopt.motion.trajectory import Array
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import Robot

HEADER = """\
/* {name}: kinematics and dynamics. Written by deltaopt.

   SI units. x down, y and z horizontal, from the base's centre; motor angles theta from the
   horizontal, up positive; every elbow outside. payload: kg at the platform's centre.
   Results are not numbers where the platform cannot be. No function keeps any state.{joints} */

#ifndef DELTA_H
#define DELTA_H

/* Motor angles, rad, of the platform's position, m. */
void delta_inverse_kinematics(const double x[3], double theta[3]);

/* Position, m, of motor angles, rad: the lower of two. */
void delta_forward_kinematics(const double theta[3], double x[3]);

/* Torques, N m, of a motion of the platform: m, m/s, m/s^2. */
void delta_inverse_dynamics(const double x[3], const double v[3], const double a[3],
                            double payload, double tau[3]);

/* Acceleration of the platform, m/s^2, under torques, N m. */
void delta_forward_dynamics(const double x[3], const double v[3], const double tau[3],
                            double payload, double a[3]);

#endif
"""

WRAPPERS = """\
void delta_inverse_kinematics(const double x[3], double theta[3]) {
  inverse_kinematics(x, theta);
}

void delta_forward_kinematics(const double theta[3], double x[3]) {
  forward_kinematics(theta, x);
}

void delta_inverse_dynamics(const double x[3], const double v[3], const double a[3],
                            double payload, double tau[3]) {
  inverse_dynamics(x, v, a, &payload, tau);
}

void delta_forward_dynamics(const double x[3], const double v[3], const double tau[3],
                            double payload, double a[3]) {
  forward_dynamics(x, v, tau, &payload, a);
}
"""

TEST = """\
/* Compares with deltaopt's own numbers, and measures the time of an evaluation.
   cc -O2 delta.c test_delta.c -lm -o test_delta && ./test_delta */

#include <math.h>
#include <stdio.h>
#include <time.h>

#include "delta.h"

/* Position, velocity, acceleration, motor angles, torques. */
enum {{ STATES = {number} }};
static const double payload = {payload!r};
static const double state[STATES][15] = {{
{states}
}};

static double worst = 0;

static void compare(const double *found, const double *wanted) {{
  double scale = 1;
  for (int k = 0; k < 3; k++) scale = fmax(scale, fabs(wanted[k]));
  for (int k = 0; k < 3; k++) {{
    const double error = fabs(found[k] - wanted[k]) / scale;
    if (!(error <= worst)) worst = error;
  }}
}}

static double nanoseconds(int forward) {{
  enum {{ ROUNDS = 20000 }};
  double result[3];
  volatile double sink = 0;
  const clock_t begin = clock();
  for (int round = 0; round < ROUNDS; round++)
    for (int i = 0; i < STATES; i++) {{
      const double *s = state[i];
      if (forward)
        delta_forward_dynamics(s, s + 3, s + 12, payload, result);
      else
        delta_inverse_dynamics(s, s + 3, s + 6, payload, result);
      sink += result[0];
    }}
  return 1e9 * (double)(clock() - begin) / CLOCKS_PER_SEC / ROUNDS / STATES;
}}

int main(void) {{
  for (int i = 0; i < STATES; i++) {{
    const double *s = state[i];
    double result[3];
    delta_inverse_kinematics(s, result);
    compare(result, s + 9);
    delta_forward_kinematics(s + 9, result);
    compare(result, s);
    delta_inverse_dynamics(s, s + 3, s + 6, payload, result);
    compare(result, s + 12);
    delta_forward_dynamics(s, s + 3, s + 12, payload, result);
    compare(result, s + 6);
  }}
  printf("largest relative error: %.1e\\n", worst);
  printf("inverse dynamics: %.0f ns, forward dynamics: %.0f ns\\n", nanoseconds(0), nanoseconds(1));
  return worst < 1e-9 ? 0 : 1;
}}
"""


def export_c(robot: Robot, directory: Path) -> list[Path]:
    """Write delta.h, delta.c and test_delta.c into a directory, made if need be.

    Returns their paths. All of them appear there at once, or none. Raises OSError, naming the file,
    if one cannot be written.
    """
    texts = {
        "delta.h": HEADER.format(name=_in_comment(robot.name), joints=_joints(robot)),
        "delta.c": source(robot),
        "test_delta.c": program(robot),
    }
    with all_or_none(directory) as folder:
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")
    return [directory / name for name in texts]


def _joints(robot: Robot) -> str:
    """A comment on how the controller's angles are counted, where the robot names that.

    The functions are in the model's angles, for a controller has its own place to scale encoders.
    """
    if robot.joints is None or robot.joints.zero is robot.joints.sign is None:
        return ""
    signs, zeros = robot.joints.signs.tolist(), robot.joints.zeros.tolist()
    rows = (
        f"\n     motor {k}: theta = {sign:+g} * angle - {zero!r}; speed, acceleration and torque "
        f"* {sign:+g}"
        for k, (sign, zero) in enumerate(zip(signs, zeros, strict=True), 1)
    )
    return "\n\n   This robot's controller counts its angles otherwise:" + "".join(rows)


def _in_comment(name: str) -> str:
    """A name that does not end the comment that it stands in."""
    return on_one_line(name).replace("*/", "* /")


def source(robot: Robot) -> str:
    """The text of delta.c: the robot's numbers are constants, the payload is an argument."""
    parts = ['#include "delta.h"', SCALAR]
    parts += [c_function(function, function.name()) for function in c_functions(robot)]
    return "\n".join([*parts, WRAPPERS])


def c_functions(robot: Robot) -> list[ca.Function]:
    """Inverse and forward kinematics, then inverse and forward dynamics of a robot.

    The last argument of the dynamics is the payload, kg.
    """
    model = DeltaModel(robot, payload=1.0)
    functions = delta_functions(model.functions.terms, Explicit())
    payload = SX.sym("payload")
    names = model.functions.terms.names
    p = ca.vertcat(
        *(payload if n == "m2" else v for n, v in zip(names, model.parameters, strict=True))
    )
    x, theta = SX.sym("x", 3), SX.sym("theta", 3)
    angles = functions.inverse_kinematics(x, p)[3::3]
    position = functions.forward_kinematics(theta, p)
    return [
        ca.Function("inverse_kinematics", [x], [angles], {"cse": True}),
        ca.Function("forward_kinematics", [theta], [position], {"cse": True}),
        *_dynamics(functions, p, payload),
    ]


def _dynamics(functions: DeltaFunctions, p: SX, payload: SX) -> list[ca.Function]:
    """Inverse and forward dynamics by eq. (39)."""
    x, v, given = (SX.sym(name, 3) for name in ("x", "v", "given"))
    return [
        ca.Function(name, [x, v, given, payload], [solved(x, v, given, p)], {"cse": True})
        for name, solved in (
            ("inverse_dynamics", functions.explicit_torques),
            ("forward_dynamics", functions.explicit_acceleration),
        )
    ]


def program(robot: Robot) -> str:
    """The text of test_delta.c: states near the middle of the workspace, and the torques by virtual
    work there to compare with."""
    payload = 0.2
    model = DeltaModel(robot, payload, VirtualWork())
    rng = np.random.default_rng(5)
    theta = rng.uniform(-0.4, 0.4, (20, 3))
    x = model.forward_kinematics(theta)
    v, a = rng.uniform(-2, 2, x.shape), rng.uniform(-50, 50, x.shape)
    rows = np.hstack([x, v, a, theta, model.inverse_dynamics(x, v, a)])
    return TEST.format(number=len(rows), payload=payload, states=",\n".join(map(_braced, rows)))


def _braced(row: Array) -> str:
    return "    {" + ", ".join(map(repr, row.tolist())) + "}"
