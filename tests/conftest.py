"""What all tests share."""

from __future__ import annotations

import os

# Before NumPy is imported: its threads wait for each other in vain where each process has a core.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Before all tests are imported: what that makes stays, and to look through it takes seconds.
import gc

gc.disable()

import signal
from collections.abc import Iterator
from typing import Any

import pytest
from matplotlib.figure import Figure

import deltaopt
from tests.overlaps import DOTS, overlaps


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """One process has all tests of a file, which share plans and equations."""
    from xdist.scheduler import LoadFileScheduling

    return LoadFileScheduling(config, log)


def pytest_collection_finish() -> None:
    """What the tests are made of is not looked through for garbage again and again."""
    gc.freeze()
    gc.enable()
    gc.set_threshold(10_000, *gc.get_threshold()[1:])


@pytest.fixture(scope="session", autouse=True)
def _requests_to_stop_are_heeded() -> Iterator[None]:
    """Ctrl-C and its like do what they do at a terminal, also where the tests run in the
    background of a shell: it makes them ignored, and programs that tests start inherit that."""
    usual = {
        signal.SIGINT: signal.default_int_handler,
        signal.SIGTERM: signal.SIG_DFL,
        signal.SIGHUP: signal.SIG_DFL,
    }
    ignored = [number for number in usual if signal.getsignal(number) is signal.SIG_IGN]
    for number in ignored:
        signal.signal(number, usual[number])
    yield
    for number in ignored:
        signal.signal(number, signal.SIG_IGN)


@pytest.fixture(scope="session")
def picked() -> deltaopt.Plan:
    """The plan of the scene that most tests of files and reports look at."""
    return deltaopt.plan(deltaopt.load_scene("problems/pick_and_place.yaml"))


@pytest.fixture(scope="session", autouse=True)
def _labels_of_charts_do_not_overlap() -> Iterator[None]:
    """Every chart in the style of the package that any test has drawn is looked at."""
    write = Figure.savefig

    def write_and_look(figure: Figure, *arguments: Any, **options: Any) -> None:
        write(figure, *arguments, **options)
        if figure.dpi == DOTS:
            assert not overlaps(figure)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(Figure, "savefig", write_and_look)
        yield


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """Every figure that is written from now on."""
    found, write = list[Figure](), Figure.savefig

    def also_kept(page: Figure, *arguments: Any, **options: Any) -> None:
        found.append(page)
        write(page, *arguments, **options)

    monkeypatch.setattr(Figure, "savefig", also_kept)
    return found
