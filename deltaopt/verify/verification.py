"""Checks a motion by means that its planner did not use.

Nothing here comes from ``planning``, and of ``motion`` only the trajectory: the polynomials of the
path, and the model that it carries. What is checked is the motion as reported: the path as a
function of time, and the coordinates and torques that the trajectory's model gives for it. What it
is held against is the scene, through models built here from the scene.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from html import escape
from math import inf, isinf
from typing import Any

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import Singular, Unreachable
from deltaopt.files.tables import finite, html_table
from deltaopt.limits.limit import OwnMeasure
from deltaopt.motion.trajectory import Trajectory, goal_of
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.known_limits import LIMITS, limits_of
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import OnPath
from deltaopt.verify.bounds import ARRIVAL_BOUNDS, BOUNDS, EXCESS, Check, Sizes
from deltaopt.verify.clearance import clearance_excess, robot_clearance, sure_robot_clearance
from deltaopt.verify.duty import Duty
from deltaopt.verify.forward_replay import NotIntegrated, replay
from deltaopt.verify.measures import Distance, Excess, MeasuredMotion, key, not_measured
from deltaopt.verify.model_errors import model_errors
from deltaopt.verify.path_distance import off_approach, off_path, off_via_points, tube_excess
from deltaopt.verify.pontryagin import NoCostates, extremal
from deltaopt.verify.resolved_curves import TooRough
from deltaopt.verify.units import Units, way_of
from deltaopt.verify.well_formed import malformed


@dataclass(frozen=True)
class Verification:
    """The measures of a motion, by ``verify``. Infinite: not evaluated, or there is no such value.

    ``way``: m, from the scene's start to its goal; where these move, how far the motion goes.
    ``arm``: m, length of the upper arm. ``time_unit``: s. ``effort``: ∫ τᵀτ dt, N²m²s.
    ``duration``, ``safe_duration``: s; the latter is the shortest to which the motion can be
        slowed so that it keeps its limits; None where an end moves, which slowing would change.
    ``duration_error``: s, from the scene's duration; None where it gives none.
    ``robot_clearance``: m, of arms and forearms from keep-out bodies, by samples; None without
        bodies. ``robot_overlap``: by how much they come nearer than the scene's clearance at any
        instant, where it has ``robot_keeps_clear``; negative where they stay farther away.
    ``rotation_left``: s, by which the scene's rotation takes longer; None where it has none.
    ``excesses``: of every limit of the scene the largest, by name: ``report.torque_excess`` is
        the value of ``report.excesses["torque_excess"]``, None where the scene has no such limit.
    ``promised``: names of all measures that the scene asks for. None of them may be missing.
    ``distances``: the least to every kind of singularity; empty where not evaluated.
    ``start_distance``, ``goal_distance``: m, from the scene's points to the motion's ends.
    ``path_distance``: m, from the scene's path, followed in order; None where it gives none.
    ``via_distance``: m, the largest from a via point or its sphere, in their order; None without.
    ``approach_distance``: m, the largest outside the scene's approach; None where it gives none.
    ``start_speed``, ``goal_speed``: m/s, by how much the velocity at an end is not the scene's.
    ``position_jump``, ``velocity_jump``: m and m/s, those at all knots added up.
    ``start_acceleration``, ``goal_acceleration``, ``jump_of_acceleration``: m/s², likewise of the
        acceleration, where limits of jerk or torque rate make it continuous; None elsewhere.
    ``kinematic_error``: E_K, mean over time of ‖(f, J q̇ + μ)‖, f in units of the upper arm, the
        rest in units of the mean speed, way / duration.
    ``dynamic_error``: E_D, mean over time of ‖q̈ - q̈(q, q̇, τ)‖ in ``Units`` of the motion.
    ``amplification``: by how much a deviation at the start grows until the end, about.
    ``arrival_distance``, ``arrival_speed``: m and m/s, how far from the goal the reported torques
        lead from the start, uncorrected. There is a bound up to an amplification of
        ``MOST_AMPLIFIED``; beyond it rounding decides, and far beyond it they are None.
    ``defect_distance``, ``defect_speed``: m and m/s, how far the reported torques lead off the
        motion within a piece of it, at most; None where there is a bound on the arrival.
    ``hamiltonian_spread``, ``sign_violation``: how far the motion is from Pontryagin's condition
        for its objective, see ``pontryagin``; None where that cannot be told, or the path is given.
    ``duty``: of the motors, their RMS torque, work, power and speed; None where not evaluated.
    ``obstacles``: what kept a measure from being evaluated, one sentence each.

    Examples:
        >>> scene = deltaopt.load_scene("problems/pick_and_place.yaml")
        >>> report = deltaopt.verify(scene, deltaopt.plan(scene).trajectory)
        >>> report.torque_excess < 1e-9, report.failures()
        (True, [])
    """

    duration: float
    way: float = inf
    arm: float = inf
    time_unit: float = inf
    safe_duration: float | None = inf
    effort: float = inf
    duration_error: float | None = None
    robot_clearance: float | None = None
    robot_overlap: float | None = None
    rotation_left: float | None = None
    excesses: Mapping[str, Excess] = field(default_factory=dict, hash=False)  # no key
    promised: tuple[str, ...] = ()
    start_distance: float = inf
    goal_distance: float = inf
    path_distance: float | None = None
    via_distance: float | None = None
    approach_distance: float | None = None
    start_speed: float = inf
    goal_speed: float = inf
    position_jump: float = inf
    velocity_jump: float = inf
    start_acceleration: float | None = None
    goal_acceleration: float | None = None
    jump_of_acceleration: float | None = None
    kinematic_error: float = inf
    dynamic_error: float = inf
    amplification: float = inf
    arrival_distance: float | None = inf
    arrival_speed: float | None = inf
    defect_distance: float | None = None
    defect_speed: float | None = None
    hamiltonian_spread: float | None = None
    sign_violation: float | None = None
    distances: tuple[Distance, ...] = ()
    duty: Duty | None = None
    obstacles: tuple[str, ...] = ()

    def __getattr__(self, name: str) -> float | None:
        """The excess of a limit; None if the scene has no such limit."""
        if name.endswith("_excess"):
            if name in self.excesses:
                return self.excesses[name].value
            if name.replace(f"_{_LIGHTER}_", "_") in _known_excesses():
                return None
        raise AttributeError(f"a verification has no {name}")

    def __repr__(self) -> str:
        said = "; ".join(self.failures()) or "every bound is kept"
        return f"<Verification of {self.duration:.6g} s, {'ok' if self.ok else 'FAILED'}: {said}>"

    @property
    def ok(self) -> bool:
        """Whether the motion passes."""
        return not self.failures()

    @property
    def judges_arrival(self) -> bool:
        """Whether the arrival has a bound: not in a long motion, where rounding decides it."""
        return self.defect_distance is None

    @property
    def sizes(self) -> Sizes:
        """What bounds are shares of: arm and way, m, duration and time unit, s."""
        return self.arm, self.way, self.duration, self.time_unit

    def checks(self) -> list[Check]:
        """All measures that have a bound in this scene, limits first."""
        bounds = BOUNDS | (ARRIVAL_BOUNDS if self.judges_arrival else {})
        values = ((name, getattr(self, name)) for name in bounds)
        known = ((name, value) for name, value in values if value is not None)
        others = (bounds[name].check(name, value, self.sizes) for name, value in known)
        return [*(excess.check for excess in self.excesses.values()), *others]

    def failures(self) -> list[str]:
        """What is wrong with the motion, one sentence each; empty if it passes."""
        failed = [c for c in self.checks() if not c.ok and not (self.obstacles and isinf(c.value))]
        missing = [name for name in self.promised if getattr(self, name, None) is None]
        sentences = [*self.obstacles, *(check.complaint for check in failed)]
        sentences += [f"nothing measures its {name.replace('_', ' ')}" for name in missing]
        beyond = any(check.measure in self.excesses for check in failed)
        if beyond and self.duration_error is None and self.safe_duration is not None:
            sentences.append(
                "slowing it down does not help: at rest somewhere on its way it exceeds a limit too"
                if isinf(self.safe_duration)
                else f"slowed to {self.safe_duration:.6g} s it would keep the limits"
            )
        return sentences

    def _repr_html_(self) -> str:
        """All measures beside their bounds as a table, and what is wrong, for notebooks."""
        rows = [(*check.cells, "ok" if check.ok else "failed") for check in self.checks()]
        table = html_table(("measure", "value", "at most", "unit", ""), rows)
        sentences = self.failures() or ["verified: every bound is kept"]
        return table + "".join(f"<p>{escape(sentence)}</p>" for sentence in sentences)

    def as_dict(self) -> dict[str, object]:
        """All measures, ``ok`` and ``failures`` for JSON, which knows no infinity: null.

        The excess of every known limit is under its name; under ``limits`` and ``singularities``
        stands where and when the motion is nearest to each.
        """
        content: dict[str, object] = {"ok": self.ok, "failures": self.failures()}
        for each in fields(self):
            if each.name == "excesses":
                absent = dict.fromkeys(_known_excesses())
                present = {name: excess.value for name, excess in self.excesses.items()}
                content |= {name: finite(value) for name, value in (absent | present).items()}
            elif each.name not in ("distances", "duty", "obstacles", "promised"):
                content[each.name] = finite(getattr(self, each.name))
        content["limits"] = {
            excess.limit: {
                "subject": excess.subject,
                "excess": finite(excess.amount),
                "unit": excess.unit,
                "t": finite(excess.t),
            }
            for excess in self.excesses.values()
        }
        content["singularities"] = {
            each.name: {key: finite(value) for key, value in vars(each).items() if key != "name"}
            for each in self.distances
        }
        content["duty"] = None if self.duty is None else self.duty.as_dict()
        return content


def _known_excesses() -> list[str]:
    """Names of the excesses of all limits that a scene may have."""
    return [key(limit.name) for limit in LIMITS if limit.promised]


def promises(scene: Scene) -> tuple[str, ...]:
    """Names of the measures that a scene asks for beside those of every motion: of its limits and
    of what else stands in it; what stands under a key that is not known here, nothing measures."""
    limits = [limit for limit in limits_of(scene).constraints.limits if limit.promised]
    links = any(limit.own_measure is OwnMeasure.LINKS for limit in limits)
    asked = {
        "duration_error": scene.objective.given_duration is not None,
        "robot_overlap": links or scene.keeps_links_clear,
        "rotation_left": scene.rotation is not None,
        "path_distance": scene.follows_path,
        "via_distance": scene.via is not None,
        "approach_distance": scene.approach is not None,
    }
    judged = [key(each.name) for each in limits if each.own_measure is not OwnMeasure.LINKS]
    unknown = (
        f"key {name}"
        for name, rule in type(scene).model_fields.items()
        if name not in _KEYS and getattr(scene, name) != rule.default
    )
    return (*dict.fromkeys(judged), *(name for name in asked if asked[name]), *unknown)


_KEYS = {
    *("robot", "payload", "least_payload", "start", "goal", "via", "approach", "path", "tube"),
    *("limits", "rotation", "objective", "keep_out", "clearance", "robot_keeps_clear"),
    "planned_links",
}
"""The keys of a scene whose measures are known."""
_LIGHTER = "with_the_least_payload"


@np.errstate(over="ignore", invalid="ignore")  # measures that are no numbers are beyond any bound
def verify(scene: Scene, trajectory: Trajectory) -> Verification:
    """Measure a motion that is to solve a scene. Never raises for a bad motion.

    Raises TypeError if it is given something else than a scene and a trajectory, such as a plan.

    Examples:
        >>> scene = deltaopt.load_scene("problems/pick_and_place.yaml")
        >>> deltaopt.verify(scene, deltaopt.plan(scene).trajectory).failures()
        []
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"scene is a {type(scene).__name__}; it must be a Scene")
    if not isinstance(trajectory, Trajectory):
        kind = type(trajectory).__name__
        raise TypeError(
            f"trajectory is a {kind}; it must be a Trajectory, such as plan(scene).trajectory"
        )
    nothing = Verification(inf, excesses=not_measured(scene), promised=promises(scene))
    obstacle = malformed(trajectory)
    if obstacle:
        return replace(nothing, obstacles=(obstacle,))
    units = Units(scene, trajectory)
    nothing = replace(
        nothing,
        duration=trajectory.duration,
        way=way_of(scene, trajectory),
        arm=units.length,
        time_unit=units.time,
    )
    return _measured(scene, trajectory, nothing)


def _measured(scene: Scene, trajectory: Trajectory, nothing: Verification) -> Verification:
    """With every measure that can be evaluated."""
    measured = nothing
    try:
        measures = _measures(scene, trajectory) | model_errors(scene, trajectory)
        measures |= _ends(scene, trajectory, nothing) | _jumps(trajectory)
        measured = replace(nothing, **(measures | _optimality(scene, trajectory)))
        return replace(measured, **replay(scene, trajectory))
    except (Unreachable, Singular, TooRough, NotIntegrated) as error:
        return replace(measured, obstacles=(str(error),))


def _measures(scene: Scene, trajectory: Trajectory) -> dict[str, Any]:
    given, motion = scene.objective.given_duration, MeasuredMotion(scene, trajectory)
    safe_duration: float | None = None
    places = (clearance_excess(scene, trajectory), tube_excess(scene, trajectory))
    misplaced = [each for each in places if each is not None]
    excesses = _largest([*motion.excesses().values(), *misplaced])
    duty = motion.duty()
    if scene.least_payload is not None:
        light = MeasuredMotion(scene.with_least_payload, trajectory)
        excesses = _largest([*excesses.values(), *_with_least_payload(light, excesses)])
        duty = duty.with_larger_rms(light.duty())
    if not scene.moves_at_ends:
        is_in_place = all(each.value <= EXCESS for each in misplaced)  # slowing changes no place
        safe_duration = motion.safe_duration() if is_in_place else inf
    measures = {
        "excesses": excesses,
        "distances": motion.distances(),
        "duty": duty,
        "effort": motion.effort(),
        "safe_duration": safe_duration,
    }
    if given is not None:
        measures["duration_error"] = abs(trajectory.duration - given)
    measures["robot_clearance"] = clearance = robot_clearance(scene, trajectory)
    if (scene.robot_keeps_clear or scene.planned_links) and clearance is not None:
        sure = sure_robot_clearance(scene, trajectory)
        measures["robot_overlap"] = scene.least_clearance - min(clearance, sure)
    if scene.rotation is not None:
        measures["rotation_left"] = max(0.0, scene.rotation.duration - trajectory.duration)
    return measures


def _largest(excesses: Iterable[Excess]) -> dict[str, Excess]:
    """The largest excess of each name."""
    found = dict[str, Excess]()
    for each in excesses:
        if each.key not in found or each.value > found[each.key].value:
            found[each.key] = each
    return found


def _with_least_payload(light: MeasuredMotion, heavy: Mapping[str, Excess]) -> Iterator[Excess]:
    """The excesses of all limits with the least payload of a range, by the motion with that
    payload; those of torques by names of their own, as the scene's limits have them."""
    for excess in light.excesses().values():
        own = replace(excess, limit=f"{excess.limit} {_LIGHTER.replace('_', ' ')}")
        yield own if own.key in heavy else excess


def _optimality(scene: Scene, trajectory: Trajectory) -> dict[str, float]:
    """How well Pontryagin's condition is met, which is that of a free path between given states."""
    task = scene.task
    if isinstance(task, OnPath) or task.gates or not task.goal.is_given:
        return {}
    try:
        found = extremal(scene, trajectory)
    except NoCostates:
        return {}
    spread, violation = found.hamiltonian_spread, found.sign_violation
    return {"hamiltonian_spread": spread, "sign_violation": violation}


def _ends(scene: Scene, trajectory: Trajectory, nothing: Verification) -> dict[str, float]:
    """Of the ends, and of what is on the way."""
    x, v, a = trajectory.path_inside([0.0, 1.0])
    task, on_path = scene.task, dict[str, float]()
    if isinstance(task, OnPath):
        asked = BOUNDS["path_distance"].tolerance.of(nothing.sizes)
        on_path["path_distance"] = off_path(task, trajectory, asked)
    goal = goal_of(problem_of(scene), trajectory)
    if task.via:
        on_path["via_distance"] = off_via_points(task, trajectory)
    if scene.columns:
        on_path["approach_distance"] = off_approach(scene.columns, trajectory)
    if scene.has_rates:
        on_path["start_acceleration"] = _norm(a[0] - task.start.acceleration)
        on_path["goal_acceleration"] = _norm(a[-1] - goal.acceleration)
        on_path["jump_of_acceleration"] = trajectory.acceleration_jump
    return on_path | {
        "start_distance": _norm(x[0] - task.start.position),
        "goal_distance": _norm(x[-1] - goal.position),
        "start_speed": _norm(v[0] - task.start.velocity),
        "goal_speed": _norm(v[-1] - goal.velocity),
    }


def _jumps(trajectory: Trajectory) -> dict[str, float]:
    """All jumps of position and velocity at knots, added up: small ones may lead far off too."""
    sides = trajectory.path_inside([0.0, 1.0])  # rows: begin, end, begin, end ...
    x, v, _ = (np.linalg.norm(row[2::2] - row[1:-1:2], axis=1) for row in sides)
    return {"position_jump": float(x.sum()), "velocity_jump": float(v.sum())}


def _norm(vector: Array) -> float:
    return float(np.linalg.norm(vector))
