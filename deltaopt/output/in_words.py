"""What is told of a motion at a terminal: tables and sentences, line by line."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from deltaopt.motion.certificate import MET
from deltaopt.motion.limit_sensitivity import limits_at_a_glance
from deltaopt.output.facts import Facts, above_nominal, motor_facts, title, together
from deltaopt.planning.plan import Optimum, Plan, TakenWay
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.objective import Time
from deltaopt.scene.scene import Scene
from deltaopt.settings import RESOLVED_BELOW
from deltaopt.verify.cycle import CycleVerification
from deltaopt.verify.duty import Duty
from deltaopt.verify.measures import Distance
from deltaopt.verify.verification import Verification

_FASTER = 0.99
"""Of a plan's duration: what a way takes that is told to look faster, for first meshes are not
exact."""
_WHOLE = 0.1
"""Share from which whole per cents are told."""


def told(facts: Facts) -> Iterator[str]:
    """The few lines that say what a motion is worth: whether it is verified, its duration, how near
    the best it is, what it saves, what limits it."""
    found = facts.plan
    duration = found.duration
    limits = limits_at_a_glance(facts.active, found.sensitivities, duration)
    back = "" if found.scene.moves_at_ends else " there and back"
    yield f"{verdict(facts.verification)}: {title(found.scene.task, duration)}{back}"
    yield from (_distance(each) for each in facts.verification.distances if each.least <= 0)
    if facts.too_warm:
        yield facts.too_warm
    if found.formulation is not None:
        yield _gap(found)
        if found.searched:
            yield found.searched
            yield _lower_bound(found.lower_bound, duration)
        yield from _comparison(facts)
    yield f"limited by {limits}" if limits else "no limit is reached"


def surprises(facts: Facts) -> list[str]:
    """Lines on what nobody asked for and everybody must know; ``details`` has them too."""
    found = facts.verification
    unmet = [] if is_optimal(found) else _optimality(found, facts.plan.tolerance)
    return [*filter(None, [above_nominal(found.duty)]), *_long(found), *unmet]


def details(facts: Facts) -> Iterator[str]:
    """All else: other ways and optima, every measure, the duty of the motors, singularities, what
    limits each motor, the lower bound."""
    found = facts.plan
    yield from _optima(found.scene, found.optima)
    yield from _ways(found.ways)
    if found.certificate:
        where = "" if found.resolved else " on its mesh"
        yield f"satisfies Pontryagin's condition to {found.certificate.residual:.0e}{where}"
    if len(found.phases) > 1:
        yield f"phases: {', '.join(f'{each:.6f}' for each in found.phases)} s"
    yield table(facts.verification, asked_for=found.tolerance)
    yield from ("what limits each motor:", *(f"  {sentence}" for sentence in facts.limits))
    yield _lower_bound(found.lower_bound, found.duration)


def verdict(found: Verification | CycleVerification) -> str:
    """Whether a motion is verified, and what torques do not show of it."""
    return f"{'verified' if found.ok else 'NOT VERIFIED'}{beyond(found.distances)}"


def beyond(distances: Iterable[Distance]) -> str:
    """The singularities that a motion is beyond at some instant, as the end of a verdict; empty
    where there is none."""
    names = dict.fromkeys(each.name for each in distances if each.least <= 0)
    if not names:
        return ""
    which = " and the ".join(names)
    return f", but beyond the {which}, where the motors do not hold the robot"


def _gap(found: Plan) -> str:
    """How near the best the plan is: estimated, and among which motions."""
    objective, what = found.scene.objective, "longer than the fastest"
    least = ""
    if not isinstance(objective, Time):
        unit, what = objective.functional.unit, "above the least"
        least = f"{objective}: {found.cost:.6g} {unit}, "
    missed = "" if found.within_tolerance else f", not the {percent(found.tolerance)} asked for"
    ways, optima = len(found.ways), len(found.optima)
    is_least = problem_of(found.scene).is_least_duration(found.duration)
    is_best = found.scene.follows_path or (is_least and isinstance(objective, Time))
    among = "" if is_best else "; a local optimum, others may be better"
    if ways or optima > 1:
        what_of = f"{ways} ways past the bodies" if ways else f"{optima} local optima"
        among = f"; the best of {what_of} that were found"
    if ways == 1:
        among = "; no other way past the bodies was found"
    unplanned = [way.duration for way in found.ways if not way.is_planned]
    faster = [duration for duration in unplanned if duration < _FASTER * found.duration]
    if faster and isinstance(objective, Time):
        may_be = f"{len(faster)} of them may be faster, down to about {min(faster):.4f} s"
        among += f"; {may_be}, but no plan was found along {'it' if len(faster) == 1 else 'them'}"
    return f"{least}at most {percent(found.gap)} {what} near it (estimated){missed}{among}"


def _comparison(facts: Facts) -> Iterator[str]:
    """Beside the free motion where the path is given, otherwise beside the quickest of the lines;
    nothing where none of them can be driven, or the objective is not time."""
    found = facts.plan
    if not isinstance(found.scene.objective, Time):
        return
    if found.free_duration is not None:
        longer = percent(found.duration / found.free_duration - 1)
        yield f"{longer} longer than on a free path: {found.free_duration:.4f} s"
    if found.scene.path is None and facts.straight_lines:
        name, other = min(facts.straight_lines.items(), key=lambda item: item[1])
        saved, name = 1 - found.duration / other, " ".join(name.split())
        than = "less than" if saved >= 0 else "more than"
        yield f"{percent(abs(saved))} {than} the {name}: {other:.4f} s"


def percent(share: float) -> str:
    """A share in per cent, to two digits, of large ones to whole numbers."""
    return f"{100 * share:.0f} %" if abs(share) >= _WHOLE else f"{100 * share:.2g} %"


def _optima(scene: Scene, optima: Sequence[Optimum]) -> Iterator[str]:
    """The distinct local minima, if there was more than one start."""
    for i, optimum in enumerate(optima, 1):
        x, y, z = optimum.halfway
        yield (
            f"local optimum {i}: {_outcome(scene, optimum)} from {optimum.starts} starts, "
            f"halfway at ({x:.4f}, {y:.4f}, {z:.4f}) m"
        )


def _outcome(scene: Scene, optimum: Optimum) -> str:
    """The duration of a local minimum, and its cost if the objective is not time."""
    if isinstance(scene.objective, Time):
        return f"{optimum.duration:.6f} s"
    return f"{optimum.cost:.6g} {scene.objective.functional.unit} in {optimum.duration:.6f} s"


def _ways(ways: Sequence[TakenWay]) -> Iterator[str]:
    """The ways past bodies, the one that is taken first."""
    for i, way in enumerate(ways):
        about = "" if way.is_planned else "about "
        taken = "way taken: " if i == 0 else "another way: "
        yield f"{taken}{way.name}, {about}{way.duration:.{6 if way.is_planned else 3}f} s"


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
            *_optimality(verification, asked_for),
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
    for the tilt of the platform, of which they know nothing: a motion beyond it is marked.
    """
    lines = [f"  {_distance(each)}" for each in distances]
    return ["least distance to singularities, 0 in one and 1 at best:", *lines] if lines else []


def _distance(each: Distance) -> str:
    """How near the motion comes to a kind of singularity."""
    where = f"at t = {each.t:.6f} s"
    where = where if each.subject == "robot" else f"{each.subject} {where}"
    passed = ", PASSED" if each.least <= 0 else ""
    return f"{each.name}: {each.formula} = {each.least:.2g}, {where}{passed}"


def is_optimal(verification: Verification) -> bool:
    """Whether the motion meets Pontryagin's condition."""
    numbers = verification.hamiltonian_spread, verification.sign_violation
    return all(each is not None and each < MET for each in numbers)


def _optimality(verification: Verification, asked_for: object) -> list[str]:
    """A line that says how well the motion meets Pontryagin's condition, if it does or is to.

    There is no bound on it, for as a rule only motions with resolved switches meet it.
    """
    spread, violation = verification.hamiltonian_spread, verification.sign_violation
    met = is_optimal(verification)
    certified = isinstance(asked_for, float) and asked_for <= RESOLVED_BELOW
    if spread is None or not (met or certified):
        return []
    verdict = "; a local statement" if met else f": not met, which would be {MET:g}"
    return [
        f"Pontryagin's condition, by costates fitted to the motion: Hamiltonian constant to "
        f"{spread:.1e}, signs of torques right to {violation:.1e}{verdict}"
    ]
