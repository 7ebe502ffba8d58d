"""What charts say in their titles is what their numbers say: counted here by hand."""

import re
from math import inf
from types import SimpleNamespace

import numpy as np
import pandas
import pytest

import deltaopt
from deltaopt.cli.map import _places_in_words
from deltaopt.compare.model_terms import MODEL_TERMS, TermEffect
from deltaopt.motion.active_limits import AT_LIMIT
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.facts import facts
from deltaopt.planning.plan import plan_as_it_is
from deltaopt.plots import dynamics, inverse, limits, model_terms, plans
from deltaopt.plots.sweeps import draw_map
from studies import parts, smoother
from studies.frontier import Attempt, points
from studies.models.measure import FAMILIES, ROUNDING, TASKS, Error
from studies.plots import conventions, digits, frontier, gap, lower_bound, terms, tutorial
from studies.terms import Effect


def attempt(method: str, seconds: float, gap: float, *, past_bodies: bool = False) -> Attempt:
    return Attempt("a", past_bodies, method, 1, 1e-3, seconds, gap, True)


def test_frontier_tells_the_least_and_the_largest_ratio_and_who_is_soonest():
    found = points(
        [
            attempt("default", 0.01, 1e-4),
            attempt("flat", 0.3, 1e-4),
            attempt("explicit", 1.2, 1e-4),
            attempt("Ruckig", 0.001, 0.25),
            attempt("default", 0.1, 1e-4, past_bodies=True),
            attempt("flat", 2.0, 1e-4, past_bodies=True),
        ]
    )
    assert frontier.title(found) == (
        "As accurate as Ipopt 20 to 120 times sooner; Ruckig is soonest, 25 % too slow"
    )
    without = [point for point in found if point.method != "Ruckig"]
    assert frontier.title(without) == "As accurate as Ipopt 20 to 120 times sooner"


def test_digits_name_the_models_that_fail():
    errors = [
        Error(family, task, model, 1e-6, 1e-14)
        for family in FAMILIES
        for task in TASKS
        for model in ("A", "B", ROUNDING)
    ]
    assert (
        digits.title(errors)
        == "None fail near singularities; 2 of 2 models keep all digits that can be kept"
    )
    wrong = Error("coplanar", "forward", "B", 1e-6, 0.3)
    same = (wrong.family, wrong.task, wrong.model)
    others = [e for e in errors if (e.family, e.task, e.model) != same]
    assert (
        digits.title([*others, wrong])
        == "B fail near singularities; 1 of 2 models keep all digits that can be kept"
    )


def test_terms_count_what_matters_anywhere():
    effects = [Effect("a", "mass", 0.3), Effect("b", "mass", 0.001), Effect("b", "pins", 0.009)]
    told = "1 of 2 terms change a plan by 1 % or more"
    assert terms.title(effects) == f"{told}; pins by less"
    assert terms.title(effects[:1]) == "1 of 1 terms change a plan by 1 % or more"


def test_terms_of_one_scene():
    effects = [TermEffect(MODEL_TERMS[0], 0.02), TermEffect(MODEL_TERMS[1], 0.001)]
    told = "1 of 2 terms change the plan by 1 % or more"
    assert model_terms.message(effects) == f"{told}, {MODEL_TERMS[0].name} most"


def test_parts_tell_the_least_and_the_largest_gain():
    rows = [parts.Row("a", 1 / 3, 90, 100, planned, 0.0) for planned in (121, 134)]
    assert parts.title(rows).startswith("21 to 34 % more parts a minute")


def test_lower_bound_tells_the_medians():
    found = {"a": np.array([0.2, 0.5, 0.9]), "b": np.array([0.8, 0.95, 0.99])}
    assert lower_bound.title(found).startswith("The lower bound is 50 to 95 % of the duration")


def test_gaps_that_are_too_small_are_counted():
    rows = [SimpleNamespace(told=told, true=1e-4) for told in (2e-4, 5e-5, 1e-4)]
    assert gap.title(rows) == "1 of 3 plans tell too small a gap"


def test_smoother_names_the_ways_with_the_longest_ramps():
    found = [
        smoother.Smoothed("limit", SimpleNamespace(), 20.0, 25.0),
        smoother.Smoothed("cost", SimpleNamespace(), 5.0, 40.0),
    ]
    said = "Longest ramps: limit; usually: cost"
    assert smoother.title(found) == said


def test_tutorial_tells_what_the_first_share_saves_and_what_tables_ask():
    said = "1 % more time saves 25 % of the effort"
    assert tutorial.title_of_effort({0.0: 200.0, 0.01: 150.0, 0.1: 90.0}) == said
    asked = [SimpleNamespace(name=name, most=m) for name, m in (("cubic, x", 1.5), ("quintic", 1))]
    assert "cubic 150 %, quintic 100 % of the limit" in tutorial.title_of_tables(asked)


def test_conventions_are_those_of_the_model():
    """Motor 2 lies clockwise from motor 1 for those who look down: from y towards z."""
    robot = deltaopt.load_scene("problems/pick_and_place.yaml").robot
    shafts = [np.array([0, 1, 0]), np.array([0, np.cos(2 * np.pi / 3), np.sin(2 * np.pi / 3)])]
    turn = np.degrees(np.arccos(shafts[0] @ shafts[1]))
    assert conventions.title().startswith(f"Motor 2 is {turn:.0f}° on from motor 1")
    assert robot.base_radius > 0


def row_of_dynamics(model: str, seconds: float, error: float) -> SimpleNamespace:
    return SimpleNamespace(task="inverse", model=model, seconds=seconds, median_error=error)


def test_dynamics_tell_the_largest_error_and_how_far_costs_lie_apart():
    rows = [row_of_dynamics("a", 5e-7, 2e-16), row_of_dynamics("b", 2e-5, 4e-16)]
    study = SimpleNamespace(rows=rows, floor={"inverse": 1e-16})
    assert dynamics.title(study) == "Models err by 4e-16 at most, and differ 40 times in cost"


def row_of_plans(formulation: str, seconds: float) -> SimpleNamespace:
    method = SimpleNamespace(formulation=formulation, closure="")
    return SimpleNamespace(method=method, seconds=seconds, gap=1e-4, failure="")


def test_plans_name_the_soonest_and_the_latest():
    rows = [row_of_plans("flat", 0.2), row_of_plans("multiplier", 0.9)]
    told = plans.title(rows, "a_case")
    assert told == "a case: flat is 4.5 times quicker than multiplier"


@pytest.mark.parametrize(("first", "last"), [(0.025, 0.45), (0.9, 3.2), (0.2, 0.26), (0.03, 40)])
def test_numbers_of_plans_have_room_whatever_the_times_are(first, last, tmp_path):
    """Every chart that a test draws is searched for labels that overlap."""
    rows = []
    for name, gaps in (("flat", (1e-2, 1e-3)), ("explicit", (3e-2, 3e-3)), ("multiplier", (9e-2,))):
        method = SimpleNamespace(formulation=name, closure="")
        rows += [
            SimpleNamespace(case="c", method=method, seconds=seconds, gap=gap, failure="")
            for seconds, gap in zip((first, last), gaps, strict=False)
        ]
    plans.draw(SimpleNamespace(rows=rows), "c", tmp_path / "plans.png")


def test_limits_are_headed_by_the_one_that_holds_longest(picked, drawn, tmp_path):
    limits.draw_limits(tmp_path / "limits.png", facts(picked))
    tau = picked.trajectory(picked.trajectory.instants(20_001)).tau
    share = 100 * (np.abs(tau) >= 10 * AT_LIMIT).mean(axis=0).max()
    told = drawn[0].axes[0].get_title(loc="left")
    assert "torque is at its limit" in told
    assert float(told.split()[-5]) == pytest.approx(share, abs=1.0)


def test_every_body_has_a_curve_with_its_name(drawn, tmp_path):
    """Three are not taken for motors; of more than can be told apart the nearest are named."""
    scene = deltaopt.load_scene("problems/pick_and_place.yaml")
    boxes = [(np.array([0.5, y, -0.1]), np.array([0.6, y + 0.01, 0.1])) for y in (0.2, 0.3, 0.4)]
    bodies = [{"box": {"from": tuple(a), "to": tuple(b)}} for a, b in boxes]
    ball = {"sphere": {"centre": (0.3, 0.0, 0.4), "radius": 0.05}}
    for more in (0, 7):
        keep_out = [*bodies, *[ball] * more]
        limited = {"limits": {"tilt_singularity": 0.01}, "keep_out": keep_out}
        passing = deltaopt.Scene.model_validate({**scene.model_dump(exclude_none=True), **limited})
        line = deltaopt.baseline(passing)
        told = facts(plan_as_it_is(passing, line, inf, None, "straight line"))
        limits.draw_limits(tmp_path / "limits.png", told)
        page = drawn.pop()
        (panel,) = (a for a in page.axes if a.get_ylabel() == "clearance (m)")
        curves = {each.get_label(): each for each in panel.get_lines()}
        x = line(curves["keep_out[0], a box"].get_xdata()).x
        for index, (least, most) in enumerate(boxes):
            away = np.linalg.norm(x - np.clip(x, least, most), axis=1)
            curve = curves[f"keep_out[{index}], a box"].get_ydata()
            np.testing.assert_allclose(curve, away, atol=1e-9)
        named = [text.get_text() for text in panel.get_legend().get_texts()]
        assert len(named) == min(8, len(keep_out))
        assert not any("motor" in name for name in curves)
        for axes in page.axes:
            label = axes.yaxis.label.get_window_extent()
            assert label.height <= 1.1 * axes.get_window_extent().height


@pytest.mark.parametrize(
    ("across", "aside", "letters"), [(0.3, 0.02, 1), (0.1, 0.4, 10), (0.2, 0.0, 12)]
)
def test_labels_of_a_map_do_not_collide_and_numbers_keep_their_units(
    across, aside, letters, drawn, tmp_path
):
    """Of a flat region, a tall one, and of places in a line; lines end at other places after some
    ``letters`` more."""
    sides = np.linspace(-across, across, 5), np.linspace(-aside, aside, 5 if aside else 1)
    y, z = (each.ravel() for each in np.meshgrid(*sides))
    far = np.hypot(y, z)
    columns = {"duration": 0.1361 + 1e-3 * far, "rms_share": 0.5 + 1e-3 * far, "singularity": far}
    table = pandas.DataFrame({"place.x": 0.7, "place.y": y, "place.z": z, **columns})
    file = tmp_path / "map.png"
    draw_map(file, f"{'x' * letters} {_places_in_words(table)}", table, [*columns])
    title = drawn[-1].get_suptitle()
    assert not re.search(r"\d\n[sm%](?!\w)|=\n", title), title
    bars = [axes for axes in drawn[-1].axes if axes.get_label() == "<colorbar>"]
    assert len(bars) == 3
    panels = [axes for axes in drawn[-1].axes if axes not in bars]
    assert all(axes.yaxis_inverted() for axes in panels)  # from above: y right, z down
    for bar in bars:
        label = bar.yaxis.label.get_window_extent()
        assert label.height <= bar.get_window_extent().height


def test_prescribed_motions_are_headed_by_their_size(drawn, tmp_path):
    line: Trajectory = deltaopt.baseline(deltaopt.load_scene("problems/pick_and_place.yaml"))
    inverse.draw_motion(tmp_path / "motion.png", line)
    inverse.draw_torques(tmp_path / "torques.png", line)
    motion, torques = (page.get_suptitle() for page in drawn)
    fastest = 1.875 * 0.15 / line.duration  # of a quintic law
    assert motion == f"150 mm in {line.duration:.3g} s, {fastest:.2g} m/s at most"
    assert torques.startswith("up to 10 N·m, ")
