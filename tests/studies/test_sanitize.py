"""The sanitizers find faults that are planted in the dense solver."""

from __future__ import annotations

import pytest

from studies import sanitize

FAULTS = {
    "one number too far": (
        "address,undefined",
        "  for (int64_t k = n - 1; k >= 0; k--) {",
        "  rows[n * width] = 0;",
        "heap-buffer-overflow",
    ),
    "memory that nobody wrote": (
        "address,undefined",
        "  const double done = ",
        "  rows[0] = *(double *)block(8);",
        "results differ by",
    ),
    "overflow": (
        "address,undefined",
        "  for (int64_t k = n - 1; k >= 0; k--) {",
        "  volatile int most = 2147483647; most += (int)n;",
        "signed integer overflow",
    ),
    "memory that threads share": (
        "thread",
        "  const double done = ",
        "  static double shared; shared += rows[0];",
        "data race",
    ),
}
"""Sanitizer; the line before which it is planted; the fault; what is said of it."""


@pytest.mark.parametrize("name", FAULTS)
def test_planted_faults_are_found(name):
    sanitizer, line, fault, said = FAULTS[name]
    why = sanitize.missing(sanitizer)
    if why:
        pytest.skip(why)
    program = sanitize.dense_systems()
    assert program.text.count(line) == 1
    program.text = program.text.replace(line, f"{fault}\n{line}")
    with pytest.raises(sanitize.Finding, match=said):
        program.run(sanitizer)
