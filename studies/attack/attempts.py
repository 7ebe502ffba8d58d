"""An attempt: hostile input in a process of its own, with bounds on time and memory, and judged."""

from __future__ import annotations

import os
import resource
import signal
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass
from io import StringIO
from math import ceil
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from time import process_time

import numpy as np

from deltaopt.cli import main
from deltaopt.errors import DeltaOptError

SECONDS = 60
"""Of the processor, for one attempt."""
_STARTED = 60
"""Seconds by the clock in which a process has surely begun, also where many others run."""
MEMORY = 8 << 30
"""Bytes of addresses."""
GOOD, WRONG, TRACEBACK, HANG = VERDICTS = ("good", "wrong", "traceback", "hang")
_LONGEST = 1000
"""Letters of a sentence that anybody reads."""

Generator = np.random.Generator
Kind = Callable[[Generator], "Attempt"]
"""Draws an attempt. The current folder is empty, and the attempt's own."""


@dataclass(frozen=True)
class Attempt:
    """Hostile input, ``told`` so that it can be made again by hand; and ``made``, which returns
    what is wrong in words, nothing if all is well.

    ``raises``: what it may raise beside deltaopt's own errors, in one sentence, as documented.
    """

    told: str
    made: Callable[[], str]
    raises: tuple[type[Exception], ...] = ()


@dataclass(frozen=True)
class Row:
    """What came of the attempt of a kind and a number. ``seconds``: of the processor."""

    kind: str
    number: int
    verdict: str
    seconds: float
    told: str
    problem: str


@dataclass(frozen=True)
class Ended:
    """A command that has ended: its exit code, what it printed, and what it complained."""

    code: int
    output: str
    errors: str

    def unclear(self, *names: str) -> str:
        """What is wrong with it as a refusal that mentions one of some names."""
        lines = self.errors.strip().splitlines()
        if self.code not in (1, 2):
            return f"exit code {self.code} where a refusal is due: {self.last}"
        if not lines or (len(lines) > 1 and "usage:" not in lines[0]):
            return f"{len(lines)} lines of complaint: {' / '.join(lines[-3:])}"
        named = not names or any(name.lower() in lines[-1].lower() for name in names)
        return unclear_sentence(lines[-1]) or (
            "" if named else f"names none of {', '.join(names)}: {lines[-1]}"
        )

    def failed(self) -> str:
        """What is wrong with it where only a result is right."""
        return "" if self.code == 0 else f"exit code {self.code} for harmless input: {self.last}"

    @property
    def last(self) -> str:
        """The last line that it printed or complained."""
        return (self.errors.strip() or self.output.strip() or "nothing").splitlines()[-1]


def unclear_sentence(text: str) -> str:
    """What is wrong with a text that is to be one clear sentence."""
    jargon = [word for word in ("pydantic", "NoneType", "Errno", "SWIG") if word in text]
    if jargon or not text.strip() or len(text) > _LONGEST or len(text.splitlines()) > 1:
        return f"no clear sentence: {text[:300]!r}"
    return f"a control sign in {text!r}" if "\x1b" in text or "\0" in text else ""


def command(*words: object) -> Ended:
    """Run a command of deltaopt in this process."""
    output, errors = StringIO(), StringIO()
    with redirect_stdout(output), redirect_stderr(errors):
        try:
            code: object = main([str(word) for word in words])
        except SystemExit as end:
            code = end.code
    return Ended(code if isinstance(code, int) else 2, output.getvalue(), errors.getvalue())


def row_of(
    kinds: Mapping[str, Kind], kind: str, seed: int, number: int, most: int = SECONDS
) -> Row:
    """Make an attempt in a process and a folder of its own, and judge what comes of it.

    ``most``: seconds of the processor for it; four times as many by the clock.
    """
    context, folder = get_context("forkserver"), Path(mkdtemp(prefix="attack-"))
    context.set_forkserver_preload(["studies.attack.kinds"])
    receiver, sender = context.Pipe(duplex=False)
    own = (seed, list(kinds).index(kind), number)
    process = context.Process(target=_judged, args=(kinds[kind], own, folder, sender, most))
    process.start()
    sender.close()
    told, verdict, problem, seconds = "", "", "", float(most)
    with suppress(EOFError):
        while not verdict and receiver.poll(4 * most + _STARTED):
            told, verdict, problem, seconds = receiver.recv()
    if not verdict:
        with suppress(ProcessLookupError):
            os.killpg(process.pid or 0, signal.SIGKILL)
    process.join()
    if not verdict:
        hung = process.exitcode in (-signal.SIGXCPU, -signal.SIGKILL)
        verdict, problem = HANG if hung else TRACEBACK, f"ended by {process.exitcode}"
    rmtree(folder, ignore_errors=True)
    return Row(kind, number, verdict, round(seconds, 2), ascii(told)[1:-1], ascii(problem)[1:-1])


def _judged(kind: Kind, own: Sequence[int], folder: Path, sender: Connection, most: int) -> None:
    """Make an attempt in this process: send what it is, and then what has come of it."""
    os.setsid()
    os.chdir(folder)
    most += ceil(process_time())
    resource.setrlimit(resource.RLIMIT_CPU, (most, most + 1))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    with open(os.devnull, "w", encoding="utf-8") as nobody:
        sys.stdout = sys.stderr = nobody
        attempt = kind(np.random.default_rng(own))
        sender.send((attempt.told, "", "", float(most)))
        verdict, problem = _tried(attempt)
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    seconds = sum(each.ru_utime + each.ru_stime for each in used)
    sender.send((attempt.told, verdict, problem, seconds))


def _tried(attempt: Attempt) -> tuple[str, str]:
    try:
        problem = attempt.made()
    except BaseException as error:  # a fault of the program is what is looked for
        if isinstance(error, (DeltaOptError, *attempt.raises)):
            return _verdict(unclear_sentence(str(error)))
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(place.filename).name}:{place.lineno}"
        return TRACEBACK, f"{type(error).__name__} in {where}: {error}"
    return _verdict(problem)


def _verdict(problem: str) -> tuple[str, str]:
    return (WRONG, problem) if problem else (GOOD, "")
