"""plan.json is what its published schema says, and its polynomials are the motion."""

from __future__ import annotations

import copy
import json
import re
from math import inf
from pathlib import Path

import numpy as np
import pytest

import deltaopt
from deltaopt.cli import main
from deltaopt.output.facts import facts
from deltaopt.output.plan_files import schema, write_json
from deltaopt.planning.plan import plan_as_it_is
from studies.problems import PROBLEMS

SCHEMA = json.loads(schema())
TYPES = {
    "object": dict,
    "array": list,
    "string": str,
    "boolean": bool,
    "null": type(None),
    "number": (int, float),
    "integer": int,
}
KEYWORDS = {
    "$schema",
    "title",
    "description",
    "type",
    "const",
    "anyOf",
    "properties",
    "required",
    "additionalProperties",
    "items",
    "minItems",
    "maxItems",
    "minimum",
}


def faults(value: object, rule: dict, place: str = "$") -> list[str]:
    """What of a value is not as a rule of JSON Schema says, for the keywords that ours uses."""
    assert set(rule) <= KEYWORDS, set(rule) - KEYWORDS
    found = []
    if "anyOf" in rule and all(faults(value, each) for each in rule["anyOf"]):
        found.append(f"{place}: none of the alternatives")
    if "const" in rule and value != rule["const"]:
        found.append(f"{place}: is not {rule['const']}")
    if "type" in rule:
        names = rule["type"] if isinstance(rule["type"], list) else [rule["type"]]
        kinds = tuple(TYPES[name] for name in names if name != "number")
        is_number = "number" in names and isinstance(value, int | float)
        if isinstance(value, bool) and "boolean" not in names:
            return [*found, f"{place}: is a truth value"]
        if not (is_number or isinstance(value, kinds)):
            return [*found, f"{place}: is no {rule['type']}"]
    if isinstance(value, dict):
        known = rule.get("properties", {})
        missing = set(rule.get("required", ())) - set(value)
        found += [f"{place}: has no {key}" for key in sorted(missing)]
        for key, inner in value.items():
            other = rule.get("additionalProperties", True)
            own = known.get(key, other)
            if own is False:
                found.append(f"{place}: {key} is not known")
            elif own is not True:
                found += faults(inner, own, f"{place}.{key}")
    if isinstance(value, list):
        if not rule.get("minItems", 0) <= len(value) <= rule.get("maxItems", len(value)):
            found.append(f"{place}: has {len(value)} items")
        for i, inner in enumerate(value):
            found += faults(inner, rule.get("items", {}), f"{place}[{i}]")
    if "minimum" in rule and value < rule["minimum"]:
        found.append(f"{place}: is less than {rule['minimum']}")
    return found


def saved(file: Path) -> dict:
    def refuse(name):
        raise AssertionError(f"{name} is no JSON")

    return json.loads(file.read_text(encoding="utf-8"), parse_constant=refuse)


@pytest.fixture(scope="module")
def plan(tmp_path_factory) -> dict:
    folder = tmp_path_factory.mktemp("plan")
    scene = deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml")
    deltaopt.plan(scene, starts=2).save(folder, chart=False)
    return saved(folder / "plan.json")


def test_a_plan(plan):
    assert faults(plan, SCHEMA) == []
    assert plan["optima"]


@pytest.mark.parametrize("name", ["paths/glue_line", "moving/stop", "via/onto_a_belt"])
def test_plans_of_other_kinds(name, tmp_path):
    scene = deltaopt.load_scene(PROBLEMS / f"{name}.yaml")
    deltaopt.plan(scene, tolerance=1e-2).save(tmp_path, chart=False)
    assert faults(saved(tmp_path / "plan.json"), SCHEMA) == []


def test_coordinates_of_their_own_and_a_certificate(tmp_path):
    scene = deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml")
    drifting = deltaopt.Redundant(deltaopt.explicit, deltaopt.AccelerationLevel())
    plan = deltaopt.plan(scene, formulation=drifting, tolerance=1e-2)
    plan.save(tmp_path, chart=False)
    assert faults(saved(tmp_path / "plan.json"), SCHEMA) == []
    again = deltaopt.load_plan(tmp_path).trajectory.coordinates.coefficients
    np.testing.assert_array_equal(again, plan.trajectory.coordinates.coefficients)
    deltaopt.plan(scene, tolerance=1e-6).save(tmp_path, chart=False)
    content = saved(tmp_path / "plan.json")
    assert faults(content, SCHEMA) == []
    assert content["certificate"] is not None


def test_lines_of_scenes_with_every_limit(tmp_path):
    for file in sorted((PROBLEMS / "limits").glob("*.yaml")):
        scene = deltaopt.load_scene(file)
        line = deltaopt.baseline(scene)
        plan = plan_as_it_is(scene, line, inf, None, "straight line")
        write_json(tmp_path / "plan.json", facts(plan))
        assert faults(saved(tmp_path / "plan.json"), SCHEMA) == [], file


def test_every_key_is_described_or_named_by_its_place(plan):
    assert set(SCHEMA["properties"]) == set(plan)
    for name, rule in SCHEMA["properties"].items():
        assert re.search(r"[.;]$", rule.get("description", "")), name


BROKEN = {
    "no duration": lambda c: c.pop("duration"),
    "a key more": lambda c: c.update(extra=1),
    "another format": lambda c: c.update(format=2),
    "a truth value for a number": lambda c: c.update(gap=True),
    "two coordinates": lambda c: c["motion"]["position"][0][0].pop(),
    "a negative count": lambda c: c.update(intervals=-1),
    "half a certificate": lambda c: c.update(certificate={"sign_violation": 0.0}),
}


@pytest.mark.parametrize("name", BROKEN)
def test_what_is_no_plan(plan, name):
    content = copy.deepcopy(plan)
    BROKEN[name](content)
    assert len(faults(content, SCHEMA)) == 1


def test_the_polynomials_are_the_motion(plan, tmp_path):
    """Evaluated from the file alone, as the schema says."""
    knots, position = plan["motion"]["knots"], plan["motion"]["position"]
    (tmp_path / "plan.json").write_text(json.dumps(plan), encoding="utf-8")
    trajectory = deltaopt.load_plan(tmp_path).trajectory
    t = np.linspace(0, plan["duration"], 1001)[:-1]
    found = []
    for each in t:
        i = max(k for k in range(len(knots) - 1) if knots[k] <= each)
        terms = [np.multiply(c, (each - knots[i]) ** k) for k, c in enumerate(position[i])]
        found.append(np.sum(terms, axis=0))
    np.testing.assert_allclose(found, trajectory(t).x, atol=1e-14)
    assert plan["scene"]["start"] == position[0][0]


def test_the_schema_is_exported(tmp_path, capsys):
    file = tmp_path / "plan.schema.json"
    assert main(["export", "schema", "-o", str(file)]) == 0
    assert json.loads(file.read_text(encoding="utf-8")) == SCHEMA
    assert f"written: {file}" in capsys.readouterr().out
