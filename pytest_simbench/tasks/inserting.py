"""A contact task: an arm picks up a peg and inserts it into a hole. Does it get in?

Geometry: a peg that is smaller than the hole gets in, a larger one never does. The arm looks once
at how the peg hangs in the hand, sets it upright over the hole, and aims beside its middle by less
than the gap, so nothing has to touch. What touches gives way, for the drives are soft (Whitney
1982: lateral compliance). When a leaning peg wedges or jams is asked without an arm, by
`laws.insertion`.

The chamfer is not aimed at: a spring in each joint yields outwards when the tool is pushed up, so
that a peg which is pressed on the far chamfer may well stay there.

Where an engine's own shapes differ from the scene's by a good part of the clearance, it is asked
another question. So a clearance is judged from `JUDGED` times what engine and facets add to it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, get_args

import numpy as np

from pytest_simbench.client.world import World
from pytest_simbench.description.robot_files import robot_cache
from pytest_simbench.motion.errors import PlanningError
from pytest_simbench.motion.grips import grips, hand_of
from pytest_simbench.motion.kinematics import inverse_kinematics, tool_over
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import panda
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import Body, Box, Cylinder, Pose, Robot, Scene
from pytest_simbench.scene.checks import check_choice
from pytest_simbench.scene.penetration import penetration
from pytest_simbench.tasks.arm import LostBody
from pytest_simbench.tasks.base import Count, Jitter, Moment, Outcome, Randomness, Task
from pytest_simbench.tasks.manipulator import APPROACH, Manipulator
from pytest_simbench.tasks.resting import RESTLESS, rest, told_forces

Section = Literal["square", "round"]

SIDES: Mapping[str, tuple[int, int]] = {"square": (4, 4), "round": (32, 8)}
"""Flat walls of the hole, and of its chamfer."""

WIDE, LONG, MASS = 0.04, 0.1, 0.1
"""Of the peg [m], [kg]."""

FRICTION = 0.3
"""Of everything: steel on steel, hardly oiled."""

PEG, HOLE = (0.45, -0.15), (0.45, 0.15)
"""Where they stand, x and y [m]."""

HIGH, THICK, CHAMFER = 0.04, 0.02, 0.004
"""Height and thickness of the walls, and width of their chamfer of 45 degrees [m]."""

ASIDE = 0.25
"""By which share of the clearance the arm aims beside the hole at most, in x and in y."""

ABOVE, STEP, SLOW = 0.005, 0.002, 0.3
"""From where the peg is lowered, above the chamfer, and about how far at a time [m]; at which share
of the joints' speed limits."""

JUDGED, NOT_JUDGED = 3.0, "not judged"

BLUE, STEEL = (0.3, 0.45, 0.75, 1.0), (0.7, 0.72, 0.75, 1.0)


@dataclass(frozen=True)
class Inserting(Task):
    """Insert a peg.

    Attributes:
        section: of the peg.
        clearance: width of the hole less that of the peg, of round ones of the diameters [m]; below
            0 the peg is larger.
        depth: how far the peg is told to go in, from the lower end of the chamfer [m].
        stiffness: with which the arm holds the tool level at the hole, mean of the two directions
            [N/m]; of drives that are springs.
        robot: that inserts, with two parallel fingers; None: the Panda.
    """

    name: ClassVar[str] = "inserting"
    counted: ClassVar[str] = "pegs inserted"
    moments: ClassVar[tuple[Moment, ...]] = (Moment("before the insertion", "insert"),)
    references: ClassVar[Mapping[str, float]] = {"inserted": 1.0, "overlap": 0.0}

    section: Section = "square"
    clearance: float = 1e-3
    depth: float = 0.025
    stiffness: float = 1000.0
    robot: Robot | None = None

    def __post_init__(self) -> None:
        check_choice(self.section, f"the section of {self.name}", get_args(Section))

    @property
    def metrics(self) -> tuple[Metric, ...]:
        return (
            Metric("inserted", "inserted", kind="yes_no",
                   doc="its end is in the hole by 0.8 of the depth that was told, or more"),
            Metric("depth", "depth", unit="mm", better=None,
                   doc="of the middle of its end in the hole, where it is over that"),
            Metric("overlap", "overlap", unit="mm", better="lower", least=0, resolution=0.01,
                   doc="of peg and hole at the end, the deepest"),
            Metric("force", "peak force", unit="N", better=None, least=0,
                   doc=f"of the hole on the peg, looked at each {1000 * STEP:g} mm"),
        )  # fmt: skip

    @property
    def arm(self) -> Robot:
        """The robot, its drives softened and its surface as slippery as the peg's.

        Raises:
            PlanningError: it does not reach the hole.
        """
        return replace(softened(self.robot or panda(), self.stiffness), friction=FRICTION)

    @property
    def facets(self) -> float:
        """By how much the corners of the hole are farther from its axis than its walls, of a round
        one [m]."""
        hole = (WIDE + self.clearance) / 2
        return hole / math.cos(math.pi / SIDES["round"][0]) - hole if self.section == "round" else 0

    def smoke(self) -> Inserting:
        return replace(self, depth=0.01)

    def problem(self) -> str | None:
        """The hand cannot hold the peg, or the arm cannot reach peg or hole, or its fingers would
        hit the hole."""
        robot, rng = self.robot or panda(), np.random.default_rng(0)
        model = RobotModel(robot)
        try:
            grip = grips(robot, self.peg(Pose()))[0]
            for x, y in (PEG, HOLE):
                above = Pose.at(x, y, grip.tool.position[2] + APPROACH)
                inverse_kinematics(model, tool_over(above, grip.tool.yaw), model.home, rng)
            softened(robot, self.stiffness)
        except PlanningError as error:
            return f"robot {robot.name!r} cannot insert the {self.section} peg: {error}"
        room = grip.tool.position[2] - hand_of(robot, 1.0).tips - CHAMFER
        if room < self.depth:
            return (
                f"robot {robot.name!r} holds the peg {1000 * room:.0f} mm above its end, so its "
                f"fingers hit the hole before that is {1000 * self.depth:.0f} mm deep"
            )
        return None

    def peg(self, disturbed: Pose) -> Body:
        """As it stands at its place, moved by a disturbance."""
        at = Pose.at(*PEG, LONG / 2) * disturbed
        if self.section == "square":
            return Box("peg", (WIDE, WIDE, LONG), at, MASS, FRICTION, BLUE)
        return Cylinder("peg", WIDE / 2, LONG, at, MASS, FRICTION, BLUE)

    def hole(self) -> Iterator[Box]:
        """Its walls, whose inner faces touch the circle in it, and the chamfers on them."""
        middle, inside = Pose.at(*HOLE, 0.0), (WIDE + self.clearance) / 2
        walls, chamfers = SIDES[self.section]
        for k in range(walls):
            turned = middle * Pose.at(0.0, 0.0, 0.0, yaw=2 * math.pi * k / walls)
            size = (THICK, 2 * inside * math.tan(math.pi / walls), HIGH)
            at = turned * Pose.at(inside + THICK / 2, 0.0, HIGH / 2)
            yield Box(f"wall_{k + 1:02}", size, at, 0.0, FRICTION, STEEL)
        leaning = Pose(quaternion=(math.cos(math.pi / 8), 0.0, -math.sin(math.pi / 8), 0.0))
        for k in range(chamfers):
            turned = middle * Pose.at(0.0, 0.0, 0.0, yaw=2 * math.pi * k / chamfers)
            wide = 2 * (inside + CHAMFER) * math.tan(math.pi / chamfers)
            face = Pose.at(inside + CHAMFER / 2, 0.0, HIGH + CHAMFER / 2) * leaning
            at = turned * face * Pose.at(0.0, 0.0, -THICK / 4)
            size = (math.sqrt(2) * CHAMFER, wide, THICK / 2)
            yield Box(f"chamfer_{k + 1}", size, at, 0.0, FRICTION, STEEL)

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        peg = self.peg(jitter.disturbed(Pose(), Randomness.of(seed).start))
        return Scene("inserting", (peg, *self.hole()), self.arm, ground_friction=FRICTION)

    def added(self, world: World) -> float:
        """What the engine's shapes and the facets add to the clearance, or take from it [m]."""
        walls = [body.name for body in self.hole() if body.name.startswith("wall")]
        return 2 * (world.misfit("peg") + world.misfit(*walls) + self.facets)

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        added = self.added(world)
        if abs(self.clearance) < JUDGED * added:
            count(0, 1)
            return Outcome(
                dict.fromkeys([metric.name for metric in self.metrics]),
                reasons=(
                    f"{NOT_JUDGED}: of a clearance of {1000 * self.clearance:g} mm the engine's "
                    f"shapes and the facets of the hole make {1000 * added:.2g} mm",
                ),
            )
        aside = ASIDE * abs(self.clearance) * Randomness.of(seed).order.uniform(-1.0, 1.0, 2)
        hand = Manipulator(world, Randomness.of(seed).planner)
        reasons: list[str] = []
        forces: list[float] = []
        there = False
        world.mark("start")
        try:
            with world.phase("pick"):
                hand.pick("peg")
            with world.phase("bring"):
                x, y = np.add(HOLE, aside).tolist()
                aim = Pose.at(x, y, HIGH + CHAMFER + ABOVE + LONG / 2)
                hand.bring(aim)
                seen = world.pose("peg")
                quarter = round(2 * seen.yaw / math.pi) * math.pi / 2
                turn = Pose.at(0.0, 0.0, 0.0, yaw=quarter if self.section == "square" else seen.yaw)
                hand.move_straight(aim * turn * seen.inverse() * hand.tool, speed=SLOW)
            with world.phase("insert"):
                there = True
                self.lower(hand, forces)
            rest(world, 2 * RESTLESS, "hold")
            hand.check_held()
        except (PlanningError, LostBody) as error:
            reasons.append(str(error))
        world.mark("end")
        pose = world.pose("peg")
        *beside, depth = np.subtract((*HOLE, HIGH), (pose * Pose.at(0.0, 0.0, -LONG / 2)).position)
        inserted = not reasons and depth > 0.8 * self.depth
        count(int(inserted), 1)
        names = [metric.name for metric in self.metrics]
        if not (there or self.references["inserted"]):  # who does not press keeps nothing out
            return Outcome(dict.fromkeys(names), reasons=tuple(reasons))
        peg = self.peg(Pose()).moved_to(pose)
        found: dict[str, float | None] = {
            "inserted": float(inserted),
            "depth": 1000 * float(depth) if np.hypot(*beside) < WIDE / 2 else None,
            "overlap": 1000 * max(0.0, *(penetration(peg, body) for body in self.hole())),
            "force": max(forces, default=None),
        }
        return Outcome(
            {name: found[name] for name in names},
            {"aside": aside.tolist(), "forces": forces, "added": added},
            reasons=tuple(reasons),
        )

    def lower(self, hand: Manipulator, forces: list[float]) -> None:
        """Straight down, step by step, and the force of the hole on the peg after each [N]; none
        where the simulator does not tell forces of this scene."""
        names = tuple(body.name for body in self.hole())
        whole = ABOVE + CHAMFER + self.depth
        steps = round(whole / STEP)
        for _ in range(steps):
            hand.move_straight(hand.tool.translated(z=-whole / steps), speed=SLOW, ignored=names)
            found = told_forces(hand.world)
            if found is None:
                continue
            each = [found[pair][:3] for n in names if (pair := ("body/peg", f"body/{n}")) in found]
            forces.append(float(np.linalg.norm(np.sum(each, axis=0))))


@dataclass(frozen=True)
class Oversized(Inserting):
    """Press a peg that is larger than the hole: it never enters. A task of its own: who inserts is
    right there, and wrong here."""

    name: ClassVar[str] = "oversized"
    references: ClassVar[Mapping[str, float]] = {"inserted": 0.0, "overlap": 0.0}

    clearance: float = -1e-3

    @property
    def metrics(self) -> tuple[Metric, ...]:
        inserted, *others = super().metrics
        return (replace(inserted, better="lower"), *others)


@robot_cache
def softened(robot: Robot, stiffness: float) -> Robot:
    """The same robot, all drives of its arm softer by one factor, so that the tool, pointing down
    on the hole, is held level with a stiffness [N/m], the mean of both directions.

    Raises:
        PlanningError: it does not reach the hole.
    """
    model = RobotModel(robot)
    tool = tool_over(Pose.at(*HOLE, HIGH + LONG / 2), 0.0)
    arm = inverse_kinematics(model, tool, model.home, np.random.default_rng(0))
    level = model.tool_jacobian(arm)[:2]
    yielding = level**2 @ (1 / robot.column("stiffness")[: model.arm])
    share = round(stiffness * float(yielding.mean()), 9)  # the same on every processor
    names = (joint.name for joint in robot.arm_joints)
    return robot.scaled(*names, stiffness=share, damping=share)
