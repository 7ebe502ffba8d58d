"""The benchmarks of multibody dynamics as cases: a mechanism, how it moves, what is known of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from deltaopt.compare.dynamics.tasks import Array
from deltaopt.dynamics import (
    Explicit,
    Formulation,
    LeastNorm,
    Mechanism,
    Multiplier,
)
from studies.benchmarks import (
    andrews,
    bricard,
    four_bars,
    governor,
    pendulum,
    references,
    slider_crank,
)
from studies.benchmarks.references import Published
from studies.simulation import (
    BDF,
    Adams,
    Integrator,
    Motion,
    NoStabilisation,
    Projection,
    Stabilisation,
    simulate,
)


@dataclass(frozen=True)
class Case:
    """A benchmark: the mechanism, its start (q, q̇), the torques, and how it is simulated.

    ``report``: quantities by name, N each, of a motion. ``published``: numbers of others.
    ``exact``: times -> what ``own`` of the motion should be, in another way: by an equation that is
    not singular, or another method; None where there is none. ``period``: between projections at
    most, s.
    """

    name: str
    title: str
    mechanism: Mechanism
    start: tuple[Array, Array]
    duration: float
    report: Callable[[Motion], dict[str, Array]]
    published: tuple[Published, ...] = ()
    exact: Callable[[Array], Array] | None = None
    own: Callable[[Motion], Array] = lambda motion: motion.q
    controls: tuple[float, ...] = ()
    formulation: Formulation = field(default_factory=Multiplier)
    integrator: Integrator = field(default_factory=Adams)
    stabilisation: Stabilisation = field(default_factory=Projection)
    tolerance: float = 1e-11
    period: float = 0.02

    def run(self, times: Array) -> Motion:
        """Simulate, reported at the times."""
        return simulate(
            self.mechanism,
            self.formulation,
            *self.start,
            times,
            controls=self.controls,
            stabilisation=self.stabilisation,
            integrator=self.integrator,
            tolerance=self.tolerance,
        )

    def times(self, until: float) -> Array:
        """Return the times of the periods and of all published values up to ``until``, s."""
        regular = np.linspace(0, until, round(until / self.period) + 1)
        known = [p.time for p in self.published if p.time <= until]
        together = np.sort(np.concatenate([regular, known]))
        later: Array = together[np.concatenate([[True], np.diff(together) > 1e-9])]
        return later


def _xy(motion: Motion) -> dict[str, Array]:
    return {"x": motion.q[:, 0], "y": motion.q[:, 1]}


def _squeezer(motion: Motion) -> dict[str, Array]:
    angles = dict(zip(references.ANGLES, motion.q.T, strict=True))
    return angles | {f"d{a}": w for a, w in zip(references.ANGLES, motion.dq.T, strict=True)}


def cases() -> list[Case]:
    """Return A01 to A05 of the IFToMM library, and the slider-crank of two equal links."""
    return [
        Case(
            "A01",
            "simple pendulum, (x, y) m",
            pendulum.pendulum(),
            pendulum.start(),
            10.0,
            _xy,
            references.PENDULUM,
            pendulum.exact,
        ),
        Case(
            "A02",
            "two four-bars, B₀ (x, y) m",
            four_bars.n_four_bar(),
            four_bars.n_four_bar_start(),
            10.0,
            _xy,
            references.FOUR_BARS,
            four_bars.as_pendulum,
            own=lambda motion: motion.q[:, :2],
            formulation=Multiplier(LeastNorm(1e-8)),
            tolerance=1e-10,
            period=0.1,
        ),
        Case(
            "A03",
            "Andrews' squeezer, rad and rad/s",
            andrews.andrews_squeezer(),
            andrews.start(),
            0.03,
            _squeezer,
            references.ANDREWS,
            andrews.by_gauss,
            controls=(andrews.TORQUE,),
            tolerance=1e-13,
            period=0.001,
        ),
        Case(
            "A04",
            "Bricard's mechanism, P₃ (x, y, z) m",
            bricard.bricard(),
            bricard.bricard_start(),
            10.0,
            lambda motion: dict(zip("xyz", motion.q[:, 3:6].T, strict=True)),
            references.BRICARD,
            formulation=Multiplier(LeastNorm(1e-8)),
            tolerance=1e-9,
            period=0.1,
        ),
        Case(
            "A05",
            "flyball governor, slider's height s, m",
            governor.governor(),
            governor.start(),
            3.0,
            lambda motion: {"s": motion.q[:, 1]},
            references.GOVERNOR,
            formulation=Explicit(),
            integrator=BDF(),
            stabilisation=NoStabilisation(),
            tolerance=1e-10,
            period=0.1,
        ),
        Case(
            "slider-crank",
            "two equal links, x of the joint, m",
            slider_crank.slider_crank(),
            slider_crank.start(),
            3.0,
            lambda motion: {"x": motion.q[:, 0]},
            exact=slider_crank.on_its_branch,
            formulation=Multiplier(LeastNorm(1e-8)),
            tolerance=1e-10,
            period=0.1,
        ),
    ]
