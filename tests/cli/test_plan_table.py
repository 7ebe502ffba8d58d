"""What is printed of a verification."""

from __future__ import annotations

from html import unescape
from pathlib import Path

from deltaopt.cli import main
from deltaopt.output.in_words import singularities_table
from deltaopt.verify.measures import Distance


def test_a_singularity_that_is_passed_is_marked():
    """No limit says so where the platform can tilt: motors do not feel it."""
    near, beyond = (Distance("tilt", "volume", least, "robot", 0.0625) for least in (0.02, -0.1))
    kept, passed = singularities_table([near, beyond])[1:]
    assert kept == "  tilt: volume = 0.02, at t = 0.062500 s"
    assert passed.startswith("  tilt: volume = -0.1, at t = 0.062500 s, PASSED")


def test_the_first_line_says_that_a_motion_is_beyond_a_singularity(tmp_path, capsys):
    """Of a plan, of a line that shows that a move can be done, and on the page."""
    robot = Path("problems/robots/orsino.yaml").resolve()
    ends = "start: [0.152, -0.106, -0.363]\ngoal: [0.378, 0.074, -0.368]\n"
    file = tmp_path / "scene.yaml"
    file.write_text(f"robot: {robot}\npayload: 0.5\n{ends}", encoding="utf-8")
    but = "but beyond the tilt of the platform, where the motors do not hold the robot"
    assert main(["check", str(file)]) == 0
    assert capsys.readouterr().out.startswith(f"verdict      can be done, {but}: the straight line")
    out = str(tmp_path / "out")
    assert main(["plan", str(file), "--no-plot", "--report", "-o", out]) == 0
    verdict, where, *_ = capsys.readouterr().out.splitlines()
    assert verdict.startswith(f"verified, {but}: ")
    assert where.startswith("tilt of the platform: volume of the parallelograms' normals = -")
    assert where.endswith(", PASSED")
    page = unescape((tmp_path / "out" / "report.html").read_text(encoding="utf-8"))
    assert f"instant, {but}.</p>" in page
