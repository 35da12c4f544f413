"""What cannot be is refused in a sentence where it is made, and where it arrives from elsewhere."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import Box, Closure, Coupling, Gripper, Joint, Pose, Scene, SceneError
from pytest_simbench.scene.body import ZERO
from pytest_simbench.scene.robot import FREE, MotionLimits
from tests.hostile import HOSTILE, assert_harmless_terminal

BOX = Box("a", (0.1, 0.1, 0.1), Pose.at(0, 0, 0.5), mass=1.0)
SCENE = Scene("s", (BOX,), panda())
NAN, INF = math.nan, math.inf


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"size": (0.1, 0.1, -0.1)}, r"the size \[m\] of 'a' is -0.1; it must be a number above 0"),
        ({"size": (0.1, 0.1, 0)}, "the size .* above 0"),
        ({"size": (0.1, 0.1)}, "the size .* must be 3 numbers"),
        ({"size": "0.1"}, "must be 3 numbers"),
        ({"size": (1e7, 1, 1)}, "the size .* to 1e\\+06"),
        ({"mass": -1.0}, "the mass \\[kg\\] of 'a' is -1.0"),
        ({"mass": 10**400}, "the mass .* it must be"),
        ({"friction": -0.1}, "the friction of 'a' is -0.1"),
        ({"colour": (0, 0, 0)}, "the colour of 'a' .* must be 4 numbers"),
        ({"colour": (0, 0, 0, NAN)}, "the colour of 'a' is nan"),
        ({"pose": Pose((NAN, 0, 0))}, "the position of 'a' is nan"),
        ({"pose": Pose(quaternion=(0, 0, 0, 0))}, "quaternion of 'a' has the length 0; it must be"),
        ({"pose": Pose(quaternion=(NAN, 0, 0, 0))}, "the quaternion of 'a' is nan"),
        ({"pose": (0, 0, 1)}, r"the pose of 'a' is \(0, 0, 1\); give a Pose"),
        ({"pose": Pose((0, 0))}, "the position of 'a' .* must be 3 numbers"),  # type: ignore[arg-type]
        ({"name": ""}, "a body has the name ''; give it a text"),
        ({"name": 3}, "a body has the name 3"),
        ({"name": "a/b"}, "a body has the name 'a/b'; a name has up to 100 printable"),
        ({"name": "a\0"}, r"a body has the name 'a\\x00'"),
        ({"name": " a"}, "a body has the name ' a'"),
        ({"name": "x" * 101}, "a body has the name"),
        ({"name": "<a>"}, "none of / "),
    ],
    ids=lambda value: str(value)[:40],
)
def test_a_box_that_cannot_be(change: dict[str, Any], said: str) -> None:
    with pytest.raises(SceneError, match=said) as caught:
        replace(BOX, **change)
    assert_harmless_terminal(str(caught.value))


@pytest.mark.parametrize("name", ["ground", "world", "Ground", "WORLD"])
def test_the_names_of_what_is_in_every_scene(name: str) -> None:
    with pytest.raises(SceneError, match=f"a body is named '{name}', as something in every scene"):
        Scene("s", (replace(BOX, name=name),))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"name": "a/b"}, "a scene has the name 'a/b'"),
        ({"gravity": (0, 0)}, "the gravity .* must be 3 numbers"),
        ({"ground_friction": -1}, "the ground's friction .* is -1"),
    ],
)
def test_a_scene_that_cannot_be(change: dict[str, Any], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        replace(SCENE, **change)


JOINT = Joint("j", 1.0, 1.0, 1.0, 0.1, 0.0)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"name": "a\x1b"}, r"a joint has the name 'a\\x1b'"),
        ({"stiffness": -1.0}, "the stiffness of joint 'j' is -1.0"),
        ({"damping": NAN}, "the damping of joint 'j' is nan"),
        ({"initial_position": NAN}, "the initial position of joint 'j' is nan"),
        ({"rest": NAN}, "the rest position of the spring in joint 'j' is nan"),
        ({"gravity": 1.1}, "the share of gravity .* must be a number from -1e\\+06 to 1"),
    ],
)
def test_a_joint_that_cannot_be(change: dict[str, Any], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        replace(JOINT, **change)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"name": ""}, "a robot has the name ''"),
        ({"urdf": None}, "robot 'panda' is described by None, which is no path"),
        ({"urdf": "a\0"}, "which is no path"),
        ({"packages": {"a": 3}}, "is described by 3, which is no path"),
        ({"tool_frame": "a/b"}, "the tool frame of 'panda' has the name 'a/b'"),
        ({"friction": NAN}, "the friction of 'panda' is nan"),
        ({"base": Pose((NAN, 0, 0))}, "the position of the base of 'panda' is nan"),
        ({"joints": (JOINT, replace(JOINT, name="k")) * 2}, "has several drives for j, k$"),
        ({"gripper": Gripper(("x",), 0.1, 0.0, 1.0)}, "the gripper .* the joints x, which have no"),
        ({"beside": ("panda_joint1", "x")}, "joints panda_joint1, x beside robot 'panda' must be"),
        ({"beside": ("panda_finger_joint2",)}, "_joint2 beside .* its last, after the gripper's"),
        ({"stand": Pose((NAN, 0, 0))}, "the position of the stand of 'panda' is nan"),
        ({"swing": ((0.0,) * 7, (0.0,) * 6)}, "the swing .* of 'panda' .* must be 7 numbers"),
        ({"couplings": (Coupling("x", "panda_joint1"),)}, "a coupling of 'panda' has the joints x"),
        ({"limits": MotionLimits(*[(1.0,)] * 4, 1.0)}, "and limits of motion of 1$"),
    ],
)
def test_a_robot_that_cannot_be(change: dict[str, Any], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        replace(panda(), **change)


@pytest.mark.parametrize("quantity", ["opened", "closed", "squeeze"])
def test_a_gripper_that_cannot_be(quantity: str) -> None:
    with pytest.raises(SceneError, match="the gripper's"):
        replace(panda().gripper, **{quantity: NAN})


def test_what_joins_links_and_joints_and_cannot() -> None:
    one, two = (1.0,), (1.0, 1.0)
    for kind, *values in (
        (Coupling, "a/b", "c"), (Coupling, "a", "c/d"), (Coupling, "a", "a"),
        (Coupling, "a", "c", NAN), (Coupling, "a", "c", 1.0, NAN), (Closure, "a/b", "c"),
        (Closure, "a", "c/d"), (Closure, "a", "c", (NAN, 0.0, 0.0)), (Closure, "a", "a"),
        (Closure, "a", "c", ZERO, one), (Gripper, ("a/b",), 1.0, 0.0, 1.0),
        (MotionLimits, one, one, one, (0.0,), 1.0), (MotionLimits, one, two, one, one, 1.0),
        (MotionLimits, one, one, one, one, 0.0),
    ):  # fmt: skip
        with pytest.raises(SceneError):
            kind(*values)


def test_the_last_that_can_be() -> None:
    made = replace(BOX, name="x" * 100, mass=1e6, friction=0.0, restitution=1.0)
    assert (len(made.name), made.mass) == (100, 1e6)
    assert [replace(JOINT, stiffness=k).stiffness for k in (0.0, 2.0)] == [FREE, 2.0]
    replace(BOX, pose=Pose(quaternion=(0.9991, 0.0, 0.0, 0.0)))
    for length in (0.9989, 1.0011):
        with pytest.raises(SceneError, match=r"has the length .*; it must be 1 \(w, x, y, z\)"):
            replace(BOX, pose=Pose(quaternion=(0.0, length, 0.0, 0.0)))


def test_numbers_of_numpy_are_numbers() -> None:
    size = tuple(np.array([0.1, 0.2, 0.3]))
    assert replace(BOX, size=size, mass=np.float32(1), friction=np.int64(1)).size == size


@given(st.sampled_from(HOSTILE) | st.text())
def test_a_name_that_is_taken_is_printable(name: str) -> None:
    try:
        box = replace(BOX, name=name)
    except SceneError as error:
        assert_harmless_terminal(str(error))
    else:
        assert box.name.isprintable()
        assert "/" not in box.name


def numbers_of(data: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Places of all numbers in plain data."""
    if isinstance(data, dict):
        return [p for key, value in data.items() for p in numbers_of(value, (*path, key))]
    if isinstance(data, list):
        return [p for k, value in enumerate(data) for p in numbers_of(value, (*path, k))]
    return [path] if isinstance(data, float | int) else []


WIRE = SCENE.to_wire()


@pytest.mark.parametrize("place", numbers_of(WIRE), ids=str)
@pytest.mark.parametrize("value", [NAN, INF, -INF, "1", None, True, [1.0]], ids=str)
def test_no_number_that_arrives_is_none(place: tuple[Any, ...], value: Any) -> None:
    data = inside = json.loads(json.dumps(WIRE))
    for key in place[:-1]:
        inside = inside[key]
    inside[place[-1]] = value
    with pytest.raises(SceneError):
        Scene.from_wire(data)
