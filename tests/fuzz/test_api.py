"""Random arguments of the functions: a result, or an error whose message is one sentence."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import deltaopt
from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.files.validated_record import Record
from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.robot import Drive, Forearm, Platform, Robot, UpperArm
from tests.fuzz.inputs import SCENE, fewer, limited, numbers, objects, result_or_sentence

RECORDS = (deltaopt.Scene, deltaopt.Limits, Robot, UpperArm, Forearm, Platform, Drive)
RECORDS += (deltaopt.Effort, deltaopt.TimeAndEffort)
LINE = deltaopt.baseline(SCENE)
SETTINGS = ("tolerance", "intervals", "transcription", "formulation", "solver", "starts", "seed")


@given(data=st.data(), record=st.sampled_from(RECORDS))
def test_records(data, record):
    keys = st.one_of(st.sampled_from(sorted(record.model_fields)), st.text(max_size=5))
    given = data.draw(st.dictionaries(keys, objects, max_size=len(record.model_fields)))
    with result_or_sentence():
        assert isinstance(record(**given), Record)


@given(data=st.data(), record=st.sampled_from([SCENE, SCENE.robot, SCENE.robot.drive]))
def test_copies(data, record):
    keys = st.one_of(st.sampled_from(sorted(type(record).model_fields)), st.text(max_size=5))
    with result_or_sentence():
        record.model_copy(update=data.draw(st.dictionaries(keys, objects, max_size=2)))


@given(settings=st.dictionaries(st.sampled_from(SETTINGS), objects, min_size=1, max_size=3))
def test_settings_of_a_planner(settings):
    """None of these asks for a plan that takes long: such values are no settings, or few."""
    with result_or_sentence(TypeError, ValueError, seconds=60):
        own = {key: value for key, value in settings.items() if key not in ("starts", "seed")}
        deltaopt.Planner(SCENE.robot, 1.0, **own)


@fewer(4)
@given(settings=st.dictionaries(st.sampled_from(("starts", "seed")), objects, min_size=1))
def test_settings_of_a_plan(settings):
    with result_or_sentence(TypeError, ValueError, seconds=60):
        deltaopt.plan(SCENE, **settings)


@given(payload=objects, start=objects, goal=objects)
def test_what_a_planner_is_asked(payload, start, goal):
    with result_or_sentence(TypeError, ValueError, seconds=60):
        deltaopt.Planner(SCENE.robot).plan(start, goal, payload=payload)


@given(scene=objects.filter(lambda each: each is not SCENE), trajectory=objects)
def test_what_is_no_scene_or_trajectory(scene, trajectory):
    for function in (deltaopt.plan, deltaopt.baseline):
        with pytest.raises((TypeError, ValueError, deltaopt.DeltaOptError)) as told:
            function(scene)
        assert len(str(told.value).splitlines()) == 1
    for arguments in ((scene, LINE), (SCENE, trajectory)):
        with pytest.raises((TypeError, ValueError)) as told:
            deltaopt.verify(*arguments)
        assert len(str(told.value).splitlines()) == 1


@given(
    t=st.one_of(objects, st.lists(st.floats(-10, 10), max_size=5), st.floats()),
    factor=st.one_of(numbers, objects),
)
def test_trajectories(t, factor):
    with result_or_sentence(TypeError, ValueError):
        motion = LINE(t)
        assert np.isfinite(motion.tau).all()
    with result_or_sentence(TypeError, ValueError):
        slowed = LINE.slowed(factor)
        assert slowed.duration == pytest.approx(LINE.duration * factor)


@fewer(4)
@given(
    knots=st.lists(st.one_of(st.floats(0, 1), st.floats()), min_size=2, max_size=5),
    values=st.lists(st.one_of(st.floats(-1, 1), st.floats()), min_size=72, max_size=72),
    sort=st.booleans(),
    around=st.booleans(),
)
def test_any_motion_is_judged(knots, values, sort, around):
    """``verify`` does not raise for a motion, however bad."""
    t = np.array(sorted(knots) if sort else knots)
    coefficients = np.array(values[: 18 * (len(t) - 1)]).reshape(len(t) - 1, 6, 3)
    if around:  # within the workspace, at first
        coefficients *= 1e-2
        coefficients[:, 0] += SCENE.start
    position = PiecewisePolynomial(t, coefficients)
    with limited(20):
        assert not deltaopt.verify(SCENE, Trajectory(position, LINE.model)).ok
