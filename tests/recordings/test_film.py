"""Pictures by phase and moment, and films: written and read back, whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_simbench.recordings import film
from pytest_simbench.recordings.film import GLANCES, SIZE, Album, Film, FilmsUnavailable
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
    album.find("end", 8.41)  # of the last one, 8.36
    album.find("later", 8.43)
    assert list(album.pictures) == ["impact", "end", "after throw"]
    assert album.times["impact"] == pytest.approx(8.04)
    np.testing.assert_array_equal(album.pictures["impact"], plain(201))
    for k in range(film.MOST):
        album.look(str(k), 10.0 + k, lambda width, height: plain(0))
    assert (len(album.pictures), [*album.pictures][-1]) == (film.MOST, f"after {film.MOST - 4}")


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


av = pytest.importorskip("av", reason="videos need the extra 'video'")

TIMES = (1.0, 1.04, 1.08, 1.125, 1.165)
"""Of a simulator whose steps do not make 40 ms, with a motion between two films' steps."""


def grey(level: int, height: int = 36, width: int = 48) -> np.ndarray:
    return np.full((height, width, 3), level, dtype=np.uint8)


def shown(path: Path) -> list[tuple[float, float]]:
    """Time and mean grey of each picture."""
    with av.open(str(path)) as container:
        return [
            (float(frame.time), frame.to_ndarray(format="gray").mean())
            for frame in container.decode(video=0)
        ]


def test_each_picture_stands_at_its_time(tmp_path: Path) -> None:
    made = Film(tmp_path, "videos/x.mp4")
    for k, time in enumerate(TIMES):
        made.take(time, grey(50 * k))
    made.take(TIMES[0], grey(255))  # a task went back: the film does not
    assert not made.path.exists()
    made.finish()
    assert (made.problem, made.frames) == ("", len(TIMES))
    times, greys = zip(*shown(made.path), strict=True)
    assert times == pytest.approx([time - TIMES[0] for time in TIMES], abs=1e-3)
    assert greys == pytest.approx([50 * k for k in range(len(TIMES))], abs=4)
    assert [path.name for path in made.path.parent.iterdir()] == ["x.mp4"]


@pytest.mark.parametrize("frames", [0, 3])
def test_nothing_stays_of_one_that_is_not_kept(tmp_path: Path, frames: int) -> None:
    made = Film(tmp_path, "videos/x.mp4")
    for time in TIMES[:frames]:
        made.take(time, grey(0))
    made.finish(keep=frames == 0)
    made.take(2.0, grey(0))  # that was still on its way
    assert made.problem == ""
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_odd_edges_lose_a_row(tmp_path: Path) -> None:
    made = Film(tmp_path, "x.mp4")
    made.take(0.0, grey(100, 37, 51))
    made.finish()
    assert made.problem == ""
    with av.open(str(made.path)) as container:
        assert [(frame.width, frame.height) for frame in container.decode(video=0)] == [(50, 36)]


def test_what_cannot_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / "videos").write_text("no folder")
    made = Film(tmp_path, "videos/x.mp4")
    for time in TIMES:
        made.take(time, grey(0))
    made.finish()
    assert made.problem.startswith(f"{tmp_path}/videos/x.mp4 could not be written (")


def test_what_is_missing_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(film, "find_spec", lambda name: None if name == "av" else name)
    with pytest.raises(FilmsUnavailable, match=r"pip install 'pytest-simbench\[video\]'"):
        film.check_available()
