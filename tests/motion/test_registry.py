"""Which robots are known, and how large their scenes are."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from pytest_simbench.motion import registry
from pytest_simbench.motion.errors import RobotError
from pytest_simbench.motion.model import FULL_WRIST_REACH, RobotModel, grasping_scale_of, scale_of
from pytest_simbench.motion.registry import find

MODULE = """
from dataclasses import replace
from pytest_simbench.motion.panda import panda

def mine():
    return replace(panda(), name="mine")

def breaks():
    raise SystemExit(3)

def nothing():
    return None
"""
ENTRIES = """[pytest_simbench.robots]
mine = my_robots:mine
other = my_robots:mine
breaks = my_robots:breaks
nothing = my_robots:nothing
absent = my_robots:absent
"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    (tmp_path / "my_robots.py").write_text(MODULE)
    metadata = tmp_path / "my_robots-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: my-robots\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(ENTRIES)
    monkeypatch.syspath_prepend(tmp_path)
    for cached in (registry._registered, registry.known_robot):
        cached.cache_clear()
    yield
    for cached in (registry._registered, registry.known_robot):
        cached.cache_clear()


@pytest.mark.usefixtures("package")
def test_a_package_registers_a_robot() -> None:
    assert registry.known()[:5] == ["panda", "so101", "ur10", "ur5", "xarm7"]
    assert "mine" in registry.known()
    assert registry.find("mine").name == "mine"


@pytest.mark.usefixtures("package")
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("other", r"the robot 'other' \(my_robots:mine\) calls itself 'mine'"),
        ("breaks", r"the robot 'breaks' \(my_robots:breaks\) cannot be made: SystemExit: 3"),
        ("nothing", r"the robot 'nothing' .* is NoneType, no pytest_simbench\.scene\.Robot"),
        ("absent", r"the robot 'absent' .* cannot be made: AttributeError: .*absent"),
    ],
)
def test_a_broken_one_is_a_sentence(name: str, message: str) -> None:
    with pytest.raises(RobotError, match=message):
        registry.find(name)


@pytest.mark.parametrize("name", ["panda", "ur5", "ur10", "xarm7"])
def test_arms_of_full_reach_have_the_studys_scene(name: str) -> None:
    assert scale_of(find(name)) == grasping_scale_of(find(name)) == 1.0


def test_the_so101_has_a_smaller_one() -> None:
    robot = find("so101")
    assert (scale_of(robot), grasping_scale_of(robot)) == (0.5, 0.4)
    reach = RobotModel(robot).wrist_reach
    assert reach == pytest.approx(0.379, abs=1e-3)  # of the URDF
    assert 0.4 <= reach / FULL_WRIST_REACH < 0.5
