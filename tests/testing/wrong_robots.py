"""Adapters that are wrong in the robot's drives, hand, links or joints, for the kit to find."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from pytest_simbench.sims.mujoco.adapter import MuJoCo
from pytest_simbench.sims.mujoco.world import ROBOT

from pytest_simbench.scene import FloatArray, Scene
from pytest_simbench.simulator import Deviation, NotSupportedError, SimulatorInfo
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


class NoEffortLimit(Lying):
    def tamper(self) -> None:
        self.model.actuator_forcelimited[:] = 0
        self.model.jnt_actfrclimited[:] = 0  # the URDF's effort limit, which is the same


class FreeFingers(Lying):
    def tamper(self) -> None:
        self.data.eq_active[:] = 0


class SlipperyHand(Lying):
    def tamper(self) -> None:
        self.model.geom_friction[:, 0] = 0.01


FINGERS = ("panda_leftfinger", "panda_rightfinger")


class Robotic(Lying):
    """Tampers only where there is a robot."""

    def load(self, scene: Scene) -> None:
        MuJoCo.load(self, scene)
        self.told = {k: np.copy(v) for k, v in MuJoCo.read_back(self).items()}
        if scene.robot is not None:
            self.tamper()

    def geoms(self, link: str) -> Any:
        return self.model.geom_bodyid == self.model.body(link).id


class StickyFingers(Robotic):
    """Fingers of friction 20."""

    def tamper(self) -> None:
        for finger in FINGERS:
            self.model.geom_friction[self.geoms(finger), 0] = 20.0


class DoubleSqueeze(Robotic):
    def tamper(self) -> None:
        for index in (7, 8):
            self.model.actuator_forcerange[index] *= 2
        self.model.jnt_actfrcrange[:] *= 2


class Teleports(MuJoCo):
    """A cube between closed fingers goes where the hand goes, whatever the forces."""

    def step(self) -> None:
        super().step()
        if self.scene.robot is None or not len(self._body_q):
            return
        hand = 0.5 * sum(self.data.body(finger).xpos for finger in FINGERS)
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


class OneFloats(Robotic):
    def tamper(self) -> None:
        self.data.xfrc_applied[-1, 2] = self.model.body_mass[-1] * -self.model.opt.gravity[2]


class GhostLink(Robotic):
    def tamper(self) -> None:
        self.model.geom_contype[self.geoms("panda_link5")] = 0


class FatLink(Robotic):
    """The shapes of link 3 are 10 mm aside."""

    def tamper(self) -> None:
        turn = self.data.body("panda_link3").xmat.reshape(3, 3)
        self.model.geom_pos[self.geoms("panda_link3")] += turn.T @ [0.0, -0.01, 0.0]
        self.model.geom_sameframe[self.geoms("panda_link3")] = 0


class Bouncy(Lying):
    def tamper(self) -> None:
        self.model.geom_solref[:] = (0.02, 0.05)


class WrongCentre(Robotic):
    """The centre of mass of link 4 is 100 mm off."""

    def tamper(self) -> None:
        link = self.model.body("panda_link4").id
        self.model.body_ipos[link, 1] -= 0.1
        self.model.body_sameframe[link] = 0


class StiffJoint(Robotic):
    """Joint 4 has viscous friction."""

    def tamper(self) -> None:
        self.model.dof_damping[self.model.joint("panda_joint4").dofadr[0]] = 1.0


class WeightlessLink(Robotic):
    def tamper(self) -> None:
        link = self.model.body("panda_link6").id
        self.data.xfrc_applied[link, 2] = self.model.body_mass[link] * -self.model.opt.gravity[2]


class NoLimits(Robotic):
    def tamper(self) -> None:
        self.model.jnt_limited[:] = 0


class StrongWrist(Robotic):
    """Joint 7 has twice its effort limit."""

    def tamper(self) -> None:
        self.model.actuator_forcerange[6] *= 2
        self.model.jnt_actfrcrange[self.model.joint("panda_joint7").id] *= 2


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


class OpenLoop(Lying):
    def tamper(self) -> None:
        self.data.eq_active[:] = 0


class StuckLoop(Lying):
    def tamper(self) -> None:
        self.model.dof_damping[:] = 1e3


class PassingLinks(Lying):
    def tamper(self) -> None:
        self.model.geom_conaffinity[self.model.geom_contype == ROBOT] = 0


class JoinedLinksCollide(Lying):
    """Links collide with the one that they hang on."""

    def tamper(self) -> None:
        self.model.exclude_signature[:] = 0


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
