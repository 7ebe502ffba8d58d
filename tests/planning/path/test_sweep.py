"""Sweeps over rows with known answers: rows that lose their u at a point and on an interval, rows
that bound speeds, and the compiled sweep beside the linear program."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt.planning.path import sweep
from deltaopt.planning.path.path_mesh import MeshMotion, PathMesh
from deltaopt.planning.path.path_rows import AffineRows
from deltaopt.planning.path.sweep import Unattainable, swept
from deltaopt.scene.path import Line
from tests.oracles.compiled_sweep import compiled_sweep


def mesh_of(cells: int) -> PathMesh:
    """Even cells of a line of length 1."""
    return PathMesh.of(Line().between((0, 0, 0), (1, 0, 0)), np.linspace(0, 1, cells + 1))


def test_nodes_that_crowd_where_a_motion_nearly_stops_are_one():
    """Cells of no length have no speed."""
    path = Line().between((0, 0, 0), (1, 0, 0))
    crowded = np.array([0.0, 0.2, 0.2, 0.2 + 1e-13, 0.6, 0.6 - 1e-13, 1.0])
    np.testing.assert_allclose(PathMesh.of(path, crowded).nodes, [0, 0.2, 0.6, 1], atol=1e-12)


def ends_of(mesh: PathMesh) -> np.ndarray:
    return np.stack([mesh.nodes[:-1], mesh.nodes[1:]], axis=1).ravel()


def rows_of(*columns) -> AffineRows:
    """From (alpha, beta, low, high) of each row."""
    arrays = [np.stack(np.broadcast_arrays(*each), axis=1) for each in zip(*columns, strict=True)]
    return AffineRows(*(np.array(each, dtype=float) for each in arrays))


def duration(mesh: PathMesh, rows: AffineRows, start: float = 0.0, goal: float = 0.0) -> float:
    return MeshMotion.of(mesh, compiled_sweep(mesh.h, rows, start, goal)).duration


def test_a_speed_limit_is_held():
    """Accelerate to v = 0.5 at 2 m/s², coast, brake: L / v + v / a."""
    mesh = mesh_of(64)  # the switches are nodes
    s = ends_of(mesh)
    rows = rows_of(
        (1 + 0 * s, 0 * s, -2 + 0 * s, 2 + 0 * s), (0 * s, 1 + 0 * s, -np.inf + 0 * s, 0.25 + 0 * s)
    )
    assert duration(mesh, rows) == pytest.approx(1 / 0.5 + 0.5 / 2, rel=1e-12)


def test_given_speeds_at_the_ends():
    """From ṡ = 1 to ṡ = 1/2 with |u| <= 2: v² = 1 + 4 s meets v² = 1/4 + 4 (1 - s)."""
    mesh = mesh_of(64)
    s = ends_of(mesh)
    rows = rows_of((1 + 0 * s, 0 * s, -2 + 0 * s, 2 + 0 * s))
    top = np.sqrt((1 + 0.25 + 4) / 2)
    assert duration(mesh, rows, 1.0, 0.25) == pytest.approx((2 * top - 1.5) / 2, rel=1e-4)
    with pytest.raises(Unattainable) as found:
        duration(mesh, rows, 4.5, 0.25)
    assert found.value.node is None


def test_a_coefficient_that_vanishes_on_an_interval():
    """Between 0.3 and 0.7 nothing accelerates but b <= 1: the speed may jump there."""
    mesh = mesh_of(2000)
    s = ends_of(mesh)
    middles = np.repeat((mesh.nodes[1:] + mesh.nodes[:-1]) / 2, 2)
    alpha = np.where((middles > 0.3) & (middles < 0.7), 0.0, 1.0)
    one = np.ones_like(s)
    rows = rows_of((alpha, 0 * s, -one, one), (0 * s, one, -np.inf * one, one))
    expected = 2 * np.sqrt(2 * 0.3) + 0.4
    assert duration(mesh, rows) == pytest.approx(expected, rel=1e-3)


def test_a_zero_inertia_point():
    """A row (s - 1/2) u + b <= 1 has no u at 1/2, where b is 1 at most. Left of it the row bounds u
    from below, right of it from above. With b = 1 + c (s - 1/2): b' / 2 = c / 2 and
    (s - 1/2) c / 2 + c (s - 1/2) <= 0, so that through the point b = 1 is the fastest: T is that of
    b = min(2 a s, 1, 2 a (1 - s)) with |u| <= a."""
    a, mesh = 4.0, mesh_of(64)
    s, one = ends_of(mesh), np.ones(128)
    rows = rows_of((one, 0 * s, -a * one, a * one), (s - 0.5, one, -np.inf * one, one))
    found = compiled_sweep(mesh.h, rows, 0.0, 0.0)
    nearby = np.abs(mesh.nodes - 0.5) < 0.05
    assert found.b[mesh.nodes == 0.5] == pytest.approx(1.0, abs=1e-9)
    assert np.abs(found.b[nearby] - 1.0).max() < 0.05
    fine = mesh_of(4096)
    s, one = ends_of(fine), np.ones(8192)
    rows = rows_of((one, 0 * s, -a * one, a * one), (s - 0.5, one, -np.inf * one, one))
    reference = duration(fine, rows)
    coarse = MeshMotion.of(mesh, found).duration
    assert coarse == pytest.approx(reference, rel=2e-3)


@pytest.mark.parametrize("seed", range(12))
def test_the_compiled_sweep_and_the_linear_program_agree(seed):
    """On random rows, some of them without lower bounds or u, and with points of zero inertia."""
    if sweep.compiled() is None:
        pytest.skip("no compiler")
    rng, mesh = np.random.default_rng(seed), mesh_of(90)
    s = ends_of(mesh)
    columns = []
    for _ in range(5):
        phase, swing = rng.uniform(0, 7, 2)
        alpha = np.sin(swing * s + phase) * (rng.random() < 0.8)
        beta = rng.normal() * np.cos(swing * s)
        low = np.where(rng.random() < 0.3, -np.inf, -1.0) + 0 * s
        columns.append((alpha, beta, low, 1.0 + 0 * s))
    columns.append((0 * s, 1 + 0 * s, -np.inf + 0 * s, 20 + 0 * s))
    columns.append((1 + 0 * s, 0 * s, -30 + 0 * s, 30 + 0 * s))
    rows = rows_of(*columns)
    quick = compiled_sweep(mesh.h, rows, 0.0, 0.0)
    slow = swept(mesh.h, rows, 0.0, 0.0)
    np.testing.assert_allclose(slow.b, quick.b, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(slow.u, quick.u, rtol=1e-5, atol=1e-5)
