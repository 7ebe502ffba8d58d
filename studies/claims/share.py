"""The 83 %: inverse dynamics along the paper's line, K and L_E against L_I, as the paper did it.

The paper's program was an interpreter with LAPACK behind its matrices (Mathematica 8), and found C
by an algorithm after eq. (8). Here NumPy does the same: M, Q̂*, Q, J are filled in as printed, then
C comes from the complete QR of Jᵀ, the singular value decomposition of J or eq. (55), and 3
equations are solved for L_E, or 12 for L_I. Every round simulates the whole motion once by each, in
turn, so that load falls on all alike.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import process_time

import casadi as ca
import numpy as np

from deltaopt.compare.dynamics.printed import as_printed
from deltaopt.compare.dynamics.samples import PAPER
from deltaopt.compare.dynamics.tasks import Array
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.mechanisms.delta.functions import DeltaFunctions
from deltaopt.mechanisms.delta.mechanism import delta
from studies.text_table import paragraph, table

Progress = Callable[[float, str], None]
PAPERS = 1.38 / 1.65
"""Average times of five simulations each, s."""
POINTS = 200
"""Of the line, in 0.5 s."""
START, GOAL = np.array([0.45, 0.10, -0.05]), np.array([0.45, -0.10, 0.05])
"""m; the paper draws its line but does not print it."""


@dataclass(frozen=True)
class Share:
    """Times of L_E with a way to C over those of L_I, one a round."""

    way: str
    ratios: Array
    agreement: float

    @property
    def median(self) -> float:
        return float(np.median(self.ratios))

    def interval(self) -> tuple[float, float]:
        """Return the 95 % interval of the median, by order statistics."""
        n, sorted_ratios = self.ratios.size, np.sort(self.ratios)
        half = 0.98 * np.sqrt(n)  # 1.96 sqrt(n) / 2
        low, high = int(max(0, np.floor(n / 2 - half))), int(min(n - 1, np.ceil(n / 2 + half)))
        return float(sorted_ratios[low]), float(sorted_ratios[high])


def measure(rounds: int, progress: Progress) -> list[Share]:
    """Simulate so often by L_I and by L_E with each way to C."""
    states = _states()
    ways = {name: _simulation(states, explicit(C)) for name, C in WAYS.items()}
    reference = _simulation(states, multiplier)
    times = {name: np.empty(rounds) for name in (*ways, "L_I")}
    for k in range(rounds):
        progress(k / rounds, f"round {k + 1}")
        for name, simulate in (*ways.items(), ("L_I", reference)):
            begin = process_time()
            simulate()
            times[name][k] = process_time() - begin
    progress(1.0, "done")
    truth = reference()
    scale = np.abs(truth).max()
    return [
        Share(name, times[name] / times["L_I"], float(np.abs(run() - truth).max() / scale))
        for name, run in ways.items()
    ]


def _states() -> list[tuple[Array, ...]]:
    """M, Q̂* + Q without torques, J, q̈ and B at every point of the line, a quintic law in time."""
    p = np.array(PAPER.values())
    functions = DeltaFunctions(PAPER.terms(), Explicit())
    m = as_printed(delta(PAPER), PAPER)
    x = [m.time, m.q, m.dq, m.parameters]
    force = m.Q_gyr + ca.substitute(m.Q, m.controls, ca.SX.zeros(3))
    assert m.closed_form is not None
    pieces = [ca.densify(e) for e in (m.M, force, m.J, m.B, m.closed_form[0])]
    evaluate = ca.Function("pieces", x, pieces)
    u, h = np.linspace(0, 1, POINTS), 0.5
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    ds = (30 * u**2 - 60 * u**3 + 30 * u**4) / h
    dds = (60 * u - 180 * u**2 + 120 * u**3) / h**2
    found = []
    for k in range(POINTS):
        way = GOAL - START
        q, dq, ddq = functions.motion(START + s[k] * way, ds[k] * way, dds[k] * way, p)
        parts = (np.asarray(part.full()) for part in evaluate(0.0, q, dq, p))
        found.append((*parts, np.asarray(ddq.full())))
    return found


def explicit(constraint_matrix: Callable[[Array, Array], Array]) -> Callable[..., Array]:
    """Return L_E: (M, force, J, B, C of eq. (55), q̈) -> τ, with C found by this function of J."""

    def torques(M: Array, force: Array, J: Array, B: Array, C55: Array, ddq: Array) -> Array:
        C = constraint_matrix(J, C55)
        return np.asarray(np.linalg.solve(C.T @ B, C.T @ (M @ ddq - force)))

    return torques


def multiplier(M: Array, force: Array, J: Array, B: Array, C55: Array, ddq: Array) -> Array:
    """L_I: 12 equations for 3 torques and 9 multipliers."""
    return np.asarray(np.linalg.solve(np.hstack([B, J.T]), M @ ddq - force)[:3])


def _by_qr(J: Array, _: Array) -> Array:
    return np.linalg.qr(J.T, mode="complete")[0][:, J.shape[0] :]


def _by_svd(J: Array, _: Array) -> Array:
    return np.linalg.svd(J)[2][J.shape[0] :].T


WAYS: dict[str, Callable[[Array, Array], Array]] = {
    "complete QR of Jᵀ, eq. (8)": _by_qr,
    "singular values of J, eq. (8)": _by_svd,
    "eq. (55), filled in": lambda J, C55: C55,
}


def _simulation(
    states: list[tuple[Array, ...]], torques: Callable[..., Array]
) -> Callable[[], Array]:
    return lambda: np.array([torques(*state).ravel() for state in states])


def report(found: list[Share]) -> str:
    """Return the shares and what they say."""
    rows = [("C of L_E by", "time of L_E / L_I", "95 % interval", "torques differ by")]
    for share in found:
        low, high = share.interval()
        interval = f"{low:.0%} to {high:.0%}"
        rows.append((share.way, f"{share.median:.0%}", interval, f"{share.agreement:.0e}"))
    rounds = found[0].ratios.size
    inside = [s.way for s in found if s.interval()[0] <= PAPERS <= s.interval()[1]]
    return f"{table(rows)}\n\n" + paragraph(
        f"Medians over {rounds} rounds of the whole motion ({POINTS} points); filling in M, Q̂*, Q,"
        f" J and eq. (55) is not in the times. The paper's {PAPERS:.1%} come from averages of"
        " five simulations each, without their spread."
        + (f" It lies within the interval of: {', '.join(inside)}." if inside else "")
        + f" L_E is {'the faster one' if found[0].median < 1 else 'the slower one'} with C by eq."
        " (8)" + f" and {'faster' if found[-1].median < 1 else 'slower'} with eq. (55)."
    )
