"""What rules a cycle out, and is said of it."""

from __future__ import annotations

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import Infeasible, SceneError
from deltaopt.planning.cycles.cycle_plan import CyclePlan
from deltaopt.planning.first_motions.around_bodies import is_clear
from deltaopt.problem.boundary import REST
from deltaopt.scene.cycle import Cycle
from deltaopt.scene.feasibility import require_ride

_APART = 1e-3
"""How far apart places along a dwell on a belt are at most at which limits are looked at, m."""


def require_priced(fastest: CyclePlan) -> None:
    """Raise where the fastest legs take longer than a given period, or nothing but their speed
    could be changed."""
    period = fastest.cycle.period
    if period is not None and fastest.at_work > period:
        raise Infeasible(
            f"period is {period:g} s, but the fastest legs that were found and the dwells take "
            f"{fastest.at_work:.6g} s"
        )
    for index, scene in enumerate(fastest.cycle.legs):
        if scene.follows_path:
            expected = "a tube beside it, for motors would run too hot at full speed"
            raise SceneError(None, f"cycle[{index}].path", str(scene.path), expected)


def require_long_enough(cycle: Cycle, shortest: CyclePlan, gap: float) -> None:
    """Raise where a cycle's given period is below that of the ``shortest`` that was found by more
    than a relative ``gap``."""
    if cycle.period is not None and shortest.period > cycle.period * (1 + gap):
        raise Infeasible(
            f"period is {cycle.period:.9g} s, but the least that was found with which motors keep "
            f"their limits of RMS torque is {shortest.period:.9g} s"
        )


def require_rides(found: CyclePlan) -> None:
    """Raise what rules it out that the robot moves along with belts while it dwells."""
    for index, (leg, wait) in enumerate(zip(found.legs, found.waits, strict=True)):
        velocity = found.cycle.velocity_after(index)
        if wait is not None and velocity != REST:
            name, way = f"the dwell after leg {index + 1}", np.linalg.norm(velocity)
            instants = np.linspace(0.0, wait.duration, 2 + int(way * wait.duration / _APART))
            require_ride(leg.scene, name, wait.position.at(instants), velocity)
            if not is_clear(leg.scene, wait):
                raise Infeasible(f"{name}: the tool is not clear of all bodies at all instants")


def too_hot(found: CyclePlan, limits: Array) -> Infeasible:
    """Why no cycle was found that keeps all limits of motors' mean square torques, (3,), N²m²,
    from the last that was tried."""
    allowed = ", ".join(f"{each:.4g}" for each in np.sqrt(limits))
    return Infeasible(
        "no speed and no wait were found with which motors keep their limits of RMS torque, "
        f"{allowed} N·m: the last that was tried took {found.in_words}; arms at rest are held "
        "by torques too"
    )
