"""Which states are no states of a world, and which only look bad."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

from pytest_simbench.scene import (
    Box,
    Capsule,
    ConvexMesh,
    Cylinder,
    FloatArray,
    Pose,
    Scene,
    SceneError,
    Sphere,
    principal,
)
from pytest_simbench.scene.plausibility import implausible
from pytest_simbench.tasks import Jitter, LeaningTowers, Stacking, Throwing

EDGE = 0.05
TABLE = Box("table", (0.9, 0.9, 0.3), Pose.at(0.6, 0.0, 0.15))


def cube(name: str, pose: Pose, edge: float = EDGE) -> Box:
    return Box(name, (edge,) * 3, pose, mass=0.1)


SCENE = Scene(
    "it", (TABLE, cube("a", Pose.at(0.6, 0.0, 0.325)), cube("b", Pose.at(0.6, 0.0, 0.375)))
)


def states(scene: Scene = SCENE, **changed: Pose) -> FloatArray:
    """Rows of the free bodies, at rest where the scene has them or where they are said to be."""
    rows = [
        [*changed.get(body.name, body.pose).as_array(), *np.zeros(6)] for body in scene.free_bodies
    ]
    return np.array(rows).reshape(-1, 13)


def tilted(x: float, y: float, z: float, degrees: float) -> Pose:
    half = math.radians(degrees) / 2
    return Pose((x, y, z), (math.cos(half), math.sin(half), 0.0, 0.0))


@pytest.mark.parametrize("task", [Stacking(), Throwing(), LeaningTowers()], ids=lambda t: t.name)
def test_every_task_starts_as_it_may(task: Any) -> None:
    scene = task.scene(1, Jitter())
    assert implausible(scene, states(scene)) is None


@pytest.mark.parametrize(
    "pose",
    [
        Pose.at(1.2, 0.0, 0.025),  # beside the table
        Pose.at(3.0, 0.0, 0.025),  # thrown
        Pose.at(-4.9, 4.9, 0.025),
        Pose.at(0.0, 0.0, 9.9),
        tilted(0.6, 0.3, 0.335, 45.0),  # on an edge
        Pose.at(0.6, 0.0, 0.375 + 0.001),
        Pose.at(0.6, 0.0, 0.375 - 0.016),  # pressed in by less than a third
        Pose.at(0.9, 0.3, 0.325 - 0.016),
        Pose.at(1.2, 0.0, 0.025 - 0.016),
        Pose.at(0.6, 0.034, 0.325),
    ],
)
def test_where_a_cube_may_be(pose: Pose) -> None:
    assert implausible(SCENE, states(b=pose)) is None


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        (Pose.at(-5.1, 0.0, 0.025), "'b' left the room"),
        (Pose.at(0.0, 5.1, 0.025), "'b' left the room"),
        (Pose.at(0.0, -5.1, 0.025), "'b' left the room"),
        (Pose.at(0.0, 0.0, 10.1), "room of scene 'it' goes 5 m to each side in x, 5 m in y, "),
        (Pose.at(1.2, 0.0, 0.025 - 0.017), "'b' is 17 mm deep in the ground"),
        (Pose.at(1.2, 0.0, -3.0), "'b' is 3025 mm deep in the ground"),
        (tilted(1.2, 0.0, 0.025 * math.sqrt(2) - 0.017, 45.0), "'b' is 17 mm deep in the ground"),
        (Pose.at(0.9, 0.3, 0.325 - 0.017), "'b' and 'table' overlap by 17 mm"),
        (Pose.at(0.6, 0.0, 0.375 - 0.017), "'a' and 'b' overlap by 17 mm"),
        (Pose.at(0.6, 0.033, 0.325), "'a' and 'b' overlap by 17 mm"),
        (Pose.at(0.6, 0.0, 0.325), "'a' and 'b' overlap by 50 mm"),
    ],
)  # fmt: skip
def test_where_no_cube_can_be(pose: Pose, message: str) -> None:
    found = implausible(SCENE, states(b=pose))
    assert re.search(message, found), found
    deep = "deep" in found or "overlap" in found
    assert implausible(SCENE, states(b=pose), striking=True) == (None if deep else found)


@pytest.mark.parametrize("column", range(13))
def test_what_is_no_number_is_no_state(column: int) -> None:
    for value in (math.nan, math.inf):
        rows = states()
        rows[1, column] = value
        assert implausible(SCENE, rows) == "the state of 'b' is not finite"


@pytest.mark.parametrize(("speed", "spin", "fine"), [
    (29.9, 0.0, True), (30.1, 0.0, False),
    (0.0, 690.0, True), (0.0, 695.0, False),  # 43 mm from the centre to a corner
    (20.0, 240.0, False),
])  # fmt: skip
def test_nothing_is_faster_than_anything_here_can_be(speed: float, spin: float, fine: bool) -> None:
    for direction in range(3):
        rows = states()
        rows[0, 7 + direction], rows[0, 10 + (direction + 1) % 3] = -speed, spin
        found = implausible(SCENE, rows)
        assert (found is None) == fine
        if found:
            assert found.startswith("'a' moves at ")


def test_who_left_and_who_is_too_fast_is_told_with_place_and_speed() -> None:
    scene = Scene("it", SCENE.bodies, room=(2.0, 3.0, 4.0))
    rows = states(scene, b=Pose.at(-1.5, 3.25, 0.025))
    assert implausible(scene, rows) == (
        "'b' left the room: it is at (-1.5, 3.25, 0.025) m, and the room of scene 'it' goes 2 m to "
        "each side in x, 3 m in y, and 4 m up"
    )
    rows = states(scene)
    rows[1, 7:10] = 20.0, 30.0, 60.0
    told = "'b' moves at 70 m/s, and nothing here can be so fast"
    assert implausible(scene, rows, striking=True) == told


def test_the_thinner_body_says_how_deep_is_too_deep() -> None:
    slab = Box("slab", (0.4, 0.4, 0.01), Pose.at(0.0, 0.0, 0.005), mass=0.1)
    scene = Scene("thin", (slab, cube("on", Pose.at(0.0, 0.0, 0.035))))
    assert implausible(scene, states(scene, on=Pose.at(0.0, 0.0, 0.032))) is None
    assert implausible(scene, states(scene, on=Pose.at(0.0, 0.0, 0.031))) == (
        "'slab' and 'on' overlap by 4 mm"
    )
    assert implausible(scene, states(scene, slab=Pose.at(0.0, 0.0, 0.001))) == (
        "'slab' is 4 mm deep in the ground"
    )


def test_fixed_bodies_may_stand_where_the_scene_has_them() -> None:
    """In each other and in the ground: nobody moved them."""
    sunk = Box("sunk", (1.0, 1.0, 1.0), Pose())
    wall = Box("wall", (1.0, 1.0, 1.0), Pose.at(0.5, 0.0, 0.0))
    scene = Scene("fixed", (sunk, wall, cube("a", Pose.at(0.0, 0.0, 0.525))))
    assert implausible(scene, states(scene)) is None
    assert implausible(Scene("bare", (sunk, wall)), np.zeros((0, 13))) is None
    alone = Scene("alone", (cube("a", Pose.at(0.0, 0.0, 0.025)),))
    assert implausible(alone, states(alone)) is None


def test_the_room_is_the_scenes() -> None:
    far = cube("a", Pose.at(7.0, 0.0, 0.025))
    with pytest.raises(
        SceneError, match=r"'a' is outside the room \(5.0, 5.0, 10.0\) \[m\]; move it"
    ):
        Scene("far", (far,))
    wide = Scene("wide", (far,), room=(8.0, 8.0, 1e6))
    assert implausible(wide, states(wide)) is None
    assert implausible(wide, states(wide, a=Pose.at(0.0, 0.0, 1000.0))) is None
    assert "left the room" in str(implausible(wide, states(wide, a=Pose.at(0.0, 8.1, 1.0))))
    assert Scene.from_wire(wide.to_wire()) == wide
    older = {name: value for name, value in SCENE.to_wire().items() if name != "room"}
    assert Scene.from_wire(older) == SCENE
    for x, y, z in ((0.0, -5.1, 1.0), (0.0, 0.0, 10.1)):
        with pytest.raises(SceneError, match="outside the room"):
            Scene("far", (cube("a", Pose.at(x, y, z)),))
    Scene("walls", (Box("wall", (1.0, 1.0, 1.0), Pose.at(20.0, 0.0, 0.5)),))  # fixed ones may


def test_round_bodies_may_touch_and_not_sink() -> None:
    """A ball, cans on their ends and a lying pill, each by less than a third of its edge."""
    ball = Sphere("ball", 0.03, Pose.at(0.0, 0.0, 0.03), 0.1)
    can = Cylinder("can", 0.03, 0.1, Pose.at(0.5, 0.0, 0.05), 0.1)
    pill = Capsule("pill", 0.03, 0.1, tilted(1.0, 0.0, 0.03, 90.0), 0.1)
    tin = Cylinder("tin", 0.03, 0.1, Pose.at(1.5, 0.0, 0.05), 0.1)
    scene = Scene("round", (ball, can, pill, tin))
    assert implausible(scene, states(scene)) is None
    for body in scene.bodies:
        for sunk, found in ((0.019, None), (0.021, f"'{body.name}' is 21 mm deep in the ground")):
            pose = body.pose.translated(z=-sunk)
            assert implausible(scene, states(scene, **{body.name: pose})) == found
    beside = [Pose.at(0.44 + into, 0.0, 0.05) for into in (0.019, 0.021)]
    beside.append(Pose.at(0.46, 0.039, 0.05))  # where boxes around them overlap by 21 mm
    found = [implausible(scene, states(scene, tin=pose)) for pose in beside]
    assert found == [None, "'can' and 'tin' overlap by 21 mm", None]


def test_a_body_reaches_down_as_far_as_it_does() -> None:
    """A pyramid, whose top is farther from its centre of mass than its base."""
    base = [(x, y, 0.0) for x in (-0.03, 0.03) for y in (-0.03, 0.03)]
    vertices, frame = principal([*base, (0.0, 0.0, 0.15)])
    standing = Scene("one", (ConvexMesh("pyramid", vertices, frame, 0.2),))
    assert implausible(standing, states(standing)) is None
    on_its_tip = Pose(quaternion=(0.0, 1.0, 0.0, 0.0)) * frame
    for height, found in ((0.15, None), (0.09, "'pyramid' is 60 mm deep in the ground")):
        pose = Pose.at(0.0, 0.0, height) * on_its_tip
        assert implausible(standing, states(standing, pyramid=pose)) == found
