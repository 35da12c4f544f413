"""The profile `file` of Newton and of Genesis: what their importers make of a file, and do not
keep."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco")

from pytest_simbench.sims.genesis.adapter import Genesis  # noqa: E402
from pytest_simbench.sims.mujoco.adapter import MuJoCo  # noqa: E402
from pytest_simbench.sims.mujoco.reading import Reading  # noqa: E402
from pytest_simbench.sims.newton.adapter import Newton  # noqa: E402

from pytest_simbench.client.errors import Unavailable  # noqa: E402
from pytest_simbench.scene import Pose, Scene  # noqa: E402

from .test_mujoco_articulated import KITCHEN  # noqa: E402
from .test_mujoco_reading import SMALL  # noqa: E402
from .worlds import Worlds, loaded, stepped  # noqa: E402

STEP = 1e-3


@pytest.fixture(scope="module")
def worlds(worlds_of: Callable[[type[Newton]], Worlds]) -> Worlds:
    return worlds_of(Newton)


@pytest.fixture(scope="module")
def genesis(worlds_of: Callable[[type[Genesis]], Worlds]) -> Worlds:
    return worlds_of(Genesis)


def scene_of(path: Path, text: str) -> Scene:
    (path / "scene.xml").write_text(text)
    return Reading(str(path / "scene.xml")).scene


def in_mujoco(scene: Scene, steps: int) -> tuple[np.ndarray, np.ndarray]:
    simulator = stepped(loaded(MuJoCo, scene, "file", timestep=STEP), steps * STEP)
    return simulator.body_state(), simulator.joint_state()


@pytest.mark.parametrize("text", [SMALL, KITCHEN], ids=["small", "kitchen"])
def test_the_imported_file_moves_as_in_mujoco(worlds: Worlds, tmp_path: Path, text: str) -> None:
    """With the file's integrator, a tenth of a second in the air; one body moved, and parity."""
    text = text.replace("<worldbody>", '<option integrator="implicitfast"/><worldbody>')
    scene = scene_of(tmp_path, text)
    scene = scene.with_pose("ball", Pose.at(0.01, 0.42, 0.31))
    world = worlds.load(scene, "file", timestep=STEP)
    world.wait(100 * STEP)
    bodies, joints = in_mujoco(scene, 100)
    for body, row in zip(scene.free_bodies, bodies, strict=True):
        assert world.pose(body.name).as_array() == pytest.approx(row[:7], abs=2e-5)
    assert world.joints == pytest.approx(joints, abs=2e-4)


DROPPED = {
    "dof damping is 0, in the file 0.1 (f)": ("<freejoint", '<joint damping=".1" type="free"'),
    "option gravity is 0 0 -9.81, in the file 0 0 -1.6": ("<option", '<option gravity="0 0 -1.6"'),
    "geom margin is 0, in the file 0.01 (g)": ('name="g"', 'name="g" margin=".01"'),
    "body mass is 0.48, in the file 37.6 (box)": ('name="g"', 'name="g" shellinertia="true"'),
    "option integrator is mjINT_IMPLICITFAST": ('integrator="implicitfast"', ""),
}


@pytest.mark.parametrize(("told", "change"), DROPPED.items())
def test_what_the_importer_drops_is_told(
    worlds: Worlds, tmp_path: Path, told: str, change: tuple[str, str]
) -> None:
    world = worlds.load(scene_of(tmp_path, SMALL.replace(*change, 1)), "file")
    assert any(told in sentence for sentence in world.excused)


def test_nothing_is_told_of_what_is_kept(worlds: Worlds, tmp_path: Path) -> None:
    """But for a switch of Newton's own: several points of contact of meshes."""
    world = worlds.load(scene_of(tmp_path, SMALL), "file")
    told = [sentence for sentence in world.excused if "importer" in sentence]
    assert told == ["Newton's importer: option disableflags is multiccd, in the file none"]


def test_a_file_that_the_importer_refuses(worlds: Worlds, tmp_path: Path) -> None:
    scene = scene_of(tmp_path, SMALL.replace("<option", '<option solver="PGS"'))
    with pytest.raises(Unavailable, match="Newton's importer refuses .*scene.xml: .*pgs"):
        worlds.load(scene, "file")


ARMATURE = {
    'name="slide"': 'name="slide" armature=".1"',
    'name="elbow"': 'name="elbow" armature=".1"',
    "<worldbody>": '<option integrator="implicitfast"/><worldbody>',
}
"""What Genesis adds to joints whose armature a file does not say."""


def test_a_file_of_genesis_moves_as_in_mujoco(genesis: Worlds, tmp_path: Path) -> None:
    """A tenth of a second in the air; one body moved, and parity: masses, places and shapes."""
    scene = scene_of(tmp_path, SMALL).with_pose("ball", Pose.at(0.01, 0.42, 0.31))
    world = genesis.load(scene, "file", timestep=STEP)
    told = [sentence for sentence in world.excused if "importer" in sentence]
    assert len(told) == 1  # what the importer never reads
    world.wait(100 * STEP)
    for body, row in zip(scene.free_bodies, in_mujoco(scene, 100)[0], strict=True):
        assert world.pose(body.name).as_array() == pytest.approx(row[:7], abs=2e-5)


def test_joints_move_as_in_mujoco_but_for_the_armature(genesis: Worlds, tmp_path: Path) -> None:
    world = genesis.load(scene_of(tmp_path, KITCHEN), "file", timestep=STEP)
    told = "joint armature is 0.1, in the file 0 (slide, elbow)"
    assert any(told in sentence for sentence in world.excused)
    text = KITCHEN
    for change in ARMATURE.items():
        text = text.replace(*change, 1)
    scene = scene_of(tmp_path, text)
    world = genesis.load(scene, "file", timestep=STEP)
    assert not any("armature" in sentence for sentence in world.excused)
    world.wait(100 * STEP)
    assert world.joints[0] == pytest.approx(in_mujoco(scene, 100)[1][0], abs=2e-3)
