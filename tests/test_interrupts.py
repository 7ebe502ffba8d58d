"""Requests to stop: raised, held back and not lost, whatever the code does that they meet."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import casadi as ca
import numpy as np
import pytest

from deltaopt.dynamics.precise_integrator import PreciseIntegrator
from deltaopt.interrupts.requests import (
    Stopped,
    interrupts_not_lost,
    requests_held,
    requests_raised,
)
from studies.problems import PROBLEMS


def interrupt(number: int = signal.SIGINT) -> None:
    signal.raise_signal(number)


@pytest.fixture(autouse=True)
def handlers_are_restored():
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.getsignal(number) for number in numbers]
    yield
    assert [signal.getsignal(number) for number in numbers] == before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_request_says_which(number):
    with pytest.raises(Stopped) as told, requests_raised():
        interrupt(number)
    assert told.value.signal == number


def test_a_request_that_became_another_error():
    """As in Python 3.11 where a class is being made, and in CasADi."""

    def renamed() -> None:
        try:
            interrupt()
        except KeyboardInterrupt:
            raise RuntimeError from None

    with pytest.raises(Stopped), requests_raised():
        renamed()


def test_a_request_in_a_finaliser_is_raised_after_it(capsys):
    class Finalised:
        def __del__(self) -> None:
            interrupt()

    def waiting() -> None:
        Finalised()
        time.sleep(5)

    begin = time.monotonic()
    with pytest.raises(Stopped), requests_raised():
        waiting()
    assert time.monotonic() < begin + 4
    assert capsys.readouterr().err == ""


def test_a_request_while_casadi_looks_at_an_argument_is_raised_after_it():
    """CasADi asks Python whether an argument is an array, and forgets what is raised there."""

    class Asked(ca.SX):
        @property
        def tocsc(self) -> None:
            interrupt()
            raise AttributeError

    def waiting() -> None:
        argument = Asked(ca.SX.sym("x"))
        assert ca.sin(argument).shape == (1, 1)
        time.sleep(5)

    begin = time.monotonic()
    with pytest.raises(Stopped), requests_raised():
        waiting()
    assert time.monotonic() < begin + 4


def test_the_same_request_twice_is_one():
    done = []

    def tidied() -> None:
        try:
            interrupt()
        finally:
            interrupt()
            done.append("tidied")

    with pytest.raises(Stopped), requests_raised():
        tidied()
    assert done == ["tidied"]


def test_held_requests_come_at_the_end():
    done = []

    def held() -> None:
        with requests_held():
            interrupt()
            done.append("held")
        done.append("never")

    with pytest.raises(KeyboardInterrupt):
        held()
    assert done == ["held"]


def test_ipopt_does_not_swallow_an_interrupt(capfd):
    """CasADi makes it a status of Ipopt's, and prints a warning."""
    x = ca.MX.sym("x")
    sent = []

    class Interrupting(ca.Callback):
        def __init__(self) -> None:
            super().__init__()
            self.construct("f", {"enable_fd": True})

        def eval(self, arguments):
            if not sent:
                sent.append(True)
                os.kill(os.getpid(), signal.SIGINT)
            return [arguments[0] ** 2]

    function = Interrupting()
    quiet = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False}
    solver = ca.nlpsol(
        "s",
        "ipopt",
        {"x": x, "f": function(x)},
        {**quiet, "ipopt.hessian_approximation": "limited-memory"},
    )
    with pytest.raises(KeyboardInterrupt), interrupts_not_lost():
        solver(x0=3.0)
    assert sent
    assert capfd.readouterr().err == ""


def test_cvodes_is_not_interrupted(capfd, monkeypatch):
    """A right-hand side that fails is tried again, and the interrupt would be lost."""
    x, u = ca.MX.sym("x"), ca.MX.sym("u")
    integrator = PreciseIntegrator(u, x, -x, ca.MX(1), ca.MX(0, 1))
    own = integrator._integrator

    def slow(**arguments):
        interrupt()
        return own(**arguments)

    monkeypatch.setattr(integrator._of_thread, "integrator", slow)
    with pytest.raises(KeyboardInterrupt):
        integrator(np.ones(1), np.zeros(0))
    assert capfd.readouterr().err == ""


IMPORTING = """
import os, signal, sys
class Finder:
    def find_spec(self, name, path, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Finder())
sys.argv = {argv!r}
"""


@pytest.mark.parametrize("module", ["deltaopt.dynamics", "casadi"])
def test_ctrl_c_during_the_imports_of_the_command(module):
    code = IMPORTING.format(module=module, argv=["/usr/bin/deltaopt", "plan"])
    code += "from deltaopt.cli import main; main()"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (run.returncode, run.stdout, run.stderr) == (130, "", "deltaopt: stopped\n")


def test_ctrl_c_during_the_imports_of_another_program():
    """Which has its own way with it."""
    code = IMPORTING.format(module="casadi", argv=["their_program.py"])
    code += "import deltaopt; deltaopt.plan"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.returncode == -signal.SIGINT
    assert "KeyboardInterrupt" in run.stderr


KILLED = """
import multiprocessing, os, signal, threading, time
import deltaopt

def kill_when_both_plan():
    while len(multiprocessing.active_children()) < 2:
        time.sleep(0.01)
    print(*(each.pid for each in multiprocessing.active_children()), flush=True)
    os.kill(os.getpid(), signal.SIGKILL)

scene = deltaopt.load_scene("problems/pick_and_place.yaml")
threading.Thread(target=kill_when_both_plan).start()
deltaopt.Planner(scene.robot).plan_many([(scene.start, scene.goal)] * 10_000, workers=2)
"""


def runs(process: int) -> bool:
    """Whether a process is there and more than what is left of one that has ended."""
    try:
        with open(f"/proc/{process}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.skipif(sys.platform != "linux", reason="processes are looked up in /proc")
def test_processes_end_with_the_one_that_started_them_when_it_is_killed(tmp_path):
    told = tmp_path / "told.txt"
    with told.open("w") as file:  # not a pipe, which those that go on would keep open
        subprocess.run([sys.executable, "-c", KILLED], cwd=PROBLEMS.parent, stdout=file)
    workers = [int(each) for each in told.read_text().split()]
    assert len(workers) == 2
    until = time.monotonic() + 5
    while any(map(runs, workers)) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(map(runs, workers))
