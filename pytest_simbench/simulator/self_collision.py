"""Which links of a robot collide with each other."""

from __future__ import annotations

from pytest_simbench.scene import Scene
from pytest_simbench.simulator.errors import NotSupportedError
from pytest_simbench.simulator.info import Capability, SimulatorInfo
from pytest_simbench.simulator.urdf import PreparedRobot


def check_self_collision(info: SimulatorInfo, scene: Scene) -> None:
    """Raise `NotSupportedError` for a robot whose links collide with each other, on a simulator
    that has them pass through each other."""
    if "self_collide" in scene.words and Capability.SELF_COLLIDE not in info.capabilities:
        raise NotSupportedError(
            f"{info.name} has links of a robot pass through each other, and those of scene "
            f"{scene.name!r} are to collide"
        )


def joined(prepared: PreparedRobot) -> frozenset[frozenset[str]]:
    """Pairs of links that one joint joins: they never collide with each other."""
    return frozenset(frozenset((joint.parent, joint.child)) for joint in prepared.joints)


def links_collide(prepared: PreparedRobot, first: str, second: str) -> bool:
    """Whether two links of the reduced robot are to collide with each other."""
    return prepared.robot.self_collide and {first, second} not in joined(prepared)
