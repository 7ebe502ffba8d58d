"""The example in the docstring of every public name runs and gives what it says."""

from __future__ import annotations

import doctest
import inspect
from pathlib import Path

import pytest

import deltaopt

NAMES = [
    name
    for name in deltaopt.__all__
    if inspect.isclass(getattr(deltaopt, name)) or inspect.isfunction(getattr(deltaopt, name))
    if name != "Verification"  # which is shown by that of ``verify``
]


@pytest.mark.parametrize("name", NAMES)
def test_example(name, monkeypatch):
    monkeypatch.chdir(Path(__file__).parents[1])
    text = inspect.getdoc(getattr(deltaopt, name))
    example = doctest.DocTestParser().get_doctest(text, {"deltaopt": deltaopt}, name, None, 0)
    assert example.examples
    told: list[str] = []
    assert doctest.DocTestRunner(verbose=False).run(example, out=told.append).failed == 0, told
