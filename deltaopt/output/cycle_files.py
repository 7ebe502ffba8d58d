"""A planned cycle as data for other programs, and in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from deltaopt.errors import shown
from deltaopt.files.csv_table import write_csv
from deltaopt.files.validated_record import vector3
from deltaopt.motion.motion_sequence import MotionSequence, waiting
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.facts import above_nominal
from deltaopt.output.in_words import duty_table, percent
from deltaopt.output.plan_files import COLUMNS, FORMAT, TABLE, instants, rows_at, versions
from deltaopt.output.saved_plan import (
    SavedPlan,
    UnreadablePlan,
    load_plan,
    read_record,
    table_difference,
)
from deltaopt.planning.cycles.cycle_plan import CyclePlan
from deltaopt.scene.moving_ends import Belt, End, State
from deltaopt.verify.cycle import CycleVerification, verify_cycle

RECORD = "cycle.json"
"""The file that says how a cycle was found."""
CYCLE_COLUMNS = (*COLUMNS, "leg", "payload")
"""Of the table of a cycle: beside those of a plan which leg it is, from 1 on, its dwell included,
and the payload, kg."""
Leg = tuple[Path, SavedPlan, Trajectory | None]
"""Of a saved cycle: its folder, its plan, and the wait after it, None without."""
_JOINED = 1e-6
"""Angle, rad, also in the duration of a motion, by which motions that follow each other may be
apart: legs are planned to less, and encoders do not see it."""


def verified(plan: CyclePlan) -> CycleVerification:
    """The measures of a planned cycle."""
    legs = [(leg.scene, leg.trajectory) for leg in plan.legs]
    goals = [scene.goal for scene in plan.cycle.legs]
    return verify_cycle(legs, plan.waits, goals, plan.cycle.rms_limits, plan.cycle.period)


def write_cycle(file: Path, plan: CyclePlan, rate: float) -> None:
    """Write a period of a cycle as CSV, a row at each instant at ``rate`` (Hz) and at its end."""
    times = instants(plan.trajectory, rate)
    ends = np.cumsum(plan.phases)[1::2]
    which = np.minimum(np.searchsorted(ends, times, side="right"), len(plan.legs) - 1)
    payloads = np.array([leg.scene.payload or 0.0 for leg in plan.legs])[which]
    rows = np.column_stack([rows_at(plan.trajectory, times), which + 1, payloads])
    write_csv(file, CYCLE_COLUMNS, rows.tolist())


def content_of_cycle(plan: CyclePlan, verification: CycleVerification) -> dict[str, object]:
    """What cycle.json says, for JSON. The motions of the legs are in their own folders."""
    return {
        "format": FORMAT,
        "period": plan.period,
        "parts_per_minute": plan.parts_per_minute,
        "gap": plan.gap if isfinite(plan.gap) else None,
        "tolerance": plan.tolerance,
        "rms_torque": verification.rms_torque,
        "rms_limits": verification.rms_limits,
        "saved_by_rms_torque": plan.prices,
        "legs": list(_legs(plan)),
        "duty": verification.duty and verification.duty.as_dict(),
        "verification": {"ok": verification.ok, "failures": verification.failures()},
        "versions": versions(),
    }


def load_legs(path: Path) -> list[Leg]:
    """The legs of a saved cycle: the folder of each, its plan and the wait after it, None without.
    A plan of a single motion is one leg. Raises UnreadablePlan, also where the legs are not those
    that the record times, or where one does not go on from the one before."""
    file = path / RECORD
    if not file.is_file():
        return [(path, load_plan(path), None)]
    legs = list[Leg]()
    record, begins = read_record(file), 0.0
    try:
        for each in record["legs"]:
            folder, dwell = path / each["folder"], float(each["dwell"])
            plan = load_plan(folder)
            state = plan.trajectory.position.with_rate_at(plan.trajectory.knots[-1:])
            at, velocity = (vector3(*column) for column in state)
            wait = waiting(plan.trajectory.model, at, velocity, dwell) if dwell > 0 else None
            legs.append((folder, plan, wait))
            _require(each["folder"], "begins", float(each["begins"]), begins)
            _require(each["folder"], "takes", float(each["duration"]), plan.duration)
            begins += plan.duration + dwell
        _require("the cycle", "takes", float(record["period"]), begins)
        _require_joined(legs)
    except (KeyError, TypeError, ValueError) as error:
        raise UnreadablePlan(f"{file}: its legs cannot be used: {error}") from None
    return legs


def verified_again(path: Path, legs: Sequence[Leg]) -> tuple[CycleVerification, list[str]]:
    """The measures of a saved cycle, against the RMS torques that its record allows, and what in
    the record and in its table is not so in its motions. Raises UnreadablePlan."""
    record, waits = read_record(path / RECORD), [wait for _, _, wait in legs]
    parts, goals, begins = list[Trajectory](), list[End](), 0.0
    for _, plan, wait in legs:
        goal = plan.scene.goal
        if isinstance(goal, Belt):
            goal = goal.after(-begins)
        elif isinstance(goal, State) and wait is not None:  # onto the belt of the first leg
            goal = Belt(at=goal.at, belt=goal.velocity).after(wait.duration)
        goals.append(goal)
        parts += [plan.trajectory] if wait is None else [plan.trajectory, wait]
        begins = sum(part.duration for part in parts)
    pairs = [(plan.scene, plan.trajectory) for _, plan, _ in legs]
    try:
        limits = None if record["rms_limits"] is None else vector3(record["rms_limits"])
        found = verify_cycle(pairs, waits, goals, limits, None)
        told, now = record["rms_torque"], found.rms_torque
        same = (told is None) == (now is None) and np.allclose(told or 0.0, now or 0.0, rtol=1e-9)
        judged = record["verification"]["ok"]
    except (KeyError, TypeError, ValueError) as error:
        raise UnreadablePlan(f"{path / RECORD}: it cannot be used: {error}") from None
    off = table_difference(path / TABLE, MotionSequence(tuple(parts)))
    sentences = [f"{path / TABLE}: {off}"] if off else []
    if not same:
        by_it = f"RMS torques are {shown(told)} N·m by it"
        sentences.append(f"{path / RECORD}: {by_it}, and {shown(now)} by its motions")
    if judged is not found.ok:
        says = f"it says that ok is {shown(judged)}, and verification now {found.ok}"
        sentences.append(f"{path / RECORD}: {says}")
    return found, sentences


def _require(what: str, does: str, told: float, found: float) -> None:
    """Raise ValueError where a time of the record, s, is not that of the motions and dwells."""
    if not abs(told - found) <= 1e-9 * max(told, found):
        by_motions = f"by motions and dwells {found:.9g} s"
        raise ValueError(f"{what} {does} {told:.9g} s by the record, and {by_motions}")


def _require_joined(legs: list[Leg]) -> None:
    """Raise ValueError unless all legs are of one robot, whatever its tool, and each motion begins
    with the angles and speeds with which the one before it ends."""
    bare = [plan.scene.robot.model_copy(update={"tool": None}) for _, plan, _ in legs]
    parts = list[tuple[str, Trajectory]]()
    for (folder, plan, wait), robot in zip(legs, bare, strict=True):
        if robot != bare[0]:
            raise ValueError(f"{folder.name} is of another robot than {legs[0][0].name}")
        parts.append((folder.name, plan.trajectory))
        parts += [] if wait is None else [(f"the wait after {folder.name}", wait)]
    for (before, one), (name, other) in zip(parts, parts[1:] + parts[:1], strict=True):
        ends, begins = one(one.knots[-1]), other(other.knots[0])
        far = float(np.abs(begins.theta - ends.theta).max())
        off = float(np.abs(begins.dtheta - ends.dtheta).max())
        if far > _JOINED or off * min(one.duration, other.duration) > _JOINED:
            raise ValueError(f"{name} begins {far:.3g} rad and {off:.3g} rad/s off {before}'s end")


def told_of_period(path: Path, period: float) -> Iterator[str]:
    """A sentence where a table of a saved cycle has a longer period, s, than was planned.
    Raises UnreadablePlan."""
    file = path / RECORD
    record = read_record(file)
    try:
        planned, rate = float(record["period"]), float(record["parts_per_minute"])
    except (KeyError, TypeError, ValueError) as error:
        raise UnreadablePlan(f"{file}: its period cannot be used: {error}") from None
    if period > planned * (1 + 1e-9):
        now = f"a period of {period:.6g} s, {rate * planned / period:.4g} parts per minute"
        yield f"{now}; planned were {planned:.6g} s, {rate:.4g} parts per minute"


def folder_of(index: int) -> str:
    """The name of the folder of a leg."""
    return f"leg_{index + 1}"


def headline_of_cycle(plan: CyclePlan) -> str:
    """How many parts a minute, and the period."""
    return f"{plan.parts_per_minute:.4g} parts per minute, {plan.period:.4f} s"


def told_of_cycle(plan: CyclePlan, verification: CycleVerification) -> Iterator[str]:
    """The few lines that say what a planned cycle is worth: parts a minute, how near the best it
    is, its legs, what limits it."""
    yield headline_of_cycle(plan)
    what = "dearer than the least heat" if plan.cycle.period else "longer than the shortest period"
    missed = "" if plan.within_tolerance else f", not the {percent(plan.tolerance)} asked for"
    how_near = f"at most {percent(plan.gap)} {what} near it (estimated){missed}"
    yield how_near if isfinite(plan.gap) else f"how much {what} it is, is not known"
    legs = "; ".join(_leg(plan, index, each) for index, each in enumerate(_legs(plan)))
    yield f"legs: {legs}"
    limits, saved = verification.rms_limits, sum(_saved(plan)) / 10
    if verification.rms_torque is not None:
        allowed = "" if limits is None else f", at most {_in_words(limits)} are allowed"
        more = f"; 10 % more would save {100 * saved:.1f} %" if saved > 0 else ""
        yield f"RMS torques over a period: {_in_words(verification.rms_torque)} N·m{allowed}{more}"
    if gears := above_nominal(verification.duty):
        yield gears
    last = plan.cycle.legs[-1].goal
    if isinstance(last, Belt):
        pitch = 1e3 * plan.period * float(np.linalg.norm(last.belt))
        yield f"the parts of two periods are placed {pitch:.6g} mm apart on the belt"


def details_of_cycle(plan: CyclePlan, verification: CycleVerification) -> Iterator[str]:
    """All else: what more torque of each motor would save, and the duty of the motors."""
    for motor, saved in enumerate(_saved(plan), 1):
        if saved > 0:
            yield f"10 % more RMS torque of motor {motor} would save {10 * saved:.1f} %"
    yield from [] if verification.duty is None else duty_table(verification.duty)


def _saved(plan: CyclePlan) -> tuple[float, ...]:
    """What one per cent more RMS torque of each motor saves of the period, per cent: in one that
    is given nothing, for there prices are of the heat."""
    return plan.prices if plan.cycle.period is None else ()


def _leg(plan: CyclePlan, index: int, each: dict[str, Any]) -> str:
    """A leg of a cycle in words."""
    dwell = f" and a dwell of {each['dwell']:.4f} s" if each["dwell"] else ""
    then = f", then {each['then']}" if each["then"] else ""
    load = plan.legs[index].scene.payload_in_words
    return f"{each['duration']:.4f} s {load}{dwell}{then}"


def _in_words(torques: tuple[float, ...]) -> str:
    return ", ".join(f"{each:.4g}" for each in torques)


def _legs(plan: CyclePlan) -> Iterator[dict[str, Any]]:
    """Of each leg: when it begins, how long it and its dwell take, s, what it carries, kg, and what
    a gripper does when it arrives."""
    begins = 0.0
    for index, (leg, dwell) in enumerate(zip(plan.legs, plan.dwells, strict=True)):
        yield {
            "folder": folder_of(index),
            "begins": begins,
            "duration": leg.duration,
            "arrives": begins + leg.duration,
            "dwell": dwell,
            "payload": leg.scene.payload or 0.0,
            "then": _gripper(plan, index),
        }
        begins += leg.duration + dwell


def _gripper(plan: CyclePlan, index: int) -> str | None:
    """What a gripper does at the end of a leg: grip, release, or None."""
    pair = plan.legs[index], plan.legs[index + 1 - len(plan.legs)]
    now, after = (leg.scene.payload or 0.0 for leg in pair)
    return "grip" if after > now else "release" if after < now else None
