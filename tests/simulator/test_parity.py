"""What is compared, what a declared deviation excuses, and what stands in the record."""

from __future__ import annotations

import numpy as np
import pytest

from pytest_simbench.simulator import Deviation, ParityError, one_value
from pytest_simbench.simulator.parity import check, compare

SOFT = Deviation("", "contacts are soft")
NO_ROTOR = Deviation("joint/*/armature", "no rotor inertia")
ROUND = Deviation("link/*/meshes body/*/boxes", "corners are rounded", within=1e-3)
EXPECTED = {"gravity": [0, 0, -9.8], "joint/a/armature": 0.1, "link/a/meshes": np.ones((1, 26))}


def test_equal_values_are_one_number() -> None:
    assert one_value([87.0, 87.0]) == 87.0
    assert np.ndim(one_value(np.full((2, 3), 0.5))) == 0


def test_different_values_are_all_told() -> None:
    assert list(one_value([[1.0, 0.5], [1.0, 1.0]])) == [0.5, 1.0]


def test_free_text_is_always_told() -> None:
    assert check(EXPECTED, EXPECTED, (SOFT, NO_ROTOR, ROUND), "sim") == ["contacts are soft"]


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
    far = {**EXPECTED, "link/a/meshes": np.full((1, 26), 1.002)}
    with pytest.raises(ParityError, match="differ by up to 0.002.*declared is at most 0.001"):
        check(EXPECTED, far, (ROUND,), "sim")


@pytest.mark.parametrize("shapes", [0, 2])
def test_another_number_of_shapes_is_never_excused(shapes: int) -> None:
    reported = {**EXPECTED, "link/a/meshes": np.ones((shapes, 26))}
    with pytest.raises(ParityError, match="link/a/meshes: scene 1x26 numbers"):
        check(EXPECTED, reported, (ROUND,), "sim")


def test_a_size_does_not_excuse_silence() -> None:
    reported = {k: v for k, v in EXPECTED.items() if k != "link/a/meshes"}
    with pytest.raises(ParityError, match="link/a/meshes: sim reports nothing"):
        check(EXPECTED, reported, (ROUND,), "sim")


def test_what_no_scene_asks_for_is_wrong() -> None:
    assert list(compare(EXPECTED, {**EXPECTED, "link/b/mass": 1.0}, (), "sim").wrong) == [
        "link/b/mass"
    ]


@pytest.mark.parametrize("value", [np.nan, [0, 0], [0, 0, -9.8, 0]])
def test_a_value_of_another_kind_differs(value: object) -> None:
    assert "gravity" in compare(EXPECTED, {**EXPECTED, "gravity": value}, (), "sim").wrong


def test_a_tensor_is_compared_as_a_whole() -> None:
    """Off-diagonal elements near zero may differ by what is nothing to the largest one."""
    tensor = {"link/a/inertia": np.diag([1.0, 2.0, 3.0])}
    noisy = {"link/a/inertia": np.diag([1.0, 2.0, 3.0]) + 1e-4}
    assert not compare(tensor, noisy, (), "sim").wrong
    turned = {"link/a/inertia": np.diag([2.0, 1.0, 3.0])}
    assert "link/a/inertia" in compare(tensor, turned, (), "sim").wrong


def test_both_signs_of_a_quaternion_are_one_pose() -> None:
    pose = np.array([1, 2, 3, 0.5, 0.5, 0.5, 0.5])
    flipped = np.concatenate([pose[:3], -pose[3:]])
    assert not compare({"body/a/pose": pose}, {"body/a/pose": flipped}, (), "sim").wrong
