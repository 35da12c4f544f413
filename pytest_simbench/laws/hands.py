"""Laws of grasping, with the Panda's hand, and of pushing."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pytest_simbench.laws.base import GRAVITY, Law, Reading, Watched, held, solved, stillness
from pytest_simbench.laws.contact import tilt
from pytest_simbench.laws.mechanisms import STRONG, Part, mechanism
from pytest_simbench.laws.sticking import SHARES, fan
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import (
    STANDARD_GRAVITY,
    Box,
    ConvexMesh,
    FloatArray,
    Pose,
    Robot,
    Scene,
    Trajectory,
    Vector3,
    Wrench,
)

HELD = 0.05
"""Edge of what is held [m]."""

GAP = 2e-4
"""Between it and each finger at the start [m]."""

SQUEEZE = 5.0
"""Of each finger [N]."""


def around(robot: Robot, gap: float = GAP) -> Robot:
    """The same robot, each finger `gap` [m] from what is held."""
    return robot.with_joints(*robot.gripper.joints, initial_position=HELD / 2 + gap)


def gravity_effort(robot: Robot, q: FloatArray, gravity: Vector3 = STANDARD_GRAVITY) -> FloatArray:
    """Efforts that hold the robot at rest at `q`, (n_joints,) [N m, N]."""
    zero = np.zeros((1, len(q)))
    return np.asarray(RobotModel(robot).inverse_dynamics(np.array(gravity), q[None], zero, zero)[0])


def hold_command(scene: Scene, timestep: float) -> Trajectory:
    """One command: everything at its start, gravity compensated."""
    robot = scene.arm
    start = robot.column("initial_position")
    return Trajectory.holding(timestep, start, gravity_effort(robot, start, scene.gravity))


def close_command(scene: Scene, timestep: float) -> Trajectory:
    """The same with the fingers closed."""
    robot, told = scene.arm, hold_command(scene, timestep)
    told.position[:, robot.finger_indices] = robot.gripper.closed
    told.effort[:, robot.finger_indices] = 0.0
    return told


class _Grip(Law, phenomenon="grasping"):
    """The Panda holds a cube between its fingers, whose friction is 1; what of it two fingers can
    carry, 2 mu F, is `1 / load` of its weight."""

    load: float
    aside: ClassVar[float] = 0.0
    held_for: ClassVar[float] = 0.3

    def build(self) -> Scene:
        """Gravity is turned by `aside` [rad] within the plane of the fingers."""
        robot = around(panda(squeeze=SQUEEZE))
        tool = RobotModel(robot).tool_pose(robot.column("initial_position"))
        x, _, z = tool.rotation().T
        a, b, c = (math.cos(self.aside) * z + math.sin(self.aside) * x) * GRAVITY
        mass = self.load * 2 * robot.friction * SQUEEZE / GRAVITY
        cube = Box("cube", (HELD,) * 3, tool, mass)
        return Scene(self.name, (cube,), robot, gravity=(float(a), float(b), float(c)))

    def commands(self) -> Trajectory:
        return close_command(self.build(), self.held_for)


@dataclass(frozen=True)
class GripHolds(_Grip, quantity="way in the hand in 0.35 s", unit="m", held_for=0.5):
    """A cube of 0.8 times what the fingers carry stays where it is in the hand, from 0.15 s on.
    Tolerance: an equilibrium, g dt^2."""

    load: float = 0.8

    def read(self, seen: Watched) -> Reading:
        model = RobotModel(self.build().arm)

        def in_hand(k: int) -> FloatArray:
            tool = model.tool_pose(seen.joints[k, 0, : model.arm])
            place = Pose.from_array(seen.bodies[k, 0, :7])
            return np.array((tool.inverse() * place).position)

        way = float(np.linalg.norm(in_hand(-1) - in_hand(int(np.argmax(seen.t > 0.15)))))
        return Reading(way, 0.0, stillness(seen.dt, 0.5))


@dataclass(frozen=True)
class GripSlips(_Grip, quantity="acceleration", unit="m/s^2"):
    """Two fingers that press with F carry 2 mu F and no more (Coulomb): a cube of 1.15 times that
    weight slips down with a = g - 2 mu F / m. Tolerance: its speed is late by one step at either
    end of the time T over which it is taken: 2 g dt / T."""

    load: float = 1.15

    def read(self, seen: Watched) -> Reading:
        along = seen.bodies[:, 0, 7:10] @ np.array(self.build().gravity) / GRAVITY
        used = (seen.t > 0.06) & (seen.t < 0.22)
        found = float(np.polyfit(seen.t[used], along[used], 1)[0])
        return seen.reading(found, GRAVITY * (1 - 1 / self.load), 2 * GRAVITY / 0.16, 1.0)


@dataclass(frozen=True)
class GripSlipsDiagonally(GripSlips, aside=math.pi / 4):
    """The same when the load pulls at 45 degrees, within the plane of the fingers: a friction
    pyramid holds up to sqrt(2) times as much there."""


BLOCK: Vector3 = (0.1, 0.1, 0.1)
BAR: Vector3 = (0.05, 0.3, 0.05)


@dataclass(frozen=True)
class _Push(Law, phenomenon="pushing", unit="m"):
    """A bar on a slide pushes a block over the ground."""

    friction: ClassVar[float] = 0.4
    speed: ClassVar[float] = 0.05
    stiffness: ClassVar[float] = 500.0

    seconds: float = 1.0

    def build(self) -> Scene:
        bar = Part(
            "bar", (1.0, 0.0, 0.0), mass=1.0, inertia=(0.01,) * 3, slides=True, shape=BAR,
            stiffness=self.stiffness, damping=2 * math.sqrt(2 * self.stiffness), effort=STRONG,
        )  # fmt: skip
        at = Pose.at(0.0, 0.0, BLOCK[2] / 2)
        robot = mechanism("pusher", bar, base=at, friction=self.friction)
        block = Box("block", BLOCK, at.translated((BAR[0] + BLOCK[0]) / 2), 1.0, self.friction)
        return Scene(self.name, (block,), robot, ground_friction=self.friction)

    def commands(self) -> Trajectory:
        return held(self.speed * self.seconds, self.seconds, self.speed)


@dataclass(frozen=True)
class PushForce(_Push, quantity="lag of the bar"):
    """The bar hangs on a spring that pulls it on: it lags behind by mu m g / k while it pushes a
    block steadily (Coulomb, Hooke). Tolerance: what gravity moves within one step, g dt^2, and the
    bar late by two steps, as of `Tracking`: 2 v dt."""

    def read(self, seen: Watched) -> Reading:
        lag = self.speed * seen.end - float(seen.joints[-1, 0, 0])
        exact = self.friction * GRAVITY / self.stiffness
        allowed = 2 * self.speed * seen.dt + stillness(seen.dt, 0.1)
        return Reading(lag, exact, allowed)


@dataclass(frozen=True)
class PushStraight(_Push, quantity="distance from its place at the bar"):
    """A block that is pushed in its middle stays at the bar: it neither runs ahead, nor turns, nor
    is it entered. Tolerance as of `PushForce`."""

    def read(self, seen: Watched) -> Reading:
        place = np.array([float(seen.joints[-1, 0, 0]) + (BAR[0] + BLOCK[0]) / 2, 0.0])
        off = float(np.linalg.norm(seen.bodies[-1, 0, :2] - place))
        allowed = 2 * self.speed * seen.dt + stillness(seen.dt, 0.1)
        return Reading(off, 0.0, allowed)


SIDE, HEIGHT = 0.2, 0.04
"""Of the prism: a side of its triangle, and how high it is [m]."""

INSIDE = SIDE / math.sqrt(12)
"""From the prism's axis to its sides [m]."""

MOMENT = SIDE**2 / 12
"""Of inertia of 1 kg of it about its axis [kg m^2]."""

FEET: FloatArray = np.array([[-INSIDE, -SIDE / 2], [-INSIDE, SIDE / 2], [2 * INSIDE, 0.0]])
"""The corners that the prism stands on, from its axis (3, 2) [m]."""


@dataclass(frozen=True)
class PushTurns(Law, phenomenon="pushing", quantity="angle turned", unit="rad"):
    """A block that slides is pushed beside its centre, and turns as its limit surface says.

    The friction that the ground can give a sliding body is a surface in the space of force and
    torque, at the point whose normal is the body's twist (Goyal, Ruina and Papadopoulos, Planar
    sliding with dry friction, Wear 143 (1991) 307). Of most bodies nobody knows how their weight is
    spread over the ground. This one is a prism that stands on three corners, so it is known: each
    is pulled with mu N against its velocity, and what pulls below the centre of mass shifts the
    weight. The push is `push` times the friction of a straight slide, along x, on a line that is
    `aside` of the centre. Newton's and Euler's equations are integrated by DOP853 with a relative
    tolerance of 1e-9. Tolerance: late by one step, w dt, and the rate is late by one step all the
    time T, T dt times the largest angular acceleration.
    """

    push: float = 1.2
    aside: float = 0.02
    speed: float = 0.3
    friction: float = 0.4
    seconds: float = 0.6

    @property
    def force(self) -> float:
        """Of the push on a prism of 1 kg [N]."""
        return self.push * self.friction * GRAVITY

    def build(self) -> Scene:
        vertices = [(x, y, z) for x, y in FEET.tolist() for z in (-HEIGHT / 2, HEIGHT / 2)]
        prism = ConvexMesh(
            "prism",
            tuple(vertices),
            Pose.at(0.0, 0.0, HEIGHT / 2),
            1.0,
            self.friction,
            linear_velocity=(self.speed, 0.0, 0.0),
            wrenches=(
                Wrench(force=(self.force, 0.0, 0.0), torque=(0.0, 0.0, -self.aside * self.force)),
            ),
        )
        return Scene(self.name, (prism,), ground_friction=self.friction)

    def acceleration(self, angle: float, twist: FloatArray) -> FloatArray:
        """Of the prism: linear along x and y, and angular, (3,) [m/s^2, rad/s^2].

        Args:
            angle: that it has turned [rad].
            twist: velocity along x and y, and rate of turning, (3,) [m/s, rad/s].
        """
        cos, sin = math.cos(angle), math.sin(angle)
        feet = FEET @ np.array([[cos, sin], [-sin, cos]])
        across = feet @ np.array([[0.0, 1.0], [-1.0, 0.0]])  # each turned by 90 degrees
        velocities = twist[:2] + twist[2] * across
        along = velocities / np.linalg.norm(velocities, axis=1, keepdims=True)
        tips = feet - self.friction * HEIGHT / 2 * along
        loads = np.linalg.solve(np.vstack([np.ones(3), tips.T]), [GRAVITY, 0.0, 0.0])
        pulls = -self.friction * loads[:, None] * along
        x, y = pulls.sum(axis=0)
        turning = (across * pulls).sum() - self.aside * self.force
        return np.array([x + self.force, y, turning / MOMENT])

    def exact(self, seconds: float) -> FloatArray:
        """Angle [rad], rate [rad/s] and angular acceleration [rad/s^2] over a time, (3, 100)."""

        def change(_: float, state: FloatArray) -> FloatArray:
            return np.concatenate([state[3:], self.acceleration(state[2], state[3:])])

        found = solved(change, [0.0, 0.0, 0.0, self.speed, 0.0, 0.0], seconds, 100, 1e-9)
        pulled = [self.acceleration(state[2], state[3:])[2] for state in found]
        return np.array([found[:, 2], found[:, 5], pulled])

    def read(self, seen: Watched) -> Reading:
        row, time = seen.bodies[-1, 0], seen.end
        angle, rate, pulled = self.exact(time)
        late = abs(rate[-1]) + float(np.abs(pulled).max()) * time
        return seen.reading(2 * math.atan2(row[6], row[3]), angle[-1], late, 1.0)


@dataclass(frozen=True)
class PushTips(Law, phenomenon="pushing", quantity="depth at which it tips", unit="m"):
    """A block that is pushed at the height h slides when its depth is more than 2 mu h / (1 + mu^2)
    and tips when it is less, all friction alike: the ground pulls with F = mu N, the bar holds its
    back down with mu F, and torques are taken about its front edge. Six depths, pushed by one bar.
    Turned by 0.05 rad it has tipped. Tolerance: half of the gap between the depths on either side;
    no step."""

    friction: float = 0.5
    height: float = 0.2
    seconds: float = 0.6

    @property
    def critical(self) -> float:
        """Depth [m]."""
        return 2 * self.friction * self.height / (1 + self.friction**2)

    def build(self) -> Scene:
        bar = Part(
            "bar", (1.0, 0.0, 0.0), mass=20.0, inertia=(5.0,) * 3, slides=True,
            shape=(0.05, 1.2, 0.004), stiffness=1e5, damping=4e3, effort=STRONG,
        )  # fmt: skip
        at = Pose.at(0.0, 0.0, self.height)
        robot = mechanism("ram", bar, base=at, friction=self.friction)
        blocks = []
        for k, share in enumerate(SHARES):
            depth = share * self.critical
            place = Pose.at(0.025 + depth / 2, 0.2 * (k - 2.5), 0.15)
            blocks.append(Box(f"block {k}", (depth, 0.1, 0.3), place, 0.5, self.friction))
        return Scene(self.name, tuple(blocks), robot, ground_friction=self.friction)

    def commands(self) -> Trajectory:
        return held(0.1 * self.seconds, self.seconds, 0.1)

    def read(self, seen: Watched) -> Reading:
        return fan(self.critical, [tilt(row) < 0.05 for row in seen.bodies[-1]])
