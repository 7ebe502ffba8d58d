"""Kinds of attempts: what is exported of plans for controllers."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

import deltaopt
from deltaopt.curves.piecewise import Array
from studies.attack.attempts import Attempt, Generator, command
from studies.attack.checks import table_share
from studies.problems import PICK_AND_PLACE

_TABLE = Path("table.csv")


def exports(rng: Generator) -> Attempt:
    """A table or a program of a motion, driven faster than planned or interpolated coarsely: it
    keeps the torques, or is refused, or its head says that it does not."""
    controller = str(rng.choice(["cubic", "quintic"]))
    cycle = str(rng.choice(["own-knots", "1ms", "2ms", "4ms", "8ms"]))
    slower, target = (
        float(rng.choice([1, 0.8, 0.95, 1.3])),
        str(rng.choice(["table", "table", "c"])),
    )

    def made() -> str:
        planned = command("plan", PICK_AND_PLACE, "--no-plot", "-o", "plan")
        if planned.code:
            return planned.failed()
        if target == "c":
            record = Path("plan/plan.json")
            content = json.loads(record.read_text(encoding="utf-8"))
            motion = content["motion"]
            motion["knots"] = [slower * knot for knot in motion["knots"]]
            powers = slower ** -np.arange(len(motion["position"][0]))[:, None]
            motion["position"] = [(np.array(each) * powers).tolist() for each in motion["position"]]
            record.write_text(json.dumps(content), encoding="utf-8")
            ended = command("export", "c", "plan", "-o", "c")
            if slower >= 1 or ended.code:
                return ended.failed() if slower >= 1 else ended.unclear()
            head = Path("c/plan.h").read_text(encoding="utf-8")
            told = any(word in head for word in ("exceed", "beyond", "%"))
            return "" if told else f"nothing said of a motion in {slower} of its time"
        words = ("--controller", controller, "--cycle", cycle, "--slower", slower, "-o", _TABLE)
        ended = command("export", "table", "plan", *words)
        if ended.code:
            return ended.unclear()
        text = _TABLE.read_text(encoding="utf-8")
        cells = [line.split(",") for line in text.split("\n") if line[:1].isdigit()]
        numbers: Array = np.array(cells, dtype=float)
        rows = [numbers[:, 3 * k + 1 : 3 * k + 4] for k in range(2 if controller == "cubic" else 3)]
        scene = deltaopt.load_plan("plan").scene
        share = table_share(scene, numbers[:, 0], rows)
        return "" if share < 1.001 or text.startswith("#") else f"asks for {share:.3f} of a torque"

    return Attempt(f"{target}, {controller}, {cycle}, {slower} times as slow", made)
