"""What is taken away to see which tests notice."""

from __future__ import annotations

import pytest

from studies.mutations import MUTATIONS


@pytest.mark.parametrize("feature", MUTATIONS)
def test_what_is_taken_away_is_there(feature):
    MUTATIONS[feature].found()
