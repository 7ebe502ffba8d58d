"""What pip and build call to build this package: setuptools, and for wheels what their C needs.

Only a wheel asks for more than setuptools: an editable installation compiles nothing when it is
installed, but on first use.
"""

from __future__ import annotations

import shutil
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from setuptools import build_meta
from setuptools.build_meta import *  # noqa: F403

_COMPILERS = ("gcc", "cc", "clang")


def get_requires_for_build_wheel(config_settings: Mapping[str, Any] | None = None) -> list[str]:
    """What must be importable to derive the C of the default model, and a compiler if need be."""
    project = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"]
    needed = [*build_meta.get_requires_for_build_wheel(config_settings), *project["dependencies"]]
    if any(shutil.which(name) for name in _COMPILERS):
        return needed
    return [*needed, *project["optional-dependencies"]["compiler"]]
