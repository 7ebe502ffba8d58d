"""Requests to stop: raised, held back for a moment, and not lost.

Python raises KeyboardInterrupt wherever it happens to be, and that is not always enough: during
imports it is a traceback of another library, in a callback or a finaliser it is printed and
forgotten, and CasADi turns it into an error of its own, or forgets it where it asks Python what an
argument is.
"""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr
from io import StringIO
from threading import Lock, Thread, current_thread, main_thread
from types import FrameType
from typing import Any

from deltaopt.interrupts.imports import NAMES, end_at_once, heeded

_IMPATIENT = 1.0
"""s; a request that follows the first so soon is the same one, sent twice by a terminal and a
shell; a later one is of somebody who has lost patience with the tidying up."""

_AGAIN = 0.01
"""s; a request that was or would be lost in a callback is made again so much later, when that is
over."""

_CASADI = "casadi.casadi"
_QUESTIONS = ("_from_array", "_from_csc")


class Stopped(KeyboardInterrupt):
    """A request to stop; ``signal``: its number, 2 for Ctrl-C."""

    def __init__(self, signal: int) -> None:
        super().__init__(signal)
        self.signal = signal


def ignore_requests() -> None:
    """Ignore requests to stop from now on, for the last milliseconds of a process that has done all
    it was to do: Python would end it in the midst of its own tidying up."""
    if current_thread() is main_thread():
        for number in heeded():
            signal.signal(number, signal.SIG_IGN)


@contextmanager
def requests_raised() -> Iterator[None]:
    """Inside, a request to stop raises Stopped, also where libraries make another error of it."""
    first: list[tuple[int, float]] = []
    telling = Lock()

    def stop(number: int, frame: FrameType | None) -> None:
        if _asked_by_casadi(frame):
            Thread(target=again, args=[number], daemon=True).start()
            return
        if not first:
            first.append((number, time.monotonic()))
            raise Stopped(number)
        if time.monotonic() > first[0][1] + _IMPATIENT:
            end_at_once(number, frame)

    def unraisable(lost: Any) -> None:
        if not issubclass(lost.exc_type, Stopped):
            usual(lost)
        elif first:
            number, _ = first.pop()
            with telling:  # what is raised before this function ends is lost too
                Thread(target=again, args=[number], daemon=True).start()

    def again(number: int) -> None:
        with telling:
            pass
        time.sleep(_AGAIN)
        _send_to_main_thread(number)

    usual = sys.unraisablehook
    with _handled_by(stop):
        sys.unraisablehook = unraisable
        try:
            yield
        except Exception:
            if first:
                raise Stopped(first[0][0]) from None
            raise
        finally:
            sys.unraisablehook = usual


def _asked_by_casadi(frame: FrameType | None) -> bool:
    """Whether a frame belongs to a function by which CasADi asks whether an argument is an array:
    it takes whatever is raised there for a no."""
    while frame is not None:
        code = frame.f_code
        if frame.f_globals.get("__name__") == _CASADI and code.co_name.endswith(_QUESTIONS):
            return True
        frame = frame.f_back
    return False


def _send_to_main_thread(number: int) -> None:
    if hasattr(signal, "pthread_kill"):  # which wakes it up if it waits for something
        signal.pthread_kill(int(main_thread().ident or 0), number)
    else:
        signal.raise_signal(number)


@contextmanager
def requests_held() -> Iterator[None]:
    """Inside, requests to stop wait: for a few operations on files that belong together."""
    waiting: list[int] = []
    try:
        with _handled_by(lambda number, frame: waiting.append(number)):
            yield
    finally:
        for number in waiting[:1]:
            signal.raise_signal(number)


@contextmanager
def interrupts_not_lost() -> Iterator[None]:
    """Inside, CasADi may make another error of a KeyboardInterrupt, print a warning and go on: at
    the end it is raised again, and nothing is printed."""
    before = signal.getsignal(signal.SIGINT)
    lost: list[BaseException] = []

    def noted(number: int, frame: FrameType | None) -> None:
        try:
            before(number, frame)  # type: ignore[misc, operator]  # noted only if it is a function
        except KeyboardInterrupt as error:
            lost.append(error)
            end.enter_context(redirect_stderr(StringIO()))
            raise

    with ExitStack() as end:
        if callable(before):
            end.enter_context(_handled_by(noted, ("SIGINT",)))
        try:
            yield
        finally:
            if lost:
                raise lost[0]


@contextmanager
def _handled_by(
    handler: Callable[[int, FrameType | None], None], names: tuple[str, ...] = NAMES
) -> Iterator[None]:
    """Inside, this function is called for the signals of these names; only the main thread can."""
    before = {} if current_thread() is not main_thread() else heeded(names)
    try:
        for number in before:
            signal.signal(number, handler)
        yield
    finally:
        for number, usual in before.items():
            signal.signal(number, usual)
