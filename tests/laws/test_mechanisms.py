"""Mechanisms are trees whose parts are named."""

from __future__ import annotations

import pytest

from pytest_simbench.laws.mechanisms import MOUNT, Part, mechanism
from pytest_simbench.simulator import PreparedRobot

Y = (0.0, 1.0, 0.0)


def test_parts_hang_on_the_one_before_or_on_a_named_one() -> None:
    parts = Part("a", Y), Part("b", Y), Part("c", Y, on="a"), Part("d", Y, on=MOUNT)
    joints = PreparedRobot(mechanism("tree", *parts)).joints
    above = {joint.name: joint.parent for joint in joints}
    assert above == {"a": "base", "b": "a link", "c": "a link", "d": "base"}


def test_a_part_that_hangs_on_none_there_is_is_refused() -> None:
    with pytest.raises(ValueError, match="'a' hangs on 'b'; choose from mount"):
        mechanism("tree", Part("a", Y, on="b"), Part("b", Y))
