"""A scene with a hinge and a slider, and a world of it that goes where a test says."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pytest_simbench.description.robot_files import keep
from pytest_simbench.scene import FloatArray, Gripper, Joint, Robot, Scene
from tests.tasks.scripted import ScriptedProcess

LINK = '<link name="{}"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0"\
 izz="1"/></inertial></link>'
JOINT = '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/>\
<limit lower="-1" upper="1" effort="9" velocity="9"/></joint>'
URDF = f"""<robot name="two"><link name="root"/>{LINK.format("door")}{LINK.format("drawer")}
{JOINT.format("hinge", "revolute", "root", "door")}
{JOINT.format("slider", "prismatic", "root", "drawer")}</robot>"""


JOINTS = (Joint("hinge", 10, 1, 9, 0, 0.0), Joint("slider", 10, 1, 9, 0, 0.05))
ROBOT = Robot("two", str(keep(URDF, {})), {}, "", JOINTS, Gripper((), 0, 0, 0), "drawer")
SCENE = Scene("two joints", (), ROBOT)


class Moved(ScriptedProcess):
    """Its joints move at `speed`, and stand at `end` after each thing that it is asked to do."""

    def __init__(self, end: tuple[float, float], speed: tuple[float, float] = (0.0, 0.0)) -> None:
        super().__init__()
        self.end, self.time, self.until = np.array([end, speed]), 0.25, math.inf

    def _advance(self, duration: float, *rest: Any) -> dict[str, Any]:
        self.until = self.time + duration
        return super()._advance(duration, *rest)

    def _command(self, position: FloatArray) -> None: ...

    def _joints(self) -> FloatArray:
        if self.until == math.inf:  # it was just loaded
            return super()._joints()
        way = (self.time - self.until) * self.end[1]
        return np.array([self.end[0] + way, self.end[1]])
