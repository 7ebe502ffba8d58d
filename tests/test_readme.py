"""README.md: what it prints is printed, what it runs is run, what it points to is there."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path

import pytest

from deltaopt.cli import COMMANDS

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
NUMBER = re.compile(r"\d+\.\d*")
TOLERANCE = 1e-3
"""As README says: of a number, or of 1 if it is smaller."""
THREE_SCREENS = 3 * 45
"""Lines."""


def fenced(language: str) -> list[str]:
    """The blocks of a language, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.M | re.S)


def test_script_prints_what_readme_says(monkeypatch):
    monkeypatch.chdir(ROOT)
    (script,), (told,) = fenced("python"), fenced("text")
    assert len([line for line in script.splitlines() if line]) <= 10
    with contextlib.redirect_stdout(io.StringIO()) as out:
        exec(compile(script, "README.md", "exec"), {})
    printed = out.getvalue()
    assert NUMBER.sub("#", printed) == NUMBER.sub("#", told)
    for found, expected in zip(NUMBER.findall(printed), NUMBER.findall(told), strict=True):
        allowed = TOLERANCE * max(1.0, float(expected))
        assert float(found) == pytest.approx(float(expected), rel=0, abs=allowed)


def test_ci_runs_the_commands_of_readme():
    """.ci/run takes them from README.md: each pattern there is one of the two, and only that."""
    patterns = re.findall(r"readme_command '(.+)'", (ROOT / ".ci/run").read_text(encoding="utf-8"))
    matched = [re.findall(rf"^{pattern}.*$", README, re.M) for pattern in patterns]
    assert matched == [[command.strip()] for command in fenced("bash")]
    assert len(matched) == 2


def test_ci_is_executable():
    assert (ROOT / ".ci/run").stat().st_mode & 0o111


def test_every_command_is_told():
    page = (ROOT / "docs/commands.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `deltaopt (\w+)", page, re.M)) == set(COMMANDS)


PAGES = ["README.md", *(f"docs/{p.name}" for p in ROOT.glob("docs/*.md"))]
FOR_AUTHORS = [f"docs/dev/{p.name}" for p in ROOT.glob("docs/dev/*.md")]


@pytest.mark.parametrize("page", PAGES)
def test_page_is_at_most_three_screens_long(page):
    assert len((ROOT / page).read_text(encoding="utf-8").splitlines()) <= THREE_SCREENS


@pytest.mark.parametrize("page", [*PAGES, *FOR_AUTHORS])
def test_links_lead_somewhere(page):
    file = ROOT / page
    for target in re.findall(r"\]\(([^)#]+)\)", file.read_text(encoding="utf-8")):
        if not target.startswith("https:"):
            assert (file.parent / target).exists(), target
