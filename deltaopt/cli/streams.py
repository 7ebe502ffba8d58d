"""Standard output and error that can print any text, whatever their encoding."""

from __future__ import annotations

import codecs
import json
import os
import sys
import unicodedata
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TextIO

from deltaopt.files.output_folder import all_or_none

_IN_WORDS = {
    "·": ".",
    "█": "#",
    "…": "...",
    "→": "->",
    "−": "-",
    "×": "x",
    "±": "+-",
    "°": " deg",
    "≤": "<=",
    "≥": ">=",
    "≈": "~",
    "√": "sqrt ",
    "∂": "d",
    "∫": "integral of ",
    "Σ": "sum of ",
    "Δ": "Delta",
    "ᵀ": "'",
    "ᵏ": "^k",
    "‖": "||",
    "′": "'",
    "’": "'",
    "⁻": "^-",
}
"""What is written instead of signs that an encoding does not have."""
_GREEK = "GREEK SMALL LETTER "
_MANY = 5
"""Files that are named one by one at most."""


def print_any_text() -> None:
    """Let standard output and error write signs that their encoding does not have in other words,
    instead of raising UnicodeEncodeError."""
    codecs.register_error("in words", _in_words)
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)  # neither closed nor replaced
        if reconfigure:
            reconfigure(errors="in words")


def _in_words(error: UnicodeError) -> tuple[str, int]:
    assert isinstance(error, UnicodeEncodeError)
    lost = error.object[error.start : error.end]
    return "".join(map(in_words, lost)), error.end


def in_words(sign: str) -> str:
    """A sign in ASCII: m² is m^2, N·m is N.m, τ is tau, é is e; others are \\u and their number."""
    if sign in _IN_WORDS:
        return _IN_WORDS[sign]
    name = unicodedata.name(sign, "")
    plain = unicodedata.normalize("NFKD", sign).encode("ascii", "ignore").decode()
    if name.startswith(_GREEK):
        return name.removeprefix(_GREEK).split()[0].lower()
    if name.startswith("SUPERSCRIPT") and plain:
        return f"^{plain}"
    if plain or unicodedata.combining(sign):
        return plain
    return sign.encode("ascii", "backslashreplace").decode()


def say(sentence: str) -> None:
    """Print a line to standard error, if anybody listens."""
    try:
        print(sentence, file=sys.stderr, flush=True)
    except (OSError, ValueError):
        discard(sys.stderr)


@contextmanager
def told_meanwhile(in_full: bool) -> Iterator[Callable[[str], None]]:
    """What is to be called with lines on what is being done: ``in_full`` they are printed to
    standard error, otherwise each shows at a terminal until the next one comes."""
    if in_full or not sys.stderr.isatty():
        yield say if in_full else lambda line: None
        return

    def show(line: str) -> None:
        print(f"\r{line.strip():<79.79}", end="\r", file=sys.stderr, flush=True)

    try:
        yield show
    finally:
        show("")


def print_json(content: Mapping[str, object]) -> None:
    """Print one JSON object, in one line, to standard output; all its numbers must be finite."""
    print(json.dumps(content, ensure_ascii=True, allow_nan=False), flush=True)


def say_failures(failures: Iterable[str]) -> int:
    """Say what verification finds wrong, and return the exit code: 1 if anything is."""
    code = 0
    for failure in failures:
        say(f"deltaopt: verification failed: {failure}")
        code = 1
    return code


@contextmanager
def new_files(directory: Path, *names: str) -> Iterator[Path]:
    """A folder for files of these names, which then appear in a directory, all or none, and are
    told."""
    before = present(directory)
    with all_or_none(directory) as folder:
        yield folder
    print_written([directory / name for name in names], before)


def present(directory: Path) -> set[Path]:
    """The files in a directory, and in those of a cycle's legs in it; hidden ones apart."""
    found = (file for names in ("[!.]*", "leg_*/[!.]*") for file in directory.glob(names))
    return {file for file in found if not file.is_dir()}


def print_written(files: Iterable[Path], before: Collection[Path]) -> None:
    """Say which files were written, which of them were there ``before`` and are replaced, and what
    was there and has been removed; of many files their folder and how many they are."""
    files = list(files)
    for what, those in (
        ("written", [file for file in files if file not in before]),
        ("replaced", [file for file in files if file in before]),
        ("removed", sorted(file for file in before if not os.path.lexists(file))),
    ):
        if len(those) > _MANY:
            print(f"{what}: {os.path.commonpath(those) or os.curdir} ({len(those)} files)")
        elif those:
            print(f"{what}:", ", ".join(map(str, those)))


def flush() -> None:
    """Write out what was printed, so that errors of the output are raised here.

    Raises OSError, and BrokenPipeError if nobody reads it.
    """
    if sys.stdout is not None:
        sys.stdout.flush()


def discard(stream: TextIO | None) -> None:
    """Let a stream that cannot be written lead nowhere: Python writes out its rest at the end."""
    with suppress(OSError, AttributeError):
        assert stream is not None
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
