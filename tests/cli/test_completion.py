"""Completion by shells: a script that bash runs, of all commands and their files."""

from __future__ import annotations

import shutil
import subprocess
import sys

import pytest

from deltaopt.cli import main


def test_without_shtab_one_sentence(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "shtab", None)
    assert main(["completion", "bash"]) == 1
    said = capsys.readouterr().err
    in_clone = "pip install -e '.[completion]' in the clone"
    with_wheel = "pip install 'deltaopt[completion]' with a wheel"
    assert said == f"deltaopt: shtab is not installed: {in_clone}, or {with_wheel}\n"


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_in_bash(tmp_path, capsys, monkeypatch):
    pytest.importorskip("shtab")
    assert main(["completion", "bash"]) == 0
    script = tmp_path / "completion.bash"
    script.write_text(capsys.readouterr().out, encoding="utf-8")
    (tmp_path / "scene.yaml").touch()
    monkeypatch.chdir(tmp_path)
    for words, found in (
        (["ex"], "export"),
        (["export", "sch"], "schema"),
        (["plan", "--so"], "--solver"),
        (["plan", "sc"], "scene.yaml"),
    ):
        line = f"COMP_WORDS=(deltaopt {' '.join(words)}); COMP_CWORD={len(words)}"
        run = f'source {script}; {line}; _shtab_deltaopt; echo "${{COMPREPLY[@]}}"'
        ran = subprocess.run(["bash", "-c", run], capture_output=True, text=True)
        assert ran.stdout.split() == [found], ran.stderr
