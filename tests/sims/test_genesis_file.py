"""The profile `file` of Genesis: what its importer makes of a file, and what it does not keep."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("mujoco")

from pytest_simbench.sims.genesis.adapter import Genesis

from pytest_simbench.scene import Pose

from .test_mujoco_articulated import KITCHEN
from .test_mujoco_reading import SMALL
from .test_newton_file import STEP, in_mujoco, scene_of
from .worlds import Worlds

ARMATURE = {
    'name="slide"': 'name="slide" armature=".1"',
    'name="elbow"': 'name="elbow" armature=".1"',
    "<worldbody>": '<option integrator="implicitfast"/><worldbody>',
}
"""What Genesis adds to joints whose armature a file does not say."""


@pytest.fixture(scope="module")
def worlds() -> Iterator[Worlds]:
    with Worlds(Genesis) as worlds:
        yield worlds


def test_the_imported_file_moves_as_in_mujoco(worlds: Worlds, tmp_path: Path) -> None:
    """A tenth of a second in the air; one body moved, and parity: masses, places and shapes."""
    scene = scene_of(tmp_path, SMALL).with_pose("ball", Pose.at(0.01, 0.42, 0.31))
    world = worlds.load(scene, "file", timestep=STEP)
    told = [sentence for sentence in world.excused if "importer" in sentence]
    assert len(told) == 1  # what the importer never reads
    world.wait(100 * STEP)
    for body, row in zip(scene.free_bodies, in_mujoco(scene, 100)[0], strict=True):
        assert world.pose(body.name).as_array() == pytest.approx(row[:7], abs=2e-5)


def test_joints_move_as_in_mujoco_but_for_the_armature(worlds: Worlds, tmp_path: Path) -> None:
    world = worlds.load(scene_of(tmp_path, KITCHEN), "file", timestep=STEP)
    told = "joint armature is 0.1, in the file 0 (slide, elbow)"
    assert any(told in sentence for sentence in world.excused)
    text = KITCHEN
    for change in ARMATURE.items():
        text = text.replace(*change, 1)
    scene = scene_of(tmp_path, text)
    world = worlds.load(scene, "file", timestep=STEP)
    assert not any("armature" in sentence for sentence in world.excused)
    world.wait(100 * STEP)
    assert world.joints[0] == pytest.approx(in_mujoco(scene, 100)[1][0], abs=2e-3)
