"""Fast driven motion past a singularity, simulated forward: by which model, by which integrator.

The paper's Delta dips from 0.1 m inside to a distance ε from a singularity and back within 0.14 s,
at ten times gravity. The torques of that motion are functions of time, in closed form; they alone
drive the simulation. So the truth is the prescribed motion, and the error the platform's largest
distance from it at twenty instants, at which states are projected. Work is counted in right-hand
sides; a factorization counts as many as its matrix has columns. Two questions: at ε = 1e-2, what
does accuracy cost by each integrator (model L_I); and how near may it come until the model matters
(CVODES' Adams method, tolerance 1e-10)?
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from deltaopt.compare.dynamics.many_digits import ManyDigits
from deltaopt.compare.dynamics.samples import PAPER, rounded
from deltaopt.compare.dynamics.tasks import Array
from deltaopt.dynamics import (
    ClosedForm,
    Explicit,
    Formulation,
    Multiplier,
    NullSpace,
    Partition,
    VirtualWork,
)
from deltaopt.dynamics.mechanism import SX, Mechanism
from deltaopt.errors import IntegrationFailed
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.mechanisms.delta.kinematics import inverse_kinematics
from studies.problems import add_directory
from studies.simulation import (
    BDF,
    Adams,
    Gauss,
    Integrator,
    NoStabilisation,
    Projection,
    Stabilisation,
    StabilisedDAE,
    simulate,
)
from studies.stability.families import Family, Maker, delta_families
from studies.stability.singularities import lapack_lu
from studies.text_table import csv, paragraph, table

HELP = "fast driven motion at ε = 1e-2 from a singularity, simulated by every model"
FAMILIES = {"stretched": "arm and bars in line", "coplanar": "bars in one plane"}
"""A serial singularity and a parallel one, in the industrial assembly mode."""
DISTANCE = 1e-2
"""ε, at its nearest, where integrators are compared."""
DISTANCES = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3)
"""Where models are. Nearer to the serial one the torques themselves lose their digits: a place
determines ε² only."""
DIP, DURATION = 0.1, 0.14
"""m and s: the platform's largest acceleration is 2 π² DIP / DURATION², 101 m/s²."""
BY_INTEGRATOR = "L_I"
"""Model of the runs that compare integrators: nothing of it is chosen."""
COARSEST = 7e-3
"""Coarsest step of Gauss, s."""
INSTANTS = 20
"""At which states are projected and errors looked at."""
TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
TIGHT = 1e-10
"""Tolerance at which models are compared."""
MOST = 1e-2
"""An error beyond this, m, is none of the motion: a tenth of the dip."""
REACHED = 1e-6
"""Error by which integrators are compared, m."""
SMALL = {"families": ("stretched",), "tolerances": (1e-6,), "distances": (1e-2,)}


@dataclass(frozen=True)
class Way:
    """A way to simulate, from coarse to fine."""

    name: str
    integrators: tuple[tuple[Integrator, float], ...]
    stabilisation: Stabilisation


@dataclass(frozen=True)
class Run:
    """A simulated motion: ``error``, m; NaN and a ``failure`` in words if there is none.

    ``cost``: right-hand sides, factorizations included.
    """

    family: str
    distance: float
    model: str
    way: str
    setting: str
    error: float
    cost: int
    seconds: float
    failure: str


@dataclass(frozen=True)
class Dip:
    """A prescribed motion of the platform: from ``begin`` to ``nearest`` and back, m."""

    mechanism: Mechanism
    begin: Array
    nearest: Array

    @classmethod
    def of(cls, family: Family, distance: float) -> Dip:
        """Towards the family's state at a distance, from the side of its regular state."""
        nearest = rounded(Maker(family, ManyDigits(30)).q(distance))[:3]
        back = family.regular[:3] - nearest
        return cls(family.mechanism, nearest + DIP * back / np.linalg.norm(back), nearest)

    def coordinates(self, t: SX) -> tuple[SX, SX, SX]:
        """Return q, q̇ and q̈ at the time t."""
        share = ca.sin(np.pi * t / DURATION) ** 2
        place = SX(self.begin) + share * SX(self.nearest - self.begin)
        q = inverse_kinematics(PAPER, place)
        dq = ca.jacobian(q, t)
        return q, dq, ca.jacobian(dq, t)

    def torques(self) -> SX:
        """Return the torques as an expression in the mechanism's time."""
        m = self.mechanism
        inverse = Explicit(ClosedForm()).inverse_dynamics(m)
        torques: SX = inverse(m.time, *self.coordinates(m.time), PAPER.values())[0]
        return torques

    def states(self, times: Array) -> tuple[Array, Array]:
        """Return q and q̇ at the times, N × 12 each."""
        t = SX.sym("t")
        q, dq, _ = self.coordinates(t)
        f = ca.Function("states", [t], [q, dq])
        found = (np.array(each.full().T) for each in f.map(len(times))(times[None]))
        q_there, dq_there = found
        return q_there, dq_there


def models(mechanism: Mechanism, q: Array) -> dict[str, Formulation]:
    """Return the models; ``q``: regular coordinates, where the motor angles are independent."""
    J = ca.Function("J", [mechanism.q, mechanism.parameters], [ca.densify(mechanism.J)])
    return {
        "L_E, eq. (55)": Explicit(ClosedForm()),
        "K, motor angles": VirtualWork(Partition.pivoted(J(q, PAPER.values()).full())),
        "L_E, null space": Explicit(NullSpace()),
        "L_I, sparse QR": Multiplier(),
        "L_I, LAPACK LU": Multiplier(lapack_lu),
    }


def ways(tolerances: tuple[float, ...]) -> tuple[Way, ...]:
    """Return the ways that are compared at these tolerances; Gauss has steps instead."""
    adams, bdf, dae = (
        tuple((kind(), t) for t in tolerances) for kind in (Adams, BDF, StabilisedDAE)
    )
    steps = tuple((Gauss(COARSEST / 2**i), 1e-10) for i in range(min(len(tolerances), 5)))
    return (
        Way("Adams, projected", adams, Projection()),
        Way("Adams, free", adams, NoStabilisation()),
        Way("BDF, projected", bdf, Projection()),
        Way("index-2 DAE (GGL, IDAS)", dae, NoStabilisation()),
        Way("Gauss, order 6", steps, NoStabilisation()),
    )


def measure(
    progress: Callable[[float, str], None],
    families: tuple[str, ...],
    tolerances: tuple[float, ...],
    distances: tuple[float, ...],
) -> list[Run]:
    """Simulate by all ways at ``DISTANCE``, and by all models at all ``distances``."""
    found = []
    chosen = [family for family in delta_families() if family.name in families]
    for i, family in enumerate(chosen):
        progress(i / len(chosen), f"{family.name}: integrators")
        every = [(way, each) for way in ways(tolerances) for each in way.integrators]
        trial = Trial.of(family, DISTANCE)
        found += [trial.run(BY_INTEGRATOR, Multiplier(), way, *each) for way, each in every]
        by_adams = Way("Adams, projected", (), Projection())
        for k, distance in enumerate(distances):
            progress((i + 0.5 + k / (2 * len(distances))) / len(chosen), f"{family.name}: models")
            trial = Trial.of(family, distance)
            found += [
                trial.run(name, formulation, by_adams, Adams(), TIGHT)
                for name, formulation in models(family.mechanism, family.regular).items()
            ]
    progress(1.0, "done")
    return found


@dataclass(frozen=True)
class Trial:
    """A dip at a ``distance``: its torques, and its q and q̇ at ``times`` (N × 12 each)."""

    family: Family
    distance: float
    torques: SX
    times: Array
    q: Array
    dq: Array

    @classmethod
    def of(cls, family: Family, distance: float) -> Trial:
        dip, times = Dip.of(family, distance), np.linspace(0, DURATION, INSTANTS + 1)
        return cls(family, distance, dip.torques(), times, *dip.states(times))

    def run(
        self,
        model: str,
        formulation: Formulation,
        way: Way,
        integrator: Integrator,
        tolerance: float,
    ) -> Run:
        """Simulate once."""
        m = self.family.mechanism
        setting = f"{tolerance:.0e}"
        if isinstance(integrator, Gauss):
            setting = f"step {1e3 * integrator.step:g} ms"
        about = self.family.name, self.distance, model, way.name, setting
        try:
            motion = simulate(
                m,
                formulation,
                self.q[0],
                self.dq[0],
                self.times,
                controls=self.torques,
                parameters=PAPER.values(),
                stabilisation=way.stabilisation,
                integrator=integrator,
                tolerance=tolerance,
            )
        except IntegrationFailed as error:
            return Run(*about, np.nan, 0, np.nan, str(error).split("(")[1].split(")")[0])
        error_ = float(np.linalg.norm(motion.q[:, :3] - self.q[:, :3], axis=1).max())
        cost = motion.work.evaluations + 2 * m.q.numel() * motion.work.factorizations
        failure = "" if error_ < MOST else "another motion"
        return Run(*about, error_, cost, motion.seconds, failure)


def by_integrator(runs: list[Run]) -> list[Run]:
    """Return the runs that answer the first question."""
    return [r for r in runs if r.model == BY_INTEGRATOR]


def by_model(runs: list[Run]) -> list[Run]:
    """Return the runs that answer the second."""
    return [r for r in runs if r.model != BY_INTEGRATOR]


def integrators_table(runs: list[Run]) -> str:
    """Return one line a setting: cost and error by every way."""
    own = by_integrator(runs)
    names = list(dict.fromkeys(r.way for r in own))
    rows = [("past", *(f"{name}: cost, m" for name in names))]
    for family in dict.fromkeys(r.family for r in own):
        columns = [[r for r in own if (r.family, r.way) == (family, name)] for name in names]
        for k in range(max(map(len, columns))):
            cells = (_cell(column[k]) if k < len(column) else "" for column in columns)
            rows.append((FAMILIES[family], *cells))
    return table(rows)


def _cell(run: Run) -> str:
    return f"{run.setting}: {run.failure or f'{run.cost:,}, {run.error:.1e}'}"


def models_table(runs: list[Run]) -> str:
    """Return one line a distance: the error of every model."""
    own = by_model(runs)
    names = list(dict.fromkeys(r.model for r in own))
    rows = [("past", "ε", *names)]
    for family, distance in dict.fromkeys((r.family, r.distance) for r in own):
        there = {r.model: r for r in own if (r.family, r.distance) == (family, distance)}
        cells = (
            there[name].failure or f"{there[name].error:.1e}, {there[name].cost:,}"
            for name in names
        )
        rows.append((FAMILIES[family], f"{distance:g}", *cells))
    return table(rows)


def verdict(runs: list[Run]) -> str:
    """Say what an error of ``REACHED`` costs, and from where on models differ."""
    told = []
    for family in dict.fromkeys(r.family for r in runs):
        own = [r for r in by_integrator(runs) if r.family == family]
        costs = {
            way: min((r.cost for r in own if r.way == way and r.error <= REACHED), default=None)
            for way in dict.fromkeys(r.way for r in own)
        }
        found = sorted((cost, way) for way, cost in costs.items() if cost is not None)
        never = [way for way, cost in costs.items() if cost is None]
        told.append(
            f"Past {FAMILIES[family]} at ε = {DISTANCE:g}, {1e6 * REACHED:g} µm cost in right-hand"
            f" sides: {', '.join(f'{way} {cost:,}' for cost, way in found) or 'nobody'}"
            + (f"; never: {', '.join(never)}." if never else ".")
        )
        differ = _differ([r for r in by_model(runs) if r.family == family])
        told.append(f"Models differ by more than ten times {differ}.")
    return paragraph(*told)


def _differ(runs: list[Run]) -> str:
    """From which distance on, and who errs most."""
    for distance in dict.fromkeys(r.distance for r in runs):
        own = [r for r in runs if r.distance == distance]
        errors = {r.model: np.inf if np.isnan(r.error) else r.error for r in own}
        worst = max(errors, key=lambda name: errors[name])
        if errors[worst] > 10 * min(errors.values()):
            return f"from ε = {distance:g} on, where {worst} errs most"
    return "at none of these distances"


def about(run: Run) -> tuple[str, float, str, str, str]:
    """Return what was tried."""
    return run.family, run.distance, run.model, run.way, run.setting


def csv_of(runs: list[Run]) -> str:
    """Return one line a run."""
    return csv(
        "family,distance,model,way,setting,error_m,cost,seconds,failure",
        ((*about(r), repr(r.error), r.cost, r.seconds, r.failure) for r in runs),
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_directory(parser, "driven")
    sizes = {"tolerances": TOLERANCES, "distances": DISTANCES}
    parser.set_defaults(families=tuple(FAMILIES), **sizes)


def run(arguments: argparse.Namespace) -> int:
    from deltaopt.files.atomic_write import atomic_write
    from studies.plots.driven import draw

    a = arguments
    runs = measure(ProgressBar(), a.families, a.tolerances, a.distances)
    print(integrators_table(runs), models_table(runs), verdict(runs), sep="\n\n")
    with atomic_write(a.directory / "driven.csv") as temporary:
        temporary.write_text(csv_of(runs), encoding="utf-8")
    draw(runs, a.directory / "driven.png")
    return 0
