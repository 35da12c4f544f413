"""Links that collide with each other, but for those that one joint joins."""

from __future__ import annotations

from typing import Any

from pytest_simbench.simulator import PreparedRobot


def part_joined(spec: Any, prepared: PreparedRobot) -> None:
    """Have links that one joint joins pass through each other. MuJoCo does so by itself, but where
    one of them is fixed in the world."""
    for joint in prepared.joints:
        spec.add_exclude(bodyname1=joint.parent, bodyname2=joint.child)
