"""What every engine is asked for, of a small world whose quantities are known by hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_simbench.description.shapes import DIRECTIONS
from pytest_simbench.parity.quantities import expected_quantities, touches
from pytest_simbench.scene import Box, Capsule, FloatArray, Joint, Pose, Robot, Scene
from pytest_simbench.scene.robot import FREE as LOOSE
from pytest_simbench.simulator import PreparedRobot
from pytest_simbench.simulator.settings import Settings
from tests.description.test_urdf_check import SOUND, described

EVEN = 'ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"'
MESH = '<collision>{}<geometry><mesh filename="meshes/hand.stl"/></geometry></collision>'
BOX = '<geometry><box size="{}"/></geometry></collision>'
ARM = SOUND
for old, new in (
    ('<link name="foot"/>', f'<link name="foot"><collision>{BOX.format("0.2 0.1 0.1")}</link>'),
    (EVEN, 'ixx="0.01" ixy="0.001" ixz="0" iyy="0.02" iyz="0" izz="0.015"'),
    (MESH.format(""), MESH.format('<origin xyz="0 0 0.03"/>')),
    (f"<collision>{BOX.format('0.1 0.1 0.2')}",
     f'<collision><origin xyz="0 0 0.1"/>{BOX.format("0.1 0.1 0.2")}{MESH.format("")}'),
    ('<link name="tip"/>',
     f'<link name="tip"><inertial><mass value="0.2"/><inertia {EVEN}/></inertial></link>'),
    ('type="fixed">',
     'type="revolute"><axis xyz="1 0 0"/><limit lower="-1" upper="1" velocity="1"/>'),
):  # fmt: skip
    assert old in ARM
    ARM = ARM.replace(old, new, 1)
FREE = Box(
    "free",
    (0.1, 0.2, 0.4),
    Pose.at(0.5, 0.0, 0.2, yaw=0.3),
    mass=0.3,
    friction=0.7,
    linear_velocity=(0.1, 0.0, -0.2),
    angular_velocity=(0.0, 0.0, 3.0),
)
PILL = Capsule("pill", 0.1, 0.4, Pose.at(-1.0, 0.0, 0.5), restitution=0.4)
SHELF = Box("shelf", (0.2, 0.2, 0.2), Pose.at(-0.5, 0.0, 0.1), friction=0.6)


@pytest.fixture
def arm(tmp_path: Path) -> Robot:
    return replace(
        described(tmp_path / "arm", ARM),
        joints=(
            Joint("shoulder", 100.0, 10.0, 20.0, 0.1, np.pi / 2),
            Joint("slide", 200.0, 11.0, 30.0, 0.2, 0.05),
            Joint("end", 300.0, 12.0, 40.0, 0.3, 0.0),
        ),
        base=Pose.at(0.1, 0.2, 0.3, yaw=np.pi / 2),
        friction=0.9,
    )


def box_reach(centre: tuple[float, ...], size: tuple[float, ...]) -> FloatArray:
    """How far an upright box reaches: d . c + |d| . size / 2."""
    return np.asarray(DIRECTIONS @ np.array(centre) + np.abs(DIRECTIONS) @ np.array(size) / 2)


def corner_reach(height: float) -> FloatArray:
    """Of the tetrahedron of the origin and 0.1 m along each axis, lifted by `height`."""
    return np.asarray(np.maximum(0.0, 0.1 * DIRECTIONS.max(axis=1)) + height * DIRECTIONS[:, 2])


NONE = np.zeros((0, 26))


def inertial(mass: float, com: Any, inertia: Any) -> dict[str, Any]:
    return {"mass": mass, "com": com, "inertia": inertia, "damping": [0, 0], "gravity": 1}


BARE = {"boxes": NONE, "meshes": NONE, "rounds": NONE}
SOLID: dict[str, Any] = {**BARE, "restitution": 0, "margin": 0}


def expected() -> dict[str, Any]:
    """All of it by hand. The shoulder, turned by 90 degrees like the base, points backwards."""
    tensor = [[0.01, 0.001, 0], [0.001, 0.02, 0], [0, 0, 0.015]]
    groups: dict[str, Mapping[str, Any]] = {
        "body/free": SOLID | {
            "pose": FREE.pose.as_array(),
            "boxes": [box_reach((0, 0, 0), (0.1, 0.2, 0.4))],
            "friction": 0.7,
            "dynamic": 1,
            "touches": [1, 1, 1],
            "velocity": [0.1, 0, -0.2, 0, 0, 3],
            **inertial(0.3, [0, 0, 0], np.diag([0.005, 0.00425, 0.00125])),
        },
        "body/shelf": SOLID | {
            "pose": [-0.5, 0, 0.1, 1, 0, 0, 0],
            "boxes": [box_reach((0, 0, 0), (0.2, 0.2, 0.2))],
            "friction": 0.6,
            "dynamic": 0,
            "touches": [0, 1, 1],
        },
        "body/pill": SOLID | {
            "pose": [-1, 0, 0.5, 1, 0, 0, 0],
            "rounds": [0.1 + 0.2 * np.abs(DIRECTIONS[:, 2])],
            "friction": 1,
            "dynamic": 0,
            "touches": [0, 1, 1],
            "restitution": 0.4,
        },
        "link/base": SOLID | {
            "pose": [0, 0, 0, 1, 0, 0, 0],
            "boxes": [box_reach((0.1, 0.2, 0.3), (0.1, 0.2, 0.1))],
            "friction": 0.9,
            "touches": [0, 1, 0],
        },
        "link/upper": SOLID | {
            "pose": [0.1, 0.2, 0.5, 0, 0, 0, 1],
            "boxes": [box_reach((0, 0, 0.1), (0.1, 0.1, 0.2))],
            "meshes": [corner_reach(0.0)],
            "friction": 0.9,
            "touches": [1, 1, 0],
            **inertial(1.0, [0, 0, 0.1], tensor),
        },
        "link/hand": SOLID | {
            "pose": [0.1, 0.15, 0.5, 0, 0, 0, 1],
            "meshes": [corner_reach(0.03)],
            "friction": 0.9,
            "touches": [1, 1, 0],
            **inertial(0.5, [0, 0, 0], 0.01 * np.eye(3)),
        },
        "link/tip": BARE | {
            "pose": [0.1, 0.15, 0.5, 0, 0, 0, 1],
            **inertial(0.2, [0, 0, 0], 0.01 * np.eye(3)),
        },
        "joint/shoulder": {
            "axis": [0, 0, 1, 0, 0, 0], "limits": [-2, 2], "effort_limit": 20, "stiffness": 100,
            "damping": 10, "friction": 0, "armature": 0.1, "initial_position": np.pi / 2,
        },
        "joint/slide": {
            "axis": [0, 0, 0, 0, 1, 0], "limits": [0, 0.1], "effort_limit": 30, "stiffness": 200,
            "damping": 11, "friction": 0, "armature": 0.2, "initial_position": 0.05,
        },
        "joint/end": {
            "axis": [1, 0, 0, 0, 0, 0], "limits": [-1, 1], "effort_limit": 40, "stiffness": 300,
            "damping": 12, "friction": 0, "armature": 0.3, "initial_position": 0,
        },
        "ground": {"height": 0, "friction": 0.8, "restitution": 0},
        "gripper": {"coupled": 1},
    }  # fmt: skip
    flat = {f"{group}/{name}": v for group, values in groups.items() for name, v in values.items()}
    return {**flat, "gravity": [0.1, 0.2, -9.0], "timestep": 0.004}


def assert_quantities(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
    assert set(found) == set(wanted)
    for name, value in wanted.items():
        assert np.shape(found[name]) == np.shape(value), name
        np.testing.assert_allclose(found[name], value, atol=1e-7, err_msg=name)


def test_every_quantity_of_a_world(arm: Robot) -> None:
    scene = Scene("s", (FREE, SHELF, PILL), arm, gravity=(0.1, 0.2, -9.0), ground_friction=0.8)
    assert_quantities(expected_quantities(scene, Settings(0.004)), expected())


def test_a_world_without_a_robot() -> None:
    scene = Scene("s", (FREE, SHELF, PILL), None, gravity=(0.1, 0.2, -9.0), ground_friction=0.8)
    alone = ("body/", "ground/", "gravity", "timestep")
    wanted = {name: v for name, v in expected().items() if name.startswith(alone)}
    wanted |= {f"body/{name}/touches": [0, 1, 0] for name in ("shelf", "pill")}
    wanted["body/free/touches"] = [1, 1, 0]
    assert_quantities(expected_quantities(scene, Settings(0.004)), wanted)


class Damped(Settings):
    def quantities(self) -> Mapping[str, Any]:
        return {"body/*/damping": [0.1, 0.2], "joint/slide/friction": 0.3, "link/no/gravity": 0}


def test_settings_change_what_they_name_and_add_nothing(arm: Robot) -> None:
    scene = Scene("s", (FREE, SHELF, PILL), arm, gravity=(0.1, 0.2, -9.0), ground_friction=0.8)
    wanted = {**expected(), "body/free/damping": [0.1, 0.2], "joint/slide/friction": 0.3}
    assert_quantities(expected_quantities(scene, Damped(0.004)), wanted)


class Braked(Settings):
    def quantities(self) -> Mapping[str, Any]:
        return {f"joint/*/{name}": 7 for name in ("stiffness", "damping", "friction")}


def test_a_motor_and_a_joints_own_friction_are_not_the_settings_and_springs_add_up(
    arm: Robot,
) -> None:
    shoulder, slide, end = arm.joints
    joints = (
        replace(shoulder, stiffness=0.0, damping=0.0),
        replace(slide, friction=0.5),
        replace(end, spring=2.0, rest=0.25, passive_damping=3.0),
    )
    found = expected_quantities(Scene("s", (), replace(arm, joints=joints)), Braked(0.004))
    told = [
        [
            float(found[f"joint/{joint.name}/{name}"])
            for name in ("stiffness", "damping", "friction")
        ]
        for joint in joints
    ]
    assert told == [[LOOSE, 0, 7], [7, 7, 0.5], [9, 10, 7]]
    assert [name for name in found if "rest" in name and "joint" in name] == ["joint/end/rest"]
    assert found["joint/end/rest"] == 0.25


def test_a_bodys_own_damping_replaces_that_of_the_settings() -> None:
    braked = FREE.changed(linear_damping=0.7)
    found = expected_quantities(Scene("s", (braked,)), Damped(0.004))
    assert found["body/free/damping"].tolist() == [0.7, 0]


def test_shares_of_what_can_be_touched(arm: Robot) -> None:
    """Of those that can ever meet: fixed things never meet each other, and nothing meets itself."""
    asked = []

    def can_touch(a: str, b: str) -> int:
        asked.append({a, b})
        return int("hand" not in a + b)

    scene = Scene("s", (FREE, SHELF), arm)
    found = touches(scene, PreparedRobot(arm), can_touch)
    assert {name: list(value) for name, value in found.items()} == {
        "body/free/touches": [1, 1, 2 / 3],
        "body/shelf/touches": [0, 1, 1 / 2],
        "link/base/touches": [0, 1, 1 / 2],
        "link/upper/touches": [1, 1, 1 / 2],
        "link/hand/touches": [0, 0, 0],
    }
    still = {"ground", "body/shelf", "link/base"}
    assert all(len(pair) == 2 and not pair <= still for pair in asked)


NAMES = "body/free", "link/hand", "link/upper"


def test_what_is_kept_apart_does_not_touch(arm: Robot) -> None:
    apart = ("link/hand", "body/free"), ("ground", "link/upper")
    found = expected_quantities(Scene("s", (FREE, SHELF), arm, apart=apart), Settings())
    told = {name: list(found[f"{name}/touches"]) for name in NAMES}
    assert told == {"body/free": [1, 1, 2 / 3], "link/hand": [1, 0.5, 0], "link/upper": [0, 1, 0]}
