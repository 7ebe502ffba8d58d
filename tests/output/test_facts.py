"""What is told of a plan at a terminal, to machines, in files and on a page is the same."""

from __future__ import annotations

import json
import re
from html import unescape

from deltaopt.cli import main
from studies.problems import PROBLEMS

FILE = str(PROBLEMS / "pick_and_place.yaml")


def test_all_tell_the_same(tmp_path, capsys):
    assert main(["plan", FILE, "-o", str(tmp_path), "--no-plot", "--report", "--details"]) == 0
    page = unescape((tmp_path / "report.html").read_text(encoding="utf-8"))
    said = capsys.readouterr().out
    assert main(["plan", FILE, "-o", str(tmp_path), "--no-plot", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    record = json.loads((tmp_path / "plan.json").read_text(encoding="utf-8"))
    shared = ("duration", "gap", "tolerance", "ways", "active_limits", "verification")
    assert {name: told[name] for name in shared} == {name: record[name] for name in shared}
    duration, gap = record["duration"], record["gap"]
    assert f"duration {duration:.6f} s" in said
    assert f"<h1>{duration:.3f} s" in page
    assert f"at most {100 * gap:.2g} % longer" in said
    assert f"at most {100 * gap:.2g} % above" in page
    sentences = re.findall(r"^  (.* is at its limit .*)$", said, re.M)
    assert sentences
    for sentence, active in zip(sentences, record["active_limits"], strict=False):
        assert f"{100 * active['share_of_time']:.0f} % of the time" in sentence
        assert f"{sentence[0].upper()}{sentence[1:]}." in page
    for motor in record["verification"]["duty"]["motors"]:
        assert f"{motor['rms_torque']:>10.4g}" in said
        assert f"<td>{motor['rms_torque']:.4g}</td>" in page
