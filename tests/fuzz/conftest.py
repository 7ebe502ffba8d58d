"""Random input by Hypothesis: small and always the same by default, long by a command.

python -m pytest tests/fuzz --hypothesis-profile long --hypothesis-seed 1
"""

from __future__ import annotations

from hypothesis import HealthCheck, settings

UNHURRIED = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.function_scoped_fixture]

settings.register_profile(
    "small",
    max_examples=40,
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=UNHURRIED,
)
settings.register_profile(
    "long", max_examples=1000, deadline=None, suppress_health_check=UNHURRIED, print_blob=True
)
settings.load_profile("small")
