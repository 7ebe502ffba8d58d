"""report.html: a plan as one file that needs no network and no program but a browser.

The script is written by hand and drawn as SVG: some ten kilobytes, where a copy of a charting
library such as plotly would be 4.9 MB in each file and could neither draw the robot's bars nor link
it to bands. All numbers are embedded as JSON and all text is escaped: names of robots come from
files.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from math import isfinite
from string import Template

from deltaopt.files.tables import html_table
from deltaopt.motion.active_limits import active_limits
from deltaopt.output.cycle_files import told_of_cycle
from deltaopt.output.facts import Facts, motor_facts, title, together
from deltaopt.output.in_words import beyond, percent
from deltaopt.planning.cycles.cycle_plan import CyclePlan
from deltaopt.planning.first_motions.around_bodies import CLEAR
from deltaopt.planning.plan import Plan, TakenWay
from deltaopt.plots.colours import COLOURS, LINE_COLOURS, OF_LIMITS
from deltaopt.problem.of_scene import problem_of
from deltaopt.report.modelled import modelled, not_modelled
from deltaopt.report.moving_robot import Moving, drawing
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import ends_in_words
from deltaopt.verify.cycle import CycleVerification
from deltaopt.verify.duty import Duty
from deltaopt.verify.verification import Verification


def report(facts: Facts) -> str:
    """The text of the page of a motion."""
    plan, verification = facts.plan, facts.verification
    scene, journal = plan.scene, plan.journal
    terms = _list(modelled(scene)) + "<p>Not modelled:</p>" + _list(not_modelled(scene))
    parts = [
        _head(facts),
        _figures([scene]),
        _section(*_compared({**facts.straight_lines, "this plan": plan.duration})),
        _section("Ways past the bodies", _ways(plan.ways)),
        _section("What limits the motion", _list(_limits(facts))),
        _section("Duty of the motors", _duty(verification.duty)),
        _section("Verification", _verification(verification)),
        _section("Distance to singularities", _singularities(verification)),
        _section("What was attempted", _list(map(str, journal)) if len(journal) > 1 else ""),
        _section("What is modelled", terms),
    ]
    name = f"{title(scene.task, plan.duration)}, {scene.robot.name}"
    return _page(name, parts, [Moving(scene, plan.trajectory, facts.active)])


def cycle_report(plan: CyclePlan, verification: CycleVerification) -> str:
    """The text of the page of a cycle."""
    robot = plan.cycle.legs[0].robot.name
    headline, *told = told_of_cycle(plan, verification)
    limits = (active_limits(problem_of(leg.scene), leg.trajectory) for leg in plan.legs)
    moving = list[Moving]()
    for leg, wait, active in zip(plan.legs, plan.waits, limits, strict=True):
        moving.append(Moving(leg.scene, leg.trajectory, active))
        moving += [] if wait is None else [Moving(leg.scene, wait, ())]
    parts = [
        f'<header><p class="robot">{escape(robot)}</p>\n<h1>{escape(headline)}</h1>\n'
        f"{_verdict(verification)}</header>",
        _figures([leg.scene for leg in plan.legs]),
        _section("Legs and motors", _list(line.strip().replace("; ", ";\n") for line in told)),
        _section("Duty of the motors", _duty(verification.duty)),
    ]
    return _page(f"{headline}, {robot}", parts, moving)


def _page(title: str, parts: Iterable[str], moving: Sequence[Moving]) -> str:
    """A page with a title, its parts and what its script draws."""
    colours = {
        "motor_colours": COLOURS,
        "limit_colours": OF_LIMITS,
        "body_colours": LINE_COLOURS[:6],
    }
    return _filled(
        "page.html",
        title=escape(title),
        style=_own_file("page.css"),
        parts="".join(parts),
        plan=_json(drawing(moving) | colours),
        robot=_own_file("page.robot.js"),
        script=_own_file("page.js"),
    )


def _limits(facts: Facts) -> list[str]:
    """A sentence for every limit that matters."""
    return [text[0].upper() + text[1:] + "." for text in facts.limits] or [
        "No limit is reached for a noticeable part of the time."
    ]


_VERIFIED = "Verified by code that the planner does not use: every limit is kept at every instant"
_PICKS = """ The parts per minute
count the way there and one as long back, and no time for gripping."""


def _head(facts: Facts) -> str:
    plan, scene, verification = facts.plan, facts.plan.scene, facts.verification
    payload = scene.payload_in_words
    way = f"{1e3 * verification.way:.4g} mm"
    picks = "" if scene.moves_at_ends else _PICKS
    optimality = (
        "This motion was not optimised: it is the straight line, as fast as the limits permit by "
        "a quintic law."
        if plan.formulation is None
        else f"Estimated to be at most {percent(plan.gap)} above the best for its objective, "
        f"{scene.objective}, "
        + (
            f"among motions near it. {_other_ways(plan)}"
            if not scene.follows_path
            else "on the path that the scene gives."
        )
    )
    return f"""<header>
<p class="robot">{escape(scene.robot.name)}</p>
<h1>{escape(title(scene.task, plan.duration))}</h1>
<p>{escape(way)} from {escape(ends_in_words(scene.task))}, {escape(payload)}.{picks}</p>
<p>{escape(optimality)}</p>
{_verdict(verification)}</header>
"""


def _verdict(verification: Verification | CycleVerification) -> str:
    if verification.ok:
        but = beyond(verification.distances)
        return f'<p class="{"bad" if but else "good"}">{_VERIFIED}{escape(but)}.</p>\n'
    return (
        f'<p class="bad">Verification failed: {escape("; ".join(verification.failures()))}.</p>\n'
    )


def _other_ways(found: Plan) -> str:
    """With which motions that lead another way it was compared."""
    ways, optima = len(found.ways), len(found.optima)
    if ways > 1:
        return (
            f"It was compared with {_counted(ways - 1, 'other way', 'other ways')} past the bodies."
        )
    if ways == 1 and found.ways[0].name == CLEAR:
        return "It keeps clear of all bodies without a detour."
    if ways == 1:
        return "No other way past the bodies was found."
    if optima > 1:
        others = _counted(optima - 1, "other local optimum", "other local optima")
        return f"It was compared with {others}."
    return "Motions that lead another way were not compared."


def _counted(number: int, one: str, several: str) -> str:
    """A number of things: "one other way", "3 other ways"."""
    return f"one {one}" if number == 1 else f"{number} {several}"


def _compared(durations: Mapping[str, float]) -> tuple[str, str]:
    """A title that says what the motion, the last, saves against the best of the others, and bars
    of all; no bars where it is alone."""
    *others, (_, own) = durations.items()
    if not others:
        return "", ""
    best, other = min(others, key=lambda each: each[1])
    how = "less" if own < other else "more"
    longest = max(durations.values())
    bars = "".join(
        f"<dt>{escape(name)}</dt>"
        f'<dd style="width: {100 * duration / longest:.1f}%">{duration:.4f} s</dd>'
        for name, duration in durations.items()
    )
    said = f"{percent(abs(own / other - 1))} {how} time than the {' '.join(best.split())}"
    return said, f'<dl class="bars">{bars}</dl>'


def _ways(ways: Sequence[TakenWay]) -> str:
    """A table of the ways past the bodies, the one that is taken first; nothing for one."""
    if len(ways) < 2:
        return ""
    rows = [
        (
            way.name,
            f"{way.duration:.4f} s" if way.is_planned else f"about {way.duration:.3f} s",
            "taken" if number == 0 else "",
        )
        for number, way in enumerate(ways)
    ]
    return _table(("way", "duration", ""), rows)


def _figures(scenes: Sequence[Scene]) -> str:
    """The drawings, with what is to be known of their marks."""
    bodies = "Bodies are grey, as if of glass: turn the robot to see on which side the path passes."
    points = "Diamonds are via points, circles about them the spheres that are passed."
    hints: dict[str, Callable[[Scene], object]] = {
        bodies: lambda scene: scene.keep_out is not None,
        "Blue is what the path stays in.": lambda scene: scene.tube or scene.columns,
        "Orange is the way of a goal on its belt meanwhile.": lambda scene: scene.task.goal.moves,
        points: lambda scene: scene.task.via,
    }
    told = "".join(f" {hint}" for hint, holds in hints.items() if any(map(holds, scenes)))
    return _filled("page.figures.html", told=escape(told))


def _verification(verification: Verification) -> str:
    intro = (
        "Each measure is held against what it may be at most. Excesses are shares of a limit: "
        "negative or zero means that it is kept."
    )
    rows = []
    for check in verification.checks():
        name, value, *bound = check.cells
        told = value if isfinite(check.value) else "not evaluated"
        rows.append((name, told, *bound, "ok" if check.ok else "failed"))
    return f"<p>{intro}</p>" + _table(("measure", "value", "at most", "unit", ""), rows)


def _duty(duty: Duty | None) -> str:
    """A table of what the motion asks of each motor; nothing where that was not evaluated."""
    if duty is None:
        return ""
    rows = [
        (each.name, *(f"{value:.4g}" for value in each.values), each.unit, each.above)
        for each in motor_facts(duty)
    ]
    head = ("at the arm", "motor 1", "motor 2", "motor 3", "unit", "")
    return _table(head, rows) + f"<p>All motors together: {escape(together(duty))}.</p>"


def _singularities(verification: Verification) -> str:
    rows = [
        (each.name, f"{each.least:.2g}", f"{each.subject} at {1e3 * each.t:.1f} ms")
        for each in verification.distances
    ]
    if not rows:
        return ""
    intro = "0 in a singularity, 1 at best. A distance that the scene asks for is verified above."
    return f"<p>{intro}</p>" + _table(("singularity", "least distance", "where and when"), rows)


def _section(title: str, content: str) -> str:
    """A section of the page; nothing without content."""
    return f"<section>\n<h2>{escape(title)}</h2>\n{content}\n</section>\n" if content else ""


def _list(items: Iterable[str]) -> str:
    return "<ul>" + "".join(f"<li>{escape(item)}</li>" for item in items) + "</ul>"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table that scrolls sideways where the window is narrow."""
    return f'<div class="wide">{html_table(head, rows)}</div>'


def _json(data: object) -> str:
    """JSON that no text in it can end the script element of."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"), ensure_ascii=True)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _own_file(name: str) -> str:
    return (files("deltaopt.report") / name).read_text(encoding="utf-8")


def _filled(name: str, **values: str) -> str:
    """An own file with values in place of ``${names}``."""
    return Template(_own_file(name)).substitute(values)
