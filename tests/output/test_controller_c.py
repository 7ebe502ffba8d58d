"""The C of a robot, whatever the robot's name is."""

from __future__ import annotations

from pathlib import Path

import pytest

from deltaopt.output.controller_c import export_c
from deltaopt.robot.robot import load_robot

ROBOT = load_robot(Path(__file__).parents[2] / "problems" / "robots" / "orsino.yaml")


@pytest.mark.parametrize("name", ["*/ int evil; /*", "a\n*/ int evil;", "µ-Delta \u2028 \\"])
def test_a_name_does_not_end_the_comment(name, tmp_path):
    header, *_ = export_c(ROBOT.model_copy(update={"name": name}), tmp_path)
    text = header.read_text(encoding="utf-8")
    assert "evil" not in text.split("*/")[1]
    assert text.splitlines()[0].endswith(": kinematics and dynamics. Written by deltaopt.")
