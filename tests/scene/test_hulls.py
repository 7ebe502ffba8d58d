"""Convex hulls, of points and of STL files."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
import yaml

from deltaopt.errors import SceneError
from deltaopt.scene.convex_hull import NoHull, convex_hull
from deltaopt.scene.scene_file import corners_in, load_scene
from studies.problems import PROBLEMS

CUBE = np.array(list(product((0.0, 1.0), repeat=3)))


def volume(points, faces):
    a, b, c = (points[faces[:, k]] for k in range(3))
    return (a * np.cross(b, c)).sum() / 6


@pytest.mark.parametrize("seed", range(5))
def test_all_points_are_inside_and_the_surface_is_closed(seed):
    points = np.random.default_rng(seed).normal(size=(200, 3))
    faces = convex_hull(points)
    a, b, c = (points[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    assert ((points[:, None] - a) * normals).sum(axis=2).max() < 1e-9
    edges = [(f[k], f[(k + 1) % 3]) for f in faces.tolist() for k in range(3)]
    assert len(set(edges)) == len(edges) == 3 * (len(np.unique(faces)) * 2 - 4)  # Euler
    assert {(q, p) for p, q in edges} == set(edges)


def test_a_cube_with_points_on_its_sides():
    rng = np.random.default_rng(1)
    inside = rng.uniform(size=(300, 3))
    inside[:150, 0] = 1.0
    points = np.vstack([inside, CUBE])
    faces = convex_hull(points)
    assert volume(points, faces) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("flat", [CUBE[:3], CUBE * [1, 1, 0], CUBE * [0, 0, 1]])
def test_points_in_a_plane_have_no_hull(flat):
    with pytest.raises(NoHull):
        convex_hull(flat)


def stl(points, faces, kind):
    triangles = points[faces]
    if kind == "text":
        vertices = ["\n".join(f"vertex {x} {y} {z}" for x, y, z in t) for t in triangles]
        loops = [f"facet normal 0 0 0\nouter loop\n{v}\nendloop\nendfacet" for v in vertices]
        return "\n".join(["solid part", *loops, "endsolid part"]).encode()
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows = np.zeros(len(triangles), record)
    rows["corners"] = triangles
    return b"solid".ljust(80) + len(rows).to_bytes(4, "little") + rows.tobytes()


@pytest.mark.parametrize("kind", ["text", "binary"])
def test_a_scene_with_an_stl_file(tmp_path, kind):
    points = 0.25 * CUBE + [2.0, 0.0, 0.0]
    (tmp_path / "part.stl").write_bytes(stl(points, convex_hull(points), kind))
    np.testing.assert_array_equal(corners_in(tmp_path / "part.stl"), points)
    content = yaml.safe_load((PROBLEMS / "pick_and_place.yaml").read_text(encoding="utf-8"))
    content |= {
        "robot": str(PROBLEMS / "robots" / "orsino.yaml"),
        "keep_out": [{"hull": {"file": "part.stl"}}],
    }
    file = tmp_path / "scene.yaml"
    file.write_text(yaml.safe_dump(content), encoding="utf-8")
    (body,) = load_scene(file).keep_out
    assert sorted(body.shape.points) == sorted(map(tuple, points.tolist()))
    (tmp_path / "part.stl").write_bytes(b"solid nothing")
    with pytest.raises(
        SceneError, match=r"part.stl has no triangles; expected an STL file"
    ) as said:
        load_scene(file)
    assert said.value.key == "keep_out[0].hull.file"
