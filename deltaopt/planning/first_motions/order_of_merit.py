"""First motions of a scene in order of merit, and the mesh that each of them can start on.

A local optimiser finds the best motion near its first one. The straight line is that of most
moves. Where it is blocked or slow, others are compared by how fast they can be driven. Where none
of those leads to a plan, paths over grids of the workspace follow (``roadmap``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain, islice, tee

import numpy as np

from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.errors import RULED_OUT, NotConverged, Unreachable, if_possible
from deltaopt.motion.loads import sizes_at
from deltaopt.motion.lower_bound import lower_bound
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.first_motions.around_bodies import axis_within_reach
from deltaopt.planning.first_motions.bands import without_bodies
from deltaopt.planning.first_motions.initial_motion import (
    PARABOLAS_AND_CUBICS,
    Proposal,
    detour,
    joint_line,
    line,
    roughly_fastest,
)
from deltaopt.planning.first_motions.roadmap import STEPS, roadmap_motions, spacing
from deltaopt.planning.path.path_planning import fastest_on_path, roughly_on_path
from deltaopt.problem.of_scene import problem_of
from deltaopt.problem.problem import Problem
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.parallel_singularity import leads_through_singularity, require_ends_on_one_side
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import distance

SLOW = 20.0
"""How many times the lower bound a straight line, of the platform or in motor angles, may take
before others are compared with it. Hardly any takes so long (docs/dev/first-motions.md says how
long they take): a smaller one would compare curves, at half the time of a plan, for nothing."""
_USUAL = 10.0
"""Below how many times √(distance · mass / force of the motors) a motion is not slow, which is
known at once, without the lower bound."""
_OF_AXIS = 1e-3
"""Relative gap of the motion on the path that a tube is about."""
_FINEST = 8
"""By what factor a first mesh may be finer than was asked for, so that a first motion stays in the
workspace between its knots. A larger one would admit motions that only graze the workspace."""
_OF_A_GRID = 2
"""How many motions on the path of a grid are tried, the fastest first; they differ in how corners
are rounded alone."""
_PIECES = 8
"""Cubics that stand for a first motion where it is tried whether it stays in a tube."""
_TRIED = np.linspace(0.0, 1.0, 8, endpoint=False)
"""Fractions of an interval at which it is tried whether a motion stays in the workspace."""
_TRIED_IN_ONE = np.linspace(0.0, 1.0, 128, endpoint=False)
_TRIED_IN_MANY = np.array([0.0, 0.5])
"""Fractions of an interval at which it is tried on which side of the parallel singularity a motion
is, of one interval or of many, at first: where it comes near, at more of them."""


def first_motion(scene: Scene) -> Trajectory:
    """The best first motion that there is. Raises Unreachable if there is none."""
    return next(in_order_of_merit(scene))


def in_order_of_merit(scene: Scene) -> Iterator[Trajectory]:
    """First motions, the best one first; each is made when it is asked for.

    Raises Unreachable if there is none, with what was searched, and at which resolution.
    """
    return (proposal.motion for proposal in chain.from_iterable(rounds(scene)))


def rounds(scene: Scene) -> Iterator[Iterator[Proposal]]:
    """First motions in order of merit, in two rounds: lines and curves, then paths over a grid. In
    a tube its axis alone, unless that is ruled out, and then the axis within reach and those that
    stay in the tube.

    The second takes longer, and is better where the workspace is narrow. Raises Unreachable after
    the second round if there was no motion in either, and Infeasible before it where every path
    leads through a parallel singularity.
    """
    if scene.tube is not None:
        # It may lead through bodies. It is not slowed to its limits between points of a mesh: under
        # friction that can take twenty times as long as to plan from it.
        axis = if_possible(RULED_OUT, roughly_on_path, _along_axis(scene), _OF_AXIS)
        if axis is not None:
            yield iter([Proposal("the tube's axis", axis)])
            return
    simple = _lines_and_curves(scene)
    if scene.tube is not None:
        simple = (p for p in simple if _is_in_tube(scene, _cubics(p.motion, _PIECES)))
        drawn = axis_within_reach(without_bodies(scene))
        simple = chain([Proposal("the tube's axis, within reach", drawn)] if drawn else [], simple)
    simple, seen = tee(simple)
    yield simple
    require_ends_on_one_side(scene)
    over_a_grid, seen_too = tee(_over_a_grid(scene))
    yield over_a_grid
    if not any(True for _ in chain(seen, seen_too)):
        raise Unreachable(what_was_searched(scene))


def require_axis(scene: Scene) -> None:
    """Raise Infeasible, Unreachable or Singular where the path that a scene's tube is about cannot
    be driven, whatever bodies are on it."""
    fastest_on_path(_along_axis(scene), _OF_AXIS, lambda _: None)


def _along_axis(scene: Scene) -> Scene:
    """A scene in a tube as if its tool had to stay on the tube's axis, and there were no bodies."""
    return without_bodies(scene.on_its_path)


_SIMPLE: tuple[tuple[str, Callable[[Scene], Trajectory]], ...] = (
    ("a straight line", line),
    ("a straight line of the motor angles", joint_line),
    ("the best curve", detour),
)


def _lines_and_curves(scene: Scene) -> Iterator[Proposal]:
    """A line that is not slow, and then slow lines, lines not looked at yet and the best curve, in
    order of their duration."""
    slow, ahead = list[Proposal](), list(_SIMPLE)
    while len(ahead) > 1:
        proposal = _driven(scene, *ahead.pop(0))
        if proposal is None:
            continue
        if not is_slow(scene, proposal.motion.duration, SLOW):
            yield proposal
            break
        slow.append(proposal)
    others = [_driven(scene, *simple) for simple in ahead]
    possible = slow + [proposal for proposal in others if proposal is not None]
    yield from sorted(possible, key=lambda proposal: proposal.motion.duration)


def _over_a_grid(scene: Scene) -> Iterator[Proposal]:
    """Motions on the path of the coarsest grid that has one."""
    for steps in STEPS:
        ways = (
            m
            for m in roadmap_motions(scene, steps)
            if not crosses_singularity(problem_of(scene), m)
        )
        motions = list(islice(ways, _OF_A_GRID))
        if motions:
            yield from (Proposal("a path over a grid", motion) for motion in motions)
            return


def _driven(scene: Scene, name: str, make: Callable[[Scene], Trajectory]) -> Proposal | None:
    """A motion as fast as the limits roughly allow; None if they rule it out, or it leads through a
    singularity."""

    def driven() -> Trajectory:
        made = make(scene)
        return made if make is detour else roughly_fastest(scene, made)

    found = if_possible(RULED_OUT, driven)
    if found is None or (make is not line and crosses_singularity(problem_of(scene), found)):
        return None
    return Proposal(name, found)


def is_slow(scene: Scene, duration: float, times: float) -> bool:
    """Whether a duration, s, is more than so many times the lower bound, and unusual too."""
    energies, lever = problem_of(scene).model.energies, scene.robot.lever
    mass = scene.robot.platform_mass + (scene.payload or 0.0)
    if energies is not None:  # arms as masses at their elbows
        mass += 3 * energies.arm_inertia / lever**2
    force = sum(scene.robot.torque_limits) / lever
    if duration < _USUAL * (distance(scene.task) * mass / force) ** 0.5:
        return False  # the lower bound would cost a tenth of a plan
    return duration > times * lower_bound(scene)


def what_was_searched(scene: Scene) -> str:
    """A sentence for a move for which no first motion is found."""
    finest = 1e3 * spacing(scene, STEPS[-1])
    return (
        "no way leads from start to goal: neither a straight line of the platform, nor one in the "
        f"motor angles, nor one of {PARABOLAS_AND_CUBICS} curves, nor a path over a grid of places "
        f"where the platform can be held, {finest:.3g} mm apart"
    )


def intervals_for(motion: Trajectory, intervals: int) -> int:
    """With how many equal intervals, at least those given, cubics through a motion's states at the
    knots stay in the workspace; 0 if not with ``_FINEST`` times as many either."""
    if len(motion.knots) == 2 and motion.position.coefficients.shape[1] == 6:  # a straight line:
        return intervals  # such cubics do not leave it
    for factor in (1, 2, 4, _FINEST):
        cubics = _cubics(motion, factor * intervals)
        alignments = motion.model.alignments(cubics.inside(*cubics.everywhere(_TRIED)))
        if (alignments > 0).all():  # False where not a number
            return factor * intervals
    return 0


def intervals_in_tube(scene: Scene, motion: Trajectory, intervals: int) -> int:
    """With how many equal intervals, at least those given and at most ``_FINEST`` times as many,
    cubics through a motion's states at the knots stay in the tube of a scene, if with any."""
    stays = (each for each in (1, 2, 4) if _is_in_tube(scene, _cubics(motion, each * intervals)))
    return next(stays, _FINEST) * intervals


def _is_in_tube(scene: Scene, cubics: PiecewisePolynomial) -> bool:
    """Whether cubics stay in the tube of a scene, at samples."""
    rows = limits_of(scene).constraints.slid_along
    sizes = sizes_at(problem_of(scene), cubics.coefficients, np.diff(cubics.knots), _TRIED)
    return bool(sizes[:, :, rows].max() <= 1)


def _cubics(motion: Trajectory, intervals: int) -> PiecewisePolynomial:
    """Cubics through the states of a motion at the ends of so many equal intervals."""
    knots = np.linspace(motion.knots[0], motion.knots[-1], intervals + 1)
    return PiecewisePolynomial.hermite(knots, *motion.position.with_rate_at(knots))


class CrossesSingularity(NotConverged):
    """The motion found passes through a parallel singularity, which no torques allow."""


def crosses_singularity(problem: Problem, motion: Trajectory) -> bool:
    """Whether a motion passes through a parallel singularity, as far as samples show."""
    knots, one = motion.knots, len(motion.knots) == 2
    pieces, since = motion.position.everywhere(_TRIED_IN_ONE if one else _TRIED_IN_MANY)
    t = np.append(knots[pieces] + since, knots[-1])
    return leads_through_singularity(problem.model, motion.position, t)
