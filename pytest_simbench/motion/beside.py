"""A jointed thing beside an arm: a drawer, a door, a lever.

A scene has one tree of links on joints, and so have all engines here. The thing is part of the
arm's tree: both are fixed in the world, so neither feels that. All that can be asked of a robot can
be asked of it: parity, state, drives, friction of joints, pictures.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

from pytest_simbench.description.links import joined
from pytest_simbench.description.urdf import PreparedRobot
from pytest_simbench.description.urdf_check import Description
from pytest_simbench.motion.adapting import mounted
from pytest_simbench.scene import Robot, Scene
from pytest_simbench.simulator import DescriptionError

STAND = "stand_of_the_thing_beside"
"""Name of the joint that fixes it."""


def with_thing(scene: Scene, thing: Robot) -> Scene:
    """The same scene, a jointed thing beside its robot.

    Links of the robot and of the thing collide. Those of the robot pass through each other as they
    did before, and so do those of the thing: `Scene.apart` has the pairs. Links that hang on the
    world itself pass through the robot's foot. All have the robot's friction.

    Args:
        scene: one with a robot.
        thing: where it stands (`base`), and the drives of its joints: free ones, or motors.

    Raises:
        DescriptionError: a name that both have, or what the arm would pass through.
    """
    arm = scene.robot
    if arm is None:
        raise DescriptionError(f"scene {scene.name!r} has no robot to put {thing.name!r} beside")
    prepared = PreparedRobot(thing)
    if prepared.links[prepared.root].shapes:
        raise DescriptionError(
            f"{thing.urdf}: the arm would pass through what is fixed of {thing.name!r}; leave its "
            "shapes out, and give them to the scene as fixed bodies"
        )
    mount, root = (Description(robot.urdf, robot.packages).root for robot in (arm, thing))
    both = replace(
        mounted(arm, thing, root, mount, arm.base.inverse() * thing.base, STAND),
        name=f"{arm.name}_and_{thing.name}",
        joints=(*arm.joints, *thing.joints),
        closures=(*arm.closures, *thing.closures),
        couplings=(*arm.couplings, *thing.couplings),
        self_collide=True,
        beside=(*arm.beside, *thing.joint_names),
    )
    through = (*_through(arm), *_through(thing))
    return replace(scene, robot=both, apart=(*scene.apart, *through))


def _through(robot: Robot) -> list[tuple[str, str]]:
    """Pairs of its links that pass through each other, but for those that one joint joins."""
    prepared = PreparedRobot(robot)
    if robot.self_collide:
        return []
    names = [link.name for link in prepared.links.values() if link.shapes]
    pairs = [pair for pair in combinations(names, 2) if frozenset(pair) not in joined(prepared)]
    return [(f"link/{first}", f"link/{second}") for first, second in pairs]
