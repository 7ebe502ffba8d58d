"""The paper's claims as measured: ways agree, counts repeat, intervals are Wilson's."""

from __future__ import annotations

import numpy as np
import pytest

from studies import shares
from studies.claims import share, singular, table1


def silent(done: float, what: str) -> None:
    pass


def test_table_one_counts_the_same_twice():
    found = table1.measure()
    assert found == table1.measure()
    k, explicit, multiplier = found
    assert k.expressions > explicit.expressions > multiplier.expressions
    assert (k.inverse, explicit.inverse, multiplier.inverse) == (850, 1312, 1725)
    # what L_E derives beyond L_I is C of eq. (55): a unit matrix and three blocks of 3 × 3
    assert explicit.expressions - multiplier.expressions == 3 + 27 - 2


def test_all_ways_along_the_line_give_the_same_torques():
    for found in share.measure(3, silent):
        assert found.agreement < 1e-13
        low, high = found.interval()
        assert low <= found.median <= high


def test_interval_of_a_median_by_order_statistics():
    """Of 100 values the 40th and the 61st bound the median with 95 %."""
    found = share.Share("", np.arange(1.0, 101.0), 0.0)
    low, high = found.interval()
    assert low == pytest.approx(40, abs=1)
    assert high == pytest.approx(61, abs=1)


@pytest.mark.parametrize(
    ("worse", "trials", "expected"), [(0, 10, (0.0, 0.2775)), (5, 10, (0.2366, 0.7634))]
)
def test_wilson(worse, trials, expected):
    assert shares.wilson(worse, trials) == pytest.approx(expected, abs=1e-4)


def test_near_stretched_bars_the_closed_form_errs_more():
    found = singular.measure(silent, 1, 30, ("stretched",))
    own = [
        c
        for c in found
        if (c.family, c.solver, c.variant) == ("stretched", "LAPACK LU", "closed form")
    ]
    assert [c.worse for c in own] == [0, 0]
    assert all(c.factor < 1e-2 for c in own)
    assert all(0 <= c.worse <= c.trials == 4 for c in found)
