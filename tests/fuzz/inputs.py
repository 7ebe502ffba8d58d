"""What is thrown at deltaopt, and what may come of it: a result or one sentence, in time."""

from __future__ import annotations

import copy
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

from deltaopt.errors import DeltaOptError
from deltaopt.scene.scene_file import load_scene
from studies.problems import PROBLEMS
from tests.scene import test_robot_and_scene

SCENE = load_scene(PROBLEMS / "pick_and_place.yaml")
ROBOT_CONTENT = test_robot_and_scene.ROBOT | {
    "drive": {"torque": [20.0, 21.0, 22.0], "speed": 8.0},
}
SCENE_CONTENT = test_robot_and_scene.SCENE | {
    "limits": {"torque": 19.0, "speed": [7.0, 6.0, 5.0]},
    "objective": {"time": 1.0, "effort": 0.002},
}
EXTREME = (0.0, -0.0, 5e-324, 1e-300, 1e-30, 1e-12, 1e-6, 1e6, 1e11, 1e12, 1.1e12, 1e30, 1e300)

finite = st.one_of(st.sampled_from(EXTREME), st.floats(-2, 2), st.floats(allow_nan=False))
numbers = st.one_of(
    finite, finite.map(lambda x: -x), st.floats(), st.integers(-(10**25), 10**25), st.just(10**400)
)
scalars = st.one_of(numbers, st.text(max_size=20), st.booleans(), st.none())
trees = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4)
    ),
    max_leaves=12,
)
objects = st.one_of(
    trees,
    st.binary(max_size=4),
    st.complex_numbers(),
    st.builds(object),
    st.sampled_from(
        [Decimal("1.5"), Fraction(1, 3), float, np.float64, lambda: 1, ..., SCENE, SCENE.robot]
    ),
    numbers.map(lambda x: np.array([x], dtype=object)),
    st.lists(st.floats(), max_size=4).map(np.array),
    st.floats().map(np.float64),
    st.integers(-5, 50).map(np.int64),
)
"""Anything that somebody may pass to a function in Python."""


def places(content: dict[str, Any]) -> list[tuple[str, ...]]:
    """The keys of a nested mapping, and of the mappings within it."""
    inner = [
        (key, *path)
        for key, each in content.items()
        if isinstance(each, dict)
        for path in places(each)
    ]
    return [(key,) for key in content] + inner


@st.composite
def changed(draw: st.DrawFn, content: dict[str, Any], values: st.SearchStrategy[Any]) -> Any:
    """The content with some values replaced, some keys removed and some added."""
    found = copy.deepcopy(content)
    for _ in range(draw(st.integers(1, 3))):
        *path, last = draw(st.sampled_from(places(content)))
        within: Any = found
        for key in path:
            within = within.get(key) if isinstance(within, dict) else None
        if isinstance(within, dict):
            what = draw(st.integers(0, 9))
            if what == 0:
                within.pop(last, None)
            elif what == 1:
                within[draw(st.text(max_size=8))] = draw(values)
            elif isinstance(within.get(last), list) and what < 6:
                within[last] = [draw(numbers) for _ in within[last]]
            else:
                within[last] = draw(numbers if what < 6 else values)
    return found


plausible = st.sampled_from([0.5, 0.9, 1.1, 2.0, 1e-3, 1e3, 1e-6, 1e6, 1e-9, 1e9])


@st.composite
def scaled(draw: st.DrawFn, content: dict[str, Any]) -> Any:
    """The content with some of its numbers multiplied by plausible and implausible factors."""
    found = copy.deepcopy(content)
    for *path, last in places(content):
        within = found
        for key in path:
            within = within[key]
        value = within[last]
        if isinstance(value, float) and draw(st.integers(0, 3)) == 0:
            within[last] = value * draw(plausible)
        elif isinstance(value, list) and draw(st.integers(0, 3)) == 0:
            within[last] = [each * draw(plausible) for each in value]
    return found


def fewer(share: int) -> settings:
    """Settings for a slow test: so many times fewer examples."""
    return settings(max_examples=max(2, settings().max_examples // share))


class TookTooLong(BaseException):
    """Not an Exception, so that nothing swallows it."""


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Raise TookTooLong from what takes longer."""

    def stop(*_: object) -> None:
        raise TookTooLong

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


@contextmanager
def result_or_sentence(*kinds: type[Exception], seconds: float = 20) -> Iterator[None]:
    """Let an error of these kinds, or of deltaopt's own, pass if it is one sentence."""
    with limited(seconds):
        try:
            yield
        except (DeltaOptError, *kinds) as error:
            sentence = str(error)
            assert sentence.strip()
            assert len(sentence.splitlines()) == 1, sentence
            assert len(sentence) < 1000, sentence
            for jargon in ("pydantic", "casadi", "validation error", "swig", "NoneType"):
                assert jargon not in sentence.lower(), sentence
