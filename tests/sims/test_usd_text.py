"""Pieces of USD text: turns, masses and meshes keep what they are given."""

from __future__ import annotations

import re

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st
from pytest_simbench.sims.ovphysx.usd_text import attributes, mass_lines, prim, turn_from_x

from pytest_simbench.scene import FloatArray, rotation_matrix

number = st.floats(-1, 1, allow_nan=False)
vectors = st.tuples(number, number, number).filter(lambda v: np.linalg.norm(v) > 0.1)
quaternions = st.tuples(number, number, number, number).filter(lambda q: np.linalg.norm(q) > 0.1)


@given(axis=vectors)
@example((1.0, 0.0, 0.0))
@example((-1.0, 0.0, 0.0))
@example((0.0, -1.0, 0.0))
def test_turn_from_x_brings_x_to_the_axis(axis: tuple[float, float, float]) -> None:
    turned = rotation_matrix(turn_from_x(np.array(axis))) @ [1.0, 0.0, 0.0]
    off = 1e-15 if np.count_nonzero(axis) == 1 else 1e-6
    np.testing.assert_allclose(turned, np.array(axis) / np.linalg.norm(axis), atol=off)


def written(lines: list[str], name: str) -> FloatArray:
    line = next(line for line in lines if f" {name} = " in line)
    return np.array([float(n) for n in re.findall(r"[-+.\de]+", line.partition("= ")[2])])


@given(quaternion=quaternions, moments=st.tuples(*[st.floats(1e-5, 1.0)] * 3))
def test_mass_lines_keep_the_inertia(
    quaternion: tuple[float, ...], moments: tuple[float, ...]
) -> None:
    rotation = rotation_matrix(quaternion)
    inertia = rotation @ np.diag(moments) @ rotation.T
    lines = mass_lines(2.5, np.array([0.1, -0.2, 0.3]), inertia)
    axes = rotation_matrix(written(lines, "physics:principalAxes"))
    principal = written(lines, "physics:diagonalInertia")
    np.testing.assert_allclose(axes @ np.diag(principal) @ axes.T, inertia, atol=1e-9)
    assert written(lines, "physics:mass") == 2.5
    np.testing.assert_array_equal(written(lines, "physics:centerOfMass"), [0.1, -0.2, 0.3])


def test_attributes_are_typed_and_none_is_left_out() -> None:
    values = {"a": True, "b": 3, "c": 0.5, "d": "TGS", "e": None}
    assert attributes("x", values) == [
        "bool x:a = true",
        "int x:b = 3",
        "float x:c = 0.5",
        'uniform token x:d = "TGS"',
    ]


def test_prims_nest() -> None:
    inner = prim("Cube", "shape", (), ["double size = 1"])
    outer = prim("Xform", "body", ("PhysicsRigidBodyAPI",), [], [inner])
    assert (
        outer.splitlines()[0] == 'def Xform "body" (prepend apiSchemas = ["PhysicsRigidBodyAPI"])'
    )
    assert outer.count("{") == outer.count("}") == 2
    assert inner in outer
