"""From a structure that was read to the one that is optimal, its switches resolved.

Newton's method finds the stationary motion of a structure. Arcs that vanish are left out; where
the motion exceeds a limit, or a price has the wrong sign, the structure is changed there; where
the polynomials do not do, there are more of them. So until nothing is wrong, or for too long.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from deltaopt.errors import NotConverged
from deltaopt.motion.certificate import Certificate, spread
from deltaopt.motion.time_scaling import safe_factor
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.flat.constraint_rows import Stage
from deltaopt.planning.nlp.scaling import Scales
from deltaopt.planning.switching.active_set import patches
from deltaopt.planning.switching.arc_mesh import Grid, Pin
from deltaopt.planning.switching.conditions import Barrier, Conditions, Stuck
from deltaopt.planning.switching.residuals import Examined
from deltaopt.planning.switching.structure import Structure, changed
from deltaopt.robot.model import DeltaModel

_DEGREE = 8
"""Of the acceleration in an interval."""
_ATTEMPTS = 10
_MOST_INTERVALS, _MOST_MODES = 48, 24
CERTIFIED = 1e-5
"""Spread of the Hamiltonian and prices of the wrong sign at most: wrong structures miss it by
orders."""
_GROSS, _FAR_BEYOND = 1e-3, 0.05
"""Prices of the wrong sign, and excesses, that no finer polynomials mend."""
_FREE_PRICE = 1e-4
"""The same of a torque that has no limit, a polynomial being no better at its ends."""


class Unsettled(NotConverged):
    """No structure near the one that was read is that of an optimal motion."""


@dataclass(frozen=True)
class Settled:
    """A motion whose switches are resolved, not yet slowed.

    ``gap``: what slowing costs, and what is given away between nodes, as a fraction.
    """

    conditions: Conditions
    trajectory: Trajectory
    safe_factor: float
    gap: float
    certificate: Certificate
    iterations: int

    @property
    def status(self) -> str:
        return "Solve_Succeeded"

    @property
    def name(self) -> str:
        grid = self.conditions.grid
        return f"{len(grid.parts)} arcs, acceleration of degree {grid.degree}"


@dataclass(frozen=True)
class _Trial:
    """What to solve for next. ``more_modes``: of torques without limit than at first."""

    structure: Structure
    grid: Grid
    more_modes: int = 0
    pins: tuple[Pin, ...] = ()

    @classmethod
    def of(cls, structure: Structure, more_modes: int = 0) -> _Trial:
        return cls(structure, Grid.of(structure, _DEGREE, more_modes), more_modes)

    def with_more_modes(self) -> _Trial:
        grid = replace(self.grid, modes=self.grid.modes + 3)
        return replace(self, grid=grid, more_modes=self.more_modes + 3)


def settle(
    stage: Stage,
    model: DeltaModel,
    structure: Structure,
    guess: Trajectory,
    scales: Scales,
    tolerance: float,
    barrier: Barrier | None = None,
) -> Settled:
    """The optimal motion whose structure is about the given one, to a tolerance of its gap.

    ``barrier``: for what no arc holds; without one limits are looked at afterwards.

    Raises Unsettled where there is none to be found.
    """
    trial, seen, iterations = _Trial.of(structure), [structure.limits], 0
    others: list[tuple[_Trial, Trajectory]] = []
    for _ in range(_ATTEMPTS):
        conditions = Conditions.of(
            stage, trial.structure, trial.grid, scales, model.parameters, trial.pins, barrier
        )
        try:
            found = conditions.solve(conditions.guess(guess, scales))
        except Stuck as error:
            if not others:
                raise Unsettled(str(error), "Stuck", guess) from None
            trial, guess = others.pop()
            continue
        iterations += found.iterations
        shares = np.where(found.vanishing, 0.0, found.motion.lengths / found.motion.duration)
        trial = replace(trial, structure=replace(trial.structure, lengths=shares))
        guess = Trajectory(conditions.polynomial(found.motion, scales), model)
        if shares.min() <= 0:
            better = [_Trial.of(changed(trial.structure, []), trial.more_modes)]
        else:
            conditions = replace(conditions, structure=trial.structure)
            examined = Examined(conditions, found.motion, tolerance / 2)
            settled = _settled(examined, guess, scales, iterations, tolerance)
            if settled:
                return settled
            better = _better(trial, examined, tolerance)
        new = []
        for each in better:
            if each.structure.limits != trial.structure.limits:
                if each.structure.limits in seen:
                    continue
                seen.append(each.structure.limits)
            new.append(each)
        others += [(each, guess) for each in reversed(new)]
        if not others:
            raise Unsettled("no other structure is known to be better", "Cycle", guess)
        trial, guess = others.pop()
    raise Unsettled(f"no structure is right after {_ATTEMPTS}", "Too_Many", guess)


def _settled(
    examined: Examined, trajectory: Trajectory, scales: Scales, iterations: int, tolerance: float
) -> Settled | None:
    """The result, if it is one."""
    wrong = examined.sign_violation > CERTIFIED or examined.free_price > _FREE_PRICE
    if wrong or max(examined.excess, examined.to_be_gained, examined.unused) > tolerance:
        return None
    factor = safe_factor(scales.scene, trajectory)
    gap = factor - 1 + examined.unused + examined.to_be_gained
    uneven = spread(examined.conditions.hamiltonian(examined.motion))
    if gap > tolerance or uneven > CERTIFIED:
        return None
    if any(push.pulls.any() for push in examined.pushes):
        return None
    falls = max((float(push.falls.max()) for push in examined.pushes), default=0.0)
    certificate = Certificate(uneven, max(examined.sign_violation, examined.free_price, falls))
    return Settled(examined.conditions, trajectory, factor, gap, certificate, iterations)


def _better(trial: _Trial, examined: Examined, tolerance: float) -> list[_Trial]:
    """What to try next, the first first: polynomials that do better before other structures, unless
    what is wrong is gross."""
    if examined.sign_violation > _GROSS or examined.excess > _FAR_BEYOND:
        better = _otherwise(trial, examined) or _finer(trial, examined, tolerance)
    else:
        better = _finer(trial, examined, tolerance) or _otherwise(trial, examined)
    return better or ([trial.with_more_modes()] if _may_have_more(trial, examined) else [])


def _may_have_more(trial: _Trial, examined: Examined) -> bool:
    """Modes, of torques without limit."""
    return bool(examined.conditions.held.free) and trial.grid.most_modes < _MOST_MODES


def _finer(trial: _Trial, examined: Examined, tolerance: float) -> list[_Trial]:
    """With more intervals, modes or pins, if the motion asks for them."""
    finest = examined.finest
    if examined.strays.max() > finest and trial.grid.intervals < _MOST_INTERVALS:
        finer = np.ceil((examined.strays / finest).clip(1) ** (1 / (_DEGREE + 1)))
        parts = trial.grid.parts * finer.astype(np.intp)
        return [replace(trial, grid=replace(trial.grid, parts=parts))]
    coarse = examined.free_price > _FREE_PRICE or examined.to_be_gained > tolerance
    coarse = coarse or CERTIFIED < examined.sign_violation < 10 * examined.free_price
    if coarse and _may_have_more(trial, examined):
        return [trial.with_more_modes()]
    pins = tuple(pin for pin in examined.pins() if pin not in trial.pins)
    return [replace(trial, pins=trial.pins + pins)] if pins else []


def _otherwise(trial: _Trial, examined: Examined) -> list[_Trial]:
    """Other structures: with all that is wrong changed, and with the worst of it."""
    found = patches(examined)
    ways = [changed(trial.structure, chain.from_iterable(found))]
    if len(found) > 1:
        ways.append(changed(trial.structure, found[0]))
    ways = [way for way in ways if way.limits != trial.structure.limits]
    return [_Trial.of(way, trial.more_modes) for way in ways]
