"""Every study at its small size: it runs, says what it found, and writes what it says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from studies import line
from studies.__main__ import DOCS, STUDIES, main
from studies.problems import PROBLEMS

SAYS = {
    "attack": "2 of 2 attempts are good",
    "bench": "2 of 2 verified and within tolerance",
    "bodies": "1 of 1 planned, 1 verified",
    "conventions": "conventions.png",
    "cycle": "| industrial | line across |",
    "first_motions": "inside               7       0   100.0%      1",
    "frontier": "On free moves within 0.01 by Ipopt flat",
    "frozen": "cases agree to 1e-09",
    "gallery": "gallery_platform_speed.png",
    "gap": "0 refused or not converged, 0 without a truth",
    "keep_out": "slot, 1 mm beside the tool: 1 of 1 planned",
    "line": "pick_and_place: line by a quintic law 0.1966 s",
    "lower_bound": "ratio of lower bound to duration",
    "models": "For torques",
    "multistart": "Of 1 moves inside 2 first guesses make faster",
    "mutations": "test_jumping_velocity",
    "numbers": "every number of a marked block stands in its output",
    "smooth": "with torques that jump",
    "parts": "| industrial | 0.45 |",
    "smoother": "cost of torque rates",
    "processors": "| OpenBLAS for Haswell |",
    "reference": "|`drive.motor.peak_torque`|a torque in N·m, greater than 0|required|",
    "sanitize": "0 findings",
    "tables": "| pick_and_place | quintic |",
    "terms": "3 of 3 terms change a plan",
    "theory": "intervals: gap told",
    "tutorial": "cubic, rows each ms: asks for 1.50 of a limit",
}


CHARTS = (DOCS / "dev/charts.md").read_text(encoding="utf-8")


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("name", SAYS)
def test_study_in_small(name, capsys):
    assert main([name, "--small"]) == 0
    assert SAYS[name] in capsys.readouterr().out


def test_robots_that_follow_no_path_are_left_out(capsys):
    """With limits of torque rate a path is given with a tube alone."""
    assert main(["cycle", str(PROBLEMS / "robots" / "industrial_smooth.yaml")]) == 0
    printed = capsys.readouterr()
    assert "industrial_smooth is left out" in printed.err
    assert "industrial_smooth" not in printed.out


def test_the_straight_lines_of_the_documentation_need_no_arguments(monkeypatch, capsys):
    """Those of docs/outputs/line.txt, which are not planned again here."""
    monkeypatch.setattr(line, "durations", lambda scene: scene.robot.name)
    assert main(["line"]) == 0
    found = re.findall("^(.*?):", capsys.readouterr().out, re.MULTILINE)
    recorded = (DOCS / "outputs" / "line.txt").read_text(encoding="utf-8")
    assert found == re.findall("^(.*?): line", recorded, re.MULTILINE)


def test_all_is_unattended(monkeypatch, capsys, tmp_path):
    """A study that ends in an unforeseen error is named, the others go on; --after leaves out those
    before; --into copies what was drawn."""

    def run(arguments):
        if arguments.study == "smoother":
            raise RuntimeError("nobody expected this")
        (Path("out/tutorial")).mkdir(parents=True, exist_ok=True)
        (Path("out/tutorial") / "tutorial_table.png").write_bytes(b"drawn")
        return 0

    for name in STUDIES:
        monkeypatch.setattr(f"studies.{name}.run", run)
    assert main(["all", "--small", "--after", "size", "--into", str(tmp_path)]) == 1
    printed = capsys.readouterr()
    copied = tmp_path / "tutorial_table.png"
    names = list(STUDIES)[list(STUDIES).index("size") + 1 :]
    expected = {name: f"{name}: 0 s, exit code 0" for name in names}
    expected["smoother"] = "smoother: 0 s, exit code 1"
    expected["tutorial"] += f", {copied}"
    assert printed.out.splitlines()[-len(names) :] == list(expected.values())
    assert "nobody expected this" in printed.err
    assert copied.read_bytes() == b"drawn"


def test_every_picture_of_the_documentation_is_listed_with_its_command():
    """A study that is still there, a command of the package, or a commit that has the study."""
    listed = re.findall(r"^\| \[\w+\]\(\.\./(.+)\) \| `(.+)`( of \w+)? \|", CHARTS, re.MULTILINE)
    assert [file for file, *_ in listed] == sorted(file.name for file in DOCS.glob("*.png"))
    studies = [command.split()[3] for _, command, of in listed if "studies" in command and not of]
    assert studies
    assert set(studies) <= set(STUDIES)


def test_pictures_of_the_documentation_are_small():
    """150 kB of each, 500 kB of the animation, so that pages come at once."""
    files = {file.name: file.stat().st_size for file in DOCS.glob("*.[pg][ni][gf]")}
    assert files.pop("animation.gif") <= 500_000
    assert len(files) > 20
    assert {name: size for name, size in files.items() if size > 150_000} == {}


def test_help_lists_every_study(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--help"])
    assert end.value.code == 0
    told = capsys.readouterr().out
    assert all(f"    {name}" in told for name in STUDIES)


def test_an_error_is_one_sentence(capsys):
    assert main(["line", "nowhere.yaml"]) == 2
    printed = capsys.readouterr()
    assert printed.err.count("\n") == 1
    assert "nowhere.yaml cannot be read" in printed.err
