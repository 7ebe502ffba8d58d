"""A wheel carries the compiled C of the default model, and so is for one kind of machine."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from setuptools import setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

ROOT = Path(__file__).parent


class BuildPython(build_py):
    """Copies the package and, unless it stays editable, compiles into the copy."""

    def run(self) -> None:
        super().run()
        if self.editable_mode:
            return
        folder = Path(self.build_lib).resolve() / "deltaopt" / "codegen" / "prebuilt"
        script = ROOT / "build_backend" / "default_model.py"
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        subprocess.run([sys.executable, script, folder], env=environment, check=True)


class BuildWheel(bdist_wheel):
    """Names the machine but no version of Python: the libraries do not use it."""

    def finalize_options(self) -> None:
        self.distribution.has_ext_modules = lambda: True  # libraries count as such
        super().finalize_options()

    def get_tag(self) -> tuple[str, str, str]:
        return "py3", "none", super().get_tag()[2]


setup(cmdclass={"build_py": BuildPython, "bdist_wheel": BuildWheel})
