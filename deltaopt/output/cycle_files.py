"""A planned cycle as data for other programs, and in words."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from deltaopt.files.atomic_write import atomic_write
from deltaopt.files.csv_table import write_csv
from deltaopt.motion.motion_sequence import waiting
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.facts import together
from deltaopt.output.plan_files import COLUMNS, FORMAT, RATE, instants, rows_at, versions
from deltaopt.output.saved_plan import SavedPlan, UnreadablePlan, load_plan, read_record
from deltaopt.planning.cycles.cycle_plan import CyclePlan
from deltaopt.scene.moving_ends import Belt
from deltaopt.verify.cycle import CycleVerification, verify_cycle
from deltaopt.verify.duty import exceeding

RECORD = "cycle.json"
"""The file that says how a cycle was found."""
CYCLE_COLUMNS = (*COLUMNS, "leg", "payload")
"""Of the table of a cycle: beside those of a plan which leg it is, from 1 on, its dwell included,
and the payload, kg."""


def verified(plan: CyclePlan) -> CycleVerification:
    """The measures of a planned cycle."""
    legs = [(leg.scene, leg.trajectory) for leg in plan.legs]
    goals = [scene.goal for scene in plan.cycle.legs]
    return verify_cycle(legs, plan.waits, goals, plan.cycle.rms_limits, plan.cycle.period)


def write_cycle(file: Path, plan: CyclePlan, rate: float = RATE) -> None:
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
        "gap": plan.gap,
        "tolerance": plan.tolerance,
        "rms_torque": verification.rms_torque,
        "rms_limits": verification.rms_limits,
        "saved_by_rms_torque": plan.prices,
        "legs": list(_legs(plan)),
        "duty": verification.duty and verification.duty.as_dict(),
        "verification": {"ok": verification.ok, "failures": verification.failures()},
        "versions": versions(),
    }


def write_record(file: Path, plan: CyclePlan, verification: CycleVerification) -> None:
    """Write cycle.json."""
    with atomic_write(file) as temporary:
        text = json.dumps(content_of_cycle(plan, verification), indent=2, ensure_ascii=False)
        temporary.write_text(text + "\n", encoding="utf-8")


def load_legs(path: Path) -> list[tuple[Path, SavedPlan, Trajectory | None]]:
    """The legs of a saved cycle: the folder of each, its plan and the wait after it, None without.
    A plan of a single motion is one leg. Raises UnreadablePlan."""
    file = path / RECORD
    if not file.is_file():
        return [(path, load_plan(path), None)]
    legs = list[tuple[Path, SavedPlan, Trajectory | None]]()
    try:
        for each in read_record(file)["legs"]:
            folder, dwell = path / each["folder"], float(each["dwell"])
            plan = load_plan(folder)
            state = plan.trajectory.position.with_rate_at(plan.trajectory.knots[-1:])
            (at,), (velocity,) = (column.tolist() for column in state)
            wait = waiting(plan.trajectory.model, at, velocity, dwell) if dwell > 0 else None
            legs.append((folder, plan, wait))
    except (KeyError, TypeError, ValueError) as error:
        raise UnreadablePlan(f"{file}: its legs cannot be used: {error}") from None
    return legs


def folder_of(index: int) -> str:
    """The name of the folder of a leg."""
    return f"leg_{index + 1}"


def headline_of_cycle(plan: CyclePlan) -> str:
    """How many parts a minute, and the period."""
    return f"{plan.parts_per_minute:.4g} parts per minute, {plan.period:.4f} s"


def told_of_cycle(plan: CyclePlan, verification: CycleVerification) -> Iterator[str]:
    """All lines on a planned cycle."""
    yield headline_of_cycle(plan)
    for index, each in enumerate(_legs(plan)):
        dwell = f" and a dwell of {each['dwell']:.6f} s" if each["dwell"] else ""
        then = f", then {each['then']}" if each["then"] else ""
        load = plan.legs[index].scene.payload_in_words
        yield f"  leg {index + 1}: {each['duration']:.6f} s{dwell}, {load}{then}"
    last = plan.cycle.legs[-1].goal
    if isinstance(last, Belt):
        pitch = 1e3 * plan.period * float(np.linalg.norm(last.belt))
        yield f"the parts of two periods are placed {pitch:.6g} mm apart on the belt"
    limits, duty = verification.rms_limits, verification.duty
    allowed = "" if limits is None else f", at most {_in_words(limits)} are allowed"
    if verification.rms_torque is not None:
        rms = _in_words(verification.rms_torque)
        yield f"RMS torques of the motors over a period: {rms} N·m{allowed}"
    for motor, saved in enumerate(plan.prices, 1):
        if saved > 0:
            yield f"  10 % more of motor {motor} would save {saved / 10:.1%} of the period"
    if duty is not None:
        yield f"motors together: {together(duty)}"
        if any(duty.above_nominal or ()):
            above = exceeding(duty.above_nominal)
            yield f"  the cubic mean of a gear's torque is above its nominal torque: {above}"
    what = "dearer than the least heat" if plan.cycle.period else "longer than the shortest period"
    missed = "" if plan.within_tolerance else f", which is not the {plan.tolerance:g} asked for"
    yield f"estimated to be at most {plan.gap:.1e} {what}{missed}"
    yield "every leg and the cycle verified" if verification.ok else "verification failed"


def _in_words(torques: tuple[float, ...]) -> str:
    return ", ".join(f"{each:.4g}" for each in torques)


def _legs(plan: CyclePlan) -> Iterator[dict[str, object]]:
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
