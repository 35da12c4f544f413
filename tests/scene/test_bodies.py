"""Kinds of bodies: sizes, moments, overlaps, how they cross, and the forces on them."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import simpson

from pytest_simbench.scene import (
    Body,
    Box,
    Capsule,
    Compound,
    ConvexMesh,
    Cylinder,
    Pose,
    Scene,
    SceneError,
    Sphere,
    Vector3,
    Wrench,
    penetration,
    principal,
)
from pytest_simbench.scene.body import Solid
from tests.approval import assert_approved, in_words

SIGNS = list(product((-1.0, 1.0), repeat=3))

UNIT = Box("unit", (1.0, 1.0, 1.0), Pose())


def test_what_is_as_by_default_is_not_written() -> None:
    """Fingerprints of a scene are made of what it writes, and stay as they were."""
    assert list(UNIT.to_wire()) == ["name", "size", "pose", "mass", "friction", "colour"]


def test_restitution_and_damping_that_cannot_be() -> None:
    ball = Sphere("ball", 0.1, Pose(), 1.0)
    for name, wrong in (
        ("restitution", 1.1), ("restitution", -0.1), ("linear_damping", -0.1),
        ("angular_damping", -1.0), ("linear_velocity", (0.0, math.nan, 0.0)),
        ("angular_velocity", (1.0, 2.0)),
    ):  # fmt: skip
        with pytest.raises(SceneError, match=f"the {name.replace('_', ' ')}.* of 'ball' is"):
            ball.changed(**{name: wrong})


def test_a_fixed_body_does_not_start_to_move_and_takes_no_force() -> None:
    with pytest.raises(SceneError, match="'post' has a velocity and no mass"):
        Box("post", (1.0, 1.0, 1.0), Pose(), angular_velocity=(0.0, 0.0, 1.0))
    with pytest.raises(SceneError, match="'post' has no mass, so no force moves it"):
        Box("post", (1.0, 1.0, 1.0), Pose(), wrenches=(PULL,))
    for more in ({"mass": 1.0}, {"linear_damping": 0.1}):
        with pytest.raises(SceneError, match="'unit' moves as prescribed, so it has no mass and"):
            UNIT.changed(prescribed=True, **more)


R, L = 0.3, 0.8
ROUNDS = [
    Sphere("ball", R, Pose(), 2.0),
    Cylinder("can", R, L, Pose(), 2.0),
    Capsule("pill", R, L, Pose(), 2.0),
]
UP, ASIDE = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)


@pytest.mark.parametrize("body", ROUNDS, ids=lambda body: body.name)
def test_a_round_body_is_what_it_says(body: Body) -> None:
    """Volume and inertia against its slices, and its reach against the farthest of points in it."""
    half = np.array(body.extents) / 2
    points = np.stack(np.meshgrid(*[np.linspace(-h, h, 121) for h in half]), -1).reshape(-1, 3)
    axial = np.array([0.0, 0.0, {"ball": 0.0}.get(body.name, L / 2)])
    away = points - np.clip(points, -axial, axial)
    if body.name == "can":
        away = points * (1.0, 1.0, 0.0)
    inside = points[np.linalg.norm(away, axis=1) <= R]
    z = np.linspace(-half[2], half[2], 20001)
    square = R**2 - np.maximum(np.abs(z) - (0.0 if body.name == "ball" else L / 2), 0.0) ** 2
    assert body.volume == pytest.approx(simpson(np.pi * square, x=z), rel=1e-6)
    discs = body.mass / body.volume * np.pi * square  # mass over thickness
    across, about = simpson(discs * (square / 4 + z**2), x=z), simpson(discs * square / 2, x=z)
    assert body.inertia() == pytest.approx([across, across, about], rel=1e-6)
    directions = np.array([UP, ASIDE, (0.6, 0.0, 0.8), (-0.48, 0.64, -0.6)])
    found = body.reach(directions)
    assert np.allclose(found, (inside @ directions.T).max(axis=0), atol=0.01)


def test_bodies_are_what_somebody_approved() -> None:
    """Each at a place, turned: what it is, what it reaches, and how deep it is in each other."""
    at = Pose((0.1, -0.2, 0.3), (0.8, 0.0, 0.36, 0.48))
    corners, frame = principal([(0, 0, 0), (0.6, 0, 0), (0, 0.5, 0), (0, 0, 0.4), (0.4, 0.4, 0.4)])
    stool = Compound(
        "stool", (Box("seat", (0.5, 0.5, 0.1), Pose()), Sphere("knob", 0.1, Pose((0, 0, 0.15)))),
        at, 3.0, moments=(0.2, 0.3, 0.4), file_frame=Pose.at(0.1, 0, 0),
    )  # fmt: skip
    bodies = [
        Box("box", (0.4, 0.5, 0.6), at, 2.0, moments=(0.1, 0.2, 0.25)),
        *(body.moved_to(at) for body in ROUNDS),
        ConvexMesh("rock", corners, at * frame, 2.0, linear_velocity=(0.1, 0.2, 0.3)),
        stool.with_friction(0.7),
    ]
    directions = np.array([UP, ASIDE, (0.6, 0.0, 0.8), (-0.48, 0.64, -0.6)])
    aside = Pose((0.25, 0.3, 0.1), (0.6, 0.8, 0.0, 0.0)) * at
    lines = []
    for body in bodies:
        lines.append(f"{body.name}: {in_words([body, body.inertia(), body.solids()])}")
        core = [] if body.name == "stool" else [body.core(0.2)[1]]
        lines.append(in_words([body.reach(directions), body.reach_placed(directions), core]))
        deep = [penetration(body, other.moved_to(aside), 0.2) for other in bodies]
        lines.append(in_words([round(depth, 5) for depth in deep]))
    assert_approved("bodies", "\n".join(lines))


def test_how_deep_round_bodies_overlap() -> None:
    """Balls and pills in any place, and flat faces, by hand; a layer of 10 % is exact here."""
    ball, can, pill = ROUNDS
    cases: list[tuple[Body, Body, Vector3, float]] = [
        (ball, ball, (0.4, 0.3, 0.0), 0.1),
        (ball, ball, (0.4, 0.5, 0.0), 0.6 - math.hypot(0.4, 0.5)),
        (ball, pill, (0.3, 0.0, 0.8), 0.1),
        (pill, pill, (0.3, 0.4, 0.7), 0.1),
        (ball, UNIT, (0.79, 0.2, 0.3), 0.01),
        (can, UNIT, (0.1, 0.0, 0.89), 0.01),
        (can, can, (0.2, 0.1, 0.79), 0.01),
        (can, can, (0.48, 0.36, 0.2), 0.0),
        (can, pill, (0.36, 0.48, -0.3), 0.0),
    ]
    for first, second, offset, depth in cases:
        for a, b in (
            (first, second.moved_to(Pose(offset))),
            (second.moved_to(Pose(offset)), first),
        ):
            assert penetration(a, b) == pytest.approx(depth, abs=1e-6), (a.name, b.name, offset)


@given(st.tuples(*[st.floats(-0.9, 0.9)] * 3), st.floats(-math.pi, math.pi))
def test_bodies_apart_never_overlap(at: tuple[float, float, float], tilt: float) -> None:
    """Where no point of a grid over a can lies in a box, the depth is no more than the grid."""
    can = ROUNDS[1].moved_to(Pose(at, (math.cos(tilt / 2), math.sin(tilt / 2), 0.0, 0.0)))
    box = Box("box", (0.5, 0.6, 0.7), Pose())
    angles = np.linspace(0, 2 * np.pi, 60)
    disc = [[r * math.cos(a), r * math.sin(a)] for a in angles for r in (0.1, 0.2, R)]
    points = np.array([[x, y, z] for x, y in disc for z in np.linspace(-L / 2, L / 2, 33)])
    points = points @ can.pose.rotation().T + np.array(at)
    if not (np.abs(points) < np.array(box.size) / 2 + 1e-9).all(axis=1).any():
        assert penetration(can, box) < 0.05


@pytest.mark.parametrize("wrong", [0.0, -1.0, math.nan])
def test_a_radius_and_a_length_are_above_0(wrong: float) -> None:
    for made in (
        lambda: Sphere("b", wrong, Pose()),
        lambda: Cylinder("b", 1.0, wrong, Pose()),
        lambda: Capsule("b", wrong, 1.0, Pose()),
    ):
        with pytest.raises(SceneError, match=r"the (radius|length) \[m\] of 'b' is"):
            made()


def test_moments_of_its_own_must_be_possible() -> None:
    assert (UNIT.changed(mass=1.0, moments=(0.2, 0.3, 0.4)).inertia() == [0.2, 0.3, 0.4]).all()
    with pytest.raises(SceneError, match="none is larger than the other two"):
        Box("a", (1.0, 1.0, 1.0), Pose(), 1.0, moments=(0.1, 0.2, 0.4))
    with pytest.raises(SceneError, match="the moments of inertia .* of 'a' is 0.0; .* above 0"):
        Box("a", (1.0, 1.0, 1.0), Pose(), 1.0, moments=(0.1, 0.1, 0.0))


SIZE = (0.3, 0.5, 0.2)
CORNERS = [tuple(s * e / 2 for s, e in zip(signs, SIZE, strict=True)) for signs in SIGNS]


def as_mesh(pose: Pose = Pose(), **values: Any) -> ConvexMesh:  # noqa: B008 - it never changes
    return ConvexMesh("mesh", tuple(CORNERS), pose, **values)


def test_a_mesh_with_a_boxs_corners_is_that_box() -> None:
    box, mesh = Box("box", SIZE, Pose(), 2.0), as_mesh(mass=2.0)
    assert mesh.volume == pytest.approx(box.volume)
    assert mesh.extents == pytest.approx(box.extents)
    assert np.allclose(mesh.inertia(), box.inertia())
    directions = np.random.default_rng(0).normal(size=(9, 3))
    assert np.allclose(mesh.reach(directions), box.reach(directions))


@given(st.tuples(*[st.floats(-0.5, 0.5)] * 3), st.tuples(*[st.floats(-1.0, 1.0)] * 4))
def test_meshes_overlap_as_boxes_do(at: Vector3, turn: tuple[float, ...]) -> None:
    """With a box, with a mesh, and either way round."""
    quaternion = np.add(turn, [1.5, 0.0, 0.0, 0.0])
    place = Pose.from_array([*at, *quaternion / np.linalg.norm(quaternion)])
    box, other = Box("box", SIZE, Pose()), Box("other", SIZE, place)
    depth = penetration(box, other)
    for pair in ((box, as_mesh(place)), (as_mesh(), other), (as_mesh(place), as_mesh())):
        assert max(penetration(*pair), 0.0) == pytest.approx(max(depth, 0.0), abs=1e-9)


def test_how_deep_round_bodies_are_in_a_mesh() -> None:
    ball, can = Sphere("ball", 0.1, Pose.at(0.0, 0.0, 0.15)), Cylinder("can", 0.1, 0.4, Pose())
    assert penetration(as_mesh(), ball) == pytest.approx(0.05)
    assert penetration(as_mesh(), ball.moved_to(Pose.at(0.0, 0.0, 0.21))) == pytest.approx(-0.01)
    assert penetration(can.moved_to(Pose.at(0.0, 0.0, 0.295)), as_mesh()) == pytest.approx(0.005)
    assert penetration(can.moved_to(Pose.at(0.0, 0.0, 0.31)), as_mesh()) < 0


@pytest.mark.parametrize(
    ("vertices", "told"),
    [
        (CORNERS[:3], "tuple of 4 to 64"),
        ([*CORNERS, (0.0, 0.0, 0.1)], r"\(0.0, 0.0, 0.1\) of 'mesh' is no corner"),
        ([(x + 0.1, y, z) for x, y, z in CORNERS], "centre of mass at .* must be the origin"),
        ([(x + 0.1 * y, y, z) for x, y, z in CORNERS], "not its principal axes"),
        ([(x, y, 0.0) for x, y, z in CORNERS], "'mesh': .* one plane"),
        ([(x, y, math.nan) for x, y, z in CORNERS], "must be a number"),
        ([(x, y) for x, y, z in CORNERS], "must be 3 numbers"),
    ],
)
def test_a_mesh_that_is_none(vertices: list[Any], told: str) -> None:
    with pytest.raises(SceneError, match=told):
        ConvexMesh("mesh", tuple(vertices), Pose())


def test_principal_makes_a_mesh_of_any_corners() -> None:
    """A wedge stands where its points were: its reach along x from there."""
    points = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 0.5)]
    wedge = [(x, y, z) for x, _, z in points for y in (0.0, 0.4)]
    vertices, frame = principal(wedge)
    mesh = ConvexMesh("wedge", vertices, frame, 1.0)
    assert mesh.volume == pytest.approx(0.1)
    right = mesh.reach((frame.rotation().T @ [1.0, 0.0, 0.0])[None])[0] + frame.position[0]
    assert right == pytest.approx(1.0)


PULL = Wrench(force=(1.0, -2.0, 3.0), torque=(0.1, 0.0, 0.2), start=0.1, end=0.25)


@given(st.floats(1e-4, 0.05), st.floats(0.0, 1.0), st.floats(1e-3, 1.0))
def test_whatever_the_step_the_momentum_is_the_same(dt: float, start: float, last: float) -> None:
    wrench = Wrench(force=(2.0, 0.0, -1.0), start=start, end=start + last)
    steps = math.ceil((start + last) / dt) + 2
    given = sum(dt * wrench.mean(k * dt, (k + 1) * dt) for k in range(steps))
    assert given == pytest.approx(last * np.array([2.0, 0.0, -1.0, 0.0, 0.0, 0.0]), abs=1e-9)


def test_a_step_within_has_all_of_it_and_one_outside_nothing() -> None:
    assert PULL.mean(0.15, 0.16) == pytest.approx([1.0, -2.0, 3.0, 0.1, 0.0, 0.2])
    assert not PULL.mean(0.05, 0.1).any()
    assert not PULL.mean(0.25, 0.3).any()
    assert PULL.mean(0.08, 0.12)[:3] == pytest.approx([0.5, -1.0, 1.5])


@pytest.mark.parametrize(
    "body",
    [
        *ROUNDS,
        as_mesh(mass=2.0),
        UNIT.moved_to(Pose.at(1, 2, 3, yaw=0.3)),
        UNIT.changed(mass=2.0, linear_velocity=(1.0, 2.0, 3.0), angular_velocity=(0.0, 0.0, -1.0)),
        UNIT.changed(mass=1.0, restitution=0.5, linear_damping=0.1, angular_damping=0.2),
        UNIT.changed(mass=1.0, moments=(0.2, 0.3, 0.4)),
        UNIT.changed(mass=1.0, wrenches=(PULL, Wrench(torque=(1.0, 0.0, 0.0)))),
        UNIT.changed(prescribed=True, linear_velocity=(1.0, 0.0, 0.0)),
    ],
)
def test_a_body_crosses(body: Body) -> None:
    assert Body.from_wire(json.loads(json.dumps(body.to_wire()))) == body


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"force": (1.0, 2.0)}, "the force [N] of a wrench is (1.0, 2.0); it must be 3 numbers"),
        ({"torque": (0.0, math.nan, 0.0)}, "the torque [N m] of a wrench is nan"),
        ({"start": 1.0, "end": 1.0}, "a wrench starts at 1.0 s and ends at 1.0 s"),
        ({"start": -1.0}, "the start [s] of a wrench is -1.0"),
        ({"end": -1.0}, "the end [s] of a wrench is -1.0"),
    ],
)
def test_what_no_force_can_be(values: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError) as caught:
        Wrench(**values)
    assert message in str(caught.value)


SHAPES = (
    Box("wall", (0.02, 0.1, 0.2), Pose.at(0.05, 0, 0)),
    Cylinder("rod", 0.01, 0.1, Pose((-0.05, 0, 0), (0.8, 0.6, 0.0, 0.0))),
    Sphere("knob", 0.03, Pose.at(0, 0, -0.1)),
)


def thing(**given: Any) -> Compound:
    place = given.pop("pose", Pose.at(0.3, 0.2, 0.5, yaw=0.4))
    shapes = given.pop("shapes", SHAPES)
    return Compound("thing", shapes, place, **{"mass": 1.0, "moments": (2e-3,) * 3, **given})


def test_it_crosses_with_its_shapes() -> None:
    told = json.loads(json.dumps(thing().to_wire()))
    assert Scene.from_wire({"name": "s", "bodies": [told]}).bodies == (thing(),)


def test_it_reaches_as_far_as_its_farthest_shape() -> None:
    body = thing()
    assert body.extents == pytest.approx((2 * 0.06, 2 * (0.96 * 0.05 + 0.28 * 0.01), 2 * 0.13))
    down = np.array([[0.0, 0.0, -1.0]])
    assert body.reach_placed(down)[0] == pytest.approx(-0.5 + 0.13)


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-3.0, 3.0))
def test_it_overlaps_as_deep_as_one_of_its_shapes(x: float, z: float, yaw: float) -> None:
    other = Box("box", (0.05, 0.06, 0.07), Pose.at(0.3 + x, 0.2, 0.5 + z, yaw=yaw))
    body = thing()
    shapes = [shape.moved_to(body.pose * shape.pose) for shape in SHAPES]
    deepest = max(penetration(shape, other) for shape in shapes)
    assert max(penetration(body, other), 0.0) == pytest.approx(max(deepest, 0.0), abs=1e-9)
    assert max(penetration(other, body), 0.0) == pytest.approx(max(deepest, 0.0), abs=1e-9)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"shapes": ()}, "has no shapes"),
        ({"shapes": (SHAPES[0], SHAPES[0])}, "2 shapes of 'thing' are named 'wall'"),
        ({"shapes": (replace(SHAPES[0], mass=1.0),)}, "without a mass"),
        ({"shapes": (thing(mass=0.0),)}, "must be one shape"),
        ({"friction": 0.5}, "all shapes of a body have its"),
        ({"moments": None}, "no `moments`"),
    ],
)
def test_what_cannot_be_is_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        thing(**given)


def test_what_is_drawn_of_a_can_and_of_a_pill() -> None:
    pose = Pose.at(1.0, 0.0, 0.5)
    assert Cylinder("can", 0.1, 0.3, pose, 1.0).solids() == [Solid("tube", (0.2, 0.2, 0.3))]
    drawn = [(solid.kind, solid.extents) for solid in Capsule("pill", 0.1, 0.3, pose, 1.0).solids()]
    assert drawn == [("tube", (0.2, 0.2, 0.3)), *[("ball", (0.2, 0.2, 0.2))] * 2]
