"""Ctrl-C during the imports of the command ``deltaopt``, which take a second: one line.

Read before all other modules, and therefore short: before its end, Ctrl-C is Python's traceback.
"""

from __future__ import annotations

import os
import signal
import sys

TYPE_CHECKING = False  # as typing has it, which takes longer to read than all of this
if TYPE_CHECKING:
    from types import FrameType
    from typing import Any

NAMES = ("SIGINT", "SIGTERM", "SIGHUP")
"""Names of the signals that ask to stop; not every system has all of them."""


def end_at_once_if_command() -> None:
    """Where this process is the command ``deltaopt``, let a request to stop end it at once.

    There is nothing to tidy up yet. Other programs, which import deltaopt for themselves, are left
    alone.
    """
    if _is_command():
        for number in heeded():
            signal.signal(number, end_at_once)


def _is_command() -> bool:
    words = sys.orig_argv
    if sys.argv[:1] == ["-m"]:  # Python's word while it looks for the module
        return "-mdeltaopt" in words or "deltaopt" in words[words.index("-m") + 1 :][:1]
    return os.path.splitext(os.path.basename(sys.argv[0]))[0] == "deltaopt"


def heeded(names: tuple[str, ...] = NAMES) -> dict[int, Any]:
    """The handlers, by number, of the signals that this system has and this process heeds."""
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    handlers = {number: signal.getsignal(number) for number in numbers}
    return {n: h for n, h in handlers.items() if h not in (signal.SIG_IGN, None)}


def end_at_once(number: int, frame: FrameType | None) -> None:
    """End the process with one line on standard error; 128 and the signal's number is its code."""
    try:  # Python's stream may be in the midst of another line
        os.write(2, b"deltaopt: stopped\n")
    finally:  # also where nobody listens
        os._exit(128 + number)
