"""What the commands do with their output streams."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from deltaopt.cli.streams import in_words

ROOT = Path(__file__).parents[2]
SCENE = "problems/pick_and_place.yaml"
GENTLY = "problems/objectives/pick_and_place_gently.yaml"


def run(*words: str, **others):
    """Run a command in a process of its own, by default with its streams as bytes."""
    usual = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": ""}
    environment = {**usual, **others.pop("environment", {})}
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **others}
    command = [sys.executable, "-m", "deltaopt", *words]
    return subprocess.run(command, env=environment, cwd=others.pop("cwd", ROOT), **streams)


def test_a_reader_that_stops_reading_is_no_error():
    """As with ``deltaopt check SCENE | head -1``: no message, and the exit code of SIGPIPE."""
    command = [sys.executable, "-u", "-m", "deltaopt", "check", SCENE]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 141


def test_standard_output_on_a_full_disk():
    with Path("/dev/full").open("wb") as full:
        ended = run("check", SCENE, stdout=full)
    assert ended.stderr == b"deltaopt: standard output: No space left on device\n"
    assert ended.returncode == 2


def test_standard_error_on_a_full_disk():
    with Path("/dev/full").open("wb") as full:
        assert run("check", "nowhere.yaml", stderr=full).returncode == 2


C_LOCALE = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": ""}


def test_a_locale_that_has_ascii_only(tmp_path):
    """Signs are said in other words; files are UTF-8 all the same."""
    out = tmp_path / "Ausgänge"
    plan = run(
        "plan",
        GENTLY,
        "--baseline",
        "--no-plot",
        "--details",
        "-o",
        str(out),
        environment=C_LOCALE,
    )
    assert (plan.returncode, plan.stderr) == (0, b"")
    assert "N^2m^2s" in plan.stdout.decode("ascii")
    assert "N²m²s" in (out / "plan.json").read_text(encoding="utf-8")


def test_signs_in_other_words():
    text = "10 u³ − 15 u⁴, ∫ τᵀτ dt, N·m, 5 °, é, ₁, ẍ, \udcff, 猫"
    plain = "10 u^3 - 15 u^4, integral of  tau'tau dt, N.m, 5  deg, e, 1, x, \\udcff, \\u732b"
    assert "".join(map(in_words, text)) == plain
