"""What is common to the adapters' read-back."""

from __future__ import annotations

import numpy as np

from pytest_simbench.simulator import one_value


def test_equal_values_are_one_number() -> None:
    assert one_value([87.0, 87.0]) == 87.0
    assert np.ndim(one_value(np.full((2, 3), 0.5))) == 0


def test_different_values_are_all_told() -> None:
    assert list(one_value([[1.0, 0.5], [1.0, 1.0]])) == [0.5, 1.0]
