"""Forces for a time: what they give a body, and what they cannot be."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.scene import Body, Box, Pose, SceneError, Wrench

PULL = Wrench(force=(1.0, -2.0, 3.0), torque=(0.1, 0.0, 0.2), start=0.1, end=0.25)


@given(st.floats(1e-4, 0.05), st.floats(0.0, 1.0), st.floats(1e-3, 1.0))
def test_whatever_the_step_the_momentum_is_the_same(dt: float, start: float, last: float) -> None:
    wrench = Wrench(force=(2.0, 0.0, -1.0), start=start, end=start + last)
    steps = math.ceil((start + last) / dt) + 2
    given = sum(dt * wrench.mean(k * dt, (k + 1) * dt) for k in range(steps))
    assert given == pytest.approx(last * np.array([2.0, 0.0, -1.0, 0.0, 0.0, 0.0]), abs=1e-9)


def test_a_step_within_has_all_of_it_and_one_outside_nothing() -> None:
    assert PULL.mean(0.15, 0.16) == pytest.approx([1.0, -2.0, 3.0, 0.1, 0.0, 0.2])
    assert not PULL.mean(0.05, 0.1).any()
    assert not PULL.mean(0.25, 0.3).any()
    assert PULL.mean(0.08, 0.12)[:3] == pytest.approx([0.5, -1.0, 1.5])


def test_a_body_carries_its_forces_across_and_names_none_where_there_are_none() -> None:
    body = Box("a", (0.1,) * 3, Pose(), 1.0)
    assert "wrenches" not in body.to_wire()
    pulled = body.changed(wrenches=(PULL, Wrench(torque=(1.0, 0.0, 0.0))))
    assert Body.from_wire(pulled.to_wire()) == pulled


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"force": (1.0, 2.0)}, "the force [N] of a wrench is (1.0, 2.0); it must be 3 numbers"),
        ({"torque": (0.0, math.nan, 0.0)}, "the torque [N m] of a wrench is nan"),
        ({"start": 1.0, "end": 1.0}, "a wrench starts at 1.0 s and ends at 1.0 s"),
        ({"start": -1.0}, "the start [s] of a wrench is -1.0"),
    ],
)
def test_what_no_force_can_be(values: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError) as caught:
        Wrench(**values)
    assert message in str(caught.value)


def test_a_fixed_body_takes_no_force() -> None:
    with pytest.raises(SceneError, match="'a' has no mass, so no force moves it; give it a mass"):
        Box("a", (0.1,) * 3, Pose(), wrenches=(PULL,))
