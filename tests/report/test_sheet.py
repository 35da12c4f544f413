"""The contact sheet: a row of pictures for each simulator, in the folder and on the page."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

from pytest_simbench.experiment.identity import file_stem_of
from pytest_simbench.recordings.album import Album
from pytest_simbench.records.record import Record
from pytest_simbench.report.figures.sheet import sheet_name, sheets
from pytest_simbench.report.files import write_files
from pytest_simbench.report.model.summary import summarise
from tests.hostile import HOSTILE

from .samples import METRICS, record

matplotlib = pytest.importorskip("matplotlib", reason="pictures need the extra 'figures'")
COLOURS = {"red": (255, 0, 0), "green": (0, 255, 0), "blue": (0, 0, 255)}


def keep(run: Path, made: Record, **phases: str) -> Record:
    """An album in a run folder: pictures of one colour each, by phase."""
    album = Album()
    for time, (phase, colour) in enumerate(phases.items()):
        picture = np.full((36, 48, 3), COLOURS[colour], dtype=np.uint8)
        album.add(phase, time, picture)
    album.write(run, f"pictures/{file_stem_of(made)}.npz")
    return made


def seen(sheet: bytes) -> np.ndarray:
    from matplotlib.image import imread

    picture: np.ndarray = (imread(io.BytesIO(sheet), format="png")[:, :, :3] * 255).astype(int)
    return picture


def test_pictures_stand_by_simulator_and_phase(tmp_path: Path) -> None:
    kept = [
        keep(tmp_path, record("drake"), pick="red", place="green"),
        keep(tmp_path, record("mujoco"), pick="blue"),
        record("dart"),
    ]
    drawn, problems = sheets(tmp_path, kept)
    assert problems == []
    assert list(drawn) == ["stacking"]
    picture = seen(drawn["stacking"])
    height, width = picture.shape[:2]
    left = width - 2 * 2.0 * 110  # two columns of pictures
    places = {
        (line, column): tuple(
            picture[int(height * (0.3 + 0.45 * line)), int(left + 110 + 220 * column)]
        )
        for line in (0, 1)
        for column in (0, 1)
    }
    assert places == {
        (0, 0): COLOURS["red"], (0, 1): COLOURS["green"],
        (1, 0): COLOURS["blue"], (1, 1): (255, 255, 255),
    }  # fmt: skip


def test_a_moment_that_one_alone_has_stands_at_its_time(tmp_path: Path) -> None:
    """Columns: pick, impact, place. Only the second simulator hit anything."""
    kept = [
        keep(tmp_path, record("drake"), pick="red", later="red", place="green"),
        keep(tmp_path, record("mujoco"), pick="blue", impact="green", place="blue"),
    ]
    path = tmp_path / "pictures" / f"{file_stem_of(kept[0])}.npz"
    album = Album.read(path)
    del album.pictures["later"]
    album.write(path.parent, path.name)
    picture = seen(sheets(tmp_path, kept)[0]["stacking"])
    height, width = picture.shape[:2]
    middle = width - int(1.5 * 220)
    assert tuple(picture[int(height * 0.3), middle]) == (255, 255, 255)
    assert tuple(picture[int(height * 0.75), middle]) == COLOURS["green"]


def test_it_is_in_the_folder_and_on_the_page(tmp_path: Path) -> None:
    kept = [keep(tmp_path, record("drake"), pick="red")]
    written = write_files(tmp_path, summarise(kept, METRICS, {}), kept)
    assert written.problems == ()
    assert (tmp_path / sheet_name("stacking")).read_bytes().startswith(b"\x89PNG")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.count('src="data:image/png;base64,iVBOR') == 1
    assert "img-src data:;" in page


def test_hostile_names_do_no_harm(tmp_path: Path) -> None:
    for text in HOSTILE:
        made = record(text, test=f"t[{text}]")
        album = Album()
        album.add(text, 0.0, np.zeros((3, 4, 3), dtype=np.uint8))
        album.write(tmp_path, f"pictures/{file_stem_of(made)}.npz")
        drawn, problems = sheets(tmp_path, [made])
        assert problems == []
        assert drawn["stacking"].startswith(b"\x89PNG")


def test_what_cannot_be_read_is_told(tmp_path: Path) -> None:
    made = keep(tmp_path, record("drake"), pick="red")
    (tmp_path / "pictures" / f"{file_stem_of(made)}.npz").write_text("no zip")
    drawn, problems = sheets(tmp_path, [made])
    assert drawn == {}
    assert len(problems) == 1
    assert "holds no arrays" in problems[0]
