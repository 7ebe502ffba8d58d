"""Cams for PLCs, read back and evaluated as a PLC does, by code of the test's own."""

from __future__ import annotations

import csv
import re

import numpy as np
import pytest

import deltaopt
from deltaopt.cli import main
from deltaopt.output.cam_tables import BLEND, without_jumps
from deltaopt.output.joint_table import JointTable

ZERO, SPEED = 0.0929912, 360.0
SIGN = np.array([1, -1, 1])


@pytest.fixture(scope="module")
def exported(saved_otherwise, tmp_path_factory):
    folder = tmp_path_factory.mktemp("cam")
    words = ["--unit", "deg", "--master-speed", str(SPEED), "-o", str(folder)]
    assert main(["export", "cam", str(saved_otherwise), *words]) == 0
    return folder


def points_of(text: str) -> list[np.ndarray]:
    """The cams of a file of structured text: per motor master, position, velocity, acceleration."""
    text = re.sub(r"\(\*.*?\*\)", "", text, flags=re.S)
    names = ("MasterPos", "SlavePos", "SlaveVelo", "SlaveAcc")
    if "SMC_CAMXYVA" in text:
        names = ("dX", "dY", "dV", "dA")
    number = r" := (-?\d+\.\d+(?:E-?\d+)?)"  # an LREAL literal has a decimal point
    cams = []
    for first, last, body in re.findall(
        r"ARRAY\[(\d+)\.\.(\d+)\] OF \w+ := \[(.*?)\];", text, re.S
    ):
        points = np.array(re.findall(", ".join(name + number for name in names), body), float)
        assert len(points) == int(last) - int(first) + 1 == body.count("(")
        cams.append(points)
    return cams


def evaluated(points: np.ndarray, master: np.ndarray) -> tuple[np.ndarray, ...]:
    """Slave position, velocity, acceleration: each piece by six equations for six coefficients."""
    k = np.clip(np.searchsorted(points[:, 0], master, side="right") - 1, 0, len(points) - 2)
    found = np.zeros((3, len(master)))
    for i in range(len(points) - 1):
        (m0, y0, v0, a0), (m1, y1, v1, a1) = points[i : i + 2]
        h = m1 - m0
        rows = [[0, 0, 0, 1], [0, 0, 1, 0], [0, 2, 0, 0]]
        rows += [[1, 1, 1, 1], [3, 2, 1, 0], [6, 2, 0, 0]]
        A = np.zeros((6, 6))
        A[:3, 2:], A[3:, 2:] = rows[:3], rows[3:]
        A[3:, :2] = [[1, 1], [5, 4], [20, 12]]
        c = np.linalg.solve(A, [y0, v0 * h, a0 * h**2, y1, v1 * h, a1 * h**2])
        inside = k == i
        u = (master[inside] - m0) / h
        for order in range(3):
            found[order, inside] = np.polyval(np.polyder(c, order), u) / h**order
    return tuple(found)


@pytest.mark.parametrize("file", ["twincat.st", "codesys.st"])
def test_a_plc_drives_the_plan(saved_otherwise, exported, file):
    """Between points as well, with the torques that the plan asks for."""
    plan = deltaopt.load_plan(saved_otherwise)
    cams = points_of((exported / file).read_text(encoding="utf-8"))
    assert len(cams) == 3
    slower = cams[0][-1, 0] / SPEED / plan.duration  # so that angles between points keep the limits
    assert 1 <= slower < 1.0001
    trajectory = plan.trajectory.slowed(slower)
    knots = trajectory.knots
    t = np.linspace(0, trajectory.duration, 20_011)
    t = t[np.abs(t[:, None] - knots).min(axis=1) > BLEND]
    motion, found = trajectory(t), [evaluated(points, SPEED * t) for points in cams]
    position, velocity, acceleration = (
        np.deg2rad(np.transpose(f)) for f in zip(*found, strict=True)
    )
    angle = SIGN * (motion.theta + ZERO)
    np.testing.assert_allclose(position, angle, atol=1e-7)
    np.testing.assert_allclose(velocity * SPEED, SIGN * motion.dtheta, atol=1e-4)
    largest = np.abs(motion.ddtheta).max()
    off = np.abs(acceleration * SPEED**2 - SIGN * motion.ddtheta)
    assert off.max() < 5e-4 * largest  # quintics in angles are not the plan's cubics in space


def test_pieces_are_between_the_points(exported):
    cams = points_of((exported / "codesys.st").read_text(encoding="utf-8"))
    with (exported / "pieces.csv").open(encoding="utf-8") as lines:
        rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(lines)]
    for k, points in enumerate(cams, 1):
        own = [row for row in rows if row["motor"] == k]
        assert len(own) == len(points) - 1
        for row, begin, end in zip(own, points[:-1], points[1:], strict=True):
            assert (row["begin"], row["end"]) == (begin[0], end[0])
            c, h = np.array([row[f"c{i}"] for i in reversed(range(6))]), end[0] - begin[0]
            for order in range(3):
                scale = np.abs(points[:, 1 + order]).max()
                rounding = 60 * 1e-15 * np.abs(points[:, 1]).max() / h**order
                ends = np.polyval(np.polyder(c, order), [0.0, h])
                off = np.abs(ends - [begin[1 + order], end[1 + order]]).max()
                assert off < 1e-12 * scale + rounding


def test_points_in_csv_are_those_in_structured_text(exported):
    with (exported / "points.csv").open(encoding="utf-8") as lines:
        rows = list(csv.DictReader(lines))
    for file in ("twincat.st", "codesys.st"):
        for k, points in enumerate(points_of((exported / file).read_text(encoding="utf-8")), 1):
            names = ("master", f"position{k}", f"velocity{k}", f"acceleration{k}")
            np.testing.assert_array_equal(points, [[float(row[n]) for n in names] for row in rows])
            assert (np.diff(points[:, 0]) > 0).all()


def test_a_jump_is_drawn_out_in_one_cubic():
    """From 3 to -2 rad/s² at 0.5 s, exactly as if acceleration were linear in between."""
    a1, a2 = np.array([3.0, 0.0, 1.0]), np.array([-2.0, 0.0, 1.0])
    t = np.array([0.0, 0.5, 0.5, 1.0])
    theta = np.array([0 * a1, a1 / 8, a1 / 8, a1 / 8 + a1 / 4 + a2 / 8])
    rates = np.array([0 * a1, a1 / 2, a1 / 2, a1 / 2 + a2 / 2])
    table = JointTable(t, theta, rates, np.array([a1, a1, a2, a2]))
    pieces = without_jumps(table).quintic()
    np.testing.assert_allclose(np.diff(pieces.knots), [0.5 - BLEND / 2, BLEND, 0.5 - BLEND / 2])
    accelerations = pieces.derivative().derivative()
    middle = accelerations.at(np.array([0.5]))[0]
    np.testing.assert_allclose(middle, (a1 + a2) / 2, atol=5e-3)  # rounding of 1e-16 over BLEND²
    dense = accelerations.at(np.linspace(0.5 - BLEND / 2, 0.5 + BLEND / 2, 101))
    assert dense.max() <= 3 + 5e-3
    assert dense.min() >= -2 - 5e-3
    np.testing.assert_allclose(accelerations.at(np.array([0.25, 0.75])), [a1, a2], atol=1e-6)


def test_what_is_said(saved_otherwise, tmp_path, capsys):
    words = ["export", "cam", str(saved_otherwise), "-o", str(tmp_path)]
    assert main([*words, "--cycle", "2ms"]) == 1
    said = capsys.readouterr().err
    assert "cam interpolation asks for 1.1" in said
    assert "the cheapest first: --cycle own-knots --keep-limits (" in said
    assert main([*words, "--cycle", "2ms", "--anyway"]) == 0
    for each in tmp_path.iterdir():
        assert "cam interpolation asks for 1.1" in each.read_text(encoding="utf-8").splitlines()[0]
    capsys.readouterr()
    assert main([*words, "--keep-limits"]) == 0
    said = capsys.readouterr().out
    assert "remed" not in said
    names = ("points.csv", "pieces.csv", "twincat.st", "codesys.st")
    assert f"replaced: {', '.join(str(tmp_path / name) for name in names)}\n" in said


def test_a_name_does_not_end_the_comment(tmp_path):
    from deltaopt.output.cam_tables import Cams, write_cams

    rows = np.zeros((2, 3))
    table = JointTable(np.array([0.0, 0.1]), rows, rows, rows)
    write_cams(tmp_path, Cams(table, "rad", 1.0), "x *) evil : INT; (*\n(*")
    for file in ("twincat.st", "codesys.st"):
        text = (tmp_path / file).read_text(encoding="utf-8")
        assert text.count("(*") == text.count("*)") == 1
        assert "evil" in text[: text.index("*)")]
