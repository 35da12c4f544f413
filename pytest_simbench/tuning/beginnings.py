"""How a scene begins where a log does: from places that are measured no better than later ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from pytest_simbench.description.urdf import PreparedRobot
from pytest_simbench.scene import Scene, Start
from pytest_simbench.tasks import Log
from pytest_simbench.tasks.base import distance
from pytest_simbench.tasks.on_scene import started

NEAR = 0.005
"""A body begins where the scene has it, if the log has it within this [m]; else where the log has
it, noise and all."""

UNIT = 0.01
"""Of the start of a joint [rad or m]."""


def begun(scene: Scene, log: Log) -> Scene:
    """The scene as it is where the log begins."""
    own, start = started(scene), log.start
    moved = [
        p for p in zip(start.bodies, start.poses, strict=True) if distance(own[p[0]], p[1]) > NEAR
    ]
    names, poses = zip(*moved, strict=True) if moved else ((), ())
    return replace(scene.at_start(Start(names, poses, start.positions)), starts=())


def starts(scene: Scene, log: Log) -> dict[str, Callable[[Scene, float], Scene]]:
    """Where joints begin is measured no better than the rest, so it is sought too, unless others
    move with them: what moves the start of a joint in a scene by so many `UNIT`, by name."""
    found: dict[str, Callable[[Scene, float], Scene]] = {}
    robot = scene.robot
    if robot is not None and not robot.closures:
        together = {name for c in robot.couplings for name in (c.follower, c.leader)}
        for name in log.joints:
            if name not in together:
                found[f"the start of {name}"] = partial(_moved, name)
    return found


def _moved(name: str, scene: Scene, amount: float) -> Scene:
    robot = scene.robot
    assert robot is not None  # it has that joint
    ends, k = PreparedRobot(robot).limits[name], robot.joint_names.index(name)
    joint = robot.joints[k]
    at = float(np.clip(joint.initial_position + UNIT * amount, *ends))
    moved = (*robot.joints[:k], replace(joint, initial_position=at), *robot.joints[k + 1 :])
    return replace(scene, robot=replace(robot, joints=moved))
