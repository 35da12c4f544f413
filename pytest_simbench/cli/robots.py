"""`simbench robots`: the robots that do the tasks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pytest_simbench.cli.values import BadInput
from pytest_simbench.description.carried import named
from pytest_simbench.description.urdf_check import Description
from pytest_simbench.ground.text import for_terminal
from pytest_simbench.motion.errors import RobotError
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.registry import find, known, known_robot
from pytest_simbench.scene import Robot
from pytest_simbench.tasks import Pushing, Stacking, Throwing


def list_robots(names: Sequence[str] = ()) -> int:
    """Print the known robots, or those that are named or whose files are; 1 when one is broken.

    Raises:
        BadInput: there is no such robot, or its file is wrong.
    """
    broken = False
    for name in names or known():
        try:
            print(for_terminal("\n".join(_lines(find(name) if names else known_robot(name)))))
        except RobotError as error:
            if names:
                raise BadInput(str(error)) from None
            broken = True
            print(for_terminal(f"{name}: BROKEN: {error}"))
    return int(broken)


def _lines(robot: Robot) -> Iterator[str]:
    """Name, size and hand of a robot, and what it cannot do."""
    arm, fingers = len(robot.arm_joints), len(robot.gripper.joints)
    many = "one jaw that opens" if fingers == 1 else f"{fingers} fingers that open"
    hand = f"{many} to {robot.gripper.opened:g} {RobotModel(robot).finger_unit}"
    x, y, z = robot.base.position
    yield (
        f"{robot.name}: {arm} arm joints, {hand if fingers else 'a hand that only touches'}, "
        f"base at ({x:g}, {y:g}, {z:g})"
    )
    if resisting := _resisting(robot):
        yield f"    not used of the URDF: damping and friction of {named(resisting)} (<dynamics>)"
    for task in (kind(robot=robot) for kind in (Stacking, Throwing, Pushing)):
        if problem := task.problem():
            yield f"    no {task.name}: {problem}"


def _resisting(robot: Robot) -> list[str]:
    """Joints of which the URDF says more than 0."""
    return [
        joint.get("name", "")
        for joint in Description(robot.urdf, robot.packages).joints
        for dynamics in joint.iter("dynamics")
        if any(dynamics.get(key, "").strip("0. ") for key in ("damping", "friction"))
    ]
