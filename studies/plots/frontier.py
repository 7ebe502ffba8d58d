"""Time against gap: the default beside Ipopt in every formulation, and beside other programs."""

from __future__ import annotations

from pathlib import Path

from deltaopt.plots.style import figure
from studies.frontier import DEFAULT, Point, best_degree
from studies.frontier_peers import PEERS, PeerPoint
from studies.plots.work_precision import Line, panel

LOOKS = {DEFAULT: 0, "flat": 1, "forward": 2, "explicit": 3, "multiplier": 4}
PEER_LOOKS = {name: look for look, name in enumerate(PEERS, start=1)}
TIME = "ms of one processor"
TITLE = "At every gap below 1 % the default takes the least time"


def draw(found: list[Point], peers: list[PeerPoint], file: Path) -> None:
    """Draw medians over the scenes; a cross where not every motion is good. Without other programs
    one panel."""
    panels = 2 if peers else 1
    with figure(file, 1.4 + 3.0 * panels, 3.9) as drawn:
        every = drawn.subplots(1, panels, sharex=True, sharey=True, squeeze=False)[0]
        default = _line(found, DEFAULT)
        methods = [m for m in dict.fromkeys(p.method for p in found) if m != DEFAULT]
        lines = [default, *(_line(found, method) for method in methods)]
        panel(every[0], lines, title="the same problem, by Ipopt", x=TIME)
        if peers:
            names = dict.fromkeys(p.peer for p in peers)
            lines = [default, *(_peer_line(peers, name) for name in names)]
            panel(every[1], lines, title="other programs", x=TIME)
        every[0].set_ylabel("longer than the optimum, share")
        drawn.suptitle(TITLE, x=0.01, ha="left", fontsize=10)
        for axes in every:
            axes.legend(
                loc="upper center",
                bbox_to_anchor=(0.5, -0.2),
                ncols=2,
                columnspacing=0.8,
                fontsize=8,
            )


def _line(found: list[Point], method: str) -> Line:
    degree = best_degree(found, method)
    own = [p for p in found if (p.method, p.degree) == (method, degree)]
    name = "deltaopt's default" if method == DEFAULT else f"{method}, Ipopt"
    failures = [1e3 * p.seconds for p in own if p.good < p.scenes]
    return Line(name, [1e3 * p.seconds for p in own], [p.gap for p in own], LOOKS[method], failures)


def _peer_line(peers: list[PeerPoint], name: str) -> Line:
    own = [p for p in peers if p.peer == name]
    failures = [1e3 * p.seconds for p in own if p.good < p.scenes]
    times, gaps = [1e3 * p.seconds for p in own], [p.gap for p in own]
    return Line(name, times, gaps, PEER_LOOKS[name], failures)
