"""The list of checks: name, law, the capability each needs, and which robots it can be asked of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pytest_simbench.motion.model import RobotModel
from pytest_simbench.scene import Robot
from pytest_simbench.simulator import Capability
from pytest_simbench.testing.subject import Subject

Law = Callable[[Subject], None]

Unfit = Callable[[Robot], str | None]
"""Why a law cannot be asked of a robot, in one sentence, or None."""


CUBE, SPACE = 0.05, 0.01
"""Edge of the cube that a hand grasps, and space beside it on either side, open [m]."""


@dataclass(frozen=True)
class Check:
    """One law of the kit.

    Attributes:
        name: its function's name, part of the test's id.
        law: raises `ConformanceFailure` when the adapter breaks it.
        needs: the capability without which it is skipped.
        robot: for which robots it is skipped, and why; None of a law about no robot, or about a
            robot of its own.
    """

    name: str
    law: Law
    needs: Capability | None = None
    robot: Unfit | None = None

    @property
    def doc(self) -> str:
        return (self.law.__doc__ or "").strip()


CHECKS: dict[str, Check] = {}
"""All checks by name, in the order in which they were defined."""


def check(needs: Capability | None = None, robot: Unfit | None = None) -> Callable[[Law], Law]:
    """Add a function to `CHECKS` under its own name."""

    def add(law: Law) -> Law:
        name = getattr(law, "__name__", "")
        CHECKS[name] = Check(name, law, needs, robot)
        return law

    return add


def any_robot(robot: Robot) -> str | None:
    """Nothing is asked of the robot."""
    return None


def coupled(robot: Robot) -> str | None:
    """It must have two fingers that move together."""
    count = len(robot.gripper.joints)
    return None if count > 1 else f"{robot.name} has {count} finger joints: none is coupled"


def grasping(robot: Robot) -> str | None:
    """It must have two parallel fingers, which open wide enough for a cube."""
    if not RobotModel(robot).has_parallel_fingers:
        return f"{robot.name} has no hand with two parallel fingers"
    needed, opened = CUBE / 2 + SPACE, robot.gripper.opened
    if opened < needed:
        return f"{robot.name} opens its fingers to {opened:g} m; the law takes {needed:g} m"
    return None


def throwing(robot: Robot) -> str | None:
    """It must grasp, and know how to swing its arm for a throw."""
    return grasping(robot) or (
        None if robot.swing else f"robot {robot.name!r} has no swing for the throw"
    )
