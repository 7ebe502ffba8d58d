"""A progress bar: a line on stderr, or in a notebook a bar below the cell."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from html import escape
from typing import Any, TextIO

WIDTH = 30

Progress = Callable[[float, str], None]
"""Is called with the share that is done, 0 to 1, and a text, such as what comes next."""


@dataclass
class ProgressBar:
    """A progress bar: call it with the share that is done, 0 to 1, and a text. Where its stream is
    no terminal but a file or a pipe, it says no more than that all is done.

    Examples:
        >>> planner = deltaopt.Planner(deltaopt.load_robot("problems/robots/orsino.yaml"))
        >>> moves = [((0.45, -0.05, 0.0), (0.45, 0.10, 0.0))]
        >>> counted = deltaopt.ProgressBar().counting(len(moves), "moves")
        >>> len(planner.plan_many(moves, progress=counted))
        1
    """

    stream: TextIO = field(default_factory=lambda: sys.stderr)
    _shown: Any = field(default=None, init=False, repr=False)

    def __call__(self, done: float, what: str) -> None:
        if _in_notebook():
            self._show(done, what)
            return
        if done < 1 and not getattr(self.stream, "isatty", bool)():
            return
        filled = round(WIDTH * done)
        bar = "█" * filled + "·" * (WIDTH - filled)
        self.stream.write(f"\r{bar} {done:4.0%}  {what:<40.40}")
        if done >= 1:
            self.stream.write("\n")
        self.stream.flush()

    def counting(self, total: int, what: str) -> Callable[[int], None]:
        """A function to call with the number that is done, of ``total``."""
        return lambda done: self(done / total, what)

    def _show(self, done: float, what: str) -> None:
        """Show the bar below the cell, where it was if it was shown before."""
        from IPython.display import HTML, display

        bar = HTML(f'<progress value="{done:.4f}"></progress> {done:.0%} {escape(what)}')
        if self._shown is None:
            self._shown = display(bar, display_id=True)
        else:
            self._shown.update(bar)
        if done >= 1:
            self._shown = None


def _in_notebook() -> bool:
    """Whether this runs in a Jupyter kernel, whose cells show more than text."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    return shell is not None and hasattr(shell, "kernel")
