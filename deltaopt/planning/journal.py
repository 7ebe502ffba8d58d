"""The journal of a plan: what was attempted, who proposed it, what came of it and what it cost."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

Progress = Callable[[str], None]
"""Is called with a line of text after every mesh, and with what is decided on the way."""
MOST_SOLVES = 600
"""Meshes that are solved for one plan at most, whatever is left to attempt: ten times what nearly
every plan takes, and three times what any scene of the frozen campaign does."""


@dataclass(frozen=True)
class Entry:
    """One attempt to plan.

    ``proposal``: what it began with, in words. ``begun``: its first mesh and other settings, in
    words. ``outcome``: what came of it, a duration and a gap or why there is none, in words.
    ``duration``: of the motion found, s; None where none was. ``solves``: meshes that were solved.
    """

    proposal: str
    begun: str
    outcome: str
    duration: float | None
    solves: int

    def __str__(self) -> str:
        solved = "1 mesh" if self.solves == 1 else f"{self.solves} meshes"
        return f"{self.proposal}, {self.begun}: {self.outcome} ({solved})"


@dataclass
class Journal:
    """Collects the entries of one plan, and what was decided between them, and tells what happens
    as it happens.

    ``tell``: is called with every line. ``solves``: meshes that were solved so far.
    """

    tell: Progress
    entries: list[Entry | str] = field(default_factory=list)
    solves: int = 0
    _begun: tuple[str, str, int] | None = None

    def note(self, text: str) -> None:
        """Tell a decision, such as why something is attempted once more."""
        self.entries.append(text)
        self.tell(text)

    def begin(self, proposal: str, begun: str) -> None:
        """An attempt begins."""
        self._begun = proposal, begun, self.solves
        self.tell(f"{proposal}, {begun}:")

    def mesh(self, text: str) -> None:
        """A mesh was solved, or not."""
        self.solves += 1
        self.tell(f"    {text}")

    def end(self, outcome: str, duration: float | None = None) -> None:
        """The attempt ends. It is told at once where it leads to no motion."""
        assert self._begun is not None
        proposal, begun, before = self._begun
        self.entries.append(Entry(proposal, begun, outcome, duration, self.solves - before))
        self.tell(f"    {outcome}")

    @property
    def is_spent(self) -> bool:
        """Whether so many meshes were solved that no other attempt is to begin."""
        return self.solves >= MOST_SOLVES
