"""The tosses, and tensors in files of torch's first format."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.lib.stride_tricks import as_strided

from pytest_simbench.data import DataError, Toss, Tosses, tosses
from pytest_simbench.data.torch_file import MAGIC, VERSION, read_tensor
from tests.data.samples import edited, falling, torch_file


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    tosses.write(tmp_path / "contactnets_cube_tosses_a.npz", [0, 3], [falling(), falling(30)])
    tosses.write(tmp_path / "contactnets_cube_tosses_b.npz", [1, 3], [falling(5), falling(30)])
    return tmp_path


def test_files_are_joined_and_halves_are_of_even_and_odd_numbers(folder: Path) -> None:
    found = tosses.read(folder)
    assert [(toss.index, len(toss.state)) for toss in found.items] == [(0, 20), (1, 5), (3, 30)]
    assert [toss.index for toss in found.half("chosen_on")] == [0]
    assert [toss.index for toss in found.half("held_out")] == [1, 3]
    assert len(found.half("all")) == 3


def test_states_of_single_precision_are_read_in_double(tmp_path: Path) -> None:
    tosses.write(tmp_path / "contactnets_cube_tosses.npz", [0], [falling().astype(np.float32)])
    assert tosses.read(tmp_path).items[0].state.dtype == float


def test_sets_are_equal_when_their_tosses_are(folder: Path) -> None:
    one, other = tosses.read(folder), tosses.read(folder)
    assert one == other
    assert hash(one) == hash(other)
    assert one != Tosses(one.items[:2] if one else ())


def test_the_angular_velocity_is_turned_into_the_world() -> None:
    state = falling()
    state[0, 3:7] = np.sqrt(0.5), 0, 0, np.sqrt(0.5)  # a quarter turn about z: body x is world y
    state[0, 10:13] = 2.0, 0.0, 0.0
    assert Toss(0, state).angular_velocity == pytest.approx((0.0, 2.0, 0.0))
    assert Toss(0, state).linear_velocity == (1.0, 0.0, 0.0)


def test_a_folder_without_tosses_is_none(tmp_path: Path) -> None:
    assert tosses.read(tmp_path) is None


def arrays() -> dict[str, Any]:
    return {"toss_index": np.array([0, 1]), "length": np.array([2, 3]), "state": falling(5)}


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (lambda found: found.pop("length"), "the array 'length' is missing"),
        (edited("toss_index", np.array([1, 1])), "toss_index has a number twice or below 0"),
        (edited("toss_index", np.array([0.5, 1])), "must be as many whole numbers"),
        (edited("length", np.array([5])), "must be as many whole numbers"),
        (edited("length", np.array([4, 1])), "a toss has under 2 rows"),
        (edited("state", falling(4)), r"state has the shape \(4, 13\).*ask for 5 rows of 13"),
        (edited("state", np.full((5, 13), np.nan)), "no numbers, too large, or no rotation"),
        (edited("state", np.zeros((5, 13))), "no rotation"),
        (edited("state", np.tile([0.0, 0, -100, 1, *[0] * 9], (5, 1))), "too large"),
    ],
)
def test_arrays_that_are_no_tosses_are_one_sentence(
    tmp_path: Path, spoil: Callable[[dict[str, Any]], None], sentence: str
) -> None:
    found = arrays()
    spoil(found)
    np.savez(tmp_path / "contactnets_cube_tosses_190.npz", **found)
    with pytest.raises(DataError, match=sentence) as caught:
        tosses.read(tmp_path)
    assert str(tmp_path) in str(caught.value)


@pytest.mark.parametrize("share", [0.0, 0.5, 0.99])
def test_a_file_that_is_cut_off_is_one_sentence(folder: Path, share: float) -> None:
    path = folder / "contactnets_cube_tosses_a.npz"
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(DataError, match="contactnets_cube_tosses_a.npz holds no arrays"):
        tosses.read(folder)


ROWS = np.arange(24.0).reshape(1, 4, 6)


@pytest.mark.parametrize(("kind", "order"), [("Double", "C"), ("Double", "F"), ("Float", "C")])
def test_a_tensor_is_what_torch_wrote(kind: str, order: Any) -> None:
    """However far it is from one to the next where there is only one."""
    for rows in (ROWS, ROWS[0][None], np.asfortranarray(ROWS[0])[None]):
        assert (read_tensor(torch_file(rows, kind, order), "x.pt") == ROWS).all()


def laid(*strides: int) -> bytes:
    """A tensor that is laid out neither by rows nor by columns."""
    return torch_file(as_strided(np.arange(24.0), (2, 3, 4), [8 * n for n in strides]), order="A")


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (torch_file(ROWS).replace(b"M\xe9\x03", b"M\xea\x03"), "it does not begin like one"),
        (torch_file(ROWS).replace(b"7q\x01a", b"8q\x01a"), "it has not just one storage"),
        (torch_file(ROWS[:0]), "it has not just one storage"),
        (torch_file(ROWS).replace(b"QK\x00", b"QK\x01"), "it is cut off"),
        (laid(0, 4, 1), "its elements lie in an unknown order"),
        (laid(0, 2, 6), "its elements lie in an unknown order"),
    ],
)
def test_why_a_file_is_no_tensor(data: bytes, why: str) -> None:
    with pytest.raises(DataError, match=f"torch wrote them: {why}$"):
        read_tensor(data, "x.pt")


@pytest.mark.parametrize("size", [0, 10, 100, 300, -8, -1])
def test_a_file_that_is_cut_off_is_none(size: int) -> None:
    with pytest.raises(DataError, match=r"^x\.pt is no tensor as torch wrote them: "):
        read_tensor(torch_file(ROWS)[:size], "x.pt")


def test_lengths_of_the_source_are_halves_of_the_edge(tmp_path: Path) -> None:
    """And another tensor is no toss."""
    tensor, half = np.ones((1, 2, 19)), [tosses.EDGE / 2] * 3
    tensor[:, :, 4:7] = 0.0
    tosses.convert({"a/7.pt": torch_file(tensor)}, tmp_path)
    assert (tosses.read(tmp_path).items[0].state == [*half, 1, 0, 0, 0, *half, 1, 1, 1]).all()
    for rows in (ROWS, np.zeros((2, 3, 19)), np.zeros((3, 19))):
        with pytest.raises(DataError, match=r"^7\.pt has the shape .*, not \(1, rows, 19\)$"):
            tosses.convert({"a/7.pt": torch_file(rows)}, tmp_path)


def test_nothing_that_a_file_asks_for_is_run(capfd: pytest.CaptureFixture[str]) -> None:
    class Malicious:
        def __reduce__(self) -> tuple[Any, ...]:
            return os.system, ("echo run",)

    parts = [MAGIC, VERSION, {}, Malicious(), []]
    with pytest.raises(DataError, match=r"it asks for posix\.system"):
        read_tensor(b"".join(pickle.dumps(part, 2) for part in parts), "x.pt")
    assert capfd.readouterr().out == ""
