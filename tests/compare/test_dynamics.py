"""The comparison of the dynamics: right numbers from a tiny run, nothing about times."""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from deltaopt.cli import main
from deltaopt.codegen.c_compiler import compiler
from deltaopt.codegen.compile import in_machine_code
from deltaopt.compare.dynamics.many_digits import ManyDigits
from deltaopt.compare.dynamics.models import TASKS, StateSamples, models
from deltaopt.compare.dynamics.printed import PAPER, as_printed
from deltaopt.compare.dynamics.samples import NEAR_HOME, exact_samples, rounding_error
from deltaopt.compare.dynamics.study import Progress, Study, compare_dynamics
from deltaopt.dynamics.constraint_matrix import Partition
from deltaopt.dynamics.lagrange import Multiplier
from deltaopt.mechanisms.delta.mechanism import MOTOR_ANGLES, DeltaParameters, delta
from tests import paper_delta as paper


@pytest.fixture(scope="module")
def study() -> Study:
    return compare_dynamics(2, 1, None, lambda *_: None)


@pytest.fixture(scope="module")
def samples() -> StateSamples:
    return exact_samples(delta(PAPER), 4, ManyDigits())


def test_samples_obey_constraints_and_dynamics(samples: StateSamples) -> None:
    mechanism = delta(PAPER)
    f = ca.Function("f", [mechanism.q, mechanism.parameters], [mechanism.holonomic])
    inverse = Multiplier().inverse_dynamics(mechanism)
    for q, dq, ddq, tau in zip(samples.q, samples.dq, samples.ddq, samples.tau, strict=True):
        assert np.abs(np.asarray(f(q, samples.parameters))).max() < 1e-15
        again, _ = inverse(0.0, q, dq, ddq, samples.parameters)
        np.testing.assert_allclose(np.asarray(again).ravel(), tau, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("task", TASKS)
def test_two_exact_formulations_differ_by_the_rounding_of_the_state_only(
    task: object, samples: StateSamples
) -> None:
    """q̈ came from L_I in 50 digits; L_E in 50 digits returns it but for the rounding."""
    error = rounding_error(delta(PAPER), task, samples, ManyDigits())  # type: ignore[arg-type]
    assert np.all(error < 5e-15)


def test_all_models_are_accurate(study: Study) -> None:
    assert len(study.rows) == 36
    for row in study.rows:
        assert 0 <= row.median_error <= row.largest_error < 1e-13


def test_the_partition_is_the_one_that_pivoting_chooses() -> None:
    assert Partition.pivoted(paper.jacobian(PAPER, NEAR_HOME)) == MOTOR_ANGLES


def test_virtual_work_and_kane_need_the_same_operations(study: Study) -> None:
    """With u = q̇ they are the same equations, section 3.3."""
    for task in ("inverse", "forward"):
        for variant in ("closed form", "partition", "null space"):
            rows = [study.row(task, f"K, {name}", variant) for name in ("Kane", "virtual work")]
            assert rows[0].operations == rows[1].operations


@pytest.mark.skipif(compiler() is None, reason="no C compiler")
def test_compiled_functions_give_the_same(samples: StateSamples) -> None:
    mechanism = delta(PAPER)
    for task in TASKS:
        model = models()[6]
        function = model.build(mechanism, task)
        (machine,) = in_machine_code([function])
        arguments = [*(x[0] for x in task.inputs(samples)), samples.parameters]
        np.testing.assert_allclose(
            np.asarray(machine(*arguments)), np.asarray(function(*arguments)), rtol=1e-13
        )


@pytest.mark.parametrize(
    "terms", [PAPER, replace(PAPER, I42=0.002), replace(PAPER, g=None, m2=0.0)]
)
def test_printed_expressions_have_the_derived_values(terms: DeltaParameters) -> None:
    mechanism = delta(terms)
    printed = as_printed(mechanism, terms)
    x = [mechanism.q, mechanism.dq, mechanism.controls, mechanism.parameters]
    pairs = [(mechanism.M, printed.M), (mechanism.Q_gyr, printed.Q_gyr), (mechanism.Q, printed.Q)]
    rng, p = np.random.default_rng(5), np.asarray(ca.DM(terms.vector())).ravel()
    for derived, typed in pairs:
        difference = ca.Function("difference", x, [derived - typed])
        left = difference(*(rng.uniform(-1, 1, n) for n in (12, 12, 3)), p)
        assert np.abs(left.full()).max() < 1e-14


def words(text: str) -> str:
    return " ".join(text.split())


def test_command_writes_table_chart_and_verdict(
    study: Study,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of the study of the tests above, which is not measured again."""

    def measured(states: int, rounds: int, compiler: None, progress: Progress) -> Study:
        assert (states, rounds, compiler) == (2, 2, None)
        progress(1.0, "done")
        return study

    monkeypatch.setattr("deltaopt.compare.dynamics.study.compare_dynamics", measured)
    monkeypatch.setattr("deltaopt.codegen.c_compiler.compiler", lambda: None)
    command = ["compare", "dynamics", "--states", "2", "--rounds", "2", "-o", str(tmp_path)]
    assert main(command) == 0
    printed = capsys.readouterr()
    first, second = printed.out.split("\n\n")[0].split("For ")[1:]
    assert re.match(
        r"inverse dynamics use .* and L_I at its fastest takes \d+\.\d\d\.", words(first)
    )
    assert re.match(r"forward dynamics use .* Median errors are at most", words(second))
    assert "null space" in printed.out
    assert re.search(r"inverse dynamics, as derived, \d+% with eq\. \(55\)", words(printed.out))
    assert "100%" in printed.err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["dynamics.csv", "dynamics.png"]
    assert (tmp_path / "dynamics.png").read_bytes().startswith(b"\x89PNG")


def test_bad_usage_is_two(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", "kinematics"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("number", ["0", "-1", "1.5", "1" * 30])
@pytest.mark.parametrize("option", ["--states", "--rounds"])
def test_numbers_that_make_no_sense(
    option: str, number: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        main(["compare", "dynamics", option, number])
    assert end.value.code == 2
    assert f"argument {option}: '{number}' is not a whole number" in capsys.readouterr().err


def test_missing_mpmath_is_one_sentence(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for module in [name for name in sys.modules if name.startswith("deltaopt.compare.dynamics")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "mpmath", None)
    assert main(["compare", "dynamics"]) == 1
    assert "mpmath is not installed: pip install -e '.[compare]'" in capsys.readouterr().err
