"""What joints do beside their drives in SAPIEN: each by itself, and two together."""

from __future__ import annotations

from typing import Any

from pytest_simbench.parity.readback import one_value
from pytest_simbench.scene import Coupling, Joint
from pytest_simbench.simulator import NotSupportedError, lazy_import

physx = lazy_import("sapien.physx")

RUBBING = 1e6
"""Damping that holds a joint up to its friction [N m s/rad, N s/m]."""

BOUNDLESS = 3.4e38
"""An impulse that limits nothing [N m s, N s]: the largest of single precision."""


def add_own(joint: Any, own: Joint, timestep: float) -> list[Any]:
    """Constraints beside a joint: PhysX itself has friction as a coefficient of the load alone.

    Its spring is a soft limit of no range, which pulls in proportion to the angle; a drive of
    PhysX's constraints pulls in proportion to the sine of half of it.
    """
    made = []
    if own.spring or own.passive_damping:
        made.append(_beside(joint, own.passive_damping, BOUNDLESS))
    if own.spring:
        limit = made[0].set_limit_x if _slides(joint) else made[0].set_limit_twist
        limit(own.rest, own.rest, own.spring, 0.0)
    if own.friction:
        made.append(_beside(joint, RUBBING, own.friction * timestep))
    return made


def _beside(joint: Any, damping: float, impulse: float) -> Any:
    """A constraint that damps a joint, by so much impulse in a step at most."""
    made = physx.PhysxDriveComponent(joint.child_link)
    made.parent = joint.parent_link
    made.pose_in_parent, made.pose_in_child = joint.pose_in_parent, joint.pose_in_child
    drive = made.set_drive_property_x if _slides(joint) else made.set_drive_property_twist
    drive(0.0, damping, impulse)
    joint.child_link.entity.add_component(made)
    return made


def own_of(joint: Any, made: list[Any], timestep: float) -> tuple[float, float, float, Any]:
    """Stiffness, damping and friction of a joint by such constraints, and where its spring is at
    rest; None: it has none."""
    stiffness = damping = friction = 0.0
    rest = None
    for beside in made:
        limit, drive = (
            (beside.get_limit_x(), beside.get_drive_property_x())
            if _slides(joint)
            else (beside.get_limit_twist(), beside.get_drive_property_twist())
        )
        if limit[2]:
            stiffness, rest = stiffness + limit[2], one_value(limit[:2])
        if drive[2] < BOUNDLESS / 2:
            friction += drive[2] / timestep
        else:
            damping += drive[1]
    return stiffness, damping, friction, rest


def _slides(joint: Any) -> bool:
    return "prism" in joint.type


def couple(robot: Any, pair: Coupling, stiffness: float) -> None:
    """Move two joints together, by a tendon from the link that both hang on.

    Torques of a tendon go by the coefficients too. SAPIEN's own loader has them go by their
    inverse, right at a ratio of 1 alone.

    Raises:
        NotSupportedError: they hang on two links. All torques of a tendon push back on one.
    """
    leader, follower = (robot.find_joint_by_name(name) for name in (pair.leader, pair.follower))
    link = leader.parent_link
    if follower.parent_link is not link:
        raise NotSupportedError(
            f"sapien couples joints of one link alone: {pair.leader!r} is on {link.name!r}, "
            f"{pair.follower!r} on {follower.parent_link.name!r}"
        )
    scale = max(1.0, abs(pair.ratio))  # with larger coefficients joints stick, 0.2 rad apart
    pulls = [0.0, -pair.ratio / scale, 1.0 / scale]
    robot.create_fixed_tendon(
        [link, leader.child_link, follower.child_link],
        pulls,
        pulls,
        rest_length=pair.offset / scale,
        stiffness=stiffness,
    )
