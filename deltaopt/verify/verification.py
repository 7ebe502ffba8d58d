"""Checks a motion by means that its planner did not use.

Nothing here comes from ``planning``, and of ``motion`` only the trajectory: the polynomials of the
path, and the model that it carries. What is checked is the motion as reported: the path as a
function of time, and the coordinates and torques that the trajectory's model gives for it. What it
is held against is the scene, through models built here from the scene.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from html import escape
from math import inf, isfinite, isinf
from typing import Any

import casadi as ca
import numpy as np

from deltaopt.codegen.vectorised import evaluate_rows
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.errors import Singular, Unreachable
from deltaopt.files.html_table import html_table
from deltaopt.limits.limit import OwnMeasure
from deltaopt.mechanisms.functions import Functions
from deltaopt.motion.trajectory import Array, Trajectory, goal_of
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import model_of
from deltaopt.scene.scene import LIMITS, Scene, limits_of
from deltaopt.scene.task import EndState, MovingEnds, OnPath
from deltaopt.verify.clearance import clearance_excess
from deltaopt.verify.duty import Duty
from deltaopt.verify.forward_replay import NotIntegrated, replay
from deltaopt.verify.links import robot_clearance, sure_robot_clearance
from deltaopt.verify.measures import Distance, Excess, Known, MeasuredMotion, key, not_measured
from deltaopt.verify.path_distance import off_approach, off_path, off_via_points
from deltaopt.verify.pontryagin import NoCostates, extremal
from deltaopt.verify.resolved_curves import DEGREE, POINTS, WEIGHTS, TooRough
from deltaopt.verify.tube import tube_excess
from deltaopt.verify.units import Units, way_of
from deltaopt.verify.well_formed import malformed

EXCESS = 1e-9
"""Of every limit, as a share of it: above rounding of inverse dynamics, below any meaning of a
limit."""
DURATION = 1e-10
"""Of a duration that the scene gives."""
BOUNDARY_DISTANCE = 1e-7
"""Of the upper arm, also for jumps: encoders see a millionth; an NLP solved to 1e-8 leaves less."""
BOUNDARY_SPEED = 3e-7
"""Upper arms in the duration of the motion, also for jumps: less than a nanometre within a
controller's millisecond."""
ROBOT_OVERLAP = 2e-9
"""Of the upper arm, by which a link may be too near to a body: rounding, and what bounds leave."""
KINEMATIC_ERROR = 1e-9
"""Of the upper arm and of the mean speed: rounding of the closed-form kinematics leaves 1e-15."""
DYNAMIC_ERROR = 1e-9
"""In units of the arm and of ``Units.time``, in which accelerations are 1 to 100: rounding leaves
1e-14."""
DEFECT_DISTANCE = 1e-7
"""Of the upper arm, after a piece of the motion: integration leaves 1e-12."""
DEFECT_SPEED = 5e-5
"""Upper arms in the duration of the motion, after a piece of it: a ten-thousandth of the speed."""
DEFECT_ROUNDING = 1e-13
"""Of the upper arm, and of it in ``Units.time``: to which the integration is known. It is more than
the shares of a way of nanometres or of a motion of years."""
ARRIVAL_DISTANCE = 1e-5
"""Of the upper arm, some micrometres, the most the project promises: good robots repeat to 1e-4 m.
"""
ARRIVAL_SPEED = 5e-4
"""Upper arms in the duration of the motion."""
BOUNDARY_SHARE = 1e-3
"""Of the way, and of its mean speed: a motion of a micrometre is held to less than one."""
ARRIVAL_SHARE = 1e-2
"""The same for where the torques lead."""


@dataclass(frozen=True)
class Bound:
    """The most a measure may be, and what to say of a value that is more.

    ``at_most``: of the upper arm's length (m), of that length in the motion's duration (m/s), or of
    the duration (s), so that large and small robots are held to the same; of nothing else.
    ``share``: of the distance from start to goal (m) or of the mean speed (m/s), if that is less.
    ``rounding``: of the upper arm (m) or of it in ``Units.time`` (m/s), if that is more.
    ``known``: what is known of the measure between samples.
    """

    measure: str
    unit: str
    known: Known
    at_most: float
    complaint: str
    share: float = inf
    rounding: float = 0.0

    def of(self, measured: Verification) -> Bound:
        """The bound of a measured motion in the measure's unit."""
        arm, way, duration = measured.arm, measured.way, measured.duration
        rate, own_rate = (1 / t if t > 0 else inf for t in (duration, measured.time_unit))
        units = {"s": duration, "m": arm, "m/s": arm * rate}
        own = {"m": way, "m/s": way * rate}
        known = {"m": arm, "m/s": arm * own_rate}
        at_most = self.at_most * units.get(self.unit, 1.0)
        if self.unit in own:
            at_most = min(at_most, self.share * own[self.unit])
            at_most = max(at_most, self.rounding * known[self.unit])
        return replace(self, at_most=at_most)


BOUNDS = (
    Bound(
        "duration_error",
        "s",
        Known.EXACT,
        DURATION,
        "it takes {:.3g} s more or less than the scene says",
    ),
    Bound(
        "robot_overlap",
        "m",
        Known.SURE,
        ROBOT_OVERLAP,
        "an arm or a forearm is up to {:.3g} m too near to a keep-out body, or inside",
    ),
    Bound(
        "rotation_left",
        "s",
        Known.EXACT,
        DURATION,
        "it ends {:.3g} s before the fourth axis has turned",
    ),
    Bound(
        "start_distance",
        "m",
        Known.EXACT,
        BOUNDARY_DISTANCE,
        "it begins {:.3g} m from the scene's start",
        BOUNDARY_SHARE,
    ),
    Bound(
        "goal_distance",
        "m",
        Known.EXACT,
        BOUNDARY_DISTANCE,
        "it ends {:.3g} m from the scene's goal",
        BOUNDARY_SHARE,
    ),
    Bound(
        "path_distance",
        "m",
        Known.SURE,
        BOUNDARY_DISTANCE,
        "it is up to {:.3g} m off the scene's path",
        BOUNDARY_SHARE,
    ),
    Bound(
        "via_distance",
        "m",
        Known.SURE,
        BOUNDARY_DISTANCE,
        "it misses a via point by {:.3g} m, or passes it out of turn",
        BOUNDARY_SHARE,
    ),
    Bound(
        "approach_distance",
        "m",
        Known.SURE,
        BOUNDARY_DISTANCE,
        "it is up to {:.3g} m outside the scene's approach",
        BOUNDARY_SHARE,
    ),
    Bound(
        "start_speed",
        "m/s",
        Known.EXACT,
        BOUNDARY_SPEED,
        "it begins with a velocity {:.3g} m/s off the scene's",
        BOUNDARY_SHARE,
    ),
    Bound(
        "goal_speed",
        "m/s",
        Known.EXACT,
        BOUNDARY_SPEED,
        "it ends with a velocity {:.3g} m/s off the scene's",
        BOUNDARY_SHARE,
    ),
    Bound(
        "position_jump",
        "m",
        Known.EXACT,
        BOUNDARY_DISTANCE,
        "its position jumps by {:.3g} m at its knots, all jumps together",
        BOUNDARY_SHARE,
    ),
    Bound(
        "velocity_jump",
        "m/s",
        Known.EXACT,
        BOUNDARY_SPEED,
        "its velocity jumps by {:.3g} m/s at its knots, all jumps together",
        BOUNDARY_SHARE,
    ),
    Bound(
        "kinematic_error",
        "1",
        Known.SAMPLED,
        KINEMATIC_ERROR,
        "its coordinates leave the loops open by {:.3g} (of the upper arm and of the mean speed, "
        "on average)",
    ),
    Bound(
        "dynamic_error",
        "1",
        Known.SAMPLED,
        DYNAMIC_ERROR,
        "its torques give accelerations that differ by {:.3g} from its own (in units of the robot "
        "and the motion, on average)",
    ),
    Bound(
        "defect_distance",
        "m",
        Known.FOLLOWED,
        DEFECT_DISTANCE,
        "its torques lead {:.3g} m off its path within a piece of it",
        BOUNDARY_SHARE,
        DEFECT_ROUNDING,
    ),
    Bound(
        "defect_speed",
        "m/s",
        Known.FOLLOWED,
        DEFECT_SPEED,
        "its torques give a speed {:.3g} m/s off its own within a piece of it",
        BOUNDARY_SHARE,
        DEFECT_ROUNDING,
    ),
)
"""Of everything but limits, whose excesses are measures of their own, each at most ``EXCESS``."""

ARRIVAL_BOUNDS = (
    Bound(
        "arrival_distance",
        "m",
        Known.FOLLOWED,
        ARRIVAL_DISTANCE,
        "its torques bring the platform to {:.3g} m from the goal",
        ARRIVAL_SHARE,
    ),
    Bound(
        "arrival_speed",
        "m/s",
        Known.FOLLOWED,
        ARRIVAL_SPEED,
        "its torques leave the platform with a velocity {:.3g} m/s off the goal's",
        ARRIVAL_SHARE,
    ),
)
"""Of the arrival, unless a motion is so long that rounding decides where it ends."""


@dataclass(frozen=True)
class Check:
    """One measure of a motion beside its bound."""

    bound: Bound
    value: float

    @property
    def ok(self) -> bool:
        """Whether the measure is within its bound; what is not a number is not."""
        return bool(self.value <= self.bound.at_most < inf)

    @property
    def complaint(self) -> str:
        """The sentence for a value that is out of bounds."""
        return self.bound.complaint.format(self.value)


@dataclass(frozen=True)
class Verification:
    """The measures of a motion. Infinite: could not be evaluated, or there is no such value.

    ``way``: m, from the scene's start to its goal; where these move, how far the motion goes.
    ``arm``: m, length of the upper arm.
    ``time_unit``: s, ``Units.time``.
    ``duration``, ``safe_duration``: s; the latter is the shortest to which the motion can be
        slowed so that it keeps its limits; None where an end moves, which slowing would change.
    ``effort``: ∫ τᵀτ dt, N²m²s.
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
    ``path_distance``: m, of the motion from the scene's path, followed from its beginning to its
        end; None where it gives none.
    ``via_distance``: m, the largest from a via point or the sphere that the scene gives about it,
        passed in the scene's order; None without.
    ``approach_distance``: m, the largest outside the scene's approach; None where it gives none.
    ``start_speed``, ``goal_speed``: m/s, by how much the platform's velocity at the motion's ends
        differs from the scene's, which is zero unless an end moves.
    ``position_jump``, ``velocity_jump``: m and m/s, those at all knots added up.
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

    @property
    def ok(self) -> bool:
        """Whether the motion passes."""
        return not self.failures()

    @property
    def judges_arrival(self) -> bool:
        """Whether the arrival has a bound: not in a long motion, where rounding decides it."""
        return self.defect_distance is None

    def checks(self) -> list[Check]:
        """All measures that have a bound in this scene, limits first."""
        bounds = BOUNDS + (ARRIVAL_BOUNDS if self.judges_arrival else ())
        values = [(bound, getattr(self, bound.measure)) for bound in bounds]
        return self._limit_checks() + [
            Check(bound.of(self), value) for bound, value in values if value is not None
        ]

    def _limit_checks(self) -> list[Check]:
        return [
            Check(Bound(name, "1", excess.known, EXCESS, excess.sentence), excess.value)
            for name, excess in self.excesses.items()
        ]

    def failures(self) -> list[str]:
        """What is wrong with the motion, one sentence each; empty if it passes."""
        failed = [c for c in self.checks() if not c.ok and not (self.obstacles and isinf(c.value))]
        missing = [name for name in self.promised if getattr(self, name, None) is None]
        sentences = [*self.obstacles, *(check.complaint for check in failed)]
        sentences += [f"nothing measures its {name.replace('_', ' ')}" for name in missing]
        beyond = any(check in failed for check in self._limit_checks())
        if beyond and self.duration_error is None and self.safe_duration is not None:
            sentences.append(
                "slowing it down does not help: at rest somewhere on its way it exceeds a limit too"
                if isinf(self.safe_duration)
                else f"slowed to {self.safe_duration:.6g} s it would keep the limits"
            )
        return sentences

    def _repr_html_(self) -> str:
        """All measures beside their bounds as a table, and what is wrong, for notebooks."""
        rows = [
            (
                check.bound.measure.replace("_", " "),
                f"{check.value:.1e}",
                f"{check.bound.at_most:.0e}",
                check.bound.unit,
                "ok" if check.ok else "failed",
            )
            for check in self.checks()
        ]
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
                content |= {name: _finite(value) for name, value in (absent | present).items()}
            elif each.name not in ("distances", "duty", "obstacles", "promised"):
                content[each.name] = _finite(getattr(self, each.name))
        content["limits"] = {
            excess.limit: {
                "subject": excess.subject,
                "excess": _finite(excess.amount),
                "unit": excess.unit,
                "t": _finite(excess.t),
            }
            for excess in self.excesses.values()
        }
        content["singularities"] = {
            distance.name: {
                "least": _finite(distance.least),
                "formula": distance.formula,
                "unit": distance.unit,
                "subject": distance.subject,
                "t": distance.t,
            }
            for distance in self.distances
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
        "robot_overlap": links or bool(scene.robot_keeps_clear and scene.keep_out),
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


def _finite(value: float | None) -> float | None:
    return value if value is not None and isfinite(value) else None


@np.errstate(over="ignore", invalid="ignore")  # measures that are no numbers are beyond any bound
def verify(scene: Scene, trajectory: Trajectory) -> Verification:
    """Measure a motion that is to solve a scene. Never raises for a bad motion.

    Raises TypeError if it is given something else than a scene and a trajectory, such as a plan.
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
    units = Units.of(scene, trajectory)
    nothing = replace(
        nothing,
        duration=trajectory.duration,
        way=way_of(scene, trajectory),
        arm=units.length,
        time_unit=units.time,
    )
    with np.errstate(invalid="ignore", over="ignore"):  # numbers that are none are told
        return _measured(scene, trajectory, nothing)


def _measured(scene: Scene, trajectory: Trajectory, nothing: Verification) -> Verification:
    """With every measure that can be evaluated."""
    try:
        measures = _measures(scene, trajectory) | _errors(scene, trajectory)
        measures |= _ends(scene, trajectory, nothing) | _jumps(trajectory)
        measures |= _optimality(scene, trajectory)
    except (Unreachable, Singular, TooRough) as error:
        return replace(nothing, obstacles=(str(error),))
    measured = replace(nothing, **measures)
    try:
        followed = replay(scene, trajectory)
    except (NotIntegrated, Unreachable, Singular) as error:
        return replace(measured, obstacles=(str(error),))
    return replace(measured, **vars(followed))


def _measures(scene: Scene, trajectory: Trajectory) -> dict[str, Any]:
    given, motion = scene.objective.given_duration, MeasuredMotion.of(scene, trajectory)
    safe_duration: float | None = None
    places = (clearance_excess(scene, trajectory), tube_excess(scene, trajectory))
    misplaced = [each for each in places if each is not None]
    excesses = _largest([*motion.excesses().values(), *misplaced])
    if scene.least_payload is not None:
        excesses = _largest([*excesses.values(), *_with_least_payload(scene, trajectory, excesses)])
    if not isinstance(scene.task, MovingEnds):
        safe_duration = motion.safe_duration() if _are_kept(misplaced) else inf
    measures = {
        "excesses": excesses,
        "distances": motion.distances(),
        "duty": motion.duty(),
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


def _with_least_payload(
    scene: Scene, trajectory: Trajectory, heavy: Mapping[str, Excess]
) -> Iterator[Excess]:
    """The excesses of all limits with the least payload of a range, by the model with that payload;
    those of torques by names of their own, as the scene's limits have them."""
    light = MeasuredMotion.of(scene.with_least_payload, trajectory).excesses()
    for excess in light.values():
        own = replace(excess, limit=f"{excess.limit} {_LIGHTER.replace('_', ' ')}")
        yield own if own.key in heavy else excess


def _are_kept(misplaced: list[Excess]) -> bool:
    """Whether a motion keeps clear of bodies and stays in its tube, which slowing it does not
    change."""
    return all(each.value <= EXCESS for each in misplaced)


def _optimality(scene: Scene, trajectory: Trajectory) -> dict[str, float]:
    """How well Pontryagin's condition is met, which is that of a free path between given states."""
    task = scene.task
    if isinstance(task, OnPath) or task.gates or not isinstance(task.goal, EndState):
        return {}
    try:
        found = extremal(scene, trajectory)
    except NoCostates:
        return {}
    spread, violation = found.hamiltonian_spread, found.sign_violation
    return {"hamiltonian_spread": spread, "sign_violation": violation}


def _ends(scene: Scene, trajectory: Trajectory, nothing: Verification) -> dict[str, float]:
    x, v, _ = trajectory.path_inside([0.0, 1.0])
    task, on_path = scene.task, dict[str, float]()
    if isinstance(task, OnPath):
        (asked,) = (b.of(nothing).at_most for b in BOUNDS if b.measure == "path_distance")
        on_path["path_distance"] = off_path(task, trajectory, asked)
    goal = goal_of(problem_of(scene), trajectory)
    if task.via:
        on_path["via_distance"] = off_via_points(task, trajectory)
    if scene.columns:
        on_path["approach_distance"] = off_approach(scene.columns, trajectory)
    return on_path | {
        "start_distance": _norm(x[0] - task.start.position),
        "goal_distance": _norm(x[-1] - goal.position),
        "start_speed": _norm(v[0] - task.start.velocity),
        "goal_speed": _norm(v[-1] - goal.velocity),
    }


def _jumps(trajectory: Trajectory) -> dict[str, float]:
    """All jumps of position and of velocity between the two sides of knots, added up: small ones
    in one direction lead as far off as a large one."""
    sides = trajectory.path_inside([0.0, 1.0])  # rows: begin, end, begin, end ...
    x, v, _ = (np.linalg.norm(row[2::2] - row[1:-1:2], axis=1) for row in sides)
    return {"position_jump": float(x.sum()), "velocity_jump": float(v.sum())}


def _errors(scene: Scene, trajectory: Trajectory) -> dict[str, float]:
    """E_K and E_D of the reported q, q̇, q̈ and τ, by the scene's mechanism."""
    units = Units.of(scene, trajectory)
    samples = _Samples.of(trajectory)
    q, dq, ddq = trajectory.coordinates_inside(samples.fractions)
    tau = trajectory.model.inverse_dynamics(*trajectory.path_inside(samples.fractions))
    model = model_of(scene.robot, scene.payload)
    functions = model.functions
    lengths = units.coordinates(functions)
    motion = [rows * units.time**k / lengths for k, rows in enumerate((q, dq, ddq))]
    arguments, parameters = [*motion, tau / units.torque(functions)], units.parameters(model)
    kinematic, dynamic = evaluate_rows(_residuals(functions), *arguments, parameters=parameters)
    doubtful = np.logical_not(np.linalg.norm(dynamic, axis=1) <= DYNAMIC_ERROR)
    if doubtful.any():
        try:
            (dynamic[doubtful],) = evaluate_rows(
                _robust_residuals(functions),
                *(rows[doubtful] for rows in arguments),
                parameters=parameters,
            )
        except RuntimeError:  # what CasADi raises where a matrix is singular
            raise Unreachable(
                "its coordinates have no solution of the equations of motion"
            ) from None
    mean_speed = way_of(scene, trajectory) / trajectory.duration * units.time / units.length
    kinematic[:, functions.mechanism.holonomic.numel() :] /= mean_speed
    return {
        "kinematic_error": samples.mean_over_time(trajectory, kinematic),
        "dynamic_error": samples.mean_over_time(trajectory, dynamic),
    }


@lru_cache(maxsize=16)
def _residuals(functions: Functions) -> ca.Function:
    """(q, q̇, q̈, τ, p) -> (f, J q̇ + μ), q̈ - q̈(q, q̇, τ)."""
    m = functions.mechanism
    closure = ca.Function("closure", [m.q, m.dq, m.parameters], [m.holonomic, m.constraint_rate])
    forward = Explicit().forward_dynamics(m)
    q, dq, ddq = (ca.MX.sym(name, m.q.numel()) for name in ("q", "dq", "ddq"))
    tau, p = ca.MX.sym("tau", 3), ca.MX.sym("p", functions.symbols().numel())
    modelled, _ = forward(0, q, dq, tau, p)
    kinematic = ca.vertcat(*closure(q, dq, p))
    return ca.Function("residuals", [q, dq, ddq, tau, p], [kinematic, ddq - modelled]).expand()


@lru_cache(maxsize=16)
def _robust_residuals(functions: Functions) -> ca.Function:
    """(q, q̇, q̈, τ, p) -> q̈ - q̈(q, q̇, τ) by eq. (37): slower, and accurate near serial
    singularities too, where eq. (39) is exact to rounding over the squared distance alone."""
    m = functions.mechanism
    q, dq, ddq = (ca.MX.sym(name, m.q.numel()) for name in ("q", "dq", "ddq"))
    tau, p = ca.MX.sym("tau", 3), ca.MX.sym("p", functions.symbols().numel())
    modelled, _ = Multiplier().forward_dynamics(m)(0, q, dq, tau, p)
    return ca.Function("robust_residuals", [q, dq, ddq, tau, p], [ddq - modelled])


@dataclass(frozen=True)
class _Samples:
    """Fractions of every piece and their weights in a mean over it, (n,) each."""

    fractions: Array
    weights: Array

    @classmethod
    def of(cls, trajectory: Trajectory) -> _Samples:
        """Twice as many as determine the polynomials of coordinates, if a motion has its own."""
        own = trajectory.coordinates
        degree = 0 if own is None else own.coefficients.shape[1] - 1
        parts = max(1, -(-2 * degree // DEGREE))
        fractions = ((np.arange(parts)[:, None] + POINTS) / parts).ravel()
        return cls(fractions, np.tile(WEIGHTS, parts) / parts)

    def mean_over_time(self, trajectory: Trajectory, rows: Array) -> float:
        """(1/T) ∫ ‖row‖ dt of samples of every piece, (K · n, m)."""
        sizes = np.linalg.norm(rows, axis=1).reshape(-1, len(self.weights))
        return float(sizes @ self.weights @ np.diff(trajectory.knots)) / trajectory.duration


def _norm(vector: Array) -> float:
    return float(np.linalg.norm(vector))
