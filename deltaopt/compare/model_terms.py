"""What a scene needs to be modelled: what happens if a term of the robot's model is left out.

A robot without a term is planned for as if it were the real one; that plan is then measured on the
robot with all terms: by how much it exceeds a limit there, and how far from the goal its torques
take the platform in open loop. A term that changes none of this need not be modelled.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from deltaopt.errors import DeltaOptError, Inexpressible
from deltaopt.files.progress_bar import Progress
from deltaopt.files.tables import text_table
from deltaopt.files.validated_record import Record
from deltaopt.mechanisms.delta.arm_loads import FRICTION
from deltaopt.planning.plan import Plan
from deltaopt.planning.planner import plan
from deltaopt.robot.drive import Drive
from deltaopt.robot.model import delta_model
from deltaopt.robot.robot import Robot, as_delta
from deltaopt.scene.scene import Scene
from deltaopt.verify.verification import verify

TOLERANCE = 1e-4
"""Of the plans, as a share of their durations: coarser drowns the effect of small terms, and finer
meshes do not converge where Coulomb friction changes its sign within a fraction of a millisecond.
"""


@dataclass(frozen=True)
class ModelTerm:
    """A term of a robot's model, by the key of its file, and what stands in its place without it.

    ``without``: a robot -> the robot without it; the same robot if it has no such term.
    """

    name: str
    instead: str
    without: Callable[[Robot], Robot]


@dataclass(frozen=True)
class TermEffect:
    """What leaving out a term does to a scene.

    ``shorter``: by what share the plan without it is too short; negative if it is longer.
    ``excess``: the largest share by which that plan exceeds a limit of the scene on the robot that
    has the term; 0 if it keeps them. ``miss``: distance of the platform from the goal at the end in
    open loop, m; None where rounding alone decides it. ``problem``: why there is no plan without
    it.
    """

    term: ModelTerm
    shorter: float = 0.0
    excess: float = 0.0
    miss: float | None = None
    problem: str = ""

    @property
    def size(self) -> float:
        """What terms are ranked by: the larger of the change of duration and the excess."""
        return max(abs(self.shorter), self.excess)


def effects_of_terms(scene: Scene, report: Progress) -> list[TermEffect]:
    """The effects of all terms of a scene's robot, the largest first.

    Raises DeltaOptError if the scene itself cannot be planned, and Inexpressible for a robot with a
    term that cannot be left out.
    """
    for load in delta_model(scene.robot, scene.payload).numbers.loads:
        if not isinstance(load, FRICTION):
            raise Inexpressible(f"the {load.words} of the robot's arms cannot be left out")
    reference = plan(scene, tolerance=TOLERANCE)
    terms = [(term, term.without(as_delta(scene.robot))) for term in MODEL_TERMS]
    present = [(term, other) for term, other in terms if other != scene.robot]
    found = []
    for done, (term, other) in enumerate(present):
        report(done / len(present), term.name)
        found.append(_effect(term, scene.model_copy(update={"robot": other}), scene, reference))
    report(1.0, "")
    return sorted(found, key=lambda effect: -effect.size)


def _effect(term: ModelTerm, without: Scene, scene: Scene, reference: Plan) -> TermEffect:
    try:
        planned = plan(without, tolerance=TOLERANCE)
    except DeltaOptError as error:
        return TermEffect(term, problem=str(error))
    found = verify(scene, planned.trajectory)
    worst = max((excess.value for excess in found.excesses.values()), default=0.0)
    shorter = 1 - planned.duration / reference.duration
    return TermEffect(term, shorter, max(worst, 0.0), found.arrival_distance)


def _part(key: str, values: Mapping[str, object]) -> Callable[[Robot], Robot]:
    """Without a term of the record under a key, which is replaced by these values."""

    def without(robot: Robot) -> Robot:
        part: Record | None = getattr(robot, key)
        if part is None or all(getattr(part, name) == value for name, value in values.items()):
            return robot
        return robot.model_copy(update={key: part.model_copy(update=values)})

    return without


def _drive(robot: Robot, values: Mapping[str, object]) -> Robot:
    """With other values of the drive, whose motor and gear are replaced by what they are at the
    arm."""
    keys = ("torque", "speed", "inertia", "friction", "torque_curve", "rms_torque")
    at_the_arm = {key: getattr(robot.drive, key) for key in keys}
    return robot.model_copy(update={"drive": Drive.model_validate(at_the_arm | dict(values))})


def _without_inertia(robot: Robot) -> Robot:
    return _drive(robot, {"inertia": None}) if robot.drive.inertia else robot


def _without_friction(*gone: str) -> Callable[[Robot], Robot]:
    """Without what these keys of friction say; the first of them says whether there is any."""

    def without(robot: Robot) -> Robot:
        friction = robot.drive.friction
        if friction is None or not getattr(friction, gone[0]):
            return robot
        left = {key: value for key, value in friction.model_dump().items() if key not in gone}
        return _drive(robot, {"friction": left if any(left.values()) else None})

    return without


def _level(robot: Robot) -> Robot:
    gravity = robot.gravity
    if not isinstance(gravity, tuple) or gravity[1:] == (0.0, 0.0):
        return robot
    size = sum(component**2 for component in gravity) ** 0.5
    return robot.model_copy(update={"gravity": (size, 0.0, 0.0) if gravity[0] > 0 else gravity})


MODEL_TERMS = (
    ModelTerm("drive.inertia", "none", _without_inertia),
    ModelTerm("drive.friction.viscous", "none", _without_friction("viscous")),
    ModelTerm("drive.friction.coulomb", "none", _without_friction("coulomb", "speed")),
    ModelTerm("upper_arm.mass", "none", _part("upper_arm", {"mass": 0.0, "inertia": None})),
    ModelTerm("upper_arm.inertia", "that of a slender bar", _part("upper_arm", {"inertia": None})),
    ModelTerm("upper_arm.centre", "the middle", _part("upper_arm", {"centre": None})),
    ModelTerm("elbow.mass", "none", _part("elbow", {"mass": 0.0})),
    ModelTerm("forearm.mass", "none", _part("forearm", {"mass": 0.0, "inertia": None})),
    ModelTerm("forearm.inertia", "those of slender bars", _part("forearm", {"inertia": None})),
    ModelTerm("platform.pins", "none", _part("platform", {"pins": None})),
    ModelTerm("tool.mass", "none", _part("tool", {"mass": None})),
    ModelTerm("gravity", "none", lambda robot: robot.model_copy(update={"gravity": 0.0})),
    ModelTerm("gravity, its tilt", "straight down", _level),
)
"""Every term of a robot file that has mass, inertia, weight or friction."""


def terms_table(effects: list[TermEffect]) -> list[str]:
    """The lines of a table of effects, for people."""
    rows = [("left out", "instead", "plan shorter by", "limit exceeded by", "misses the goal by")]
    for effect in effects:
        name, instead = effect.term.name, effect.term.instead
        if effect.problem:
            rows.append((name, instead, f"no plan: {effect.problem}", "", ""))
            continue
        miss = "-" if effect.miss is None else f"{1e3 * effect.miss:.3g} mm"
        rows.append((name, instead, f"{effect.shorter:.2%}", f"{effect.excess:.2%}", miss))
    return text_table(rows)
