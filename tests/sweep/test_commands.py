"""The commands map and sweep, as they are typed."""

from __future__ import annotations

import csv
import resource
import signal
from pathlib import Path

import numpy as np
import pytest

import deltaopt
from deltaopt.cli import main
from deltaopt.scene.scene_file import made_of
from deltaopt.sensitivity.keys import changed

ROBOT = "problems/robots/industrial.yaml"


def columns(file, *names):
    with file.open(newline="") as opened:
        found = sorted(csv.DictReader(opened), key=lambda row: int(row["point"]))
    return [np.array([float(row[name] or "nan") for row in found]) for name in names]


def test_a_map_has_the_symmetry_of_the_robot(tmp_path, capsys):
    """Chain 1 lies in the plane z = 0, along which the usual move is; 3 m below there is none."""
    file = tmp_path / "map.csv"
    where = ["--x", "0.7", "0.8", "2", "--y", "0", "--z", "-0.2", "0.2", "3"]
    assert main(["map", ROBOT, *where, "-o", str(file), "--workers", "1"]) == 0
    x, z, duration = columns(file, "place.x", "place.z", "duration")
    assert x.tolist() == [0.7] * 3 + [0.8] * 3
    assert z.tolist() == [-0.2, 0, 0.2] * 2
    left, middle, right = duration.reshape(2, 3).T
    assert left == pytest.approx(right, rel=2e-3)
    assert (middle != left).all()
    told = capsys.readouterr().out
    assert "6 of 6 points have a plan" in told
    best = int(duration.argmin())
    assert f"Fastest {x[best]:.3g} m below the base at y = 0, z = {z[best]:.3g} m" in told
    assert file.with_suffix(".png").stat().st_size > 10_000
    assert (
        main(["map", ROBOT, "--x", "3", "--y", "0", "--z", "0", "-o", str(tmp_path / "no.csv")])
        == 1
    )
    assert capsys.readouterr().out.startswith("0 of 1 points have a plan:\n1 of 1: start: ")


def test_random_moves_begin_and_end_in_their_region(tmp_path, capsys):
    pytest.importorskip("scipy")
    file = tmp_path / "moves.csv"
    region = ["--x", "0.7", "0.8", "--y", "-0.2", "0.1", "--z", "0.0", "0.2"]
    asked = ["map", ROBOT, "--moves", "4", *region, "-o", str(file), "--workers", "1"]
    assert main(asked) == 0
    ends = np.array(columns(file, *(f"{e}.{k}" for e in ("start", "goal") for k in range(3))))
    assert ends.shape == (6, 4)
    least, most = np.tile([0.7, -0.2, 0], 2), np.tile([0.8, 0.1, 0.2], 2)
    assert ((least[:, None] <= ends) & (ends <= most[:, None])).all()
    (duration,) = columns(file, "duration")
    scene = deltaopt.Scene(
        robot=deltaopt.load_robot(ROBOT),
        payload=1.0,
        start=tuple(ends[:3, 1]),
        goal=tuple(ends[3:, 1]),
    )
    assert duration[1] == pytest.approx(deltaopt.plan(scene).duration, rel=1e-6)
    told = capsys.readouterr().out
    assert f"less than {np.median(duration):.3f} s" in told


def test_random_moves_of_a_cycle_are_like_its_first_leg(tmp_path):
    pytest.importorskip("scipy")
    file = tmp_path / "cycle.yaml"
    file.write_text(
        f"robot: {Path(ROBOT).resolve()}\nstart: [0.85, -0.1, 0]\nperiod: 1 s\n"
        "limits: {rms_torque: 22 N*m, platform_speed: 5}\ncycle:\n"
        "  - {goal: [0.85, 0.1, 0], payload: 2, limits: {acceleration: 90}, dwell: 50 ms}\n"
        "  - {goal: [0.85, -0.1, 0]}\n"
    )
    for task in deltaopt.load_cell(file).moves(3, x=(0.7, 0.8)):
        scene = made_of(changed(task.base.content, task.changes), file)
        assert [*scene.start, *scene.goal] == [*task.changes.values()]
        assert scene.payload == 2
        assert scene.limits == deltaopt.Limits(platform_speed=5, acceleration=90)


def test_a_sweep_draws_its_keys_and_the_best_compromises(tmp_path, capsys):
    sweep, file = tmp_path / "sweep.yaml", tmp_path / "rows.csv"
    sweep.write_text(
        f"scene: {Path('problems/pick_and_place.yaml').resolve()}\n"
        "grid: {payload: [500 g, 1 kg], limits.torque: [9, 10 N*m]}\n"
        "pareto: [duration, limits.torque]\n"
    )
    for _ in range(2):  # then from the table alone
        assert main(["sweep", str(sweep), "-o", str(file), "--workers", "1"]) == 0
        told = capsys.readouterr().out
        duration, torque = columns(file, "duration", "limits.torque")
        best = int(duration.argmin())
        (first,) = (line for line in told.splitlines() if "+0.0 %" in line)
        assert first.split()[0] == str(best)
        assert file.with_suffix(".png").exists()
        assert file.with_suffix(".pareto.png").exists()
    dominated = [
        ((duration <= t) & (torque <= c) & ((duration < t) | (torque < c))).any()
        for t, c in zip(duration, torque, strict=True)
    ]
    assert dominated == [False, False, True, True]
    from deltaopt.sweeps.findings import best_compromises, message
    from deltaopt.sweeps.sweep import read

    best = best_compromises(read(file), ("duration", "limits.torque"))
    assert sorted(best["point"]) == [0, 1]
    title = message(read(file), ["payload"], "duration")
    assert title.startswith("duration (s) is least at payload = 0.5 kg: 0.")


def test_what_cannot_be_used_is_told_before_any_work(tmp_path, capsys):
    sweep = tmp_path / "sweep.yaml"
    sweep.write_text("scene: nowhere.yaml\n")
    assert main(["sweep", str(sweep), "-o", str(tmp_path / "rows.csv")]) == 2
    assert main(["map", ROBOT, "--x", "0.8", "0.7"]) == 2
    assert main(["map", ROBOT, "--moves", "3", "--x", "0.8"]) == 2
    assert main(["map", ROBOT, "--x", "nan"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 4
    assert "nowhere.yaml" in said[0]
    wanted = "FROM TO in m with FROM below TO"
    more = ", or FROM TO STEPS with 2 to 999 steps, or one number"
    assert said[1:] == [
        f"deltaopt: --x is 0.8 0.7; it must be {wanted}{more}",
        f"deltaopt: --x is 0.8; it must be {wanted}",
        f"deltaopt: --x is nan; it must be {wanted}{more}",
    ]
    assert not list(tmp_path.glob("*.csv"))


def test_a_table_is_not_lost_to_its_picture_nor_to_a_full_disk(tmp_path, capsys):
    sweep = tmp_path / "sweep.yaml"
    scene = Path("problems/pick_and_place.yaml").resolve()
    sweep.write_text(f"scene: {scene}\ngrid: {{payload: [500 g, 1 kg]}}\n")
    words = ["sweep", str(sweep), "--workers", "1", "-o"]
    assert main([*words, str(tmp_path / "rows.png")]) == 2
    assert "rows.png is no name of a table; it is to end in .csv or" in capsys.readouterr().err
    assert not (tmp_path / "rows.png").exists()
    assert main([*words, str(sweep / "rows.csv")]) == 2
    assert "sweep.yaml: is a file, not a directory" in capsys.readouterr().err
    full = tmp_path / "full.csv"
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    usual = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))
    try:
        assert main([*words, str(full)]) == 2
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, usual)
    assert f"deltaopt: {full}: File too large" in capsys.readouterr().err


def test_a_table_as_parquet_has_the_same_rows(tmp_path):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    sweep = deltaopt.Sweep(scene="problems/pick_and_place.yaml", grid={"payload": [0.5, 1.0]})
    found = deltaopt.sweep(sweep, tmp_path / "rows.parquet", workers=1)
    pandas.testing.assert_frame_equal(pandas.read_parquet(tmp_path / "rows.parquet"), found)
    assert found["payload"].tolist() == [0.5, 1.0]
