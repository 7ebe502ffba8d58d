"""The motion on a first mesh alone: it tells how fast a way is, and is what plans begin with."""

from __future__ import annotations

from dataclasses import replace

from deltaopt.curves.piecewise import Array
from deltaopt.errors import ENDS_AN_ATTEMPT, if_possible
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.mesh.constraint_tightening import first_tightening, points_apart
from deltaopt.planning.mesh.edges import next_phases
from deltaopt.planning.nlp.problem import Formulated, Guess, MeshProgram, Solved
from deltaopt.planning.nlp.scaling import Scaling


def motion_on_first_mesh(
    program: Formulated, scaling: Scaling, guess: Guess, mesh: Array
) -> Trajectory:
    """The motion that solves a program on a mesh. Where it touches edges of
    bodies it is solved again in phases that meet on them; the faster of both is returned. Raises
    NotConverged.

    On a coarse mesh a motion passes an edge between two points, and a solver hardly ever moves it
    to another pair. An edge that is rounded by less than the points are apart is as sharp to it.
    """
    own = program(mesh)
    motion, solution = _solved(own, scaling, guess)
    apart = float(points_apart(scaling.problem, motion, own.mesh).max())
    faces = next_phases(own, scaling, motion, solution, sharp=apart)
    if faces is None:
        return motion
    past, begin = replace(scaling, faces=faces), replace(guess, trajectory=motion)
    mesh = faces.on(own.mesh, scaling.problem.together)
    found = if_possible(ENDS_AN_ATTEMPT, _solved, program(mesh), past, begin)
    return found[0] if found and found[0].duration < motion.duration else motion


def _solved(program: MeshProgram, scaling: Scaling, guess: Guess) -> tuple[Trajectory, Solved]:
    """The motion that solves a program, and the solution. Raises NotConverged."""
    model = guess.trajectory.model
    tightened = first_tightening(scaling, guess.trajectory, program.mesh)
    found = program.solve(guess, tightened)
    return Trajectory(found.position, model, found.coordinates), found
