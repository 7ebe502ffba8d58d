"""The pages of keys are those that the code prints, and every key is on one of them."""

import re
from pathlib import Path

import pytest

from deltaopt.output.starting_files import robot_text, scene_text
from studies.reference import pages

DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.parametrize("name", pages())
def test_page_is_what_the_command_prints(name):
    """If not: python -m studies reference -o docs"""
    assert (DOCS / name).read_text(encoding="utf-8") == pages()[name]


@pytest.mark.parametrize(("text", "name"), [(robot_text, "robot"), (scene_text, "scene")])
def test_every_key_of_a_starting_file_has_a_row(text, name):
    keys = re.findall(r"^\s*#?(\w+):(?= )", text(), re.M)
    page = pages()[f"{name}-keys.md"] + pages()["drive-keys.md"]
    assert len(keys) > 10
    for key in keys:
        assert f"| `{key}` |" in page, key
