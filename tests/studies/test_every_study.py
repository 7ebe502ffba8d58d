"""Every study at its small size: it runs, says what it found, and writes what it says."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from studies.__main__ import STUDIES, main
from studies.charts import CHARTS
from studies.stability.drift import FREQUENCIES, MINIMAL
from studies.stability.singularities import DISTANCES, METHODS, PROBLEMS

SAYS = {
    "agreement": "forward, 80 on switches",
    "attack": "8 of 8 attempts are good",
    "basin": "The same motion is found: flat 2 of 2",
    "bench": "2 of 2 verified and within tolerance",
    "benchmarks": "Gough-Stewart platform: L_I, L_E",
    "charts": "| chart | drawn by | what it says |",
    "claims": "in brackets the 95 % interval",
    "bodies": "1 of 1 planned, 1 verified",
    "conventions": "conventions.png",
    "cycle": "| industrial | line across |",
    "damage": "3 of 3 damages beyond a bound are found",
    "driven": "Past arm and bars in line at ε = 0.01, 1 µm cost in right-hand",
    "frontier": "Within 0.01: the default takes",
    "frozen": "cases agree to 1e-09",
    "gap": "0 refused or not converged, 0 without a truth",
    "interruptions": "3 of 3 planned and verified",
    "interrupts": "SIGINT during check, 2 instants",
    "inverse": "inverse dynamics",
    "keep_out": "slot, 1 mm beside the tool: 1 of 1 planned",
    "limits": "workspace radius     1 of 1",
    "line": "pick_and_place: line by a quintic law 0.1966 s",
    "lower_bound": "ratio of lower bound to duration",
    "models": "For torques",
    "mujoco": "planned with terms left out, steps of 500 µs",
    "multistart": "Of 1 moves inside 2 first guesses make faster",
    "mutations": "test_jumping_velocity",
    "objectives": "least effort ∫ τᵀτ dt in",
    "open_loop": "nothing: up to",
    "processors": "| OpenBLAS for Haswell |",
    "proportions": "2 have a plan that is verified",
    "reference": "| `peak_torque` | a torque in N·m, greater than 0 | required | `3.82 N*m` |",
    "sanitize": "0 findings",
    "scaling": "time of an iteration grows as N^",
    "tables": "| pick_and_place | quintic |",
    "tilt": "orsino torque ε^0, bars ε^-1.0",
    "tolerances": "gaps against 0.14087",
    "tutorial": "cubic, rows each ms: asks for 1.50 of a limit",
    "via": "8 of 8 planned and verified",
}


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("name", SAYS)
def test_study_in_small(name, capsys):
    assert main([name, "--small"]) == 0
    assert SAYS[name] in capsys.readouterr().out


def test_given_paths_in_small(capsys):
    pytest.importorskip("toppra")
    assert main(["given_paths", "--small"]) == 0
    assert "ours: found 2 of 2, 2 within 0.001" in capsys.readouterr().out


def test_all_runs_every_study_in_turn(monkeypatch, capsys):
    ran = []
    for name, study in STUDIES.items():
        monkeypatch.setattr(study, "run", lambda arguments, name=name: ran.append(arguments) or 0)
    assert main(["all", "--small"]) == 0
    assert [arguments.study for arguments in ran] == list(STUDIES)
    told = [line for line in capsys.readouterr().out.splitlines() if line]
    assert told[: len(STUDIES)] == [f"=== {name} ===" for name in STUDIES]
    assert told[len(STUDIES) :] == [f"{name}: 0 s, exit code 0" for name in STUDIES]
    gap = ran[list(STUDIES).index("gap")]
    small, full = (vars(arguments) for arguments in (gap, _parsed(monkeypatch, "gap")))
    assert small["number"] < full["number"]


def test_all_is_unattended(monkeypatch, capsys, tmp_path):
    """A study that ends in an unforeseen error is named, the others go on; --after leaves out those
    before; --into copies what was drawn."""

    def run(arguments):
        if arguments.study == "tilt":
            raise RuntimeError("nobody expected this")
        (Path("out/tutorial")).mkdir(parents=True, exist_ok=True)
        (Path("out/tutorial") / "tutorial_table.png").write_bytes(b"drawn")
        return 0

    for study in STUDIES.values():
        monkeypatch.setattr(study, "run", run)
    assert main(["all", "--small", "--after", "tables", "--into", str(tmp_path)]) == 1
    printed = capsys.readouterr()
    copied = tmp_path / "tutorial_table.png"
    names = list(STUDIES)[list(STUDIES).index("tables") + 1 :]
    expected = {name: f"{name}: 0 s, exit code 0" for name in names}
    expected["tilt"] = "tilt: 0 s, exit code 1"
    expected["tutorial"] += f", {copied}"
    assert printed.out.splitlines()[-len(names) :] == list(expected.values())
    assert "nobody expected this" in printed.err
    assert copied.read_bytes() == b"drawn"


def test_every_chart_of_the_documentation_is_listed(capsys):
    docs = Path(__file__).parents[2] / "docs"
    assert {chart.file for chart in CHARTS} == {file.name for file in docs.glob("*.png")}
    assert {chart.study for chart in CHARTS} - {""} <= set(STUDIES)
    assert main(["charts"]) == 0
    assert capsys.readouterr().out in (docs / "charts.md").read_text(encoding="utf-8")


def _parsed(monkeypatch, *words):
    """The arguments that a study is run with."""
    found = []
    monkeypatch.setattr(STUDIES[words[0]], "run", lambda arguments: found.append(arguments) or 0)
    assert main(list(words)) == 0
    return found[0]


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


# Where methods fail


def rows(name: str) -> list[dict[str, str]]:
    with (Path("out/stability") / f"{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def written() -> list[str]:
    return sorted(path.name for path in Path("out/stability").iterdir())


def said(capsys) -> str:
    return " ".join(capsys.readouterr().out.split())


def test_singularities_in_small(capsys):
    assert main(["stability", "singularities", "--small"]) == 0
    told = said(capsys)
    assert "eq. (55): its error grows as ε^-1.0 (torques at rest)" in told
    assert "So whether L_I suffers more is a matter of its linear solver" in told
    charts = ["singularities_delta.png", "singularities_pendulum.png"]
    assert written() == ["singularities.csv", *charts]
    for chart in charts:
        assert (Path("out/stability") / chart).stat().st_size > 10_000
    table = rows("singularities")
    methods = len(METHODS) + 1  # and the rounding of the state alone
    curves = [row for row in table if row["problem"] != "condition number"]
    assert len(curves) == 6 * len(PROBLEMS) * methods * len(DISTANCES)
    exact = [
        float(row["value"])
        for row in curves
        if (row["family"], row["problem"]) == ("level", "forward")
        and (row["model"], row["variant"]) == ("L_E", "closed form")
    ]
    assert len(exact) == len(DISTANCES)
    assert max(exact) < 1e-14


def test_drift_in_small(capsys):
    assert main(["stability", "drift", "--small"]) == 0
    assert "Over 0.2 s at tolerance 1e-08" in said(capsys)
    assert written() == ["drift.csv", "drift.png"]
    drift = {(row["method"], float(row["tolerance"])): float(row["f_m"]) for row in rows("drift")}
    assert len(drift) == 3 * (2 + len(FREQUENCIES) + 1)
    kept = [f for (method, _), f in drift.items() if method in ("projection", MINIMAL)]
    assert len(kept) == 6
    assert max(kept) < 1e-14
    assert drift["none", 1e-10] < drift["none", 1e-6]


def test_benchmarks_in_small(capsys):
    assert main(["stability", "benchmarks", "--small"]) == 0
    printed = capsys.readouterr()
    assert "A02: inside 0.1 J are" in printed.out
    assert "100%" in printed.err
    assert written() == ["benchmarks.csv", "benchmarks.png"]
    assert Path("out/stability/benchmarks.png").read_bytes().startswith(b"\x89PNG")
    errors = [float(row["largest_energy_error_J"]) for row in rows("benchmarks")]
    assert np.nanmax(errors) < 1e-6


def test_edge_in_small(capsys):
    assert main(["stability", "edge", "--small"]) == 0
    assert "0 end in anything else" in said(capsys)
    assert written() == ["edge.csv", "edge.png"]


def test_unknown_part_is_named(capsys):
    assert main(["stability", "earthquakes"]) == 2
    assert "earthquakes is no part" in capsys.readouterr().err
