"""Adapters that are wrong in the robot's drives, hand, links or joints, for the kit to find."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from pytest_simbench.sims.mujoco.adapter import MuJoCo

from pytest_simbench.scene import FloatArray, Scene
from pytest_simbench.simulator import Deviation, NotSupportedError, SimulatorInfo
from tests.testing import tampered
from tests.testing.wrong import Lying


class SoftDrives(Lying):
    def tamper(self) -> None:
        self.model.actuator_gainprm[:, 0] /= 2
        self.model.actuator_biasprm[:, 1] /= 2


DRIVE_NOT_TOLD = replace(
    MuJoCo.info,
    deviations=(
        *MuJoCo.info.deviations,
        Deviation("joint/*/stiffness joint/*/damping", "the adapter's own drive"),
    ),
)


class DrivesNotTold(MuJoCo):
    """Springs as they should be, which are declared not to be told."""

    info: ClassVar[SimulatorInfo] = DRIVE_NOT_TOLD


class SoftDrivesNotTold(SoftDrives):
    info: ClassVar[SimulatorInfo] = DRIVE_NOT_TOLD


class NoRobots(MuJoCo):
    """Builds no robot, and says so."""

    info: ClassVar[SimulatorInfo] = replace(
        MuJoCo.info, deviations=(Deviation("link/*", "there are no robots here"),)
    )

    def load(self, scene: Scene) -> None:
        if scene.robot is not None:
            raise NotSupportedError("there are no robots here")
        super().load(scene)


class NoFeedForward(MuJoCo):
    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        super().command(position, 0 * velocity, 0 * effort)


class Teleports(MuJoCo):
    """A cube between closed fingers goes where the hand goes, whatever the forces."""

    def step(self) -> None:
        super().step()
        if self.scene.robot is None or not len(self._body_q):
            return
        hand = 0.5 * sum(self.data.body(finger).xpos for finger in tampered.FINGERS)
        closed = self.joint_state()[0, 7] < 0.026
        held = getattr(self, "held", None)
        if closed and held is None:
            self.held = self.data.qpos[self._body_q[0]][:3] - hand
        elif closed:
            self.data.qpos[self._body_q[0][:3]] = hand + held
            self.data.qvel[self._body_v[0]] = 0.0


class Magnet(MuJoCo):
    """Cubes near the hand hang there, though no finger touches them."""

    def step(self) -> None:
        super().step()
        if self.scene.robot is not None and len(self._body_q):
            self.data.qvel[self._body_v[0]] *= 0.9


class TiltedAxis(MuJoCo):
    """The axis of joint 1 is tilted by 5 degrees; it is told as if it was not."""

    def load(self, scene: Scene) -> None:
        super().load(scene)
        if scene.robot is not None:
            axis = (np.sin(np.radians(5)), 0.0, np.cos(np.radians(5)))
            self.model.jnt_axis[self.model.joint("panda_joint1").id] = axis

    def read_back(self) -> dict[str, Any]:
        told = super().read_back()
        return told | {k: v for k, v in self.straight.items() if k in told}

    straight: ClassVar[dict[str, Any]] = {"joint/panda_joint1/axis": [0, 0, 1, 0, 0, 0]}


class LinkAxes(MuJoCo):
    """Tells what joints transmit in the axes of the link below."""

    def joint_wrenches(self) -> FloatArray:
        bodies = self.model.jnt_bodyid
        turns = self.data.xmat[bodies].reshape(-1, 3, 3)
        halves = super().joint_wrenches().reshape(-1, 2, 3)
        return np.einsum("nij,nki->nkj", turns, halves).reshape(-1, 6)


class OnTheLinkAbove(MuJoCo):
    def joint_wrenches(self) -> FloatArray:
        return -super().joint_wrenches()


class AboutCentres(MuJoCo):
    """Its torques are about the centres of mass of the links below."""

    def joint_wrenches(self) -> FloatArray:
        told, bodies = super().joint_wrenches(), self.model.jnt_bodyid
        arms = self.data.xipos[bodies] - self.data.xpos[bodies]
        told[:, 3:] -= np.cross(arms, told[:, :3])
        return told
