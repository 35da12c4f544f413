"""A film plays as long as the motion took, and is there whole or not at all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pytest_simbench.recordings import film
from pytest_simbench.recordings.film import Film, FilmsUnavailable

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
    assert len(shown(made.path)) == 1


def test_what_cannot_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / "videos").write_text("no folder")
    made = Film(tmp_path, "videos/x.mp4")
    for time in TIMES:
        made.take(time, grey(0))
    made.finish()
    assert "x.mp4 could not be written" in made.problem


def test_what_is_missing_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(film, "find_spec", lambda name: None)
    with pytest.raises(FilmsUnavailable, match=r"pip install 'pytest-simbench\[video\]'"):
        film.check_available()
