"""Active-set update: what should be active instead where a structure is wrong.

By Pontryagin's principle the controls minimise H = p · (V, A) at every instant, and A is affine in
them: a linear program, whose vertices are what may be active on an arc. As many controls are at
their limits as there are motors less the active state limits. Where a control's multiplier has the
wrong sign, or a control that follows from a state limit exceeds its own limit, the best vertex says
what should be active instead. That is not always the control's other limit: another motor's may
have to be left.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product

import numpy as np

from deltaopt.curves.piecewise import Array, Truths
from deltaopt.planning.switching.arc_mesh import DENSE
from deltaopt.planning.switching.conditions import state_rows
from deltaopt.planning.switching.residuals import OptimalityResiduals, StateMultiplier
from deltaopt.planning.switching.structure import Arc, MotorArc

Change = tuple[int, MotorArc]
"""A motor, and what should be active of it for a time."""

_WRONG_SIGN = 1e-5
"""Multiplier of the wrong sign, relative to the largest, that asks for a change: a smaller one
would take errors of the polynomials for wrong structures."""
_INSERTED = 0.04
"""Length of an arc inserted amid another, relative to the time over which something is wrong: where
multipliers have the wrong sign for long, what is missing is short, and Newton's method lengthens an
arc more easily than it shortens one."""
_ALIKE = 1e-9
"""Difference of two times, as a fraction of the duration, that is rounding."""
_SINGULAR = 1e-12
"""Determinant below which no choice of the other controls keeps the active state limits."""
_CONTROL = 2
"""The order of limits of controls, next to 0 and 1 of state limits."""


@dataclass(frozen=True)
class ActiveSetUpdate:
    """What would reduce what is wrong with a structure, by its residuals at samples, (n, dense)."""

    residuals: OptimalityResiduals

    @property
    def changes(self) -> list[Change]:
        """What should be active of every motor in each run of samples that should be alike."""
        before, after = self._active, self._wanted
        found, begin = list[Change](), 0
        for end in range(1, len(after) + 1):
            if end < len(after) and after[end] == after[begin]:
                continue
            if after[begin:end] != before[begin:end]:
                times = self._between(begin, end)
                found += [(k, MotorArc(*times, each)) for k, each in enumerate(after[begin])]
            begin = end
        return found

    @property
    def _lengths(self) -> Array:
        """Lengths of the intervals, fractions of the duration, (n,)."""
        h = self.residuals.point.interval_lengths(self.residuals.conditions.mesh)
        return np.asarray(h / h.sum())

    @cached_property
    def _times(self) -> Array:
        """Times of the samples, fractions of the duration, (n · dense,)."""
        h = self._lengths
        return np.ravel((np.cumsum(h) - h)[:, None] + h[:, None] * DENSE)

    @property
    def _active(self) -> list[Arc]:
        """The active limits at the samples, in their order."""
        conditions = self.residuals.conditions
        return [conditions.structure.limits[a] for a in conditions.mesh.arc for _ in DENSE]

    @property
    def _wanted(self) -> list[Arc]:
        """The limits that should be active at the samples, in their order."""
        wanted, arc = self._active, self.residuals.conditions.mesh.arc
        wrong = self._wrong.any(axis=(2, 3)) | self._to_leave.any(axis=(2, 3))
        for i, j in np.argwhere(wrong).tolist():
            wanted[i * len(DENSE) + j] = self._better(i, j)
        for a, motor in self._contacts_to_leave:
            for sample in np.flatnonzero(np.repeat(arc, len(DENSE)) == a):
                limits = list(wanted[sample])
                limits[motor] = limits[motor].without_contacts
                wanted[sample] = tuple(limits)
        return wanted

    def _between(self, begin: int, end: int) -> tuple[float, float]:
        """Beginning and end of a change at the samples from ``begin``, without ``end``: a part of
        their time only if they lie amid an arc."""
        number, point = len(self._times), self.residuals.point
        first = self._edge(begin - 1, begin) if begin else 0.0
        last = self._edge(end, end - 1) if end < number else 1.0
        switches = np.concatenate([[0.0], np.cumsum(point.lengths) / point.duration])
        if min(np.abs(switches - first).min(), np.abs(switches - last).min()) > _ALIKE:
            middle, half = (first + last) / 2, _INSERTED * (last - first) / 2
            first, last = middle - half, middle + half
        return first, last

    def _edge(self, outside: int, inside: int) -> float:
        """When something begins or ends to be wrong, between neighbouring samples."""
        good_at, bad_at = self._times[outside], self._times[inside]
        violations = self._violations.reshape(len(self._times), -1)
        good, bad = violations[outside], violations[inside]
        worst = int(bad.argmax())
        if not (bad[worst] > 0 > good[worst] > -np.inf):
            return float(good_at + bad_at) / 2
        return float(good_at + (bad_at - good_at) * good[worst] / (good[worst] - bad[worst]))

    @cached_property
    def _violations(self) -> Array:
        """By how much a multiplier has the wrong sign, relative to the largest, or a row exceeds
        its limit, (n, dense, m, 3) by order; negative where nothing is wrong."""
        e, conditions = self.residuals, self.residuals.conditions
        structure, arc = conditions.structure, conditions.mesh.arc
        found = np.full((*e.control.shape, 3), -np.inf)
        by_multiplier = -e.multipliers * e.signs / e.largest_multiplier
        found[..., _CONTROL] = np.where(e.signs != 0, by_multiplier, np.abs(e.control) - 1)
        for state in conditions.rows.states:
            active = structure.state(state.order)[arc][:, None] != 0
            over = np.abs(e.rows[..., state.value]) - 1
            found[..., state.order] = np.where(active, -np.inf, over)
        return found

    @cached_property
    def _wrong(self) -> Truths:
        """Where there is a violation, (n, dense, m, 3) by order."""
        wrong = self._violations > self.residuals.finest
        by_multiplier = self._violations[..., _CONTROL] > _WRONG_SIGN
        of_control = wrong[..., _CONTROL]
        wrong[..., _CONTROL] = np.where(self.residuals.signs != 0, by_multiplier, of_control)
        return wrong

    @cached_property
    def _wrong_multipliers(self) -> list[tuple[StateMultiplier, Truths]]:
        """Multipliers of state limits that have the wrong sign somewhere, and where: before, at the
        samples, and after."""
        found = [(each, each.has_wrong_sign) for each in self.residuals.state_multipliers]
        return [(each, wrong) for each, wrong in found if wrong.any()]

    @cached_property
    def _to_leave(self) -> Truths:
        """Where time would be gained by leaving a state limit, (n, dense, m, 2) by order."""
        leave = np.zeros((*self.residuals.control.shape, 2), bool)
        for each, wrong in self._wrong_multipliers:
            inside = wrong[1:-1].reshape(-1, len(DENSE))
            leave[each.active, :, each.entry.motor, each.order] |= inside
        return leave

    @property
    def _contacts_to_leave(self) -> list[tuple[int, int]]:
        """Contact points, (arc, motor), whose multiplier has the wrong sign."""
        found = [each.entry for each, _ in self._wrong_multipliers if not each.active.any()]
        return [(entry.arc, entry.motor) for entry in found]

    def _better(self, i: int, j: int) -> Arc:
        """What should be active at a sample: the best vertex or, where a control is singular or a
        position limit is left, so that multipliers do not say which vertex is best, the limits that
        are exceeded."""
        e, leave = self.residuals, self._to_leave[i, j]
        limits = self._with_states(i, j)
        arc = e.conditions.mesh.arc[i]
        if not leave[:, 0].any() and all(a != arc for a, _ in e.conditions.active.singular):
            signs = self._vertex(i, j, limits)
            if signs is None:  # no controls keep all of these state limits
                limits = tuple(each._replace(states=(0, 0)) for each in limits)
                signs = self._vertex(i, j, limits)
            if signs is not None:
                return tuple(
                    each._replace(control=sign) for each, sign in zip(limits, signs, strict=True)
                )
        return tuple(
            each._replace(control=-each.control or int(np.sign(e.control[i, j, k])))
            if self._wrong[i, j, k, _CONTROL]
            else each
            for k, each in enumerate(limits)
        )

    def _with_states(self, i: int, j: int) -> Arc:
        """The limits at a sample, with state limits that are exceeded made active, and those left
        that should be left."""
        e, wrong, leave = self.residuals, self._wrong[i, j], self._to_leave[i, j]
        conditions = e.conditions
        limits = list(conditions.structure.limits[conditions.mesh.arc[i]])
        for state in conditions.rows.states:
            for k, row in enumerate(state.value):
                if wrong[k, state.order]:
                    sign = int(np.sign(e.rows[i, j, row]))
                    limits[k] = limits[k].with_state(state.order, sign)
                if leave[k, state.order]:
                    limits[k] = limits[k].with_state(state.order, 0)
        return tuple(limits)

    def _vertex(self, i: int, j: int, limits: Arc) -> list[int] | None:
        """The best vertex of the linear program at a sample: signs of the limits of controls, 0 for
        those that follow, at which H is least of all vertices that keep the active state limits of
        ``limits``; None if there is none."""
        e, J = self.residuals, self._slopes[i, j]
        rows, m = e.conditions.rows, e.conditions.rows.motors
        by_control = np.linalg.inv(J[rows.control])
        row = e.conditions.active.row[e.conditions.mesh.arc[i]]
        cost = -(e.multipliers[i, j] @ J[row]) @ by_control
        states = [state for _, state in state_rows(rows, limits)]
        if len(states) > m:
            return None
        plane, now = J[states] @ by_control, e.control[i, j]
        aim = plane @ now - e.rows[i, j, states]
        least, best = np.inf, None
        for at_limit in combinations(range(m), m - len(states)):
            follow = [k for k in range(m) if k not in at_limit]
            square = plane[:, follow]
            if abs(np.linalg.det(square)) < _SINGULAR:
                continue
            for signs in product((1.0, -1.0), repeat=len(at_limit)):
                control = np.zeros(m)
                control[list(at_limit)] = signs
                control[follow] = np.linalg.solve(square, aim - plane @ control)
                if np.abs(control).max() <= 1 + e.finest and cost @ control < least:
                    least = float(cost @ control)
                    best = [int(control[k]) if k in at_limit else 0 for k in range(m)]
        return best

    @cached_property
    def _slopes(self) -> Array:
        """Derivatives of the rows by A at the samples, (n, dense, rows, m)."""
        conditions = self.residuals.conditions
        rows, m = conditions.rows, conditions.rows.motors
        y = conditions.between(self.residuals.point).reshape(-1, 3 * m)
        J = rows.derivatives(y, np.zeros((len(y), rows.number)), conditions.p)[1]
        return J[..., 2 * m :].reshape(*self.residuals.control.shape[:2], rows.number, m)
