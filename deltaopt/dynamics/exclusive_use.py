"""Solvers and integrators that several threads use at once, each its own.

A CasADi function may be called by several threads at once, but the integrators of SUNDIALS then
write into each other's memory: results are wrong, or the process ends. And what a solver says of
its last call (``stats``) is that of any thread's last call.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import casadi as ca


class Copies:
    """As many copies of a CasADi function as threads use it at once.

    ``build`` makes a copy that shares no memory with the others; one is made here, others when all
    there are are in use.
    """

    def __init__(self, build: Callable[[], ca.Function]) -> None:
        self._build = build
        self._idle = [build()]  # a list's append and pop are atomic

    @contextmanager
    def one(self) -> Iterator[ca.Function]:
        """A copy that no other thread uses within the block."""
        try:
            copy = self._idle.pop()
        except IndexError:
            copy = self._build()
        try:
            yield copy
        finally:
            self._idle.append(copy)
