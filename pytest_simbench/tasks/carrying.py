"""A contact task: a thing of any shape is picked up, carried, shaken and held still. Does it slip?

Two pads that press with N each hold up to 2 mu N along themselves (Coulomb). So what weighs less,
the accelerations of the shaking included, stays where it was grasped; what weighs more slips out.
The load is a share of that bound, whatever the shape.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, get_args

import numpy as np

from pytest_simbench.client.motion import Motion
from pytest_simbench.client.world import World
from pytest_simbench.motion.collision import PlanningScene
from pytest_simbench.motion.errors import PlanningError
from pytest_simbench.motion.grasping import choose
from pytest_simbench.motion.grips import grips
from pytest_simbench.motion.kinematics import tool_path
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import panda
from pytest_simbench.motion.timing import TICK, Timed
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import (
    STANDARD_GRAVITY,
    Body,
    Box,
    Capsule,
    ConvexMesh,
    Cylinder,
    Pose,
    Robot,
    Scene,
    Sphere,
    Trajectory,
    principal,
)
from pytest_simbench.scene.checks import check_choice, check_number
from pytest_simbench.tasks.arm import LostBody
from pytest_simbench.tasks.base import Count, Jitter, Moment, Outcome, Randomness, Task, distance
from pytest_simbench.tasks.manipulator import APPROACH, Manipulator
from pytest_simbench.tasks.resting import FORCE_JITTER, RESTLESS, SHORTEST, calm, rates, spread

Shape = Literal["cube", "ball", "tube", "pill", "prism"]

FRICTION = 0.5
"""Of everything: rubber pads on wood or metal have 0.4 to 0.7."""

PLACE = (0.45, -0.15)
"""Where it stands, x and y [m]."""

WAY = 0.3
"""Sideways, and back [m]."""

SHAKES, FREQUENCY, ACCELERATION = 4, 2.0, 2.5
"""Swings up and back, how many in a second [1/s], and their largest acceleration [m/s^2]."""

PURPLE = (0.55, 0.35, 0.75, 1.0)


HELD = Metric("held", "held", kind="yes_no", doc="it is still in the hand at the end")


@dataclass(frozen=True)
class Carrying(Task):
    """Carry a thing.

    Attributes:
        shape: of the thing. All are 5 cm wide between the fingers and lie or stand as they rest.
        load: its largest weight on the way, over what two pads hold, 2 mu N; below 1.
        still: how long it is held still at the end [s].
        robot: that carries, with two parallel fingers; None: the Panda.
    """

    name: ClassVar[str] = "carrying"
    counted: ClassVar[str] = "things held"
    moments: ClassVar[tuple[Moment, ...]] = (Moment("before the way", "carry"),)

    shape: Shape = "cube"
    load: float = 0.8
    still: float = 10.0
    robot: Robot | None = None

    def __post_init__(self) -> None:
        check_choice(self.shape, f"the shape of {self.name}", get_args(Shape))
        check_number(self.still, f"the still time [s] of {self.name}", SHORTEST)

    @property
    def arm(self) -> Robot:
        """The robot that carries, its surface as slippery as the thing's."""
        return replace(self.robot or panda(), friction=FRICTION)

    @property
    def metrics(self) -> tuple[Metric, ...]:
        turn = Metric(
            "turn", "turn", unit="deg", better="lower", least=0,
            doc="by which it turned in the hand from the grasp to the end of the shaking",
        )  # fmt: skip
        return (
            HELD,
            Metric("slip", "slip", unit="mm", better="lower", least=0,
                   doc="how far it moved in the hand from the grasp to the end of the shaking"),
            # a ball turns freely about the line between its two points of contact
            *((turn,) if self.shape != "ball" else ()),
            Metric("creep", "creep", unit="mm/min", better="lower", least=0, resolution=0.1,
                   doc=f"how fast it moves in the hand while that is still, over {self.still:g} s"),
            Metric("restless", "restless", unit="mm/s", better="lower", least=0, resolution=0.1,
                   doc=f"root mean square speed in the hand in the last {RESTLESS:g} s"),
            FORCE_JITTER,
        )  # fmt: skip

    @property
    def references(self) -> Mapping[str, float]:  # type: ignore[override]
        """Of Coulomb friction."""
        return {**dict.fromkeys([metric.name for metric in self.metrics], 0.0), "held": 1.0}

    @property
    def mass(self) -> float:
        """[kg]"""
        most = 2 * FRICTION * self.arm.gripper.squeeze
        return self.load * most / (-STANDARD_GRAVITY[2] + ACCELERATION)

    def smoke(self) -> Carrying:
        return replace(self, still=SHORTEST)

    def problem(self) -> str | None:
        """The hand cannot hold the thing, or cannot come down to it or carry it aside."""
        model = RobotModel(self.arm)
        robot, rng = model.robot, np.random.default_rng(0)
        if not model.has_parallel_fingers:
            return f"robot {robot.name!r} has no two parallel fingers, so no squeeze [N] is known"
        try:
            tools = [grip.tool for grip in grips(robot, self.thing(Pose()))]
            planning = PlanningScene(model, Scene(self.name, (), robot))
            choose(planning, tools, APPROACH, model.home, model.home, rng, way=(0.0, WAY, 0.0))
        except PlanningError as error:
            return f"robot {robot.name!r} cannot carry the {self.shape}: {error}"
        return None

    def thing(self, disturbed: Pose) -> Body:
        """As it lies at its place, moved by a disturbance."""
        lying, half = Pose(quaternion=(math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)), 0.025
        at = Pose.at(*PLACE, half) * disturbed
        corner = half / math.cos(math.pi / 6)
        ring = [(corner * math.cos(k), corner * math.sin(k)) for k in np.arange(6) * math.pi / 3]
        corners, frame = principal([(x, y, z) for z in (-half, half) for x, y in ring])
        shapes: dict[Shape, Body] = {
            "cube": Box("thing", (2 * half,) * 3, at),
            "ball": Sphere("thing", half, at),
            "tube": Cylinder("thing", half, 0.08, at * lying),
            "pill": Capsule("thing", half, 0.05, at * lying),
            "prism": ConvexMesh("thing", corners, at * frame),
        }
        return shapes[self.shape].changed(mass=self.mass, friction=FRICTION, colour=PURPLE)

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        disturbed = jitter.disturbed(Pose(), Randomness.of(seed).start)
        return Scene("carrying", (self.thing(disturbed),), self.arm, ground_friction=FRICTION)

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        hand = Manipulator(world, Randomness.of(seed).planner)
        looks: list[Pose] = []
        failure: PlanningError | LostBody | None = None
        world.mark("start")
        try:
            with world.phase("pick"):
                hand.pick("thing", way=(0.0, WAY, 0.0))
            looks.append(_in_hand(world, hand.model))
            with world.phase("carry"):
                for way in (WAY, -WAY):
                    hand.move_straight(hand.tool.translated(y=way), speed=hand.speeds.carry)
            with world.phase("shake"):
                hand.follow(self.shaking(hand))
            looks.append(_in_hand(world, hand.model))
            began = world.time
            seen, forces = calm(world, self.still, "hold")
            looks.append(_in_hand(world, hand.model))
            hand.check_held()
        except (PlanningError, LostBody) as error:
            failure = error
        world.mark("end")
        count(int(failure is None), 1)
        if failure is not None:  # who does not get there lets nothing slip
            judged = self.references["held"] or isinstance(failure, LostBody)
            return Outcome({"held": 0.0} if judged else {}, reasons=(str(failure),))
        grasped, shaken, end = looks
        found: dict[str, float | None] = {
            "held": 1.0,
            "slip": 1000 * distance(grasped, shaken),
            "turn": math.degrees(_turn(grasped, shaken)),
            "creep": 1000 * distance(shaken, end) * 60.0 / (world.time - began),
            "restless": _speed(seen, hand.model),
            "force_jitter": spread(world.scene, forces),
        }
        return Outcome(
            {metric.name: found[metric.name] for metric in self.metrics},
            {"in_hand": [look.as_array().tolist() for look in looks]},
        )

    def shaking(self, hand: Manipulator) -> Trajectory:
        """Up and back with h (1 - cos) / 2, whose largest acceleration is `ACCELERATION`."""
        pulse = 2 * math.pi * FREQUENCY
        time = np.arange(0.0, SHAKES / FREQUENCY + TICK / 2, TICK)
        heights = ACCELERATION / pulse**2 * (1 - np.cos(pulse * time))
        rises = [hand.tool.translated(z=float(height)) for height in heights[1:]]
        with hand.world.stopwatch.measuring("plan"):
            path = tool_path(hand.model, hand.arm, rises)
            velocity = np.gradient(path, TICK, axis=0)
            timed = Timed(path, velocity, np.gradient(velocity, TICK, axis=0))
            return hand.planner.set_points(timed, np.full(len(path), hand.fingers))


@dataclass(frozen=True)
class Slipping(Carrying):
    """Carry what is too heavy: it slips out. A task of its own: who holds is right there, and wrong
    here."""

    name: ClassVar[str] = "slipping"
    references: ClassVar[Mapping[str, float]] = {"held": 0.0}

    load: float = 1.25

    @property
    def metrics(self) -> tuple[Metric, ...]:
        return (replace(HELD, better="lower"),)


def _in_hand(world: World, model: RobotModel) -> Pose:
    """The thing's pose at the tool centre point, as the joints are."""
    return model.tool_pose(world.joints[0, : model.arm]).inverse() * world.pose("thing")


def _turn(a: Pose, b: Pose) -> float:
    """Angle between two attitudes [rad]."""
    return 2 * math.acos(min(1.0, abs((a.inverse() * b).quaternion[0])))


def _speed(seen: Motion, model: RobotModel) -> float:
    """Root mean square speed of the thing in the hand [mm/s]."""
    tools = [model.tool_pose(joints[0, : model.arm]) for joints in seen.joints]
    things = [Pose.from_array(bodies[0, :7]) for bodies in seen.bodies]
    at = np.array([(a.inverse() * b).position for a, b in zip(tools, things, strict=True)])
    return 1000 * float(np.linalg.norm(rates(seen.time, at)))
