"""Proposals: first motions with words for what they are."""

from __future__ import annotations

from typing import NamedTuple

from deltaopt.motion.trajectory import Trajectory


class Proposal(NamedTuple):
    """A first ``motion``, and its ``name``: a noun phrase, such as "a straight line". ``legs``: of
    how many that are the best ones by themselves it is made; 0 where it is not."""

    name: str
    motion: Trajectory
    legs: int = 0
