"""The benchmarks of multibody dynamics against what others published for them."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from deltaopt.dynamics import Multiplier
from studies.benchmarks import (
    andrews,
    four_bars,
    governor,
    integrators,
    references,
    stewart,
    windows,
)
from studies.benchmarks.cases import Case, cases
from studies.benchmarks.published import Comparison, compared

CASES = {case.name: case for case in cases()}


def differences(case: Case, until: float) -> dict[str, list[Comparison]]:
    """What is published up to a time beside ours, by source."""
    found: dict[str, list[Comparison]] = {}
    for c in compared(case, case.run(case.times(until))):
        found.setdefault(c.published.source, []).append(c)
    return found


@pytest.mark.parametrize(("name", "until"), [("A01", 10), ("A04", 2), ("A05", 3)])
def test_six_published_digits(name, until):
    found = differences(CASES[name], until)["IFToMM"]
    assert len(found) >= 7
    assert max(abs(c.difference) for c in found) < 1e-6


def test_sixteen_digits_of_andrews_squeezer():
    """Ten of them hold: a method of order 8 finds what Adams does (docs/benchmarks.md)."""
    found = differences(replace(CASES["A03"], tolerance=1e-13), 0.03)["IVP"]
    assert len(found) == 20
    for kind, bound in (("λ", 1e-7), ("d", 1e-9), ("", 2e-10)):
        own = [c for c in found if c.published.quantity.startswith(kind)]
        found = [c for c in found if c not in own]
        largest = max(abs(c.published.value) for c in own)
        assert max(abs(c.difference) for c in own) < bound * largest


def test_andrews_squeezer_is_assembled_as_the_test_set_has_it():
    m, (q, _) = andrews.andrews_squeezer(), andrews.start()
    assert np.abs(ca.Function("f", [m.q], [m.holonomic])(q).full()).max() < 1e-17
    forward = Multiplier().forward_dynamics(m)
    ddq, lam = forward(0, q, np.zeros(7), andrews.TORQUE, [])
    expected = [14222.4439199541138705911625887, -10666.8329399655854029433719415, *5 * [0.0]]
    np.testing.assert_allclose(ddq.full().ravel(), expected, atol=1e-8)
    expected = [-98.5668703962410896057654982170, 6.12268834425566265503114393122, *4 * [0.0]]
    np.testing.assert_allclose(lam.full().ravel(), expected, atol=1e-9)


def test_two_four_bars_end_where_exudyn_ends_and_not_where_the_library_does():
    """By the one equation of the cranks, and by the mechanism while the library's curve holds."""
    end = four_bars.as_pendulum(np.array([0, 10.0]))[1]
    numbers: dict[str, list[float]] = {}
    for p in references.FOUR_BARS:
        if p.time == 10:
            numbers.setdefault(p.source, []).append(p.value)
    errors = {source: np.abs(end - value).max() for source, value in numbers.items()}
    coarse, fine = errors["Exudyn, step 0.25 ms"], errors["Exudyn, step 0.125 ms"]
    assert fine < 1e-6
    assert coarse / fine == pytest.approx(4, abs=0.1)  # order 2
    assert errors["IFToMM"] > 0.1
    found = differences(CASES["A02"], 0.2)["IFToMM"]
    assert [abs(c.difference) > 6e-5 for c in found if c.published.quantity == "x"] == [True, True]
    assert max(abs(c.difference) for c in found) < 1e-3


@pytest.mark.parametrize("windows", [1, 3])
def test_all_cranks_turn_alike(windows):
    times = np.linspace(0, 0.3, 4)
    case = replace(
        CASES["A02"],
        mechanism=four_bars.n_four_bar(windows),
        start=four_bars.n_four_bar_start(windows),
    )
    motion = case.run(times)
    expected = four_bars.as_pendulum(times, windows)
    for i in range(windows + 1):
        np.testing.assert_allclose(motion.q[:, 2 * i : 2 * i + 2] - [i, 0], expected, atol=1e-8)


def test_slider_crank_stays_on_its_branch():
    """Three times through the singularity where crank and rod stand upright."""
    case = CASES["slider-crank"]
    times = case.times(3.0)
    motion = case.run(times)
    exact = case.exact(times)
    assert np.sum(np.diff(np.sign(exact[:, 0])) != 0) >= 3
    np.testing.assert_allclose(motion.q, exact, atol=1e-6)
    assert np.ptp(motion.energy) < 1e-6


def test_governor_begins_with_relaxed_springs_and_keeps_its_spin():
    m, (q, dq) = governor.governor(), governor.start()
    values = ca.Function("values", [m.q, m.dq], [e.value for e in m.efforts])(q, dq)
    assert max(abs(float(x)) for x in values) < 1e-9
    momentum = ca.Function("momentum", [m.q, m.dq], [ca.gradient(m.T, m.dq)[0]])
    motion = CASES["A05"].run(np.array([0, 0.5, 1.0]))
    spins = [float(momentum(*state)) for state in zip(motion.q, motion.dq, strict=True)]
    np.testing.assert_allclose(spins, spins[0], rtol=1e-8)


def test_stewart_platform_hangs_by_its_weight():
    """At rest, level and symmetric: six equal forces carry it and the legs, by virtual work."""
    p = stewart.Stewart()
    m, q = stewart.gough_stewart(p), stewart.legs(p, np.array([0, 0, 0.9, 0, 0, 0.0]))
    assert np.abs(ca.Function("f", [m.q], [m.holonomic])(q).full()).max() < 1e-15
    still = np.zeros(24)
    force = Multiplier().inverse_dynamics(m)(0, q, still, still, [])[0].full().ravel()
    np.testing.assert_allclose(force, force[0], rtol=1e-12)
    length = q[8]
    rise = 0.9 / length  # of the leg's length for each metre that the platform rises
    # what cylinder and rod rise for each metre of the platform, from z = s cos γ, cos γ = h/l
    cylinder = p.cylinder_centre * (1 / length - 0.9 * rise / length**2)
    rod = 1 - p.rod_centre * (1 / length - 0.9 * rise / length**2)
    work = 9.81 * (p.mass / 6 + p.cylinder * cylinder + p.rod * rod)
    assert force[0] * rise == pytest.approx(work, rel=1e-12)


def test_stewart_platform_by_four_ways():
    found = stewart.agreement(3)
    assert found.forces < 1e-12
    assert found.power < 1e-12


def test_counts_are_the_same_twice():
    twice = [windows.measure(lambda done, what: None, (1, 3)) for _ in range(2)]
    assert twice[0] == twice[1]
    runs = [integrators.measure(lambda done, what: None, 0.02, 1) for _ in range(2)]
    assert [(r.work, repr(r.error)) for r in runs[0]] == [(r.work, repr(r.error)) for r in runs[1]]


def test_sparse_qr_of_a_diagonal_matrix_costs_its_size():
    assert windows._sparse_qr(ca.Sparsity.diag(5)) == windows._sparse_qr(ca.Sparsity.diag(10)) // 2
