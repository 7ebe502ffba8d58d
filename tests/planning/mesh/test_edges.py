"""Motions over sharp edges of bodies in phases: faces against distances, a wall against Ipopt."""

from __future__ import annotations

from operator import itemgetter

import casadi as ca
import numpy as np
import pytest

from deltaopt import Limits, State, plan
from deltaopt.mechanisms.instant import AnyInstant, PlatformInstant
from deltaopt.motion.sure_bounds import distances_from_faces, signed_distances
from deltaopt.planning.flat.interior_point import IntervalPoints
from deltaopt.planning.mesh.edges import phases_over_edges
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import delta_model
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.objective import Effort
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import load_scene
from deltaopt.verify.verification import verify
from studies.problems import PROBLEMS
from tests.oracles.point_motion import End, Instant, Leg, Row, System, fastest

WALL = load_scene(PROBLEMS / "keep_out" / "wall_25_305_25.yaml")
EDGE = (0.825, 0.13)
"""Of the wall, where the motion touches it: depth and y."""
LAST, FIRST = (*EDGE, 0.0), (0.825, -0.13, 0.0)
"""The middles of the wall's edges."""
CORNERS = [[0.9, 0.0, 0.0], [1.1, 0.1, 0.0], [1.1, -0.1, 0.05], [1.1, 0.0, 0.1], [0.95, 0.1, 0.1]]
PLACE = np.array([0.95, 0.1, 0.0])
BODIES = {
    "box": {"box": {"from": [0.82, 0.08, -0.11], "to": [0.96, 0.14, 0.11]}},
    "cylinder": {"cylinder": {"from": [0.9, 0.1, 0.0], "to": [1.1, 0.15, 0.1], "radius": 0.05}},
    "hull": {"hull": {"points": CORNERS}},
}


@pytest.fixture(scope="module")
def over_the_wall():
    return plan(WALL, tolerance=1e-4)


def with_body(body: dict, **keys: object) -> Scene:
    """The scene of the wall with another body instead."""
    content = WALL.model_dump(exclude_none=True) | {"keep_out": [body]} | keys
    return Scene.model_validate(content | {"robot": WALL.robot})


@pytest.mark.parametrize("name", BODIES)
def test_outside_of_a_body_is_outside_of_one_of_its_faces(name):
    """At places about it. Inside its distance is that of the nearest face, and outside no face is
    farther away than the body."""
    scene = with_body(BODIES[name])
    x = PLACE + np.random.default_rng(1).uniform(-0.3, 0.3, (20_000, 3))
    body, faces = (
        signed_distances(problem_of(scene), x)[0][:, 0],
        distances_from_faces(problem_of(scene), x, 0),
    )
    assert faces.shape[1] == {"box": 6, "cylinder": 3, "hull": 6}[name]
    assert (faces.max(axis=1) <= body + 1e-12).all()
    np.testing.assert_array_equal(faces.max(axis=1) > 1e-9, body > 1e-9)
    inside = body < -1e-9
    assert inside.sum() > 100
    np.testing.assert_allclose(faces.max(axis=1)[inside], body[inside], atol=1e-11)


def distances(scene: Scene, numbers: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Of places from the body of the first row, with other numbers."""
    constraints = limits_of(scene).constraints
    point, own = ca.SX.sym("x", 3), constraints.numbers()
    motion, row = AnyInstant(constraints.motors), int(np.flatnonzero(constraints.convex)[0])
    motion.x = point
    function = ca.Function("d", [point, own], [constraints.measures(motion, own)[row]])
    found = function.map(len(x))(x.T, np.repeat(numbers[:, None], len(x), axis=1))
    return np.asarray(found)[0]


def test_the_wall_is_crossed_on_its_edge(over_the_wall):
    """A knot lies on it to nanometres, and the motion is clear of the wall."""
    found = over_the_wall
    assert found.within_tolerance
    verified = verify(WALL, found.trajectory)
    assert verified.ok, verified.failures()
    knots = found.trajectory.position.at(found.trajectory.knots)
    assert np.linalg.norm(knots[:, :2] - EDGE, axis=1).min() < 1e-8
    x = found.trajectory.position.at(np.linspace(0.0, found.duration, 100_001))
    assert signed_distances(problem_of(WALL), x)[0][:, 0].min() >= -1e-9


@pytest.mark.parametrize(
    ("speed", "via", "edges", "keys", "tolerance"),
    [
        (0.0, [], [LAST], {}, 1e-5),
        (0.6, [], [LAST], {}, 1e-5),
        (0.0, [(0.835, 0.14, 0.0)], [LAST], {}, 1e-4),
        (0.0, [], [LAST], {"limits": Limits(jerk=1e4)}, 1e-4),
        (0.0, [(0.8, 0.0, 0.0)], [LAST], {"limits": Limits(jerk=1e4)}, 1e-3),
        (0.0, [], [FIRST, LAST], {"objective": Effort(duration=0.2)}, 1e-4),
    ],
)
def test_a_via_point_on_the_edge_without_the_wall_costs_as_much(speed, via, edges, keys, tolerance):
    """From rest, from motion, with another via point beside or above the wall, with limited jerk,
    and of effort, which leads over both edges. The wall's motion passes the middle of each edge, by
    symmetry, and touches nothing else. From motion it swerves to one side by 3 mm before it comes
    to the wall, which spares 4e-6: one that lies in the plane of symmetry is stationary too, so
    that a start of 1 µm/s to one side decides."""
    start = State(at=WALL.start, velocity=(0.0, speed, 1e-6)) if speed else WALL.start
    wall = WALL.model_copy(update={"start": start, "via": via or None, **keys})
    ours = plan(wall, tolerance=tolerance)
    in_order = sorted([*edges, *via], key=itemgetter(1))
    through = wall.model_copy(update={"keep_out": None, "via": in_order})
    theirs = plan(through, tolerance=tolerance)
    assert ours.within_tolerance
    assert theirs.within_tolerance
    assert ours.cost == pytest.approx(theirs.cost, rel=ours.gap + theirs.gap)


def test_no_motion_over_the_edge_is_faster_by_ipopt():
    """In two phases that meet anywhere on the edge, by another transcription on the same mesh, and
    without the wall beside it: a bound from below. Its guess is half as fast, for the quintics of
    the duration itself are far beyond the motors."""
    found = plan(WALL, tolerance=5e-3)
    knots = found.trajectory.knots
    x = found.trajectory.position.at(knots)
    passed = int(np.linalg.norm(x[:, :2] - EDGE, axis=1).argmin())
    model = delta_model(WALL.robot, WALL.payload)
    limits = limits_of(WALL)
    torque, speed = limits.upper("torque"), limits.upper("speed")

    def at(now: Instant) -> PlatformInstant:
        p = ca.SX(ca.DM(model.parameters))
        return PlatformInstant(model.functions, now.x, now.v, now.a, p, torque * now.tau)

    def rows(now: Instant) -> list[Row]:
        rates = at(now).dtheta
        return [Row(now.tau[k]) for k in range(3)] + [Row(rates[k] / speed[k]) for k in range(3)]

    robot = System(3, 2, lambda now: at(now).force / 100, rows)
    place, rate = found.trajectory.position.with_rate_at(knots[[0, passed, -1]])
    slower = 2.0
    ends = []
    for k, fixed in enumerate(([1, 1, 1], [1, 1, 0], [1, 1, 1])):
        state = np.array([place[k], rate[k] / slower, np.zeros(3)])
        state[0, :2] = EDGE if k == 1 else state[0, :2]
        given = np.array([fixed, [k != 1] * 3, [0, 0, 0]], dtype=bool)
        ends.append(End(state, given, np.zeros(3)))
    spans = (knots[: passed + 1], knots[passed:])
    sizes = [float(k[-1] - k[0]) for k in spans]
    legs = [
        Leg(np.diff(k) / size, slower * size, np.zeros(1))
        for k, size in zip(spans, sizes, strict=True)
    ]
    theirs = fastest(robot, legs, ends, IntervalPoints.of([0, 1 / 3, 2 / 3, 1]))
    assert found.meshes[-1].duration == pytest.approx(theirs.sum(), rel=1e-4)
    assert found.duration / (1 + found.gap) <= theirs.sum()


def test_a_motion_that_touches_no_edge_has_no_phases():
    """Neither one that is clear of the body, nor one that touches rounded edges."""
    rounded = WALL.model_copy(update={"clearance": 0.002})
    for scene in (WALL, rounded):
        found, problem = plan(scene), problem_of(scene)
        of_all = len(found.trajectory.knots) - 1, problem.limits.constraints.number
        touching = np.zeros(of_all, bool) if scene is WALL else np.ones(of_all, bool)
        assert phases_over_edges(problem, found.trajectory, touching) is None
