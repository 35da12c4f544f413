"""The Franka Panda and its hand: where they are described, their drives and limits of motion."""

from __future__ import annotations

from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from pytest_simbench.scene import Gripper, Joint, MotionLimits, Pose, Robot
from pytest_simbench.simulator import DescriptionError

DISTRIBUTION = "example-robot-data"
"""PyPI distribution that carries the Panda's URDF, SRDF and meshes (BSD-3-Clause)."""

STIFFNESS = (4500.0, 4500.0, 3500.0, 3500.0, 2000.0, 2000.0, 2000.0)
DAMPING = (450.0, 450.0, 350.0, 350.0, 200.0, 200.0, 200.0)
"""Joint drives [N m/rad, N m s/rad]: stiff, over-damped; ENGINES, measured on eight engines."""

EFFORT_LIMITS = (87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0)
"""[N m], the URDF's, from Franka's data sheet."""

ARMATURE = 0.1
"""Rotor inertia seen at each joint [kg m^2], and at each finger [kg]."""

READY = (0.0, -0.785398, 0.0, -2.356194, 0.0, 1.570796, 0.785398)
"""Arm joints of the SRDF's state "default" [rad]."""

FINGER_STIFFNESS, FINGER_DAMPING = 1000.0, 40.0
FINGER_OPENED, FINGER_CLOSED, SQUEEZE = 0.035, 0.0, 25.0
"""[m] and [N]. On a 0.05 m cube a finger stands at 0.025: 1000 N/m x 0.025 m = 25 N, the limit, so
that PD drives and force-limited velocity motors squeeze alike."""

LIMITS = MotionLimits(
    velocity=(2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61),
    acceleration=(15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0),
    jerk=(7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0),
    levers=(0.85, 0.85, 0.65, 0.65, 0.30, 0.30, 0.15),
    finger_speed=0.2,
)
"""Of the arm from Franka's data sheet, of the fingers from the URDF."""

WIND_UP = (0.0, -1.65, 0.0, -0.1, 0.0, 3.6, 0.8)
THROW_END = (0.0, 0.9, 0.0, -1.1, 0.0, 1.9, 0.8)
"""Arm joints before and after the throw [rad] (study code)."""


HAND, TOOL_FRAME = "panda_hand", "panda_hand_tcp"
"""Links: the root of the hand, which other arms can carry, and its tool centre point."""


@cache
def description_folder() -> Path:
    """The folder that the URDF calls `package://example-robot-data`.

    Raises:
        DescriptionError: the distribution is not installed; says how to.
    """
    try:
        files = distribution(DISTRIBUTION).files or []
    except PackageNotFoundError:
        files = []
    for file in files:
        if file.match("panda_description/urdf/panda.urdf"):
            return Path(str(file.locate())).resolve().parents[3]
    raise DescriptionError(
        f"the Panda's description is missing: pip install {DISTRIBUTION} (it is a dependency of "
        "pytest-simbench)"
    )


def fingers(squeeze: float = SQUEEZE) -> tuple[Joint, ...]:
    """The drives of the hand, each pressing with at most `squeeze` [N]."""
    return tuple(
        Joint(name, FINGER_STIFFNESS, FINGER_DAMPING, squeeze, ARMATURE, FINGER_OPENED)
        for name in ("panda_finger_joint1", "panda_finger_joint2")
    )


def gripper(squeeze: float = SQUEEZE) -> Gripper:
    """The hand."""
    names = tuple(joint.name for joint in fingers(squeeze))
    return Gripper(names, FINGER_OPENED, FINGER_CLOSED, squeeze)


def panda(*, squeeze: float = SQUEEZE, friction: float = 1.0, base: Pose | None = None) -> Robot:
    """The Panda with its hand, nine driven joints: seven of the arm, two fingers.

    Args:
        squeeze: effort limit of each finger [N].
        base: pose of the base, default the world's origin.
    """
    folder = description_folder()
    robot = folder / "robots/panda_description"
    arm = [
        Joint(f"panda_joint{i + 1}", STIFFNESS[i], DAMPING[i], EFFORT_LIMITS[i], ARMATURE, READY[i])
        for i in range(7)
    ]
    return Robot(
        name="panda",
        urdf=str(robot / "urdf/panda.urdf"),
        packages={DISTRIBUTION: str(folder)},
        srdf=str(robot / "srdf/panda.srdf"),
        joints=(*arm, *fingers(squeeze)),
        gripper=gripper(squeeze),
        tool_frame=TOOL_FRAME,
        base=base or Pose(),
        friction=friction,
        limits=LIMITS,
        swing=(WIND_UP, THROW_END),
    )
