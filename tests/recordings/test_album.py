"""Pictures by phase and moment: the first of each, in the order of time, written and read back, and
refused where they are none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_simbench.recordings.album import GLANCES, SIZE, Album
from tests.hostile import HOSTILE


def plain(grey: int) -> np.ndarray:
    return np.full((3, 4, 3), grey, dtype=np.uint8)


def test_the_first_picture_of_a_phase_is_kept(tmp_path: Path) -> None:
    album, asked = Album(), []

    def render(width: int, height: int) -> np.ndarray:
        asked.append((width, height))
        return plain(len(asked))

    for time, phase in enumerate(("pick", "place", "pick", *HOSTILE[:3])):
        album.look(phase, time, render)
    assert asked == [SIZE] * 5
    album.write(tmp_path, "pictures/x.npz")
    read = Album.read(tmp_path / "pictures" / "x.npz")
    assert list(read.pictures) == [f"after {name}" for name in ("pick", "place", *HOSTILE[:3])]
    assert list(read.times.values()) == [0, 1, 3, 4, 5]
    np.testing.assert_array_equal(read.pictures["after place"], plain(2))


def test_a_moment_is_shown_by_the_nearest_glance() -> None:
    album = Album()
    for k in range(GLANCES + 10):
        album.glance(0.04 * k, plain(k % 256))
    album.look("throw", 9.0, lambda width, height: plain(0))
    album.find("impact", 8.05)  # between 8.04 and 8.08
    album.find("impact", 8.2)  # the first counts
    album.find("of the past", 0.2)  # longer ago than glances are kept
    album.find("never", 100.0)
    assert list(album.pictures) == ["impact", "after throw"]
    assert album.times["impact"] == pytest.approx(8.04)
    np.testing.assert_array_equal(album.pictures["impact"], plain(201))


@pytest.mark.parametrize(
    "arrays",
    [
        {"times": [1.0]},
        {"times": [1.0], "picture_0": np.zeros((3, 4, 3))},
        {"times": [1.0], "picture_0": np.zeros((3, 4), dtype=np.uint8)},
        {"times": [1.0], "picture_0": np.zeros((3, 4, 3, 2), dtype=np.uint8)},
        {"picture_0": plain(0)},
        {"times": [np.nan], "picture_0": plain(0)},
        {"times": ["1"], "picture_0": plain(0)},
        {"times": [[1.0]], "picture_0": plain(0)},
        {"times": np.float64(1.0), "picture_0": plain(0)},
    ],
)
def test_what_is_no_album_is_refused(arrays: Any, tmp_path: Path) -> None:
    np.savez(tmp_path / "x.npz", phases=["pick"], **arrays)
    told = "(picture 0 is none|it does not tell its times)"
    with pytest.raises(ValueError, match=f"is no album of a repetition: {told}"):
        Album.read(tmp_path / "x.npz")


def test_a_phase_that_is_no_list_is_refused(tmp_path: Path) -> None:
    """Found by the fuzz test of run folders."""
    np.savez(tmp_path / "x.npz", phases=np.array(3 + 2j), times=np.zeros(3))
    with pytest.raises(ValueError, match="it does not tell its times"):
        Album.read(tmp_path / "x.npz")
