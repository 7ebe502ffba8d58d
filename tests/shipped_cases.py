"""The shipped scenes and the five-bar as cases of the comparison, built once."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache, cached_property

import deltaopt
from deltaopt.compare.plans.cases import delta_case, five_bar_case
from deltaopt.planning.nlp.points import PointFunction
from studies.problems import PROBLEMS


@cache
def case(scene):
    """By the name of its file, or five_bar."""
    if scene == "five_bar":
        return five_bar_case()
    return delta_case(scene, deltaopt.load_scene(PROBLEMS / f"{scene}.yaml"))


class InterpretedPointFunction(PointFunction):
    """A point function whose derivatives are not compiled."""

    @cached_property
    def derivatives(self):
        return self.derived


def interpreted(equations):
    """The same equations with no point function compiled."""
    own = {each.name: getattr(equations, each.name) for each in fields(equations)}
    points = {
        name: InterpretedPointFunction(value.name, value.function)
        for name, value in own.items()
        if isinstance(value, PointFunction)
    }
    return replace(equations, **points)
