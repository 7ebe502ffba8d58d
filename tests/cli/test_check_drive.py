"""What `deltaopt check` prints of a drive: numbers computed by hand from the catalogue's."""

from __future__ import annotations

import yaml

from deltaopt.cli import main
from deltaopt.cli.check import drive_table
from deltaopt.robot.drive import Drive
from studies.problems import PROBLEMS


def test_every_step_from_the_catalogue_to_the_arm(capsys):
    """Hornet 565: 20 x 0.94 = 18.8; 20² = 400; 6000 rpm = 628.319 rad/s; docs/drives.md too."""
    assert main(["check", str(PROBLEMS / "robots/hornet_565.yaml")]) == 0
    out = capsys.readouterr().out
    lines = [" ".join(line.split()) for line in out.splitlines()]
    for line in (
        "torque 65 N·m, set by the gear",
        "motor 3.82 N·m · 20 · 0.94 = 71.816",
        "gear 65 N·m = 65",
        "RMS torque 23.876 N·m = 1.27 N·m · 20 · 0.94, motor",
        "speed 31.416 rad/s, set by the motor",
        "gear 628.319 rad/s / 20 = 31.416",
        "inertia 0.018 kg·m², most of it is the motor",
        "motor 2.8e-05 kg·m² · 20² = 0.0112",
        "brake 5e-06 kg·m² · 20² = 0.002",
        "gear 1.2e-05 kg·m² · 20² = 0.0048",
        "gear, nominal 35 N·m, for the cubic mean weighted with speed",
        # 71.816 - (71.816 - 35.72) (n - 3500) / 2500 = 65 N·m at n = 3972.1 rpm = 415.95 rad/s
        "torque curve 65 N·m at 0 rad/s, 65 N·m at 20.798 rad/s, 35.72 N·m at 31.416 rad/s",
    ):
        assert line in lines
    page = (PROBLEMS.parent / "docs/drives.md").read_text(encoding="utf-8")
    assert out[out.index("drive, at the arm") :] in page


def test_the_zeros_and_signs_of_the_controller_are_told_in_degrees(capsys, tmp_path):
    """In which a zero that lacks its unit is seen."""
    robot = yaml.safe_load((PROBLEMS / "robots/industrial.yaml").read_text())
    for zero, told in (("[5.328 deg, 0 deg, -3 deg]", "-5.328, 0, 3"), (5.328, "-305.272, " * 3)):
        joints = {"zero": yaml.safe_load(str(zero)), "sign": [1, 1, -1]}
        (tmp_path / "robot.yaml").write_text(yaml.safe_dump(robot | {"joints": joints}))
        assert main(["check", str(tmp_path / "robot.yaml")]) == 0
        line = capsys.readouterr().out.splitlines()[1]
        assert f"the model's are {told.strip(', ')} degrees; it counts downwards: motor 3" in line
    assert main(["check", str(PROBLEMS / "robots/industrial.yaml")]) == 0
    assert "angles" not in capsys.readouterr().out


def test_the_baselines_duty_where_motors_are_rated(capsys, tmp_path):
    robot = yaml.safe_load((PROBLEMS / "robots/industrial.yaml").read_text(encoding="utf-8"))
    robot["drive"] = {"torque": 40.0, "rms_torque": 20.0, "friction": {"viscous": 0.5}}
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(robot), encoding="utf-8")
    (tmp_path / "scene.yaml").write_text(
        "{robot: robot.yaml, start: [0.85, -0.1, 0], goal: [0.85, 0.1, 0]}", encoding="utf-8"
    )
    assert main(["check", str(tmp_path / "scene.yaml")]) == 0
    out = capsys.readouterr().out
    for words in ("  friction      0.5 N·m·s/rad · θ̇", "the baseline:", "    rated torque  "):
        assert words in out
    assert main(["check", str(PROBLEMS / "industrial_cross.yaml")]) == 0
    assert "the baseline:" not in capsys.readouterr().out


def test_a_drive_at_the_arm():
    drive = {
        "torque": [10.0, 11.0, 11.0],
        "speed": 8.0,
        "inertia": 0.02,
        "friction": {"viscous": 0.3, "coulomb": 2.0, "speed": 0.05},
        "rms_torque": 5.0,
    }
    lines = [" ".join(line.split()) for line in drive_table(Drive.model_validate(drive))]
    assert lines == [
        "drive, at the arm",
        "torque 10, 11, 11 N·m",
        "RMS torque 5 N·m",
        "speed 8 rad/s",
        "inertia 0.02 kg·m²",
        "friction 0.3 N·m·s/rad · θ̇ + 2 N·m · tanh(θ̇ / (0.05 rad/s))",
    ]
