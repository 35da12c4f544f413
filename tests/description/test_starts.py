"""Stored starts: what is read, what is refused, and how many really differ."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pytest_simbench.description.starts import distinct, read_starts
from pytest_simbench.ground.errors import DescriptionError
from pytest_simbench.scene import Box, Pose, Scene

SCENE = Scene(
    "s", tuple(Box(name, (0.1,) * 3, Pose.at(x, 0, 0.1), 1.0) for name, x in (("a", 0), ("b", 1)))
)


def rows(*places: tuple[float, float, float]) -> np.ndarray:
    return np.array([[*place, 1.0, 0.0, 0.0, 0.0] for place in places])


def test_equal_starts_elsewhere_on_the_table_are_one(tmp_path: Path) -> None:
    a = rows((0, 0, 1), (0.5, 0, 1), (0, 0, 1))
    b = rows((0, 0, 2), (0.5, 0, 2), (0, 0.1, 2))
    np.savez(tmp_path / "starts.npz", a=a, b=b)
    starts = read_starts(tmp_path / "starts.npz", SCENE)
    assert [dict(start)["b"].position for start in starts] == [(0, 0, 2), (0.5, 0, 2), (0, 0.1, 2)]
    assert distinct(starts) == 2
    assert distinct(starts[:2]) == 1


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"c": rows((0, 0, 0))}, "'c', which is no free body of scene 's'; it has a, b"),
        ({"a": np.zeros((2, 3))}, r"must hold an array \(n, 7\)"),
        ({"a": rows((0, 0, 0)), "b": rows((0, 0, 0), (1, 0, 0))}, "of the same n"),
        ({"a": rows((0, 0, np.nan))}, "not all finite"),
        ({"a": np.zeros((1, 7))}, "quaternion of 'a' in row 0 has no unit length"),
        ({}, r"must hold an array \(n, 7\)"),
    ],
)
def test_bad_starts_are_one_sentence(
    arrays: dict[str, np.ndarray], message: str, tmp_path: Path
) -> None:
    np.savez(tmp_path / "starts.npz", **arrays)
    with pytest.raises(DescriptionError, match=message):
        read_starts(tmp_path / "starts.npz", SCENE)


def test_no_such_file_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(DescriptionError, match="cannot read the file"):
        read_starts(tmp_path / "none.npz", SCENE)
