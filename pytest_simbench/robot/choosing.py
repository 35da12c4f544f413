"""Which of several equivalent poses of the tool an arm takes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pytest_simbench.robot.collision import PlanningScene
from pytest_simbench.robot.errors import PlanningError, Unreachable
from pytest_simbench.robot.kinematics import inverse_kinematics
from pytest_simbench.scene import FloatArray, Pose

RESTARTS, FURTHER_RESTARTS = 10, 40
"""Of the search for joint positions: for those nearest to home, and for others where these touch
something. An arm of six joints has up to eight for a pose, the UR5 many more by whole turns."""


class Choice(NamedTuple):
    """A pose of the tool, and the arm joints above it, (arm,) [rad]."""

    tool: Pose
    above: FloatArray


def choose(
    scene: PlanningScene,
    tools: Sequence[Pose],
    approach: float,
    home: FloatArray,
    arm: FloatArray,
    rng: np.random.Generator,
    ignored: Sequence[str] = (),
) -> Choice:
    """The pose that is free and needs the least joint travel.

    The arm takes the joint positions nearest to home. Where those touch something for all poses, it
    looks for others.

    Args:
        tools: equivalent poses of the tool in the world.
        approach: how far above the pose must be free, too, with the planning scene's margin [m].
        home: arm joints where the search starts, (arm,) [rad].
        arm: present arm joints, (arm,) [rad].
        rng: draws further starts of the search.
        ignored: bodies that may be touched.

    Raises:
        PlanningError: none is free, and why the last one is not.
    """
    reason: PlanningError = Unreachable("unreachable")
    for restarts in (RESTARTS, FURTHER_RESTARTS):
        found = []
        for tool in tools:
            try:
                found.append(_free(scene, tool, approach, home, rng, ignored, restarts))
            except PlanningError as error:
                reason = error
        if found:
            return min(found, key=lambda choice: float(np.abs(choice.above - arm).max()))
    raise reason


def _free(
    scene: PlanningScene,
    tool: Pose,
    approach: float,
    home: FloatArray,
    rng: np.random.Generator,
    ignored: Sequence[str],
    restarts: int,
) -> Choice:
    """
    Raises:
        PlanningError: it is out of reach, or touches something.
    """

    def wanted(arm: FloatArray) -> bool:
        return restarts == RESTARTS or scene.collision(arm, ignored=ignored) is None

    over = tool.translated(z=approach)
    above = inverse_kinematics(scene.model, over, home, rng, restarts, wanted)
    at = inverse_kinematics(scene.model, tool, above)
    for arm, margin in ((at, False), (above, True)):
        touching = scene.collision(arm, ignored=ignored, margin=margin)
        if touching is not None:
            raise PlanningError(f"in collision: {' and '.join(touching)}")
    return Choice(tool, above)
