"""Pictures by phase: the first of each, written, read back, and refused where they are none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_simbench.recordings.album import SIZE, Album
from tests.hostile import HOSTILE


def plain(grey: int) -> np.ndarray:
    return np.full((3, 4, 3), grey, dtype=np.uint8)


def test_the_first_picture_of_a_phase_is_kept(tmp_path: Path) -> None:
    album, asked = Album(), []

    def render(width: int, height: int) -> np.ndarray:
        asked.append((width, height))
        return plain(len(asked))

    for phase in ("pick", "place", "pick", *HOSTILE[:3]):
        album.look(phase, render)
    assert asked == [SIZE] * 5
    album.write(tmp_path / "pictures" / "x.npz")
    read = Album.read(tmp_path / "pictures" / "x.npz")
    assert list(read.pictures) == ["pick", "place", *HOSTILE[:3]]
    np.testing.assert_array_equal(read.pictures["place"], plain(2))


@pytest.mark.parametrize(
    "arrays",
    [
        {"phases": ["pick"]},
        {"phases": ["pick"], "picture_0": np.zeros((3, 4, 3))},
        {"phases": ["pick"], "picture_0": np.zeros((3, 4), dtype=np.uint8)},
        {"phases": ["pick"], "picture_0": np.zeros((3, 4, 3, 2), dtype=np.uint8)},
    ],
)
def test_what_is_no_album_is_refused(arrays: Any, tmp_path: Path) -> None:
    np.savez(tmp_path / "x.npz", **arrays)
    with pytest.raises(ValueError, match="is no album of a repetition: picture 0 is none"):
        Album.read(tmp_path / "x.npz")
