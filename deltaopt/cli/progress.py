"""A progress bar on stderr."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TextIO

WIDTH = 30


@dataclass
class ProgressBar:
    """A progress bar: call it with the share that is done, 0 to 1, and a text."""

    stream: TextIO = field(default_factory=lambda: sys.stderr)

    def __call__(self, done: float, what: str) -> None:
        filled = round(WIDTH * done)
        bar = "█" * filled + "·" * (WIDTH - filled)
        self.stream.write(f"\r{bar} {done:4.0%}  {what:<40.40}")
        if done >= 1:
            self.stream.write("\n")
        self.stream.flush()

    def counting(self, total: int, what: str) -> Callable[[int], None]:
        """A function to call with the number that is done, of ``total``."""
        return lambda done: self(done / total, what)
