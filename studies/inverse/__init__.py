"""Kinematics and dynamics of the public model: nanoseconds a point, beside other ways to them.

The public calls of ``DeltaModel`` are timed for one point and for many, then the same torques by
NumPy written by hand, and by Pinocchio and MuJoCo, where these are installed. Each way is first
held against the model's torques; one that differs is left out. A time is processor time, that of
the fastest of many short batches: what else the machine does makes it longer, never shorter. At
last comes the exported C code, timed by its own test program.
"""

from __future__ import annotations

import argparse
import re
import subprocess
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time

import numpy as np

import deltaopt
from deltaopt.cli.arguments import positive
from deltaopt.codegen.c_compiler import compiler
from deltaopt.curves.piecewise import Array
from deltaopt.errors import MissingPackage
from deltaopt.output.controller_c import export_c
from studies.inverse.by_hand import inverse_dynamics
from studies.inverse.peers import Peer, mujoco_torques, pinocchio_torques, pinocchio_tree, relative
from studies.problems import ORSINO, add_robots

Robot = deltaopt.Robot
Call = Callable[[], object]

HELP = "the public model, NumPy by hand, Pinocchio, MuJoCo and exported C: ns a point"
SIZES = (1, 10, 1_000, 1_000_000)
SMALL = {"robots": (ORSINO,), "sizes": (1, 10), "seconds": 0.01}
_PAYLOAD = 1.0
_WIDTH = 64
_FEWEST = 5
"""Batches at least."""
_BATCH = 2e-4
"""s of a batch: short enough that some run between what else the machine does."""


@dataclass(frozen=True)
class States:
    """Motions in the middle of a robot's workspace: of the platform, (N, 3), of all coordinates,
    (N, 12), and the torques, (N, 3), that the model gives."""

    model: deltaopt.DeltaModel
    x: Array
    v: Array
    a: Array
    joints: tuple[Array, Array, Array]
    tau: Array

    @classmethod
    def of(cls, model: deltaopt.DeltaModel, number: int) -> States:
        rng = np.random.default_rng(5)
        x = model.forward_kinematics(rng.uniform(-0.4, 0.4, (number, 3)))
        v, a = rng.uniform(-2, 2, x.shape), rng.uniform(-50, 50, x.shape)
        return cls(model, x, v, a, model.motion(x, v, a), model.inverse_dynamics(x, v, a))

    @property
    def platform(self) -> tuple[Array, Array, Array]:
        return self.x, self.v, self.a


@dataclass(frozen=True)
class Timing:
    """For how many points calls are timed, and the least seconds spent on a number."""

    sizes: Sequence[int]
    seconds: float

    def up_to(self, most: int) -> Timing:
        return Timing([number for number in self.sizes if number <= most], self.seconds)

    def row(self, name: str, chosen: Callable[[int], Call]) -> str:
        """A line of the table."""
        times = (nanoseconds(chosen(number), number, self.seconds) for number in self.sizes)
        return f"  {name:<{_WIDTH}}" + "".join(f"{time:>11,.0f}" for time in times)


def nanoseconds(call: Call, points: int, seconds: float) -> float:
    """The least processor time a point of a call, of many short batches."""
    begin = process_time()
    call()
    once = process_time() - begin
    repeats = max(1, int(_BATCH / once))
    batches: list[float] = []
    end = perf_counter() + seconds
    while len(batches) < _FEWEST or perf_counter() < end:
        begin = process_time()
        for _ in range(repeats):
            call()
        batches.append((process_time() - begin) / repeats)
    return 1e9 * min(batches) / points


def public_calls(states: States) -> Iterator[tuple[str, Callable[[int], Call]]]:
    """Each public call: its name, and the call for N points, a single one for N = 1."""
    model, theta = states.model, np.ascontiguousarray(states.joints[0][:, 3::3])
    dynamic = (states.x, states.v, states.tau)
    calls: tuple[tuple[Callable[..., object], tuple[Array, ...]], ...] = (
        (model.inverse_kinematics, (states.x,)),
        (model.forward_kinematics, (theta,)),
        (model.motion, states.platform),
        (model.inverse_dynamics, states.platform),
        (model.forward_dynamics, dynamic),
        (model.multipliers, states.platform),
        (model.joint_inverse_dynamics, states.joints),
    )
    for function, arrays in calls:
        yield function.__name__, _for_points(function, arrays)


def _for_points(function: Callable[..., object], arrays: Sequence[Array]) -> Callable[[int], Call]:
    def chosen(number: int) -> Call:
        rows = [a[0] if number == 1 else a[:number] for a in arrays]
        return lambda: function(*rows)

    return chosen


def by_hand(states: States, timing: Timing) -> str:
    """The line of NumPy by hand."""
    p, name = states.model.numbers, "the same torques, NumPy by hand"
    sample = tuple(rows[:100] for rows in states.platform)
    if _differ(inverse_dynamics(p, *sample), states.tau[:100]):
        return f"  {name}: left out, it does not know all terms of this robot"

    def chosen(number: int) -> Call:
        rows = [a[:number] for a in states.platform]
        return lambda: inverse_dynamics(p, *rows)

    return timing.row(name, chosen)


def peer(
    name: str,
    make: Callable[[Robot, float], Peer],
    states: States,
    compared: bool,
    timing: Timing,
) -> str:
    """The line of another program, which takes one point at a time."""
    try:
        called = make(states.model.robot, _PAYLOAD)
    except MissingPackage as error:
        return f"  {name}: {error}"
    q, dq, ddq = (relative(rows[:100]) for rows in states.joints)
    points = list(zip(q, dq, ddq, strict=True))
    if compared and _differ(np.array([called(*point) for point in points]), states.tau[:100]):
        return f"  {name}: left out, it is not told all terms of this robot"
    line = timing.up_to(1).row(name, lambda _: lambda: called(*points[0]))
    return f"{line}  (one point at a time)"


def _differ(found: Array, tau: Array) -> bool:
    return not np.abs(found - tau).max() < 1e-9 * np.abs(tau).max()


PEERS: dict[str, tuple[Callable[[Robot, float], Peer], bool]] = {
    "of joints, Pinocchio: rnea of the open tree alone": (pinocchio_tree, False),
    "of joints, Pinocchio: rnea, Jacobians, loops closed in NumPy": (pinocchio_torques, True),
    "of joints, MuJoCo: mj_inverse, Jacobians, loops closed in NumPy": (mujoco_torques, True),
}
"""Other programs, and whether their results are torques to compare."""


def with_other_bars(robot: Robot) -> Robot:
    """The robot with bars whose moments of inertia are no slender bar's."""
    bars = robot.forearm
    slender = bars.mass * bars.length**2 / 12
    inertia = (1.1 * slender, 0.02 * slender, 1.2 * slender)
    forearm = bars.model_copy(update={"inertia": inertia})
    return robot.model_copy(update={"forearm": forearm})


def exported_nanoseconds(robot: Robot) -> tuple[float, float]:
    """Return the nanoseconds of inverse and of forward dynamics in exported C.

    Raises MissingPackage where there is no C compiler.
    """
    found = compiler()
    if found is None:
        raise MissingPackage("no C compiler is installed")
    with TemporaryDirectory() as folder:
        export_c(robot, Path(folder))
        files = ["delta.c", "test_delta.c", "-lm", "-o", "test_delta"]
        subprocess.run([found.command, *found.arguments, "-O2", *files], cwd=folder, check=True)
        ran = subprocess.run([f"{folder}/test_delta"], capture_output=True, text=True, check=True)
    inverse, forward = re.findall(r"(\d+) ns", ran.stdout)
    return float(inverse), float(forward)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robots(parser)
    parser.add_argument(
        "--sizes",
        nargs="+",
        type=int,
        default=SIZES,
        metavar="N",
        help=f"numbers of points (default: {' '.join(map(str, SIZES))})",
    )
    parser.add_argument(
        "--seconds",
        type=positive,
        default=0.5,
        metavar="S",
        help="spent on each number of the table: more gives steadier figures (default: 0.5)",
    )


def run(arguments: argparse.Namespace) -> int:
    sizes: Sequence[int] = arguments.sizes
    timing = Timing(sizes, arguments.seconds)
    for robot in map(deltaopt.load_robot, arguments.robots):
        heading = "".join(f"{f'N = {number:g}':>11}" for number in sizes)
        print(f"{f'{robot.name}: ns a point':<{_WIDTH + 2}}{heading}")
        states = States.of(deltaopt.DeltaModel(robot, _PAYLOAD), max(100, *sizes))
        for name, chosen in public_calls(states):
            print(timing.row(name, chosen), flush=True)
        print(by_hand(states, timing), flush=True)
        for name, (make, compared) in PEERS.items():
            print(peer(name, make, states, compared, timing), flush=True)
        _other_models(robot, timing)
        inverse, forward = exported_nanoseconds(robot)
        print(f"  exported C: inverse dynamics {inverse:.0f} ns, forward dynamics {forward:.0f} ns")
    return 0


def _other_models(robot: Robot, timing: Timing) -> None:
    """Lines of models that are not in the short form, up to a thousand points if interpreted."""
    general = deltaopt.DeltaModel(with_other_bars(robot), _PAYLOAD)
    for name, chosen in public_calls(States.of(general, max(100, *timing.sizes))):
        if name in ("inverse_dynamics", "forward_dynamics", "multipliers"):
            print(timing.row(f"{name}, bars that are not slender", chosen), flush=True)
    interpreted = deltaopt.DeltaModel(robot, _PAYLOAD, deltaopt.multiplier)
    for name, chosen in public_calls(States.of(interpreted, 1000)):
        if name == "inverse_dynamics":
            print(timing.up_to(1000).row(f"{name}, model L_I, interpreted", chosen), flush=True)
