"""What is told of a motion at a terminal: tables and sentences, line by line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from deltaopt.motion.certificate import MET
from deltaopt.output.facts import Facts, StraightLine, motor_facts, together
from deltaopt.planning.plan import Optimum, Plan
from deltaopt.scene.objective import Time
from deltaopt.scene.scene import Scene
from deltaopt.settings import RESOLVED_BELOW
from deltaopt.verify.duty import Duty
from deltaopt.verify.measures import Distance
from deltaopt.verify.verification import Verification


def told(facts: Facts) -> Iterator[str]:
    """All lines on a plan, or on the straight line that it is compared with."""
    found = facts.found
    if facts.too_warm:
        yield facts.too_warm
    if not isinstance(found, StraightLine):
        yield from _optima(found)
        if found.searched:
            yield found.searched
        yield from _ways(found)
        yield from _gap(found)
        if found.free_duration is not None:
            yield (
                f"on the given path {found.duration:.6f} s, on a free path "
                f"{found.free_duration:.6f} s: the path costs "
                f"{found.duration / found.free_duration - 1:.1%}"
            )
    if len(found.phases) > 1:
        yield f"phases: {', '.join(f'{each:.6f}' for each in found.phases)} s"
    yield table(facts.verification, asked_for=found.tolerance)
    yield "what limits the motion:" if facts.limits else "no limit is reached"
    yield from (f"  {sentence}" for sentence in facts.limits)
    yield _lower_bound(found.lower_bound, facts.trajectory.duration)


def _optima(found: Plan) -> Iterator[str]:
    """The distinct local minima, if there was more than one start."""
    for i, optimum in enumerate(found.optima, 1):
        x, y, z = optimum.halfway
        yield (
            f"local optimum {i}: {_outcome(found.scene, optimum)} from {optimum.starts} starts, "
            f"halfway at ({x:.4f}, {y:.4f}, {z:.4f}) m"
        )


def _outcome(scene: Scene, optimum: Optimum) -> str:
    """The duration of a local minimum, and its cost if the objective is not time."""
    if isinstance(scene.objective, Time):
        return f"{optimum.duration:.6f} s"
    return f"{optimum.cost:.6g} {scene.objective.unit} in {optimum.duration:.6f} s"


def _ways(found: Plan) -> Iterator[str]:
    """The ways past bodies, the one that is taken first."""
    for i, way in enumerate(found.ways):
        about = "" if way.is_planned else "about "
        taken = "way taken: " if i == 0 else "another way: "
        yield f"{taken}{way.name}, {about}{way.duration:.{6 if way.is_planned else 3}f} s"


def _gap(found: Plan) -> Iterator[str]:
    """The cost, the estimated optimality gap and the certificate of a plan."""
    objective, above = found.scene.objective, "longer than the optimum"
    if not isinstance(objective, Time):
        yield f"{objective}: {found.cost:.9g} {objective.unit}"
        above = "above the least"
    missed = "" if found.within_tolerance else f", which is not the {found.tolerance:g} asked for"
    yield f"estimated to be at most {found.gap:.1e} {above}{missed}"
    if found.certificate:
        met = f"satisfies Pontryagin's condition to {found.certificate.residual:.0e}"
        near = "no motion near it is faster; one far from it may be"
        yield f"{met}: {near}" if found.resolved else f"{met} on its mesh"


def _lower_bound(bound: float, duration: float) -> str:
    """What no motion of the scene undercuts, on whatever path; both in s."""
    if not bound:
        return "lower bound for every path: none is known (an end moves, or a term of the robot)"
    share = f"{bound / duration:.2f} of the duration (proven)"
    return f"lower bound for every path: {bound:.6f} s, {share}"


def table(verification: Verification, *, asked_for: object = None) -> str:
    """A table of the duration and of all measures of a verification beside their bounds.

    ``asked_for``: tolerance of the plan, None if it is none. Where it is one for which switches are
    resolved, the table says too where Pontryagin's condition is not met.
    """
    rows = [("measure", "value", "at most", "unit", "")]
    rows += [(*check.cells, "ok" if check.ok else "FAILED") for check in verification.checks()]
    width = 1 + max(len(name) for name, *_ in rows)
    certified = isinstance(asked_for, float) and asked_for <= RESOLVED_BELOW
    return "\n".join(
        [
            f"duration {verification.duration:.6f} s, effort {verification.effort:.6g} N²m²s",
            *(
                f"{name:<{width}}{value:>10}{bound:>9}  {unit:<13}{ok}".rstrip()
                for name, value, bound, unit, ok in rows
            ),
            *([] if verification.duty is None else duty_table(verification.duty)),
            *_long(verification),
            *singularities_table(verification.distances),
            *_optimality(verification, certified),
        ]
    )


def duty_table(duty: Duty) -> list[str]:
    """Lines on the duty of each motor: RMS torque, mechanical work, power, speed."""
    lines = [f"{'duty of the motors, at the arm':<34}{'1':>10}{'2':>10}{'3':>10}"]
    for fact in motor_facts(duty):
        name = f"  {fact.name.removesuffix(' of the gear')}" if fact.rating else fact.name
        values = "".join(f"{value:>10.4g}" for value in fact.values)
        lines.append(f"  {name:<32}{values}  {fact.unit:<7}{fact.above.upper()}".rstrip())
    return [*lines, f"  together: {together(duty)}"]


def _long(verification: Verification) -> list[str]:
    """A line for a motion so long that without feedback its torques need not lead to the goal."""
    away, grown = verification.arrival_distance, verification.amplification
    if verification.judges_arrival:
        return []
    led = "" if away is None else f" (integrated to 12 digits they end {away:.1e} m from it)"
    return [
        f"without feedback a deviation grows {grown:.0e} times, and so torques alone do not lead "
        f"to the goal{led}: judged in pieces"
    ]


def singularities_table(distances: Sequence[Distance]) -> list[str]:
    """Lines that say how near the motion comes to each kind of singularity.

    There is no bound on these distances. Torques, which are bounded, grow near a singularity, but
    for the tilt of the platform, of which they know nothing: a motion beyond it is marked, and
    ``limits.tilt_singularity`` keeps motions from it.
    """
    lines = [
        f"  {each.name}: {each.formula} = {each.least:.2g}, "
        + ("" if each.subject == "robot" else f"{each.subject} ")
        + f"at t = {each.t:.6f} s"
        + (", PASSED: the motors do not hold the robot there" if each.least <= 0 else "")
        for each in distances
    ]
    return ["least distance to singularities, 0 in one and 1 at best:", *lines] if lines else []


def _optimality(verification: Verification, certified: bool) -> list[str]:
    """A line that says how well the motion meets Pontryagin's condition, if it does or is to.

    There is no bound on it, for as a rule only motions with resolved switches meet it.
    """
    spread, violation = verification.hamiltonian_spread, verification.sign_violation
    if spread is None or violation is None:
        return []
    met = max(spread, violation) < MET
    if not (met or certified):
        return []
    verdict = "; a local statement" if met else f": not met, which would be {MET:g}"
    return [
        f"Pontryagin's condition, by costates fitted to the motion: Hamiltonian constant to "
        f"{spread:.1e}, signs of torques right to {violation:.1e}{verdict}"
    ]
