"""What an adapter says of a version of its engine, and in which scenes its deviations count."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from pytest_simbench.sims.mujoco.adapter import MuJoCo

from pytest_simbench.ground.errors import SimulatorError
from pytest_simbench.ground.versions import VersionedName
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import Cylinder, Gripper, Pose, Scene
from pytest_simbench.simulator import FOLLOWER, Deviation
from pytest_simbench.simulator.registry import UnknownSimulatorError, adapter, address, registered

INFO = replace(
    MuJoCo.info,
    name="sim",
    distribution="engine",
    oldest_version="1.2",
    tested_version="1.10.0",
    requirements=("engine==1.10.0", "helper==2"),
    companions={"1.2": ("numpy<2",), "1.9": ("numpy", "helper"), "1.10.1": ("numpy",)},
)


@pytest.mark.parametrize(
    ("version", "tested"),
    [("1.10.0", True), ("1.2.0", True), ("1.9.7", True), ("1.11", False), ("0.9", False)],
)
def test_tested_versions(version: str, tested: bool) -> None:
    assert INFO.tested(version) is tested
    assert INFO.tested_range == "1.2 to 1.10.0"


def test_only_the_newest_is_tested_where_no_older_one_was_tried() -> None:
    info = replace(INFO, oldest_version="")
    assert info.tested("1.10.0")
    assert not info.tested("1.9.0")
    assert not info.refused("0.1")


def test_an_older_release_is_refused_in_one_sentence() -> None:
    with pytest.raises(SimulatorError, match=r"^sim==1.1: .* 1.2 to 1.10.0 .*, not with 1.1$"):
        INFO.of_version(VersionedName("sim", "==", "1.1"))


@pytest.mark.parametrize(
    ("version", "needs"),
    [
        ("1.2.5", ("engine==1.2.5", "numpy<2")),
        ("1.9", ("engine==1.9", "numpy", "helper")),
        ("2.0", ("engine==2.0", "numpy")),
    ],
)
def test_what_a_release_needs_besides(version: str, needs: tuple[str, ...]) -> None:
    info = INFO.of_version(VersionedName("sim", "==", version))
    assert (info.requirements, info.home, info.name) == (needs, "", f"sim=={version}")
    bare = replace(INFO, companions={}).of_version(VersionedName("sim", "==", version))
    assert bare.requirements == (needs[0], "numpy")


def test_the_pinned_release_has_the_environment_of_the_bare_name_and_a_build_none() -> None:
    info = INFO.of_version(VersionedName("sim", "==", "1.10.0"))
    assert (info.home, info.requirements) == ("sim", INFO.requirements)
    of_system = replace(INFO, system_packages=("python3-engine",))
    build = of_system.of_version(VersionedName("sim", "@", "4.1.0"))
    assert build == replace(INFO, name="sim@4.1.0", requirements=(), install=build.install)
    assert build.install == "--sim sim@4.1.0=PATH"


def test_the_adapter_of_a_version() -> None:
    cls = adapter("mujoco==3.3.7")
    assert issubclass(cls, MuJoCo)
    assert cls.info.name == "mujoco==3.3.7"
    assert cls.info.install == "simbench install mujoco==3.3.7"
    assert address("mujoco==3.3.7") == address("mujoco")
    with pytest.raises(UnknownSimulatorError, match="choose from"):
        adapter("nosuch==3.3.7")
    with pytest.raises(SimulatorError, match="packages of the system"):
        adapter("ode==1.0")


@pytest.mark.parametrize("name", registered())
def test_older_releases_than_were_tried_are_refused_in_one_sentence(name: str) -> None:
    info = adapter(name).info
    if info.system_packages:
        assert not info.oldest_version  # the system has one release
        return
    assert info.tested(info.oldest_version)
    assert not info.refused(info.oldest_version)
    assert re.fullmatch(r"the adapter was tested with .* not with 0\.0\.1", info.refused("0.0.1"))
    with pytest.raises(SimulatorError, match=r"==0\.0\.1: the adapter was tested"):
        adapter(f"{name}==0.0.1")


def test_sizes_hold_for_the_robot_they_were_measured_on() -> None:
    """Another robot may have larger meshes, and fingers of other names."""
    hull = Deviation("link/*/meshes", "hulls", within=5e-4, elsewhere=1e-3)
    finger = Deviation(f"joint/{FOLLOWER}/effort_limit", "follows")
    ur5 = replace(
        panda(), name="ur5", gripper=Gripper(("panda_joint1", "panda_joint2"), 1.0, 0.0, 1.0)
    )
    for robot in (None, panda()):
        assert hull.with_robot(robot) == hull
        assert not finger.with_robot(robot).excuses("joint/panda_finger_joint2/effort_limit")
    assert hull.with_robot(ur5).within == 1e-3
    assert replace(hull, elsewhere=None).with_robot(ur5).within == 5e-4
    fingers = Gripper(ur5.joint_names[:3], 1.0, 0.0, 1.0)
    three = replace(ur5, gripper=fingers, limits=None, swing=None)
    assert hull.with_robot(three).quantity == hull.quantity
    assert finger.with_robot(ur5).excuses("joint/panda_joint2/effort_limit")
    assert not finger.with_robot(ur5).excuses("joint/panda_joint1/effort_limit")


def test_some_deviations_count_only_where_a_scene_has_their_word() -> None:
    bouncing = Deviation("", "it does not bounce", only="restitution")
    rolling = Deviation("", "it does not roll", only="cylinder")
    can = Cylinder("can", 0.1, 0.1, Pose.at(0.0, 0.0, 0.05), 1.0)
    scenes = [Scene("s"), Scene("s", (can,)), Scene("s", (can.changed(restitution=0.5),))]
    assert [bouncing.concerns(scene) for scene in scenes] == [False, False, True]
    assert [rolling.concerns(scene) for scene in scenes] == [False, True, True]
    assert all(Deviation("", "always").concerns(scene) for scene in scenes)
    assert Scene("s", (can.changed(linear_damping=0.1),)).words == {"cylinder", "damping"}
