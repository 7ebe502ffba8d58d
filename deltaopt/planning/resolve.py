"""From a solution on a mesh to one whose switches are resolved, with its certificate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from deltaopt.errors import DeltaOptError, NotConverged
from deltaopt.limits import safe_factor
from deltaopt.model import DeltaModel
from deltaopt.planning.certificate import Certificate
from deltaopt.planning.examine import Examined
from deltaopt.planning.extremal import Conditions, Extremal, Grid, Held, Stuck
from deltaopt.planning.scales import Scales
from deltaopt.planning.stage import Stage
from deltaopt.planning.structure import VANISHED, Structure, changed
from deltaopt.trajectory import Trajectory

Array = NDArray[np.float64]

_DEGREE, _MODES = 8, 0
_ATTEMPTS = 25
CERTIFIED = 1e-5


@dataclass(frozen=True)
class Resolved:
    conditions: Conditions
    motion: Extremal
    trajectory: Trajectory
    safe_factor: float
    gap: float
    certificate: Certificate
    iterations: int

    @property
    def name(self) -> str:
        grid = self.conditions.grid
        return f"{len(grid.parts)} arcs, acceleration of degree {grid.degree}"


class Unsettled(NotConverged):
    """The structure read from the mesh is not that of an optimal motion."""


def resolve(stage, model, structure, guess, scales, tolerance, tell: Callable[[str], None] = lambda _: None):
    p = np.concatenate([scales.vector(), model.parameters])
    grid = Grid.of(structure, _DEGREE, _MODES)
    seen, total, more, pins = [], 0, 0, ()
    for attempt in range(_ATTEMPTS):
        conditions = Conditions(stage, structure, Held.of(structure), grid, scales.goal, p, pins)
        try:
            motion, iterations = conditions.solve(conditions.guess(guess, scales))
        except Stuck as error:
            raise Unsettled(str(error), "stuck", None) from None
        total += iterations
        lengths = motion.lengths / motion.duration
        structure = replace(structure, lengths=lengths)
        guess = Trajectory(conditions.polynomial(motion, scales), model)
        tell(f"{attempt} {iterations} {motion.duration*scales.time:.9f} modes {grid.modes} parts {grid.parts} lengths {lengths}")
        vanishing = np.abs(lengths) < 2e-3 if not conditions.converged(motion) else lengths < VANISHED
        if vanishing.any() or lengths.min() < 0:
            structure = replace(structure, lengths=np.where(vanishing, 0.0, lengths))
            seen.append(structure.limits)
            pins = ()
            structure = changed(structure, [])
            tell("reordered"); 
            if structure.limits in seen:
                raise Unsettled("the structures repeat themselves", "cycle", None)
            grid = replace(Grid.of(structure, _DEGREE, more))
            continue
        examined = Examined(conditions, motion)
        patches = list(examined.patches())
        worst, finest = examined.worst_arcs, max(tolerance, 1e-7)
        tell(f"free {examined.price_of_free:.0e} gain {examined.to_be_gained:.0e} unused {examined.unused:.1e} signs {examined.sign_violation:.0e} worst {worst}")
        for q in patches: tell(f"   {q[0]} {q[1].begin:.4f} {q[1].end:.4f} {q[1].limit}")
        if worst.max() > finest and grid.parts.sum() < 60:
            finer = np.ceil((worst / finest).clip(1) ** (1 / (grid.degree + 1))).astype(int)
            grid = replace(grid, parts=grid.parts * finer)
            continue
        coarse = examined.price_of_free > 1e-4 or examined.to_be_gained > tolerance
        if examined.excess < tolerance and examined.sign_violation < CERTIFIED and not coarse:
            factor = safe_factor(scales.scene, guess)
            H = conditions.hamiltonian(motion)
            spread = float(np.abs(H - H.mean()).max() / abs(H.mean()))
            certificate = Certificate(spread, max(examined.sign_violation, examined.price_of_free))
            gap = factor - 1 + examined.unused
            tell(f"sf {factor-1:.1e} {certificate}")
            if gap < tolerance and spread < CERTIFIED:
                return Resolved(conditions, motion, guess, factor, gap, certificate, total)
        if coarse and conditions.held.free and grid.most_modes < 24:
            grid, more = replace(grid, modes=grid.modes + 3), more + 3
            continue
        more_pins = [pin for pin in examined.pins() if pin not in pins]
        if more_pins:
            pins = (*pins, *more_pins)
            tell(str(pins))
            continue
        new = changed(structure, patches)
        if new.limits == structure.limits and conditions.held.free and grid.most_modes < 24:
            grid, more = replace(grid, modes=grid.modes + 3), more + 3
            continue
        if new.limits == structure.limits:
            raise Unsettled(f"nothing to change: signs {examined.sign_violation:.0e}, excess {examined.excess:.0e}", "", None)
        seen.append(structure.limits)
        structure, pins = new, ()
        if structure.limits in seen:
            raise Unsettled("the structures repeat themselves", "cycle", None)
        grid = Grid.of(structure, _DEGREE, more)
    raise Unsettled("too many attempts", "", None)
