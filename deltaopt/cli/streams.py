"""Standard output and error that can print any text, whatever their encoding."""

from __future__ import annotations

import codecs
import os
import sys
import unicodedata
from contextlib import suppress
from typing import TextIO

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
