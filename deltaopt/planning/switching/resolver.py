"""Switch resolution of mesh solutions: to a motion with exact switches, or to a certificate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from deltaopt.curves.piecewise import Truths
from deltaopt.motion.certificate import MET, Certificate
from deltaopt.planning.flat.constraint_rows import (
    ByOrder,
    can_be_held,
    constraint_rows,
    holdable,
)
from deltaopt.planning.flat.equations import point_equations
from deltaopt.planning.mesh.mesh_costates import certify_mesh
from deltaopt.planning.mesh.mesh_solution import MeshSolution
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.switching.conditions import ActiveRows
from deltaopt.planning.switching.detection import (
    BY_MULTIPLIERS,
    SHARP,
    STANDARD,
    DetectionSettings,
    detect_structure,
)
from deltaopt.planning.switching.resolution import ResolvedMotion, SwitchResolution, Unresolved
from deltaopt.planning.switching.structure import Arc, SwitchingStructure

_ACTIVE = 1 - 1e-3
"""Size of a row from which on a limit is taken to matter for a motion. A lesser one would give
up motions that keep it by themselves, a larger one try to resolve others in vain."""


class SwitchResolver:
    """Resolves the switches of a scene's motion, to a gap within a tolerance.

    Where a scene has limits that arcs cannot hold, a motion is resolved only if none of them
    matters for it; the resolved motion is held against all. Where arcs can hold none of its motions
    it certifies mesh solutions only.

    ``rows``: of the limits that arcs can hold; ``all_rows``: of all limits of the scene.
    ``scaling``: the scene's for the former, with all of every limit.
    """

    def __init__(self, scaling: Scaling, tolerance: float, tell: Callable[[str], None]) -> None:
        """``tell``: what each attempt is reported to."""
        functions = scaling.problem.model.functions
        self.all_rows = constraint_rows(point_equations(functions, scaling.constraints))
        self.scaling = replace(scaling, kept=holdable(scaling.constraints))
        self.rows = constraint_rows(point_equations(functions, self.scaling.constraints))
        self.tolerance, self.tell = tolerance, tell

    def from_coarse(self, solution: MeshSolution) -> ResolvedMotion | None:
        """From a mesh that shows the structure roughly; None if it cannot be resolved yet."""
        return self._resolved(solution, STANDARD)

    def from_fine(self, solution: MeshSolution) -> ResolvedMotion | None:
        """From a mesh whose motion is close to optimal; None if it cannot be resolved."""
        return self._resolved(solution, SHARP)

    def from_last(self, solution: MeshSolution) -> ResolvedMotion | None:
        """From the last mesh, whose multipliers say which limits are active; None as above."""
        if not solution.has_all_multipliers:
            return None
        return self._resolved(solution, BY_MULTIPLIERS)

    def certificate(self, solution: MeshSolution) -> Certificate | None:
        """How well a mesh solution meets Pontryagin's condition, if it does."""
        if not solution.has_all_multipliers:
            return None
        found = certify_mesh(self.all_rows, solution)
        return found if found.residual <= MET else None

    def _resolved(
        self, last: MeshSolution, settings: Sequence[DetectionSettings]
    ) -> ResolvedMotion | None:
        """From the structures that are detected with each of the settings."""
        constraints, held = self.rows.constraints, self._held
        size = self.all_rows.constraints.size(last.rows)
        if not can_be_held(constraints) or (size[..., ~held] > _ACTIVE).any():
            return None
        tried = set[tuple[Arc, ...]]()
        rows = ByOrder.of(constraints, last.rows[..., held])
        multipliers = None
        if last.has_all_multipliers:
            of_intervals = last.solution.multipliers[..., held].sum(axis=1)
            multipliers = ByOrder.of(constraints, of_intervals / last.mesh[:, None])
        for each in settings:
            structure = detect_structure(last.mesh, rows, each, multipliers)
            if structure.limits in tried:
                continue
            tried.add(structure.limits)
            for barrier in self._barriers(structure):
                resolution = SwitchResolution(self.rows, self.scaling, self.tolerance, barrier)
                try:
                    resolved = resolution.from_structure(structure, last.trajectory)
                except Unresolved as error:
                    self.tell(f"{len(structure.limits)} arcs: not resolved yet: {error}")
                    continue
                self.tell(
                    f"{len(resolved.conditions.structure.limits)} arcs: "
                    f"{resolved.trajectory.duration:.9f} s, gap {resolved.gap:.1e}, satisfies "
                    f"Pontryagin's condition to {resolved.certificate.residual:.0e}"
                )
                return resolved
        return None

    @property
    def _held(self) -> Truths:
        """Which rows of all limits are of those that arcs can hold, (rows,)."""
        constraints, kept = self.all_rows.constraints, self.scaling.kept or ()
        return constraints.of_rows([i in kept for i in range(len(constraints.items))], np.bool)

    def _barriers(self, structure: SwitchingStructure) -> tuple[float, ...]:
        """Without one first; then with, where there is anything to be kept within limits."""
        active = ActiveRows(self.rows, structure)
        if self.rows.state(1) is None and not (active.singular or active.follows.any()):
            return (0.0,)
        return 0.0, self.tolerance / 10
