"""A scene with a hinge and a slider, and a world of it that goes where a test says."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from pytest_simbench.client.motion import Motion
from pytest_simbench.description.robot_files import keep
from pytest_simbench.scene import Gripper, Joint, Pose, Robot, Scene, Trajectory

LINK = '<link name="{}"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0"\
 izz="1"/></inertial></link>'
JOINT = '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/>\
<limit lower="-1" upper="1" effort="9" velocity="9"/></joint>'
URDF = f"""<robot name="two"><link name="root"/>{LINK.format("door")}{LINK.format("drawer")}
{JOINT.format("hinge", "revolute", "root", "door")}
{JOINT.format("slider", "prismatic", "root", "drawer")}</robot>"""


def _scene() -> Scene:
    joints = (Joint("hinge", 10, 1, 9, 0, 0.0), Joint("slider", 10, 1, 9, 0, 0.05))
    robot = Robot("two", str(keep(URDF, {})), {}, "", joints, Gripper((), 0, 0, 0), "drawer")
    return Scene("two joints", (), robot)


SCENE = _scene()


class Scripted:
    """A world whose joints move at `speed`, and stand at `end` after all that it is asked to do.

    Attributes:
        followed: trajectories that it was given.
    """

    def __init__(
        self, scene: Scene, end: tuple[float, float], speed: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        assert scene.robot is not None
        self.scene, self.time, self.end = scene, 0.25, np.array([end, speed])
        start = scene.robot.column("initial_position")
        self.joints = np.stack([start, np.zeros_like(start)])
        self.bodies = np.zeros((0, 13))
        self.followed: list[Trajectory] = []

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        yield

    def pose(self, name: str) -> Pose:
        raise KeyError(name)

    def follow(self, trajectory: Trajectory, *, log_period: float | None = None) -> Motion:
        self.followed.append(trajectory)
        return self.wait(trajectory.duration, log_period=log_period)

    def wait(self, duration: float, *, log_period: float | None = None) -> Motion:
        count = round(duration / (log_period or duration))
        times = self.time + np.linspace(duration / count, duration, count)
        self.time, self.joints = float(times[-1]), self.end
        joints = np.array([self.end] * count)
        joints[:, 0] += (times - self.time)[:, None] * self.end[1]
        return Motion(times, joints, np.zeros((count, 0, 13)))
