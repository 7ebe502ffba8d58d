"""Planners, plans and verification used by many threads at once: every bit as by one thread."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np

from deltaopt import Planner, Scene, load_robot, plan, verify
from deltaopt.planning.nlp.problem import Ipopt
from deltaopt.planning.plan import Plan
from deltaopt.plots.style import figure
from studies.bench.random_scenes import random_scenes

ROOT = Path(__file__).parents[2]
THREADS = 8
MOVES = 12


def moves(number: int) -> list[Scene]:
    """As many random moves, half of them of each of the shipped robots."""
    robots = [load_robot(ROOT / f"problems/robots/{r}.yaml") for r in ("orsino", "industrial")]
    return [s for robot in robots for s in random_scenes(robot, 1.0, number // 2, seed=3)]


def bits(found: Plan) -> tuple[object, ...]:
    """Everything of a plan that must not depend on what other threads do."""
    torques = found.trajectory(np.linspace(0, found.duration, 7)).tau
    position = found.trajectory.position
    arrays = (position.knots, position.coefficients, torques)
    return found.duration, found.gap, found.iterations, *(each.tobytes() for each in arrays)


def in_threads(
    work: Callable[[Scene], object], scenes: Sequence[Scene], number: int = THREADS
) -> list[list[object]]:
    """What each of the threads finds for all scenes; each begins with another one."""
    found: list[list[object]] = [[None] * len(scenes) for _ in range(number)]
    ready = threading.Barrier(number)

    def run(k: int) -> None:
        ready.wait()
        for i in range(len(scenes)):
            which = (i + k * len(scenes) // number) % len(scenes)
            found[k][which] = work(scenes[which])

    threads = [threading.Thread(target=run, args=(k,)) for k in range(number)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    return found


def test_eight_threads_with_two_planners():
    """12 moves in each thread, by planners that the threads share."""
    scenes = moves(MOVES)
    planners = {scene.robot.name: Planner(scene.robot) for scene in scenes}

    def work(scene: Scene) -> object:
        return bits(planners[scene.robot.name].plan_scene(scene))

    alone = [work(scene) for scene in scenes]
    assert all(each == alone for each in in_threads(work, scenes))


def compare_from_the_start() -> None:
    """Plan by both solvers and verify, in threads first, in a process that has built nothing yet;
    then in this thread alone."""
    sys.setswitchinterval(1e-4)

    def work(scene: Scene) -> object:
        found = plan(scene)
        by_ipopt = plan(scene, solver=Ipopt(), tolerance=0.1)
        return bits(found), bits(by_ipopt), repr(verify(scene, found.trajectory))

    scenes = moves(2)[:1]
    found = in_threads(work, scenes, 3)
    alone = [work(scene) for scene in scenes]
    print(sum(each == alone for each in found))


def test_threads_that_begin_together_in_a_new_process():
    """Everything that is built once in a process is built by several threads at once."""
    code = "from tests.planning.test_threads import compare_from_the_start as f; f()"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert (run.returncode, run.stdout, run.stderr) == (0, "3\n", "")


def test_charts_of_threads(tmp_path):
    """They are those of one thread, and leave Matplotlib's settings as they were."""
    before = dict(mpl.rcParams)

    def draw(name: str) -> bytes:
        file = tmp_path / name
        with figure(file, 2.0, 1.5) as drawn:
            drawn.subplots().set_title("τ in N·m", fontsize=9)
        return file.read_bytes()

    drawn: dict[int, bytes] = {}
    threads = [
        threading.Thread(target=lambda k=k: drawn.update({k: draw(f"{k}.png")})) for k in range(4)
    ]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert set(drawn.values()) == {draw("alone.png")}
    assert len(drawn) == len(threads)
    assert dict(mpl.rcParams) == before
