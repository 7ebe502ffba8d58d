"""A progress bar on stderr."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TextIO

WIDTH = 30


@dataclass
class ProgressBar:
    """Call it with the share that is done (0 to 1) and what is going on."""

    stream: TextIO = field(default_factory=lambda: sys.stderr)

    def __call__(self, done: float, what: str) -> None:
        filled = round(WIDTH * done)
        bar = "█" * filled + "·" * (WIDTH - filled)
        self.stream.write(f"\r{bar} {done:4.0%}  {what:<40.40}")
        if done >= 1:
            self.stream.write("\n")
        self.stream.flush()

    def counting(self, total: int, what: str) -> Callable[[int], None]:
        """Return what to call with the number that is done of ``total``."""
        return lambda done: self(done / total, what)
