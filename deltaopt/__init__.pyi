"""The public names and where they are: what type checkers read, and the package itself, which loads
a name when it is first used. Those of ``deltaopt.research`` are not among ``__all__``."""

from deltaopt.designs.design import design as design
from deltaopt.errors import (
    DeltaOptError as DeltaOptError,
    EndMoves as EndMoves,
    Inexpressible as Inexpressible,
    Infeasible as Infeasible,
    MissingPackage as MissingPackage,
    NotConverged as NotConverged,
    SceneError as SceneError,
    Singular as Singular,
    Unreachable as Unreachable,
    Unusable as Unusable,
)
from deltaopt.files.progress_bar import ProgressBar as ProgressBar
from deltaopt.files.version import __version__ as __version__
from deltaopt.motion.trajectory import Motion as Motion, Trajectory as Trajectory
from deltaopt.output.saved_plan import (
    SavedPlan as SavedPlan,
    UnreadablePlan as UnreadablePlan,
    load_plan as load_plan,
)
from deltaopt.planning.cycles.cycle_plan import CyclePlan as CyclePlan
from deltaopt.planning.cycles.cycle_planning import plan_cycle as plan_cycle
from deltaopt.planning.comparisons import (
    beside_free_path as beside_free_path,
    timed_line as timed_line,
)
from deltaopt.planning.first_motions.initial_motion import baseline as baseline
from deltaopt.planning.plan import Plan as Plan
from deltaopt.planning.planner import Planner as Planner, plan as plan
from deltaopt.research import (
    AccelerationLevel as AccelerationLevel,
    Baumgarte as Baumgarte,
    InteriorPoint as InteriorPoint,
    Ipopt as Ipopt,
    KnotConstraints as KnotConstraints,
    PiecewiseAcceleration as PiecewiseAcceleration,
    Projection as Projection,
    Redundant as Redundant,
    explicit as explicit,
    flat as flat,
    forward as forward,
    interior_point as interior_point,
    ipopt as ipopt,
    kane as kane,
    multiplier as multiplier,
    virtual_work as virtual_work,
)
from deltaopt.robot.model import DeltaModel as DeltaModel
from deltaopt.robot.robot import Robot as Robot, load_robot as load_robot
from deltaopt.robot.tool import Box as Box, Sphere as Sphere, Tool as Tool
from deltaopt.scene.bodies import (
    Body as Body,
    Cylinder as Cylinder,
    HalfSpace as HalfSpace,
    Hull as Hull,
)
from deltaopt.scene.moving_ends import Anywhere as Anywhere, Belt as Belt, State as State
from deltaopt.scene.objective import (
    Effort as Effort,
    SmoothMotion as SmoothMotion,
    SmoothTorque as SmoothTorque,
    Time as Time,
    TimeAndEffort as TimeAndEffort,
    TimeAndEfforts as TimeAndEfforts,
    TimeAndJerk as TimeAndJerk,
    TimeAndTorqueRate as TimeAndTorqueRate,
)
from deltaopt.scene.path import (
    Corners as Corners,
    Curve as Curve,
    Line as Line,
    PickAndPlace as PickAndPlace,
)
from deltaopt.scene.known_limits import Limits as Limits
from deltaopt.scene.scene import Scene as Scene
from deltaopt.scene.cycle import Cycle as Cycle
from deltaopt.scene.scene_file import load_cycle as load_cycle, load_scene as load_scene
from deltaopt.sensitivity.sensitivity import Sensitivity as Sensitivity
from deltaopt.sweeps.cell_map import load_cell as load_cell
from deltaopt.sweeps.sweep import sweep as sweep
from deltaopt.sweeps.sweep_file import Sweep as Sweep
from deltaopt.verify.verification import Verification as Verification, verify as verify
