"""A short motion of the Panda and two cubes, beside a table, a capsule and a wedge."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pytest_simbench.client.motion import Motion
from pytest_simbench.motion.panda import READY, panda
from pytest_simbench.recordings.trace import Trace
from pytest_simbench.scene import Body, Box, Capsule, ConvexMesh, Pose, Scene
from pytest_simbench.testing.scenes import wedge

RED, BLUE = (0.9, 0.1, 0.1, 1.0), (0.1, 0.1, 0.9, 1.0)
SAMPLES = 12


def scene(*, robot: bool = True) -> Scene:
    cubes: list[Body] = [
        Box("red", (0.05,) * 3, Pose.at(0.5, 0.0, 0.125), 0.1, colour=RED),
        Box("table", (0.2, 0.2, 0.1), Pose.at(0.5, 0.0, 0.05)),
        Box("blue", (0.05,) * 3, Pose.at(0.5, 0.3, 0.025), 0.1, colour=BLUE),
        Capsule("pill", 0.02, 0.06, Pose.at(0.7, -0.3, 0.05)),
        ConvexMesh("wedge", wedge(), Pose.at(0.4, -0.3, 0.05)),
    ]
    return Scene("sample", tuple(cubes), panda() if robot else None)


def motion(joints: int = 9) -> Motion:
    """Every joint and cube moves a little, and turns."""
    time = np.arange(1, SAMPLES + 1) * 0.02
    start = np.zeros(joints)
    start[:7] = READY[:joints]
    start[7:] = 0.03
    speed = np.linspace(0.1, 0.3, joints)
    positions = start + time[:, None] * speed
    bodies = np.zeros((SAMPLES, 2, 13))
    for k, y in enumerate((0.0, 0.3)):
        bodies[:, k, :3] = np.stack([0.5 + time, y + 0 * time, 0.125 - k * 0.1 + time / 2], 1)
        bodies[:, k, 3], bodies[:, k, 6] = np.cos(time), np.sin(time)
        bodies[:, k, 7:10] = 1.0, 0.0, 0.5
    return Motion(time, np.stack([positions, np.tile(speed, (SAMPLES, 1))], 1), bodies)


def trace(*, robot: bool = True, phases: Sequence[tuple[float, str]] = ((0.0, "pick"),)) -> Trace:
    return Trace.of(scene(robot=robot), motion(9 if robot else 0), phases)
