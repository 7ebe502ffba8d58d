"""Commands that are stopped at random instants: nothing is half-written, no traceback is printed.

  help, check, plan   Ctrl-C (SIGINT) during these commands: exit code 130, or 0 where the command
                      had finished, at most one line about it, the files of a plan all there or none
  kill                SIGKILL during deltaopt plan with nothing compiled yet: the same of the files,
                      and the next plan, which finds what is left of this one, succeeds and tidies

Every other plan is written to a folder that has an older plan and a file of the user's.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from deltaopt.cli.arguments import WrongUsage, one_or_more, seed
from deltaopt.codegen.compile import CACHE
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.output.plan_files import COLUMNS
from studies.problems import PICK_AND_PLACE

HELP = "stop and kill commands at random instants: nothing is half-written"
SMALL = {"parts": ("check",), "number": 2}
PARTS = ("help", "check", "plan", "kill")
FILES = {"plan.json", "plan.png", "trajectory.csv"}
NOTES = "notes.txt"
"""A file of the user's in the folder that a plan is written to."""
STOPPED = "deltaopt: stopped"
SILENT = 0.1
"""s; before Python has its own handlers, which takes some hundredths of a second, it says nothing
when it is interrupted."""
ENDING = b"IEND" + bytes.fromhex("ae426082")
"""The last bytes of every PNG file."""


@dataclass(frozen=True)
class Ended:
    """A command that was given a signal at an instant, s after its start."""

    instant: float
    code: int
    errors: tuple[str, ...]

    @property
    def outside(self) -> bool:
        """Whether Python was stopped by Ctrl-C when it had not come to deltaopt yet: by a traceback
        without it, or in its first milliseconds without a word."""
        named = any(f"{os.sep}deltaopt{os.sep}" in line for line in self.errors)
        ended = self.code in (1, -signal.SIGINT)
        return ended and not named and (bool(self.errors) or self.instant < SILENT)


@dataclass(frozen=True)
class Outcome:
    """What became of one command, in a word, and what is wrong, in sentences."""

    word: str
    faults: tuple[str, ...]


def command(*words: str) -> list[str]:
    return [sys.executable, "-m", "deltaopt", *words]


def run_until(
    words: Sequence[str], instant: float, number: int, *, group: bool, cache: Path | None = None
) -> Ended:
    """Run a command, send it a signal at an instant, and wait for its end.

    ``group``: whether its compiler gets the signal too. ``cache``: its own folder of libraries.
    """
    environment = {**os.environ, **({CACHE: str(cache)} if cache else {})}
    with tempfile.TemporaryFile("w+", encoding="utf-8") as errors:
        process = subprocess.Popen(
            command(*words),
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=errors,
            start_new_session=True,
        )
        with suppress(subprocess.TimeoutExpired):
            process.wait(instant)
        with suppress(ProcessLookupError):
            if group:
                os.killpg(process.pid, number)
            else:
                process.send_signal(number)
        code = process.wait()
        errors.seek(0)
        return Ended(instant, code, tuple(errors.read().splitlines()))


def half_written(folder: Path) -> list[str]:
    """Sentences about files in the folder of a plan that are not whole, or missing."""
    if not folder.is_dir():
        return []
    names = {path.name for path in folder.iterdir()} - {NOTES}
    faults = [f"{name} is in the folder" for name in names - FILES if not name.startswith(".")]
    if names & FILES not in (FILES, set()):
        faults.append(f"only {', '.join(sorted(names & FILES))} are there")
    readers: dict[str, Callable[[Path], bool]] = {
        "plan.json": lambda file: bool(json.loads(file.read_text(encoding="utf-8"))),
        "plan.png": lambda file: file.read_bytes().endswith(ENDING),
        "trajectory.csv": _is_whole_table,
    }
    return faults + [
        f"{name} is not whole"
        for name in sorted(names & FILES)
        if not _reads(folder / name, readers)
    ]


def _reads(file: Path, readers: dict[str, Callable[[Path], bool]]) -> bool:
    try:
        return readers[file.name](file)
    except ValueError:
        return False


def _is_whole_table(file: Path) -> bool:
    text = file.read_text(encoding="utf-8")
    rows = list(csv.reader(text.splitlines()))
    return text.endswith("\n") and rows[0] == list(COLUMNS) and {len(r) for r in rows} == {22}


def contents(folder: Path) -> dict[str, bytes]:
    """The content of each file of a plan in a folder, by name."""
    return {name: (folder / name).read_bytes() for name in FILES if (folder / name).is_file()}


def faults_of_files(folder: Path, old: dict[str, bytes]) -> tuple[str, ...]:
    """What is wrong with a folder in which there was an old plan, or none (``old`` is empty)."""
    faults = half_written(folder)
    if old:
        new = contents(folder)
        kept = {name for name in FILES if new.get(name) == old[name]}
        if kept not in (FILES, set()):
            faults.append(f"of the old plan only {', '.join(sorted(kept))} stayed")
        if not (folder / NOTES).is_file():
            faults.append(f"{NOTES} is gone")
    return tuple(faults)


def left_behind(folder: Path) -> tuple[str, ...]:
    """Sentences about hidden files in a folder and beside it."""
    hidden = [*folder.parent.glob(".*"), *folder.glob(".*")]
    return tuple(f"{path} was left behind" for path in hidden)


@dataclass(frozen=True)
class Experiment:
    """Commands that are ended at random instants: ``words`` without the folder of the output.

    ``number``: of the signal. ``longest``: s, the last instant. ``writes``: whether the command has
    an output. ``usual``: lines that it prints on standard error if it is not stopped.
    """

    words: tuple[str, ...]
    number: int
    longest: float
    writes: bool
    usual: frozenset[str]

    @property
    def name(self) -> str:
        return f"{signal.Signals(self.number).name} during {self.words[0].lstrip('-')}"

    def outcomes(self, instants: Sequence[float], old: Path) -> Iterator[Outcome]:
        """What becomes of a command at each instant; ``old``: the folder of an older plan."""
        for i, instant in enumerate(instants):
            with tempfile.TemporaryDirectory() as place:
                folder = Path(place) / "out" / "plan"
                if self.writes and i % 2:
                    shutil.copytree(old, folder)
                yield self._outcome(instant, folder, Path(place) / "cache", group=i % 4 < 2)

    def _outcome(self, instant: float, folder: Path, cache: Path, *, group: bool) -> Outcome:
        old = contents(folder)
        words = (*self.words, "-o", str(folder)) if self.writes else self.words
        killed = self.number == signal.SIGKILL
        own = cache if killed else None
        ended = run_until(words, instant, self.number, group=group, cache=own)
        faults = faults_of_files(folder, old)
        if killed:
            again = run_until(words, 600, signal.SIGKILL, group=True, cache=own)
            faults += () if again.code == 0 else (f"the next plan: {again.errors}",)
            faults += faults_of_files(folder, {}) + left_behind(folder)
            faults += () if folder.is_dir() else ("the next plan wrote nothing",)
            word = "finished" if ended.code == 0 else "stopped"
        else:
            faults += left_behind(folder)
            word, wrong = self._judged(ended)
            faults += wrong
        return Outcome(word, tuple(f"at {instant:.3f} s: {fault}" for fault in faults))

    def _judged(self, ended: Ended) -> tuple[str, tuple[str, ...]]:
        """A word for how a command took Ctrl-C, and what is wrong with that."""
        unusual = [line for line in ended.errors if line not in self.usual]
        if ended.outside:
            return "too early", ()
        if ended.code == 0 and not unusual:
            return "finished", ()
        if ended.code == 128 + self.number and unusual == [STOPPED]:
            return "stopped", ()
        return "stopped", (f"exit code {ended.code}, {' / '.join(unusual)}",)


def uninterrupted(words: Sequence[str], cache: Path | None = None) -> tuple[float, frozenset[str]]:
    """The duration of a command, s, and its lines on standard error.

    Raises WrongUsage if it fails.
    """
    begin = time.perf_counter()
    ended = run_until(words, 600, signal.SIGKILL, group=True, cache=cache)
    if ended.code != 0:
        raise WrongUsage(f"deltaopt {' '.join(words)}: {' '.join(ended.errors)}")
    return time.perf_counter() - begin, frozenset(ended.errors)


def experiment(part: str, scene: Path, place: Path) -> Experiment:
    """The experiment of a part, after its command was run to its end."""
    words = {"help": ("--help",), "check": ("check", str(scene))}.get(part, ("plan", str(scene)))
    writes, cache = words[0] == "plan", place / "cache" if part == "kill" else None
    whole = (*words, "-o", str(place / part)) if writes else words
    if part == "plan":
        uninterrupted(whole)  # what is to be compiled is compiled now
    longest, usual = uninterrupted(whole, cache)
    number = signal.SIGKILL if part == "kill" else signal.SIGINT
    return Experiment(words, number, longest, writes, usual)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("parts", nargs="*", metavar="PART", default=PARTS, help=", ".join(PARTS))
    parser.add_argument(
        "--number",
        type=one_or_more,
        default=100,
        metavar="N",
        help="instants for each command (default: 100)",
    )
    parser.add_argument(
        "--seed", type=seed, default=1, metavar="N", help="of the instants (default: 1)"
    )
    parser.add_argument(
        "--scene", type=Path, default=PICK_AND_PLACE, metavar="SCENE", help="the scene to plan"
    )


def run(arguments: argparse.Namespace) -> int:
    unknown = [part for part in arguments.parts if part not in PARTS]
    if unknown:
        raise WrongUsage(f"{unknown[0]} is no part of this study; {', '.join(PARTS)} are")
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        # As in the background of a shell; the commands would inherit it.
        signal.signal(signal.SIGINT, signal.default_int_handler)
    rng, good = random.Random(arguments.seed), True
    with tempfile.TemporaryDirectory() as name:
        place, old = Path(name), Path(name) / "old"
        if {"plan", "kill"} & set(arguments.parts):
            uninterrupted(("plan", str(arguments.scene), "--baseline", "-o", str(old)))
            (old / NOTES).write_text("mine\n", encoding="utf-8")
        for part in arguments.parts:
            tried = experiment(part, arguments.scene, place)
            instants = [rng.uniform(0, tried.longest) for _ in range(arguments.number)]
            outcomes = _with_progress(tried, instants, old)
            print(report(tried, outcomes), flush=True)
            good = good and not any(outcome.faults for outcome in outcomes)
    return 0 if good else 1


def _with_progress(experiment: Experiment, instants: list[float], old: Path) -> list[Outcome]:
    progress = ProgressBar().counting(len(instants), experiment.name)
    outcomes = []
    for outcome in experiment.outcomes(instants, old):
        outcomes.append(outcome)
        progress(len(outcomes))
    return outcomes


def report(experiment: Experiment, outcomes: Sequence[Outcome]) -> str:
    """A line that counts what became of the commands, and one for each fault."""
    number = {word: sum(outcome.word == word for outcome in outcomes) for word in WORDS}
    faults = [fault for outcome in outcomes for fault in outcome.faults]
    counts = ", ".join(f"{count} {WORDS[word]}" for word, count in number.items() if count)
    line = (
        f"{experiment.name}, {len(outcomes)} instants within {experiment.longest:.1f} s: {counts}; "
        f"{len(faults)} faults"
    )
    return "\n".join([line, *(f"  {fault}" for fault in faults)])


WORDS = {
    "stopped": "stopped",
    "finished": "had finished",
    "too early": "before Python came to deltaopt",
}
