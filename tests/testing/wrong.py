"""MuJoCo with one planted fault each: adapters that lie, forget or confuse.

Where the engine itself is changed, `read_back` goes on telling the scene's value, so that the
check under test has to find it, not the parity check at loading.
"""

from __future__ import annotations

import fnmatch
from collections.abc import Callable
from dataclasses import replace
from typing import Any, ClassVar

import mujoco  # on purpose: this module does not import without its engine
import numpy as np
from pytest_simbench.sims.mujoco.adapter import MuJoCo

from pytest_simbench.parity.quantities import expected_quantities
from pytest_simbench.scene import FloatArray, Scene
from pytest_simbench.scene.overlap import rotations
from pytest_simbench.simulator import Deviation, NotSupportedError, SimulatorInfo

FINGERS = ("panda_leftfinger", "panda_rightfinger")


Told = Callable[[Any, Any], Any]
"""What an adapter tells, of itself and of what it should tell."""


class Lying(MuJoCo):
    """Reads back what was built before `tamper` changed it."""

    def load(self, scene: Scene) -> None:
        super().load(scene)
        self.told = {k: np.copy(v) for k, v in super().read_back().items()}
        self.tamper()

    def tamper(self) -> None: ...

    def read_back(self) -> dict[str, Any]:
        return self.told


class ImportsEngine(MuJoCo):
    version = mujoco.__version__


class NoTitle(MuJoCo):
    info: ClassVar[SimulatorInfo] = replace(MuJoCo.info, title=" ")


class NoTuned(MuJoCo):
    profiles = {**MuJoCo.profiles}  # noqa: RUF012 - as an adapter's author might
    del profiles["default"]


class Air(Lying):
    """Brakes the first free body."""

    braked: ClassVar[slice] = slice(0, 3)

    def step(self) -> None:
        super().step()
        self.data.qvel[self.braked] *= 1 - 0.04 * self.settings.timestep


class AngularDamping(Air):
    braked = slice(3, 6)


class NoForce(MuJoCo):
    def push(self, wrenches: FloatArray) -> None:
        pass


class DoubleForce(MuJoCo):
    def push(self, wrenches: FloatArray) -> None:
        super().push(2 * wrenches)


class EndlessTorque(MuJoCo):
    def push(self, wrenches: FloatArray) -> None:
        if wrenches.any():
            super().push(wrenches)


class OwnAxes(MuJoCo):
    """Takes torques in the bodies' axes."""

    def push(self, wrenches: FloatArray) -> None:
        turns = rotations(self.body_state()[:, 3:7])
        torques = np.einsum("nij,nj->ni", turns, wrenches[:, 3:])
        super().push(np.hstack([wrenches[:, :3], torques]))


class FallingBelt(MuJoCo):
    """Only starts what it should lead."""

    def lead(self, before: FloatArray, after: FloatArray) -> None:
        if not self.time:
            self.model.body_gravcomp[:] = 0.0
            super().lead(before, after)


class StandingBelt(MuJoCo):
    """Moves the belt, and its surface does not: as a body that is put from place to place."""

    def lead(self, before: FloatArray, after: FloatArray) -> None:
        before = before.copy()
        before[:, 7:] = 0.0
        super().lead(before, after)


class LongStep(Lying):
    def tamper(self) -> None:
        self.model.opt.timestep *= 1.001


class OwnClock(MuJoCo):
    """Takes the profile's step whatever its settings say."""

    @property
    def time(self) -> float:
        steps = round(super().time / self.settings.timestep)
        return steps * self.profiles["tuned"].timestep


class OneShot(MuJoCo):
    """Forgets its command after half a second."""

    def step(self) -> None:
        super().step()
        if self.time > 0.5 and self.scene.robot is not None:
            self.data.ctrl[:] = self.scene.robot.column("initial_position")


class Meddler(MuJoCo):
    """Steps while it is asked."""

    def read_back(self) -> dict[str, Any]:
        told = super().read_back()
        self.data.qvel[-1] += 1e-9
        return told


class EchoLimits(MuJoCo):
    """Tells what it should have built, of some quantities, instead of the engine's."""

    echoed: ClassVar[str] = "joint/*/limits"

    def read_back(self) -> dict[str, Any]:
        wanted = expected_quantities(self.scene, self.settings)
        return super().read_back() | {k: wanted[k] for k in fnmatch.filter(wanted, self.echoed)}


class EchoGroundFriction(EchoLimits):
    echoed = "ground/friction"


class EchoLinkInertia(EchoLimits):
    echoed = "link/*/inertia"


class EchoScene(EchoLimits):
    echoed = "*"


class ForgetsCommand(MuJoCo):
    def restore(self, state: FloatArray) -> None:
        command = self.data.ctrl.copy()
        super().restore(state)
        self.data.ctrl[:] = command


class Noisy(MuJoCo):
    """Each process has its own random state."""

    def load(self, scene: Scene) -> None:
        super().load(scene)
        self.noise = np.random.default_rng()

    def step(self) -> None:
        self.data.qvel[:] += 1e-12 * self.noise.standard_normal(len(self.data.qvel))
        super().step()


class Hoarder(MuJoCo):
    """Each of its worlds leaves 5 MB behind."""

    kept: ClassVar[list[Any]] = []

    def load(self, scene: Scene) -> None:
        super().load(scene)
        self.kept.append(np.ones(625_000))


class Blank(MuJoCo):
    """Its pictures are of one colour, which is no grey, and another one in each scene."""

    def render(self, width: int, height: int) -> Any:
        colour = (len(self.scene.bodies), 90, 200)
        return np.full((height, width, 3), colour, np.uint8)


class Misbuilt(MuJoCo):
    """Builds half the gravity, and says so."""

    def load(self, scene: Scene) -> None:
        super().load(scene)
        self.model.opt.gravity *= 0.5


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


def columns(first: int, last: int, change: Callable[[Any], Any]) -> Told:
    """Some columns are told otherwise."""

    def told(_: Any, rows: FloatArray) -> FloatArray:
        rows[:, first:last] = change(rows[:, first:last])
        return rows

    return told


def wrenches(*factors: float) -> Told:
    """Contact forces and torques, (6,), are told multiplied."""
    return lambda _, told: ((a, b, np.array(factors) * wrench) for a, b, wrench in told)


def in_link_axes(s: Any, told: FloatArray) -> FloatArray:
    turns = s.data.xmat[s.model.jnt_bodyid].reshape(-1, 3, 3)
    return np.einsum("nij,nki->nkj", turns, told.reshape(-1, 2, 3)).reshape(-1, 6)


def about_centres(s: Any, told: FloatArray) -> FloatArray:
    """Torques are about the centres of mass of the links below."""
    bodies = s.model.jnt_bodyid
    told[:, 3:] -= np.cross(s.data.xipos[bodies] - s.data.xpos[bodies], told[:, :3])
    return told


TOLD: dict[str, tuple[str, Told, str]] = {
    "ScalarLast": ("body_state", columns(3, 7, lambda q: np.roll(q, -1, axis=1)),
                   "state_as_loaded"),
    "Reversed": ("body_state", lambda _, rows: rows[::-1].copy(), "state_as_loaded"),
    "BodyFrame": ("body_state", lambda s, rows: np.hstack(
        [rows[:, :10], s.data.qvel[s._body_v + 3]]), "velocity_frames"),  # as the engine keeps it
    "LongQuaternion": ("body_state", columns(3, 7, lambda q: 1.001 * q), "quaternions_are_unit"),
    "WrongSign": ("contact_forces", wrenches(*[-1.0] * 6), "weight_is_told"),
    "WrongTorque": ("contact_forces", wrenches(1, 1, 1, -1, -1, -1), "weight_is_told"),
    "NormalAlone": ("contact_forces", wrenches(0, 0, 1, 0, 0, 0), "friction_is_told"),
    "NoContacts": ("contact_count", lambda *_: 0, "contacts_counted"),
    "LinkAxes": ("joint_wrenches", in_link_axes, "joint_loads_are_told"),
    "OnTheLinkAbove": ("joint_wrenches", lambda _, told: -told, "joint_loads_are_told"),
    "AboutCentres": ("joint_wrenches", about_centres, "joint_loads_are_told"),
    "RoundsState": ("save", lambda _, state: state.astype(np.float32).astype(float),
                    "restore_continues"),
}  # fmt: skip
"""Adapters that tell something else than the engine: which method, what, the law that finds it."""


def telling(name: str) -> type[MuJoCo]:
    """The adapter of a row; workers find it by the name of its class."""
    method, change, _ = TOLD[name]

    def told(self: MuJoCo) -> Any:
        return change(self, getattr(MuJoCo, method)(self))

    return type(name, (MuJoCo,), {method: told, "__module__": __name__})


for _name in TOLD:
    globals()[_name] = telling(_name)
