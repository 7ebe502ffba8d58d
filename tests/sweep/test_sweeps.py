"""Sweeps: rows are those of plans made by hand, whatever plans them and whatever stops it."""

from __future__ import annotations

import csv
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import pytest

import deltaopt
from deltaopt.sweeps.run import NoCluster, cluster
from deltaopt.sweeps.sweep import OtherTable, fill

PICK = Path("problems/pick_and_place.yaml").resolve()
GRID = {"robot.upper_arm.length times": [1.0, 1.02], "limits.torque": ["10 N*m", 9.0, 1e-3]}


def rows(file):
    with file.open(newline="") as opened:
        found = sorted(csv.DictReader(opened), key=lambda row: int(row["point"]))
    return [{key: text for key, text in row.items() if key != "seconds"} for row in found]


@pytest.fixture
def swept():
    return deltaopt.Sweep(scene=str(PICK), grid=GRID)


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """The file of the grid, by one process."""
    file = tmp_path_factory.mktemp("sweep") / "one.csv"
    deltaopt.sweep(deltaopt.Sweep(scene=str(PICK), grid=GRID), file, workers=1)
    return file


@pytest.fixture(scope="module")
def expected(table):
    """Its rows."""
    return rows(table)


def test_rows_are_those_of_plans_of_changed_scenes(expected):
    scene = deltaopt.load_scene(PICK)
    arm = scene.robot.upper_arm
    cases = [(length, torque) for length in (1.0, 1.02) for torque in (10.0, 9.0)]
    told = [row for row in expected if not row["error"]]
    for (times, torque), row in zip(cases, told, strict=True):
        changed = arm.model_copy(update={"length": times * arm.length})
        robot = scene.robot.model_copy(update={"upper_arm": changed})
        plan = deltaopt.plan(
            scene.model_copy(update={"robot": robot, "limits": {"torque": torque}})
        )
        report = deltaopt.verify(plan.scene, plan.trajectory)
        assert float(row["duration"]) == pytest.approx(plan.duration, rel=1e-9)
        assert float(row["gap"]) == pytest.approx(plan.gap, rel=1e-6)
        assert (row["verified"] == "yes") == report.ok
        assert float(row["singularity"]) == min(each.least for each in report.distances)
        assert row["limited_by"].startswith("torque of motor")
        assert float(row["torque_share"]) == pytest.approx(1, abs=2e-3)


def test_a_point_without_a_plan_is_a_row_with_its_sentence(expected):
    refused = [row for row in expected if row["error"]]
    assert [row["limits.torque"] for row in refused] == ["0.001", "0.001"]
    for row in refused:
        assert row["error"].startswith("start: at rest at")
        assert not row["duration"]


def test_rows_are_the_same_whatever_plans_them(swept, expected, tmp_path):
    deltaopt.sweep(swept, tmp_path / "two.csv", workers=2)
    assert rows(tmp_path / "two.csv") == expected
    with ThreadPoolExecutor(2) as threads:
        deltaopt.sweep(swept, tmp_path / "threads.csv", executor=threads, workers=2)
    assert rows(tmp_path / "threads.csv") == expected


def test_a_key_that_a_fact_has_the_name_of_has_a_column_of_its_own(tmp_path):
    """A given duration beside that of the plan, which is none where 0.1 s is too short."""
    gently, file = PICK.parent / "objectives" / "pick_and_place_gently.yaml", tmp_path / "rows.csv"
    sweep = deltaopt.Sweep(scene=str(gently), grid={"duration": [0.1, 0.3]})
    for _ in range(2):  # then from the table alone
        table = deltaopt.sweep(sweep, file, workers=1)
        assert table.columns.is_unique
        assert table["scene.duration"].tolist() == [0.1, 0.3]
        assert table["duration"].tolist() == pytest.approx([float("nan"), 0.3], nan_ok=True)


def test_a_stopped_sweep_goes_on_and_plans_nothing_twice(swept, table, expected, tmp_path):
    file, whole = tmp_path / "rows.csv", table.read_bytes()
    lines = whole.splitlines(keepends=True)
    file.write_bytes(b"".join(lines[:4]) + lines[4][:20])  # as a kill leaves it
    told = []
    deltaopt.sweep(swept, file, workers=1, progress=lambda done, text: told.append(text))
    assert rows(file) == expected
    assert file.read_bytes().startswith(b"".join(lines[:4]))
    assert [text.split(",")[0] for text in told] == [f"{n} of 6 points" for n in (4, 5, 6)]


def test_a_table_of_other_points_is_refused(swept, table, tmp_path):
    file, before = tmp_path / "rows.csv", table.read_bytes()
    file.write_bytes(before)
    other = deltaopt.Sweep(scene=str(PICK), grid={**GRID, "limits.torque": [10.0, 9.5, 1e-3]})
    with pytest.raises(OtherTable, match=r"2 of its 6 rows are of other points"):
        deltaopt.sweep(other, file, workers=1)
    with pytest.raises(OtherTable, match="not a table with the columns of this sweep"):
        deltaopt.sweep(deltaopt.Sweep(scene=str(PICK)), file, workers=1)
    assert file.read_bytes() == before
    file.write_bytes(before.replace(b",1.02,", b",1.03,", 1))  # by hand, where a value was told
    with pytest.raises(OtherTable, match=r"1 of its 6 rows are of other points .* edited"):
        deltaopt.sweep(swept, file, workers=1)
    notes = tmp_path / "notes.txt"
    notes.write_text("no newline")
    with pytest.raises(OtherTable, match="not a table"):
        deltaopt.sweep(swept, notes, workers=1)
    assert notes.read_text() == "no newline"


KILLED = """
import os, signal, sys
from pathlib import Path
import deltaopt
from deltaopt.sweeps import run
plan = run.row_of
def ends_its_process(task):
    once, always = Path(sys.argv[1]), 4
    if task.index == always or task.index == 1 and not once.exists():
        once.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return plan(task)
run.row_of = ends_its_process
deltaopt.sweep(sys.argv[2], sys.argv[3], workers=2)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="processes are forked, with what is planted")
def test_a_worker_that_is_killed_loses_nothing(expected, tmp_path):
    """One point ends its process once, another one always."""
    sweep, table = tmp_path / "sweep.yaml", tmp_path / "rows.csv"
    values = "{from: 6 N*m, to: 10 N*m, steps: 6}"
    sweep.write_text(f"scene: {PICK}\ngrid:\n  limits.torque: {values}\n")
    subprocess.run(
        [sys.executable, "-c", KILLED, tmp_path / "once", sweep, table], check=True, timeout=120
    )
    found = rows(table)
    assert [row["point"] for row in found] == list("012345")
    assert [row["point"] for row in found if row["error"]] == ["4"]
    assert found[4]["error"] == "whatever process plans it ends"
    assert all(row["verified"] == "yes" for row in found if not row["error"])


def test_a_worker_of_a_cluster_that_is_killed_loses_nothing(swept, expected, tmp_path):
    """Two processes of a Dask cluster plan the same; one is killed with points under way."""
    distributed = pytest.importorskip("distributed")
    killed = []
    with (
        distributed.LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            dashboard_address=":0",
            silence_logs="CRITICAL",
        ) as local,
        local.get_client() as client,
    ):
        pids = client.run(os.getpid)

        def kill(done, text):
            """After the first row: a process that has been given other points."""
            if not killed:
                killed.extend(pids[worker] for worker, keys in client.processing().items() if keys)
                os.kill(killed[0], signal.SIGKILL)

        there = partial(cluster, local.scheduler_address)
        fill(tmp_path / "rows.csv", swept.points_from(Path()), there, kill)
        assert killed[0] not in client.run(os.getpid).values()
    assert rows(tmp_path / "rows.csv") == expected


def test_without_a_cluster_there_is_a_sentence(swept, tmp_path):
    pytest.importorskip("distributed")
    with pytest.raises(NoCluster, match="no Dask scheduler answers there"):
        fill(tmp_path / "rows.csv", swept.points_from(Path()), partial(cluster, "nonsense://1"))
