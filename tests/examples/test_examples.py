"""Every example and notebook runs, and tells what it is there to tell."""

from __future__ import annotations

import json
import runpy
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
SAYS = {
    "01_first_look.ipynb": "straight line 0.1966 s, fastest motion 0.1409 s",
    "02_z_up_cell.py": "pick at (0.8, -0.15, -0.04) m in the robot's frame",
    "03_over_a_wall.py": "  0 mm: 0.1401 s, verified: True",
    "04_belt.py": "belt at 0.5 m/s: met after 0.0829 s",
    "05_glue_path.py": "m off the circle",
    "06_cycle.py": "rated 15.0 N·m: 137 parts a minute, RMS 15.0,",
    "07_smooth_torques.py": "40 N·m in 8 ms  0.1484 s",
    "08_controller_table.py": "quintic interpolation asks for",
    "09_inverse_dynamics.py": "largest torque 2.3568 N·m",
    "10_own_limit.py": "draws 400.0 W, ok: True",
    "11_own_mechanism.py": "",
    "12_where_to_put_the_robot.ipynb": "parts per minute",
}


def run(example: Path) -> None:
    """A script, or the cells of a notebook in turn."""
    if example.suffix == ".py":
        runpy.run_path(str(example), run_name="__main__")
        return
    cells = json.loads(example.read_text(encoding="utf-8"))["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    exec(compile("\n".join(code), example.name, "exec"), {"__name__": "__main__"})


def test_all_are_here():
    assert sorted(file.name for file in EXAMPLES.iterdir() if file.is_file()) == sorted(SAYS)


@pytest.mark.parametrize("name", SAYS)
def test_runs(name, tmp_path, monkeypatch, capsys):
    (tmp_path / "problems").symlink_to(EXAMPLES.parent / "problems")  # where notebooks look
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", [name])
    run(EXAMPLES / name)
    assert SAYS[name] in capsys.readouterr().out


def test_both_models_give_the_same_torques():
    example = runpy.run_path(str(EXAMPLES / "09_inverse_dynamics.py"))
    t, explicit, multiplier = example["torques"](example["setup"]())
    assert t[-1] == pytest.approx(0.5)
    assert np.abs(explicit - multiplier).max() < 1e-13 * np.abs(explicit).max()


def test_a_cell_turned_by_90_degrees_is_the_same_cell(monkeypatch):
    """A point 100 mm towards motor 1 and 40 mm to its left, wherever motor 1 is."""
    example = runpy.run_path(str(EXAMPLES / "02_z_up_cell.py"))
    expected = example["point"](100, 40, 700)
    monkeypatch.setitem(example["point"].__globals__, "MOTOR_1", 90.0)
    assert example["point"](-40, 100, 700) == pytest.approx(expected)
