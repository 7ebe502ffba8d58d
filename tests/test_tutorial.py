"""The manual: its commands run, and print what its pages say they print."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from deltaopt.cli import main
from deltaopt.files.yaml_file import read_yaml

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs/tutorial.md").read_text(encoding="utf-8")
_BLOCK = re.compile(r"^```console\n\$ deltaopt (.*)\n((?:.*\n)*?)```$", re.M)
BLOCKS = _BLOCK.findall(PAGE)
_SCENE = re.compile(r"^```yaml\n# (problems/[\w/]+\.yaml)\n(.*?)```$", re.M | re.S)
BY_JOB = ("approach", "bodies", "cycles", "limits", "moving", "paths", "report", "smooth")
"""Pages that show a scene and what planning it prints."""
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e-?\d+)?")
TOLERANCE = 0.01
"""Of a number. Those below a thousandth are roundings and gaps, of which any will do."""
SMALLEST, OF_GAPS = 1e-3, 0.1
"""Differences that count; of gaps, in per cent: an estimate within the tolerance hangs on the last
bits of a processor."""
SHARE, OF_SHARES = re.compile(r"\d+(?= % of the time)"), 1.0
"""Shares of the time are whole per cent, so two that are told differ by their roundings."""
SAVED, OF_SAVED = re.compile(r"(?<=would save )\d+\.\d(?= %)"), 0.1001
"""So do tenths of a per cent: 3.648 on one processor and 3.664 on another are 3.6 and 3.7."""


def said(line: str, printed: str) -> bool:
    """Whether a line is among those printed, but for small differences of numbers."""
    words = " ".join(NUMBER.sub("#", line).split())
    smallest = OF_GAPS if line.startswith("at most") else SMALLEST
    for other in printed.splitlines():
        if " ".join(NUMBER.sub("#", other).split()) == words:
            both = line, other
            shares, saved = ([each.findall(text) for text in both] for each in (SHARE, SAVED))
            others = (NUMBER.findall(SAVED.sub("#", SHARE.sub("#", text))) for text in both)
            rounded = near(*shares, OF_SHARES) and near(*saved, OF_SAVED)
            if rounded and near(*others, smallest):
                return True
    return False


def near(one: list[str], other: list[str], smallest: float) -> bool:
    """Whether numbers are the same but for small differences."""
    return all(
        abs(a - b) <= max(smallest, TOLERANCE * abs(a))
        for a, b in zip(map(float, one), map(float, other), strict=True)
    )


def test_commands_print_what_the_page_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert len(BLOCKS) == 8
    for command, told in BLOCKS:
        assert main(shlex.split(command)) == 0, command
        printed = capsys.readouterr().out
        for line in told.splitlines():
            assert said(line, printed), f"{command}\n{line}\n{printed}"


def test_files_are_those_of_the_page(tmp_path, monkeypatch):
    """The lines that count are those that `deltaopt new` writes."""
    monkeypatch.chdir(tmp_path)
    main(["new", "cell"])
    shown = re.findall(r"^```yaml\n# (cell/\w+\.yaml)\n(.*?)```$", PAGE, re.M | re.S)
    assert [name for name, _ in shown] == ["cell/robot.yaml", "cell/scene.yaml"]
    for name, text in shown:
        file = tmp_path / "shown.yaml"
        file.write_text(text, encoding="utf-8")
        assert read_yaml(file) == read_yaml(tmp_path / name)


@pytest.mark.parametrize("page", BY_JOB)
def test_a_page_by_job_shows_its_scene_and_what_is_printed(page, tmp_path, capsys, monkeypatch):
    (tmp_path / "problems").symlink_to(ROOT / "problems")
    monkeypatch.chdir(tmp_path)
    text = (ROOT / f"docs/{page}.md").read_text(encoding="utf-8")
    command, told = _BLOCK.findall(text)[0]
    assert main([*shlex.split(command), "--no-plot"]) == 0
    printed = capsys.readouterr().out
    for line in told.splitlines():
        assert said(line, printed), f"{line}\n{printed}"
    for file, shown in _SCENE.findall(text):
        copy = tmp_path / "shown.yaml"
        copy.write_text(shown, encoding="utf-8")
        planned = {"objective": "time", **read_yaml(copy)}
        assert planned == {"objective": "time", **read_yaml(ROOT / file)}
