"""What is compared, what a declared deviation excuses, and what stands in the record."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pytest_simbench.description.shapes import DIRECTIONS
from pytest_simbench.parity.compare import Lasting, check, compare, misfit
from pytest_simbench.parity.quantities import constants
from pytest_simbench.parity.readback import one_value
from pytest_simbench.scene import Box, Pose, Scene
from pytest_simbench.simulator import Deviation, ParityError

SOFT = Deviation("", "contacts are soft")
NO_ROTOR = Deviation("joint/*/armature", "no rotor inertia")
ROUND = Deviation("link/*/meshes body/*/boxes", "corners are rounded", within=1e-3)
EXPECTED = {"gravity": [0, 0, -9.8], "joint/a/armature": 0.1, "link/a/meshes": np.ones((1, 26))}


def test_equal_values_are_one_number_and_different_ones_are_all_told() -> None:
    assert one_value([87.0, 87.0]) == 87.0
    assert np.ndim(one_value(np.full((2, 3), 0.5))) == 0
    assert list(one_value([[1.0, 0.5], [1.0, 1.0]])) == [0.5, 1.0]


def test_what_is_not_told_is_told_once_with_its_reason() -> None:
    expected = {**EXPECTED, "joint/b/armature": 0.1}
    reported = {k: v for k, v in expected.items() if "armature" not in k}
    assert check(expected, reported, (NO_ROTOR,), "sim") == [
        "joint/*/armature: no rotor inertia (not told by the engine)"
    ]


def test_an_excused_difference_is_told_with_both_values() -> None:
    reported = {**EXPECTED, "joint/a/armature": 0.0}
    assert check(EXPECTED, reported, (NO_ROTOR,), "sim") == [
        "joint/*/armature: no rotor inertia (joint/a/armature: scene 0.1, sim 0.)"
    ]


def test_a_difference_is_excused_up_to_its_declared_size() -> None:
    near = {**EXPECTED, "link/a/meshes": np.full((1, 26), 1.0005)}
    assert check(EXPECTED, near, (ROUND,), "sim") == [
        "link/*/meshes body/*/boxes: corners are rounded (differs by at most 0.001)"
    ]


def test_a_size_does_not_excuse_silence() -> None:
    reported = {k: v for k, v in EXPECTED.items() if k != "link/a/meshes"}
    with pytest.raises(ParityError, match="link/a/meshes: sim reports nothing"):
        check(EXPECTED, reported, (ROUND,), "sim")


@pytest.mark.parametrize(
    ("name", "value", "near", "far"),
    [
        ("gravity", [0.0, 0.0, -9.8], [0.9e-6, 0.0, -9.8], [1.1e-6, 0.0, -9.8]),
        *(("gravity", [0.0, 0.0, -9.8], [0.0, 0.0, -9.8], kind)
          for kind in (np.nan, [0, 0], [0, 0, -9.8, 0])),
        ("joint/a/limits", [0.0, 2.0], [0.0, 2.00019], [0.0, 2.0003]),
        ("body/a/pose", [0, 0, 0, 1, 0, 0, 0], [9e-7, 0, 0, 1, 0, 0, 0], [2e-6, 0, 0, 1, 0, 0, 0]),
        ("body/a/pose", [1, 2, 3, *[0.5] * 4], [1, 2, 3, *[-0.5] * 4], [1, 2, 3, *[0.5] * 3, -0.5]),
        ("body/a/pose", [0, 0, 0, 1, 0, 0, 0], [0, 0, 0, 0.99999, 0, 0, 0], [0, 0, 0, 0, 1, 0, 0]),
        ("link/a/pose", [0, 0, 0, 1, 0, 0, 0], [9e-6, 0, 0, 1, 0, 0, 0], [2e-5, 0, 0, 1, 0, 0, 0]),
        ("body/a/boxes", [[0.0, 1.0]], [[9e-6, 1.0]], [[2e-5, 1.0]]),
        ("body/a/meshes", [[0.0, 1.0]], [[9e-6, 1.0]], [[2e-5, 1.0]]),
        ("body/a/meshes", np.zeros((0, 26)), np.zeros((0, 26)), np.zeros((1, 26))),
        ("body/a/com", [0.0, 0.0, 0.0], [9e-6, 0.0, 0.0], [2e-5, 0.0, 0.0]),
        ("joint/a/axis", [0, 0, 1, 0, 0, 0], [9e-6, 0, 1, 0, 0, 0], [2e-5, 0, 1, 0, 0, 0]),
        ("link/a/mass", 1e-3, 1.00009e-3, 1.0002e-3),
        ("body/a/mass", 2.0, 2.00019, 2.0003),
        ("link/a/inertia", [1e-6, 0.0, 1e-7], [1e-6, 9e-11, 1e-7], [1e-6, 2e-10, 1e-7]),
        ("body/a/inertia", np.zeros((3, 3)), np.full((3, 3), 9e-13), np.full((3, 3), 2e-12)),
    ],
)  # fmt: skip
def test_how_near_is_equal(name: str, value: object, near: object, far: object) -> None:
    """Up to 1e-4 of the value and 1e-6; 1e-5 m where single precision composes poses. A quaternion
    and its negative are one rotation, and no other is."""
    assert not compare({name: value}, {name: near}, (), "sim").wrong
    assert name in compare({name: value}, {name: far}, (), "sim").wrong


def test_what_the_comparison_says_word_by_word() -> None:
    expected = {
        "gravity": [0, 0, -9.80665123],
        "link/a/inertia": np.diag([1.0, 2.0, 3.0]),
        "link/a/meshes": np.ones((1, 26)),
        "link/b/meshes": np.ones((1, 26)),
        "joint/a/armature": 0.1,
    }
    reported = {
        "gravity": [0, 0, -1],
        "link/a/inertia": np.diag([2.0, 1.0, 3.0]),
        "link/a/meshes": np.full((1, 26), 1.25),
        "link/b/meshes": np.ones((2, 26)),
        "body/z/mass": 1,
    }
    found = compare(expected, reported, (SOFT, ROUND), "sim")
    declared = " (declared is at most 0.001: corners are rounded)"
    assert found.wrong == {
        "gravity": "scene [ 0.      ,  0.      , -9.806651], sim [ 0.,  0., -1.]",
        "link/a/inertia": "scene [[1., 0., 0.], [0., 2., 0.], [0., 0., 3.]], "
        "sim [[2., 0., 0.], [0., 1., 0.], [0., 0., 3.]]",
        "link/a/meshes": "scene 1x26 numbers, sim 1x26 numbers, which differ by up to 0.25"
        + declared,
        "link/b/meshes": "scene 1x26 numbers, sim 2x26 numbers" + declared,
        "joint/a/armature": "sim reports nothing, and declares no deviation",
        "body/z/mass": "reported, but not part of the scene",
    }
    assert list(found.untold) == []
    assert list(found.deviations) == ["contacts are soft"]


def test_the_first_ten_differences_are_told() -> None:
    expected = {f"joint/{k:02}/damping": float(k) for k in range(11)}
    reported = {name: value + 1 for name, value in expected.items()}
    with pytest.raises(ParityError) as caught:
        check(expected, reported, (), "sim")
    parts = [f"joint/{k:02}/damping: scene {k}., sim {k + 1}." for k in range(10)]
    start = "sim built another world than the scene describes: "
    assert str(caught.value) == start + "; ".join(parts) + "; and 1 more"
    ten = dict(list(expected.items())[:10])
    with pytest.raises(ParityError) as caught:
        check(ten, dict(list(reported.items())[:10]), (), "sim")
    assert str(caught.value) == start + "; ".join(parts)


def test_what_is_untold_is_named_and_the_first_difference_stands_for_all() -> None:
    names = [f"joint/{joint}/armature" for joint in "abc"]
    expected = dict.fromkeys(names, 0.1)
    found = compare(expected, {names[1]: 0.2, names[2]: 0.3}, (SOFT, NO_ROTOR), "sim")
    assert not found.wrong
    assert list(found.untold) == [names[0]]
    assert list(found.deviations) == [
        "contacts are soft",
        "joint/*/armature: no rotor inertia (not told by the engine; joint/b/armature: "
        "scene 0.1, sim 0.2)",
    ]


def test_a_difference_of_just_the_declared_size_is_excused() -> None:
    half = Deviation("gravity", "why not", within=0.5)
    assert not compare({"gravity": 1.0}, {"gravity": 1.5}, (half,), "sim").wrong
    assert compare({"gravity": 1.0}, {"gravity": 1.5000001}, (half,), "sim").wrong
    assert compare({"gravity": 1.0}, {"gravity": 0.0}, (half,), "sim").wrong


def test_a_body_touches_elsewhere_by_its_reach_and_its_margin_across() -> None:
    upright = np.zeros((1, 26))
    expected = {"body/peg/boxes": upright, "body/peg/rounds": upright[:0], "body/peg/margin": 0.0}
    grown = upright.copy()
    grown[0, DIRECTIONS[:, 2] == 0.0] -= 1e-4
    grown[0, DIRECTIONS[:, 2] > 0.9] += 1.0  # it is longer, too, which leaves its width
    assert misfit(expected, {"body/peg/boxes": grown}, "peg") == pytest.approx(1e-4)
    told = {**expected, "body/peg/boxes": grown, "body/peg/margin": 1e-3}
    assert misfit(expected, told, "peg") == pytest.approx(1.1e-3)
    assert misfit(expected, {}, "peg") == 0.0


SHELF = Box("shelf", (0.1, 0.1, 0.1), Pose.at(1.0, 0.0, 0.05))
REACH = np.ones((1, 10))
LASTS = {
    **{f"body/can/{name}": 1.0 for name in ("mass", "friction", "margin", "gravity", "com")},
    "body/shelf/pose": np.zeros(7), "link/base/pose": np.zeros(7), "body/can/boxes": REACH,
    "body/can/rounds": REACH, "body/can/pose": np.zeros(7), "link/hand/pose": np.zeros(7),
    "body/can/velocity": np.zeros(6), "joint/a/initial_position": 0.0,
}  # fmt: skip


def test_what_lasts_is_held_against_the_first_reading() -> None:
    """But for what moves. A shape may differ by twice what the engine declares. The first
    difference is told with both values, three more by their names."""
    near = replace(ROUND, quantity="body/*/boxes body/*/margin")
    lasting = Lasting(LASTS, Scene("s", (SHELF,)), "sim", (near, replace(near, within=None)))
    fine = {"body/can/boxes": 1.0019 * REACH, "body/can/mass": 1.00009}
    lasting.check({**LASTS, **dict.fromkeys([*LASTS][-4:], 5.0), **fine}, 0.1)
    base = "link/fixed base/pose"  # where another one is named base
    assert constants(("link/base/pose", base), Scene("s")) == [base]
    for wrong, said in (
        ({"body/can/boxes": 1.0021 * REACH}, "t = 0.123 s, which differ by up to 0.0021$"),
        ({"body/can/boxes": np.ones((2, 10))}, "1x10 numbers .*, 2x10 numbers at t = 0.123 s$"),
        ({"body/can/rounds": 1.0019 * REACH}, "t = 0.123 s, which differ by up to 0.0019$"),
        ({"body/can/margin": 1.0019}, "1. when it was loaded, 1.0019 at t = 0.123 s$"),
        ({"body/can/mass": None}, "mass while it ran: 1. .*, not told at t = 0.123 s$"),
        ({"body/can/new": 2.0}, "new while it ran: not told .*, 2. at t = 0.123 s$"),
        (dict.fromkeys([*LASTS][5:7], np.ones(7)), "body/shelf/pose .*; and link/base/pose$"),
        (dict.fromkeys([*LASTS][:4], 2.0), "; and .*friction, .*/margin, .*/gravity$"),
        (dict.fromkeys([*LASTS][:5], 2.0), "; and .*friction, .*/margin, .*/gravity and 1 more$"),
    ):
        told = {name: value for name, value in {**LASTS, **wrong}.items() if value is not None}
        with pytest.raises(ParityError, match=said):
            lasting.check(told, 0.1234)
