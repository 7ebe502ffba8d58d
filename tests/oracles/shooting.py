"""A fastest motion by shooting: the lengths of its arcs are all there is to find.

Where every motor is held, by a limit of its torque or of its speed, the acceleration is a function
of the state. Integrated from the start, arc by arc, the motion must end at the goal, at rest;
among the lengths that bring it there the shortest sum is sought. The integration is Gauss's
method of order 16 on forward dynamics by the general derivation in twelve coordinates: nothing
of the planner's polynomials, variables or equations is in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.curves.nodes import collocation
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.dynamics.linear import solve_affine
from deltaopt.errors import NotConverged
from deltaopt.mechanisms.delta.functions import delta_functions
from deltaopt.mechanisms.delta.mechanism import DeltaTerms
from deltaopt.planning.flat.constraint_rows import ConstraintRows, constraint_rows
from deltaopt.planning.flat.equations import point_equations
from deltaopt.planning.switching.conditions import ActiveRows
from deltaopt.planning.switching.structure import SwitchingStructure
from deltaopt.robot.model import DeltaModel
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import given_points

Array = NDArray[np.float64]

_STEPS = 40
"""Over the duration, and one an arc at least."""
_SWEEPS = 40
"""Of the stages' fixed point: each gains two digits or so."""
_ITERATIONS = 8
_SHIFT = 1e-4
"""Of the duration, for differences."""
_STEADY, _SOLVED = 1e-8, 1e-11
"""Largest step of a length, of the duration, to whose square the sum of all is as exact as the
misses are; and the largest miss."""


@dataclass(frozen=True)
class Shot:
    """``duration``: s. ``miss``: of the goal, of rest and of speed limits, without dimension.
    ``lengths``: of the arcs, s."""

    duration: float
    miss: float
    lengths: Array


def shoot(scene: Scene, structure: SwitchingStructure, duration: float) -> Shot:
    """The fastest motion of a structure, from estimates of its lengths and duration (s).

    Raises NotConverged, also where limits of torque and speed alone do not say what an arc is.
    """
    shooting = _Shooting(scene, structure, duration)
    entries = shooting.active.entries
    if shooting.active.singular or any(entry.rows.order == 0 for entry in entries):
        raise NotConverged(
            "on some arc a torque is at no limit, or a fold at its margin", "Not_Held", structure
        )
    lengths = structure.lengths.copy()
    for _ in range(_ITERATIONS):
        step = shooting.step(lengths)
        lengths += step
        miss = float(np.abs(shooting.misses(lengths[None])).max())
        if np.abs(step).max() < _STEADY and miss < _SOLVED:
            return Shot(float(lengths.sum()) * duration, miss, lengths * duration)
    raise NotConverged(
        f"shooting has not settled: a step of {np.abs(step).max():.0e}, a miss of {miss:.0e}",
        "No_Progress",
        lengths,
    )


@dataclass(frozen=True)
class _Shooting:
    """Lengths are in units of ``duration``."""

    scene: Scene
    structure: SwitchingStructure
    duration: float

    @cached_property
    def model(self) -> DeltaModel:
        return DeltaModel(self.scene.robot, self.scene.payload)

    def step(self, lengths: Array) -> Array:
        """Newton's, of min Σ L where the misses vanish; rows that imply each other do no harm."""
        n = len(lengths)
        pairs = list(combinations(range(n), 2))
        shifts = [np.zeros(n), *(s * _SHIFT * np.eye(n)[i] for i in range(n) for s in (1, -1))]
        shifts += [_SHIFT * (np.eye(n)[i] + np.eye(n)[j]) for i, j in pairs]
        misses = self.misses(lengths + np.array(shifts))
        if not np.isfinite(misses).all():
            raise NotConverged("shooting has left the workspace", "Out_Of_Reach", lengths)
        here, up, down = misses[0], misses[1 : 2 * n + 1 : 2], misses[2 : 2 * n + 2 : 2]
        J = ((up - down) / (2 * _SHIFT)).T
        curvature = np.zeros((len(here), n, n))
        for i in range(n):
            curvature[:, i, i] = (up[i] - 2 * here + down[i]) / _SHIFT**2
        for (i, j), both in zip(pairs, misses[2 * n + 1 :], strict=True):
            curvature[:, i, j] = (both - up[i] - up[j] + here) / _SHIFT**2
            curvature[:, j, i] = curvature[:, i, j]
        multipliers = np.linalg.lstsq(J.T, -np.ones(n), rcond=1e-9)[0]
        H = np.einsum("r,rij->ij", multipliers, curvature)
        m = len(here)
        matrix = np.block([[H, J.T], [J, np.zeros((m, m))]])
        solved = np.linalg.lstsq(matrix, -np.concatenate([np.ones(n), here]), rcond=1e-9)[0]
        return np.asarray(solved[:n])

    def misses(self, lengths: Array) -> Array:
        """Of many motions at once, lengths (B, arcs) -> (B, 6 and one for each speed that an arc
        begins to hold or to leave at once)."""
        scene, structure = self.scene, self.structure
        start, goal = np.array(given_points(scene.task))
        way = float(np.linalg.norm(goal - start))
        x = np.tile(start, (len(lengths), 1))
        v, misses = np.zeros_like(x), []
        for a in range(len(structure.lengths)):
            misses += self._speed_misses(a, x, v)
            x, v = self._along(a, x, v, lengths[:, a] * self.duration)
        misses += list(((x - scene.goal) / way).T) + list((v * self.duration / way).T)
        return np.stack(misses, axis=1)

    @cached_property
    def rows(self) -> ConstraintRows:
        constraints = limits_of(self.scene).constraints
        return constraint_rows(point_equations(self.model.functions, constraints))

    @cached_property
    def active(self) -> ActiveRows:
        return ActiveRows(self.rows, self.structure)

    def _speed_misses(self, a: int, x: Array, v: Array) -> list[Array]:
        new = [entry for entry in self.active.entries if entry.arc == a]
        speed = limits_of(self.scene).upper("speed")
        if not new or speed is None:
            return []
        share = self.model.motion(x, v, np.zeros_like(x))[1][:, 3::3] / speed
        return [share[:, entry.motor] - entry.value for entry in new]

    def _at_rest(self, a: int) -> tuple[int | None, ...]:
        """For each motor the one whose θ̈ = 0 its torque keeps up; None if its torque is given."""
        velocity = self.rows.state(1)
        holding = [] if velocity is None else velocity.holding.tolist()
        return tuple(
            holding.index(row) if row in holding else None for row in self.active.row[a].tolist()
        )

    def _along(self, a: int, x: Array, v: Array, length: Array) -> tuple[Array, Array]:
        """An arc, (B, 3) each."""
        value = self.active.value[a] * limits_of(self.scene).upper("torque")
        steps = int(np.ceil(_STEPS * self.structure.lengths[a]))
        acceleration = _acceleration(self.model.functions.terms, self._at_rest(a))
        h, g = (length / steps)[:, None, None], collocation(8)
        for _ in range(steps):
            A = np.zeros((len(x), len(g.weights), 3))
            for _ in range(_SWEEPS):
                V = v[:, None] + h * (g.a @ A)
                X = x[:, None] + h * (g.a @ V)
                rows = (part.reshape(-1, 3) for part in (X, V, np.broadcast_to(value, X.shape)))
                (new,) = acceleration(*rows, parameters=self.model.parameters)
                change = np.abs(new.reshape(A.shape) - A).max() / np.abs(new).max()
                A = new.reshape(A.shape)
                if change < 1e-15:
                    break
            V = v[:, None] + h * (g.a @ A)
            x, v = x + h[:, 0] * (g.weights @ V), v + h[:, 0] * (g.weights @ A)
        return x, v


@lru_cache(maxsize=8)
def _acceleration(terms: DeltaTerms, at_rest: tuple[int | None, ...]) -> RowFunction:
    """(x, v, torques, p) -> the acceleration at which one row for each motor holds: its torque or,
    where it keeps a motor at its speed limit, that motor's θ̈ = 0."""
    functions = delta_functions(terms, Explicit())
    x, v, a, value = (ca.SX.sym(name, 3) for name in ("x", "v", "a", "value"))
    p = terms.symbols().vector()
    torque, _ = functions.inverse_dynamics.expand()(x, v, a, p)
    bend = functions.motion(x, v, a, p)[2][3::3]
    rows = [
        torque[k] - value[k] if motor is None else bend[motor] for k, motor in enumerate(at_rest)
    ]
    solved = solve_affine(ca.vertcat(*rows), a)
    function = ca.Function("acceleration", [x, v, value, p], [ca.densify(solved)], {"cse": True})
    return RowFunction(function)
