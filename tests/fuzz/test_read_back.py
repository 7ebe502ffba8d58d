"""Random plans and tables to read: a result, or one sentence."""

from __future__ import annotations

import copy
import json
from math import inf
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import deltaopt
from deltaopt.cli import main
from deltaopt.output.facts import facts
from deltaopt.output.foreign_table import read_foreign_table
from deltaopt.output.plan_files import write_json, write_motion
from deltaopt.output.saved_plan import load_plan
from deltaopt.planning.plan import plan_as_it_is
from studies.problems import PROBLEMS
from tests.fuzz.inputs import SCENE, fewer, limited, numbers, result_or_sentence, trees

ROBOT = str(PROBLEMS / "robots/orsino.yaml")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    found, line = tmp_path_factory.mktemp("plans"), deltaopt.baseline(SCENE)
    plan = plan_as_it_is(SCENE, line, inf, None, "straight line")
    write_json(found / "good.json", facts(plan))
    write_motion(found / "good.csv", line, rate=50)
    return found


def replaced(content: Any, path: list[int], value: object) -> Any:
    """A nested content in which the value at a place, given by numbers, is another."""
    if not path or not isinstance(content, dict | list) or not content:
        return value
    found = copy.copy(content)
    keys = list(found) if isinstance(found, dict) else range(len(found))
    key = keys[path[0] % len(keys)]
    found[key] = replaced(found[key], path[1:], value)
    return found


@given(
    path=st.lists(st.integers(0, 50), min_size=1, max_size=5),
    value=st.one_of(trees, numbers),
    key=st.sampled_from(["scene", "motion", None]),
)
def test_plans(path, value, key, folder):
    content = json.loads((folder / "good.json").read_text(encoding="utf-8"))
    if key:
        content[key] = replaced(content[key], path, value)
    else:
        content = replaced(content, path, value)
    (folder / "plan.json").write_text(json.dumps(content), encoding="utf-8")
    with result_or_sentence():
        load_plan(folder / "plan.json")


@given(
    content=st.one_of(
        st.binary(max_size=80), st.text("[]{}:,\"'0e.-nul \n", max_size=80).map(str.encode)
    )
)
def test_any_bytes(content, folder):
    for name in ("plan.json", "table.csv"):
        (folder / name).write_bytes(content)
    with result_or_sentence():
        load_plan(folder / "plan.json")
    with result_or_sentence():
        read_foreign_table(folder / "table.csv")


@fewer(2)
@given(data=st.data())
def test_tables(data, folder, capfd):
    lines = (folder / "good.csv").read_text(encoding="utf-8").splitlines()
    for _ in range(data.draw(st.integers(1, 3))):
        row = data.draw(st.integers(0, len(lines) - 1))
        cells = lines[row].split(",")
        text = data.draw(st.one_of(numbers.map(str), st.text('0123.e-,t" naif', max_size=6)))
        cells[data.draw(st.integers(0, len(cells) - 1))] = text
        lines[row] = ",".join(cells)
    (folder / "table.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    with result_or_sentence():
        read_foreign_table(folder / "table.csv")
    capfd.readouterr()
    with limited(20):
        assert main(["verify", str(folder / "table.csv"), "--robot", ROBOT]) in (0, 1, 2)
    assert "Traceback" not in capfd.readouterr().err
