"""Files of cycles: what is read, what is refused and how, and what the command writes."""

from __future__ import annotations

import json
import re
import shutil
from contextlib import redirect_stdout
from io import StringIO
from itertools import combinations

import numpy as np
import pytest

import deltaopt
from deltaopt import SceneError, load_cycle, load_plan, load_scene
from deltaopt.cli import main
from deltaopt.files.csv_table import read_csv
from deltaopt.output.joint_table import JointTable
from deltaopt.output.plan_files import COLUMNS as PLANNED
from deltaopt.output.table_files import COLUMNS
from studies.problems import PROBLEMS

CYCLE = PROBLEMS / "cycles" / "there_and_back.yaml"
TEXT = CYCLE.read_text(encoding="utf-8").replace("../robots", str(PROBLEMS / "robots"))


def test_what_stands_beside_the_legs_is_for_all_and_bodies_and_limits_add_up(tmp_path):
    body = "[{sphere: {centre: [0.5, 0, %s], radius: 0.01}}]"
    text = TEXT.replace("start:", f"keep_out: {body % 0.1}\nclearance: 1 mm\nstart:")
    text = text.replace("limits: {", "limits: {torque: 25, acceleration: 200, ")
    file, own = tmp_path / "cycle.yaml", "limits: {platform_speed: 2.5, acceleration: 100}"
    file.write_text(text.replace("payload: 1.0", f"payload: 1.0, {own}, keep_out: {body % 0.2}"))
    there, back = load_cycle(file).legs
    assert (there.given("torque"), there.given("platform_speed")) == (25.0, 2.5)
    assert (there.given("acceleration"), back.given("acceleration")) == (100.0, 200.0)
    assert back.given("platform_speed") is None
    assert (len(there.keep_out), len(back.keep_out)) == (2, 1)
    assert (there.payload, back.payload, back.clearance) == (1.0, None, 0.001)
    assert there.goal == back.start


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("dwell: 50 ms}", "dwell: -3 ms}", r"cycle\[0\].dwell is '-3 ms'; expected a duration"),
        ("dwell: 50 ms}", "dwell: 50 g}", r"cycle\[0\].dwell is '50 g', which cannot be conv"),
        ("22 N*m", "22 kg", "limits.rms_torque is '22 kg', which cannot be converted to N"),
        ("payload: 1.0", "payload: -1", r"cycle\[0\].payload is -1"),
        ("payload: 1.0", "payloda: 1", r"cycle\[0\].payloda is not a known key"),
        ("goal: [0.85, 0.1525, 0.0], ", "", r"cycle\[0\].goal is missing"),
        (
            "goal: [0.85, -0.1525",
            "goal: [0.85, -0.1",
            r"cycle\[1\].goal is .* where it begins",
        ),
        (
            "payload: 1.0",
            "limits: {rms_torque: 10}",
            r"cycle\[0\].limits.rms_torque is 10.*none of a single motion or a leg",
        ),
        ("payload: 1.0", "tool: {offset: [0, 40 mm, 0]}", r"cycle\[1\].tool.offset is .*0.04"),
        ("payload: 1.0", "robot: other.yaml", r"cycle\[0\].robot is 'other.yaml'; expected none"),
        ("payload: 1.0", "start: home", r"cycle\[0\].start is 'home'; expected none in"),
        ("start:", "period: 0 s\nstart:", "period is '0 s'; expected a duration"),
        ("start: [0.85, -0.1525, 0.0]", "", "start is missing"),
        ("start:", "objective: effort\nduration: 1\nstart:", "objective is .* least period"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, old, new, said):
    file = tmp_path / "cycle.yaml"
    file.write_text(TEXT.replace(old, new, 1))
    with pytest.raises(SceneError, match=said):
        load_cycle(file)


def numbers_of(axes):
    return [text for text in axes.texts if text.get_text().isdigit()]


def test_a_new_cell_is_planned(tmp_path, capsys, drawn):
    """Four legs, of which two end on a belt; a folder of its plan names the plans in it. In its
    picture the numbers of legs are apart, each in its path, and above all torques."""
    assert main(["new", "--cell", str(tmp_path)]) == 0
    scene = tmp_path / "scene.yaml"
    assert f"deltaopt plan {scene}" in capsys.readouterr().out
    cell = load_cycle(scene)
    assert (len(cell.legs), cell.parts, cell.rms_limits) == (4, 2, (25.0, 25.0, 25.0))
    out = tmp_path / "out"
    assert main(["plan", str(scene), "--tolerance", "0.02", "-o", str(out)]) == 0
    *views, torques = drawn[-1].axes
    (axes, numbers) = max(
        ((each, numbers_of(each)) for each in views), key=lambda each: len(each[1])
    )
    paths = [line.get_xydata() for line in axes.get_lines() if len(line.get_xdata()) > 100]
    boxes = [number.get_window_extent() for number in numbers]
    assert sum(len(numbers_of(each)) for each in views) == len(boxes) == len(paths) == 4
    assert not [one for one, other in combinations(boxes, 2) if one.overlaps(other)]
    for text, path in zip(numbers, paths, strict=True):
        assert np.linalg.norm(path - text.xy, axis=1).min() < 1e-9
    highest = max(line.get_ydata().max() for line in torques.get_lines())
    assert min(number.xy[1] for number in numbers_of(torques)) > highest
    assert main(["verify", str(out)]) == 0  # with a belt
    assert main(["export", "c", str(out), "-o", str(out / "c")]) == 2
    assert "whose legs are plans: leg_1, leg_2, leg_3, leg_4" in capsys.readouterr().err
    assert main(["verify", str(out / "leg_2")]) == 0


def test_a_cycle_is_no_scene(tmp_path):
    with pytest.raises(SceneError, match="cycles are for deltaopt plan, check"):
        load_scene(CYCLE)
    with pytest.raises(SceneError, match="cycle is missing"):
        load_cycle(PROBLEMS / "pick_and_place.yaml")


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """The folder of the planned cycle, with charts of its legs' limits, and what was told."""
    folder, told = tmp_path_factory.mktemp("there_and_back"), StringIO()
    words = ["plan", str(CYCLE), "--json", "--no-plot", "--plot-limits", "-o", str(folder)]
    with redirect_stdout(told):
        assert main(words) == 0
    return folder, json.loads(told.getvalue())


@pytest.fixture(scope="module")
def there_and_back(planned):
    return planned[0]


def test_the_command_writes_the_whole_and_each_leg(planned):
    folder, told = planned
    assert told["verification"]["ok"]
    table = read_csv(folder / "trajectory.csv")
    t, leg, payload = (table.columns([name])[:, 0] for name in ("t", "leg", "payload"))
    assert t[-1] == pytest.approx(told["period"])
    arrives = told["legs"][1]["begins"]
    assert (leg == np.where(t < arrives, 1, 2)).all()
    assert set(payload[leg == 1]) == {1.0}
    assert set(payload[leg == 2]) == {0.0}
    assert [each["then"] for each in told["legs"]] == ["release", "grip"]
    second = load_plan(folder / "leg_2")
    assert second.duration == pytest.approx(told["legs"][1]["duration"])
    assert deltaopt.verify(second.scene, second.trajectory).ok


def test_rated_is_there_and_back_for_ever(tmp_path, capsys):
    scene = str(PROBLEMS / "hornet" / "1_kg.yaml")
    assert main(["plan", scene, "-o", str(tmp_path), "--no-plot"]) == 0
    assert "\nmotors overheat if this goes on there and back" in capsys.readouterr().out
    assert main(["plan", scene, "--rated", "-o", str(tmp_path / "rated"), "--no-plot"]) == 0
    first, gap, legs, torques, files = capsys.readouterr().out.splitlines()
    assert re.match(r"verified: \d+(\.\d)? parts per minute, ", first)
    assert gap.startswith("at most ")
    assert legs.count(" s with 1 kg") == 2
    assert "may" not in torques
    number = sum(file.is_file() for file in (tmp_path / "rated").rglob("*"))
    assert files == f"written: {tmp_path / 'rated'} ({number} files)"
    content = json.loads((tmp_path / "rated/cycle.json").read_text())
    assert max(content["rms_torque"]) == pytest.approx(content["rms_limits"][0], rel=1e-3)
    assert_written_over(scene, tmp_path / "rated")
    capsys.readouterr()
    assert main(["plan", str(PROBLEMS / "pick_and_place.yaml"), "--rated"]) == 2
    assert "does not say what motors are rated for" in capsys.readouterr().err


def assert_written_over(scene, folder):
    """A folder has the files of what was last written to it, cycle or plan, and those of others."""

    def names():
        files = (file for file in folder.rglob("*") if file.is_file())
        return {file.relative_to(folder).as_posix() for file in files}

    cycle, plan = names(), {"trajectory.csv", "plan.json"}
    (folder / "leg_2" / "notes.txt").touch()
    shutil.copytree(folder / "leg_1", folder / "leg_3")
    assert main(["plan", scene, "--baseline", "-o", str(folder)]) == 0
    assert names() == {*plan, "plan.png", "leg_2/notes.txt"}
    assert main(["verify", str(folder)]) == 0
    for _ in range(2):
        words = ["plan", scene, "--rated", "--tolerance", "0.05", "-o", str(folder), "--no-plot"]
        assert main(words) == 0
        assert names() == {*cycle, "leg_2/notes.txt"}
        shutil.copytree(folder / "leg_1", folder / "leg_3")
    other = folder.parent / "scenes"  # whose plans have names of legs, and are none
    for name in ("leg_1", "."):
        words = ["plan", scene, "--baseline", "--no-plot", "-o", str(other / name)]
        assert main(words) == 0
    assert load_plan(other / "leg_1").duration == load_plan(other).duration


def test_options_of_single_motions_are_refused(capsys):
    assert main(["plan", str(CYCLE), "--starts", "3"]) == 2
    assert "--starts is for single motions" in capsys.readouterr().err


def test_limits_are_drawn_of_every_leg(there_and_back):
    for leg in (1, 2):
        assert (there_and_back / f"leg_{leg}" / "limits.png").stat().st_size > 10_000


@pytest.mark.parametrize("controller", ["cubic", "quintic"])
def test_a_table_at_equal_steps_has_a_row_at_each(there_and_back, controller, tmp_path, capsys):
    """Also where legs and dwells meet, where its one acceleration exceeds no limit either, as
    verification of the file measures. A longer period is told."""
    file = tmp_path / "table.csv"
    words = ["--cycle", "1ms", "--keep-limits", "--controller", controller, "-o", str(file)]
    assert main(["export", "table", str(there_and_back), *words]) == 0
    t = read_csv(file).columns(["t"])[:, 0]
    np.testing.assert_allclose(np.diff(t), 1e-3, rtol=1e-9)
    record = json.loads((there_and_back / "cycle.json").read_text())
    period, rate = record["period"], record["parts_per_minute"]
    said = f"a period of {t[-1]:.6g} s, {rate * period / t[-1]:.4g} parts per minute; planned were"
    assert f"{said} {period:.6g} s, {rate:.4g} parts per minute" in capsys.readouterr().out
    robot = str(PROBLEMS / "robots" / "industrial.yaml")
    assert main(["verify", str(file), "--robot", robot, "--controller", controller]) == 0


def test_of_a_given_period_nothing_is_saved(planned, tmp_path, capsys):
    """By more RMS torque, also where that is used up."""
    period = 1.001 * planned[1]["period"]
    file = tmp_path / "cycle.yaml"
    file.write_text(f"{TEXT}\nperiod: {period}\n")
    assert max(planned[1]["saved_by_rms_torque"]) > 0
    assert main(["plan", str(file), "--details", "--no-plot", "-o", str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out
    assert "at most 22, 22, 22 are allowed" in told
    assert max(json.loads((tmp_path / "out/cycle.json").read_text())["saved_by_rms_torque"]) > 0
    assert "would save" not in told


def test_of_a_cycle_that_cannot_be_written_no_leg_is(tmp_path, capsys):
    (tmp_path / "cycle.json").mkdir()
    assert main(["plan", str(CYCLE), "--no-plot", "-o", str(tmp_path)]) == 2
    assert "cycle.json: is a directory" in capsys.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == ["cycle.json"]


def test_a_part_that_is_gripped_at_too_much_acceleration(tmp_path, capsys):
    """One row cannot tell it: that is said, not tried with ever slower motions."""
    file, table = tmp_path / "cycle.yaml", tmp_path / "table.csv"
    file.write_text(
        TEXT.replace(", payload: 1.0, dwell: 50 ms", "").replace("dwell: 50 ms", "payload: 1.0")
    )
    assert main(["plan", str(file), "--no-plot", "-o", str(tmp_path / "out")]) == 0
    words = ["export", "table", str(tmp_path / "out"), "-o", str(table), "--cycle", "1ms"]
    assert main([*words, "--keep-limits"]) == 1
    assert "rows at own knots or cubic interpolation do" in capsys.readouterr().err
    assert not table.exists()
    assert main([*words, "--keep-limits", "--controller", "cubic"]) == 0


def test_a_table_has_the_whole_cycle(there_and_back, tmp_path, capsys):
    """Its quintics are the planned motion at every instant, dwells included."""
    shutil.copytree(there_and_back, tmp_path / "out")
    given = ["export", "table", str(tmp_path / "out"), "-o", str(tmp_path / "table.csv")]
    capsys.readouterr()
    assert main(given) == 0
    assert "" not in capsys.readouterr().out.splitlines()
    rows = read_csv(tmp_path / "table.csv").columns(COLUMNS)
    t, theta, dtheta, ddtheta = rows[:, 0], *np.split(rows[:, 1:], 3, axis=1)
    table = JointTable(t, theta, dtheta, ddtheta).quintic()
    planned = read_csv(tmp_path / "out" / "trajectory.csv").columns(PLANNED)
    found = table.at(planned[:, 0])
    angles = [PLANNED.index(f"theta{k}") for k in (1, 2, 3)]
    assert t[-1] == pytest.approx(planned[-1, 0], rel=1e-12)
    assert np.abs(found - planned[:, angles]).max() < 1e-6
    (tmp_path / "out" / "cycle.json").write_text('{"format": 1, "legs": [{}]}')
    assert main(given) == 2
    assert "cycle.json: its legs cannot be used: 'folder'" in capsys.readouterr().err
    (tmp_path / "out" / "cycle.json").write_text("[]")
    assert main(given) == 2
    assert "it is no record of a plan" in capsys.readouterr().err


def edited(there_and_back, folder, change):
    """A copy of the planned cycle whose record has another number, at the same times."""
    shutil.copytree(there_and_back, folder)
    record = json.loads((folder / "cycle.json").read_text())
    change(record)
    (folder / "cycle.json").write_text(json.dumps(record))
    return folder


@pytest.mark.parametrize("target", ["table", "ros2", "cam"])
def test_legs_that_do_not_join_are_refused(there_and_back, tmp_path, capsys, target):
    """The way there twice, with times that add up: it jumps back by what trajectory.csv says."""

    def twice(record):
        there, back = record["legs"]
        record["period"] -= back["duration"] - there["duration"]
        there["folder"] = back["folder"] = "leg_1"
        back["duration"] = there["duration"]

    folder = edited(there_and_back, tmp_path / "out", twice)
    angles = [f"theta{k}" for k in (1, 2, 3)]
    way = np.diff(read_csv(folder / "leg_1" / "trajectory.csv").columns(angles)[[0, -1]], axis=0)
    words = ["export", target, str(folder), "-o", str(tmp_path / "written")]
    assert main(words) == 2
    said = capsys.readouterr().err
    told = rf"leg_1 begins {np.abs(way).max():.3g} rad and \S+ rad/s off the wait after leg_1's end"
    assert re.search(told, said)
    assert said.count("\n") == 1
    assert not (tmp_path / "written").exists()


@pytest.mark.parametrize("key", ["begins", "duration", "dwell", "period"])
def test_times_of_a_record_that_its_legs_do_not_take_are_refused(
    there_and_back, tmp_path, capsys, key
):
    def longer(record):
        numbers = record if key == "period" else record["legs"][1]
        numbers[key] += 0.01

    folder = edited(there_and_back, tmp_path / "out", longer)
    assert main(["export", "table", str(folder), "-o", str(tmp_path / "table.csv")]) == 2
    said = capsys.readouterr().err
    assert "cycle.json: its legs cannot be used: " in said
    assert said.count("\n") == 1


def test_a_leg_that_begins_at_another_speed_is_refused(there_and_back, tmp_path, capsys):
    """At 0.1 m/s along x: motors of equal arms turn about as fast as that over an arm's length."""
    folder = edited(there_and_back, tmp_path / "out", lambda record: None)
    plan = json.loads((folder / "leg_2" / "plan.json").read_text())
    plan["motion"]["position"][0][1][0] += 0.1
    (folder / "leg_2" / "plan.json").write_text(json.dumps(plan))
    assert main(["export", "table", str(folder), "-o", str(tmp_path / "table.csv")]) == 2
    told = r"leg_2 begins \S+ rad and (\S+) rad/s off the wait after leg_1's end"
    length = plan["scene"]["robot"]["upper_arm"]["length"]
    speed = float(re.search(told, capsys.readouterr().err)[1])
    assert 0.5 < speed * length / 0.1 < 2


def test_legs_of_other_robots_are_refused(there_and_back, tmp_path, capsys):
    folder = edited(there_and_back, tmp_path / "out", lambda record: None)
    plan = json.loads((folder / "leg_2" / "plan.json").read_text())
    plan["scene"]["robot"]["platform"]["mass"] *= 1.1
    (folder / "leg_2" / "plan.json").write_text(json.dumps(plan))
    assert main(["export", "table", str(folder), "-o", str(tmp_path / "table.csv")]) == 2
    assert "leg_2 is of another robot than leg_1" in capsys.readouterr().err


def test_a_saved_cycle_is_verified_again(there_and_back, capsys):
    """RMS torques by the trapezoidal rule on trajectory.csv, which cuts the corners of jumps."""
    assert main(["verify", str(there_and_back), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["ok"], told["failures"], told["differences"]) == (True, [], [])
    rows = read_csv(there_and_back / "trajectory.csv").columns(["t", "tau1", "tau2", "tau3"])
    t, squares = rows[:, 0], rows[:, 1:] ** 2
    mean = np.diff(t) @ (squares[1:] + squares[:-1]) / 2 / t[-1]
    assert told["rms_torque"] == pytest.approx(np.sqrt(mean), rel=5e-3)
    assert told["period"] == pytest.approx(t[-1])


def lower_limits(record):
    record["rms_limits"] = [22.0, 22.0, 21.0]


def cooler(record):
    record["rms_torque"][1] *= 0.9


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lower_limits, "verification failed: the RMS torque of motor 3 is 21.9[0-9]+ N·m, and may"),
        (lower_limits, "cycle.json: it says that ok is True, and verification now False"),
        (cooler, "cycle.json: RMS torques are .* by it, and .* by its motions"),
        (dict.clear, "cycle.json: it has no format; this version of deltaopt reads format 1"),
    ],
)
def test_what_is_wrong_with_a_saved_cycle_is_told(there_and_back, tmp_path, capsys, change, told):
    folder = edited(there_and_back, tmp_path / "out", change)
    assert main(["verify", str(folder)]) == (2 if change is dict.clear else 1)
    assert re.search(told, capsys.readouterr().err)


@pytest.mark.parametrize("name", ["trajectory.csv", "leg_2/trajectory.csv"])
def test_tables_of_a_saved_cycle_are_those_of_its_motions(there_and_back, tmp_path, capsys, name):
    shutil.copytree(there_and_back, tmp_path / "out")
    file = tmp_path / "out" / name
    lines = file.read_text().splitlines()
    t, x, *others = lines[-3].split(",")
    row = ",".join([t, str(1.001 * float(x)), *others])
    file.write_text("\n".join([*lines[:-3], row, *lines[-2:], ""]))
    assert main(["verify", str(tmp_path / "out")]) == 1
    assert f"{file}: x is " in capsys.readouterr().err
