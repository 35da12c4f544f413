"""What only Genesis' adapter has to show, in its own interpreter: drives and reloading.

Worlds are dear (about a second of CPU each, ten for a process), so one worker serves all tests
that can share it.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pytest_simbench.sims.genesis.adapter import Genesis
from pytest_simbench.sims.genesis.engine import quick_inspection
from scipy.spatial import ConvexHull

from pytest_simbench.client.errors import EngineFailed
from pytest_simbench.description.mesh_check import written_stl
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import Box, Compound, Gripper, Joint, Pose, Robot, Scene, Sphere
from pytest_simbench.testing import scenes

from .worlds import Worlds

EGG = """<robot name="egg">
  <link name="foot"/>
  <link name="egg">
    <inertial><mass value="1"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
    <collision><geometry><mesh filename="egg.stl"/></geometry></collision>
  </link>
  <joint name="turn" type="revolute">
    <origin xyz="0 0 0.5"/><parent link="foot"/><child link="egg"/>
    <axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="50" velocity="1"/>
  </joint>
</robot>
"""


@pytest.fixture(scope="module")
def worlds(worlds_of: Callable[[type[Genesis]], Worlds]) -> Worlds:
    return worlds_of(Genesis)


def test_the_worker_survives_a_bad_option(worlds: Worlds) -> None:
    """The engine refuses the elliptic cone with noslip; the next world loads as if nothing was."""
    with pytest.raises(EngineFailed, match="elliptic"):
        worlds.load(scenes.tower(), friction_cone="elliptic", noslip_iterations=5)
    assert worlds.load(scenes.tower()).time == 0.0


def test_a_world_of_other_shapes_is_another_to_compile_for() -> None:
    """Else they compile while they load, which must not take a minute."""
    kind = Genesis(Genesis.profiles["tuned"]).kind
    places = [Pose.at(0.2 * k, 0.0, 0.1) for k in range(4)]
    boxes = [Box(f"b{k}", (0.1,) * 3, at, 0.1) for k, at in enumerate(places)]
    fixed = tuple(replace(box, mass=0.0) for box in boxes[:2])
    ball, pair = Sphere("ball", 0.1, places[3], 0.1), Compound("pair", fixed, places[2])
    two = Scene("two", tuple(boxes[:2]))
    assert kind(two) == kind(replace(two, name="three", bodies=tuple(boxes[:3])))
    others = [replace(two, bodies=(*boxes[:2], other)) for other in (ball, pair)]
    others += [
        replace(two, bodies=()),
        replace(two, bodies=(boxes[0],)),
        replace(two, robot=panda()),
    ]
    assert len({kind(scene) for scene in (two, *others)}) == 1 + len(others)
    finer = replace(Genesis.profiles["tuned"], timestep=1e-4)
    assert Genesis(finer).kind(two) == kind(two)


def test_hulls_of_more_than_500_faces_are_kept_whole(worlds: Worlds, tmp_path: Path) -> None:
    """The engine simplifies them by default; the parity check then refuses the world."""
    points = np.random.default_rng(1).normal(size=(400, 3))
    points *= [[0.03, 0.04, 0.06]] / np.linalg.norm(points, axis=1, keepdims=True)
    faces = ConvexHull(points).simplices
    assert len(faces) > 500
    (tmp_path / "egg.stl").write_bytes(written_stl(points[faces]))
    (tmp_path / "egg.urdf").write_text(EGG)
    joint = Joint("turn", 100.0, 10.0, 50.0, 0.1, 0.0)
    hand = Gripper((), 0.0, 0.0, 0.0)
    robot = Robot("egg", str(tmp_path / "egg.urdf"), {}, "", (joint,), hand, "egg")
    world = worlds.load(Scene("egg", (), robot))
    assert not any("meshes" in excused for excused in world.excused)


def test_import_is_spared_only_what_finds_nothing() -> None:
    """For frames of Python's import system the answer is None, as it would be after a search; for
    all else it is `inspect`'s own, which is back in its place even after an error."""
    original = inspect.getmodule
    code = compile("import sys; frame = sys._getframe()", "<frozen importlib._bootstrap>", "exec")
    names: dict[str, Any] = {}
    exec(code, names)
    here = sys._getframe()

    def look_around_and_fail() -> None:
        with quick_inspection():
            assert inspect.getmodule is not original
            assert inspect.getmodule(names["frame"]) is None
            assert inspect.getmodule(here) is sys.modules[__name__]
            assert inspect.getmodule(Scene) is sys.modules[Scene.__module__]
            raise KeyError("planned")

    with pytest.raises(KeyError, match="planned"):
        look_around_and_fail()
    assert inspect.getmodule is original
    assert inspect.getmodule(names["frame"]) is None
