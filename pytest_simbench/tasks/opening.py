"""A contact task: the arm opens a drawer by its handle. What does that take? Where does it stay?

The drawer slides on a joint with dry friction F (Coulomb). So what pulls with less than F moves it
nowhere, and what pulls with more gives it (pull - F) / m: it is pushed with 0.9 F and with 1.1 F by
a motor in its joint, before the arm comes. Then the arm pulls it slowly over a known way. The pull
is F all along, and its work F times the way, which friction takes: the drawer is at rest before and
after. The work is that of the contact forces between hand and handle over the drawer's way.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from pytest_simbench.client.world import World
from pytest_simbench.description.links import link_poses
from pytest_simbench.description.robot_files import keep
from pytest_simbench.description.urdf import (
    Link,
    MovingJoint,
    PreparedRobot,
    Shape,
    write_joint,
    write_link,
)
from pytest_simbench.motion.beside import with_thing
from pytest_simbench.motion.errors import PlanningError
from pytest_simbench.motion.grips import grips
from pytest_simbench.motion.kinematics import inverse_kinematics
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import panda
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import Box, FloatArray, Gripper, Joint, Pose, Robot, Scene, Trajectory
from pytest_simbench.scene.checks import check_number
from pytest_simbench.scene.robot import FASTEST, FREE
from pytest_simbench.tasks.base import Count, Jitter, Moment, Outcome, Randomness, Task
from pytest_simbench.tasks.manipulator import APPROACH, Manipulator
from pytest_simbench.tasks.resting import told_forces

PLACE = (0.55, 0.0, 0.25)
"""Of the handle's middle, the drawer shut [m]. It opens towards the robot, along minus x."""

BAR = (0.05, 0.12, 0.02)
"""Edges of the handle, level [m]. As wide as the study's cubes: around these the fingers press
with their whole squeeze. Their drives are springs, and press less around what is thinner."""

POSTS = ((0.065, 0.015, 0.015), 0.0525)
"""That hold it: their edges, and how far aside they are [m]. Open fingers fit between it and the
drawer."""

BOX, BEHIND, BELOW = (0.3, 0.3, 0.14), 0.09, 0.01
"""Edges of the drawer, how far behind the handle's middle its front is, and how far above that its
top [m]: the palm stands higher."""

RANGE = (-0.05, 0.4)
"""How far it goes [m]: its stops are far from where it is moved."""

DRAWER, SLIDE = "drawer", "slide"
"""Link and joint."""

LESS, LONG, MORE, SHORT = 0.9, 0.5, 1.1, 0.1
"""Shares of the friction with which its motor pushes, each followed by for how long [s]."""

STOPPED = 0.3
"""Time for it to stop after a push, or a pull [s]."""

EVERY = 0.02
"""Between two looks at the contact forces [s]."""

SMOOTHED = 5
"""So many looks make one for the largest pull, as a wrist sensor's filter does: 0.1 s."""

WITHIN = 0.005
"""It is open when its way is as long as asked within this [m]."""


def drawer(friction: float, mass: float, at: Pose) -> Robot:
    """A drawer that stands alone, its handle's middle there.

    Args:
        friction: of its joint [N].
        mass: [kg].
    """
    x, y, z = BOX
    centre = (BEHIND + x / 2, 0.0, BELOW - z / 2)
    inertia = np.diag([y * y + z * z, x * x + z * z, x * x + y * y]) * mass / 12
    post, aside = POSTS
    posts = [Shape(Pose.at(BAR[0] / 2 + post[0] / 2, side, 0.0), post) for side in (aside, -aside)]
    shapes = [Shape(Pose(), BAR), *posts, Shape(Pose(centre), BOX)]
    root = ET.Element("robot", name=DRAWER)
    ET.SubElement(root, "link", name="rails")
    write_link(root, Link(DRAWER, mass, np.array(centre), inertia, shapes), visuals=False)
    joint = MovingJoint(SLIDE, "prismatic", "rails", DRAWER, Pose(), (-1.0, 0.0, 0.0))
    write_joint(root, joint, RANGE, 2 * friction, FASTEST)
    motor = Joint(SLIDE, FREE, 0.0, 2 * friction, 0.0, 0.0, friction=friction)
    return Robot(
        DRAWER, str(keep(root)), {}, "", (motor,),
        Gripper((), 0.0, 0.0, 0.0), DRAWER, at,
    )  # fmt: skip


@dataclass(frozen=True)
class Opening(Task):
    """Open a drawer.

    Attributes:
        friction: of its joint [N]; below twice what each finger presses with.
        mass: [kg].
        way: by which it is pulled [m].
        speed: of the hand on this way, on average [m/s].
        rest: how long it is looked at once it was let go [s].
        robot: that opens, with two parallel fingers; None: the Panda.
    """

    name: ClassVar[str] = "opening"
    counted: ClassVar[str] = "drawers opened"
    moments: ClassVar[tuple[Moment, ...]] = (Moment("before the pull", "pull"),)

    friction: float = 10.0
    mass: float = 2.0
    way: float = 0.15
    speed: float = 0.05
    rest: float = 2.0
    robot: Robot | None = None

    def __post_init__(self) -> None:
        for name in ("friction", "mass", "way", "speed"):
            check_number(getattr(self, name), f"the {name} of {self.name}", 0.0, above=True)

    @property
    def metrics(self) -> tuple[Metric, ...]:
        return (
            Metric("opened", "opened", kind="yes_no",
                   doc=f"its way is {self.way:g} m within {1000 * WITHIN:g} mm"),
            Metric("slip", "slip", unit="mm", better="lower", least=0,
                   doc="difference of the hand's way and the drawer's"),
            Metric("work", "work", better=None, resolution=0.001,
                   doc="of hand on handle, over friction times the drawer's way"),
            Metric("peak", "peak", better=None, resolution=0.001,
                   doc="largest pull, also to speed it up, over friction; means of 0.1 s"),
            Metric("creep", "creep", unit="mm", better="lower", least=0, resolution=0.1,
                   doc=f"how far it moves while it is let go and in {self.rest:g} s after"),
            Metric("held_back", "moved by 0.9", unit="mm", better="lower", least=0, resolution=0.1,
                   doc=f"how far {LESS:g} of its friction moves it in {LONG:g} s"),
            Metric("pushed", "moved by 1.1", unit="mm", better=None, least=0, resolution=0.1,
                   doc=f"how far {MORE:g} of its friction moves it in {SHORT:g} s"),
        )  # fmt: skip

    @property
    def references(self) -> Mapping[str, float]:  # type: ignore[override]
        """Of Coulomb friction."""
        pushed = 1000 * (MORE - 1) * self.friction / self.mass * SHORT**2 / 2
        still = dict.fromkeys(("slip", "creep", "held_back"), 0.0)
        return {"opened": 1.0, "work": 1.0, **still, "pushed": pushed}

    def smoke(self) -> Opening:
        return replace(self, way=min(self.way, 0.05), rest=min(self.rest, 0.5))

    def problem(self) -> str | None:
        """The hand cannot hold the handle, or cannot reach it shut and open."""
        model = RobotModel(self.robot or panda())
        robot, rng = model.robot, np.random.default_rng(0)
        if not model.has_parallel_fingers:
            return f"robot {robot.name!r} has no two parallel fingers to hold the handle with"
        if self.friction >= 2 * robot.gripper.squeeze:
            return (
                f"the fingers of robot {robot.name!r} press with {robot.gripper.squeeze:g} N each, "
                f"and a pull of {self.friction:g} N opens them"
            )
        try:
            for x in (0.0, -self.way):
                tool = grips(robot, _handle(Pose.at(*PLACE).translated(x)))[0].tool
                for z in (0.0, APPROACH):
                    inverse_kinematics(model, tool.translated(z=z), model.home, rng)
        except PlanningError as error:
            return f"robot {robot.name!r} cannot open the drawer: {error}"
        return None

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        at = jitter.disturbed(Pose.at(*PLACE), Randomness.of(seed).start)
        thing = drawer(self.friction, self.mass, at)
        return with_thing(Scene(self.name, (), self.robot or panda()), thing)

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        found: dict[str, float | None] = {"opened": 0.0}
        with world.phase("push"):
            found["held_back"] = 1000 * abs(self._push(world, LESS, LONG))
            found["pushed"] = 1000 * self._push(world, MORE, SHORT)
        hand = Manipulator(world, Randomness.of(seed).planner)
        world.mark("start")
        pulls: list[float] = []
        reasons: tuple[str, ...] = ()
        try:
            found |= self._open(world, hand, pulls)
        except PlanningError as error:
            reasons = (str(error),)
        world.mark("end")
        count(int(found["opened"] or 0.0), 1)
        kept = [pull for pull in pulls if np.isfinite(pull)]
        return Outcome(found, {"pulls": kept}, reasons=reasons)

    def _push(self, world: World, share: float, seconds: float) -> float:
        """Way of the drawer while its motor pushes with a share of the friction [m]."""
        start, before = world.joints[0], _out(world)
        effort = np.zeros(len(start))
        effort[-1] = share * self.friction
        world.follow(Trajectory.holding(seconds, start, effort))
        way = _out(world) - before
        world.follow(Trajectory.holding(STOPPED, start))
        return way

    def _open(self, world: World, hand: Manipulator, pulls: list[float]) -> dict[str, float | None]:
        """Grasp, pull and let go; what was measured. `pulls` takes the pulls on the way [N]."""
        with world.phase("grasp"):
            at = _place(world)
            hand.reach_for(_handle(at), (DRAWER,))
            hand.close_hand()
        shut, from_here = _out(world), _tool(world, hand)
        outward = at.rotation() @ [-1.0, 0.0, 0.0]
        steps = np.linspace(0.0, self.way, 2 + int(self.way / 0.01))[1:]
        poses = [hand.tool.translated(*(outward * step).tolist()) for step in steps]
        with world.stopwatch.measuring("plan"):
            whole = hand.planner.move_along(
                hand.arm, poses, hand.fingers, tool_speed=self.speed, ignored=(DRAWER,)
            )
        ways = [shut]
        pulls.append(_pull(world, outward))
        with world.phase("pull"):
            for part in _parts(whole):
                hand.follow(part)
                pulls.append(_pull(world, outward))
                ways.append(_out(world))
            world.wait(STOPPED)
        opened = _out(world)
        reached = float(outward @ (_tool(world, hand) - from_here))
        with world.phase("let go"):
            hand.open_hand()
            up = hand.tool.translated(z=hand.approach)
            hand.move_straight(up, speed=hand.speeds.contact, ignored=(DRAWER,))
            world.wait(self.rest)
        way, told = opened - shut, bool(np.isfinite(pulls).all())
        work = float(np.trapezoid(pulls, ways))
        smooth = np.convolve(pulls, np.full(SMOOTHED, 1 / SMOOTHED), "valid")
        return {
            "opened": float(abs(way - self.way) < WITHIN),
            "slip": 1000 * abs(reached - way),
            "work": work / (self.friction * way) if told and way > WITHIN else None,
            "peak": float(smooth.max()) / self.friction if told else None,
            "creep": 1000 * abs(_out(world) - opened),
        }


def _handle(at: Pose) -> Box:
    return Box("handle", BAR, at)


def _out(world: World) -> float:
    """How far the drawer is out [m]."""
    return float(world.joints[0, -1])


def _place(world: World) -> Pose:
    """Of the handle's middle: the drawer's frame."""
    return link_poses(PreparedRobot(world.scene.arm), world.joints[0])[DRAWER]


def _tool(world: World, hand: Manipulator) -> FloatArray:
    """Where the hand is, as the joints are [m]."""
    return np.array(hand.model.tool_pose(world.joints[0]).position)


def _pull(world: World, outward: FloatArray) -> float:
    """What the robot's other links do to the drawer along its way [N]; no number in an engine that
    does not tell."""
    forces = told_forces(world)
    if forces is None:
        return float("nan")
    of_links = (forces[pair][:3] for pair in forces if pair[0] == f"link/{DRAWER}")
    return float(sum(outward @ force for force in of_links))


def _parts(whole: Trajectory) -> Iterator[Trajectory]:
    """Of `EVERY` each, one beginning where the one before ends."""
    rows = round(EVERY / whole.tick)
    for first in range(0, len(whole.position) - 1, rows):
        part = slice(first, first + rows + 1)
        yield Trajectory(whole.tick, whole.position[part], whole.velocity[part], whole.effort[part])
