"""Pictures of a run: of tasks, releases, time steps, and the contact sheet of each task."""

from __future__ import annotations

import io
import struct
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.image import imread

from pytest_simbench.experiment.identity import file_stem_of
from pytest_simbench.recordings.film import Album
from pytest_simbench.records.folder import RunContents
from pytest_simbench.records.record import Record
from pytest_simbench.report.figures import front, sweep
from pytest_simbench.report.figures.drawing import FiguresUnavailable, Picture, drawing, write
from pytest_simbench.report.figures.history import FAILS, NOT_ASKED, draw_laws
from pytest_simbench.report.figures.sheet import sheet_name, sheets
from pytest_simbench.report.figures.task import draw, pictures
from pytest_simbench.report.files import write_files
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.model.summary import summarise
from tests.hostile import HOSTILE
from tests.measure.test_law_history import asked, row

from .model.test_laws import SWEPT, law, swept
from .samples import METRICS, REFERENCES, failed, record, stacking_run, throwing_run

COLOURS = {"red": (255, 0, 0), "green": (0, 255, 0), "blue": (0, 0, 255)}
WHITE = (255, 255, 255)


def test_the_folder_holds_the_pictures_of_each_task(tmp_path: Path) -> None:
    records = stacking_run() + throwing_run()
    written = write_files(tmp_path, Report(summarise(records, METRICS, REFERENCES), records))
    assert (written.problems, written.complete) == ([], True)
    drawn = [f"{task}_{name}.png" for task in ("stacking", "throwing")
             for name in ("metrics", "resources", "times")]  # fmt: skip
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["report.csv", "report.html", "report.md", *drawn]
    report = (tmp_path / "report.md").read_text()
    for picture in tmp_path.glob("*.png"):
        head = picture.read_bytes()[:24]
        width, height = struct.unpack(">II", head[16:24])
        assert head.startswith(b"\x89PNG")
        assert 600 < width < 3000
        assert 150 < height < 2000
        assert f"]({picture.name})" in report


def test_a_picture_of_means_tells_what_failed(tmp_path: Path) -> None:
    lost = [failed("WorkerHung", "load", "no answer", simulator="drake", repetition=1)]
    (summary,) = summarise([*stacking_run(), *lost], METRICS)
    with drawing():
        (axis, *_) = draw(summary, "metrics").axes
        labels = [label.get_text() for label in axis.get_yticklabels()]
        (times,) = draw(summary, "times").axes
    assert labels == ["drake\n1 of 1 crashed", "mujoco", "pybullet\n3 of 20 crashed"]
    assert [label.get_text() for label in times.get_yticklabels()] == ["mujoco", "pybullet"]
    interrupted = [record(status="interrupted")]
    assert write(tmp_path, pictures(summarise(interrupted, METRICS))) == []


def test_without_matplotlib_one_line_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "matplotlib"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    records = throwing_run()
    report = Report(summarise(records, METRICS), records)
    with pytest.raises(FiguresUnavailable, match=r"pip install 'pytest-simbench\[figures\]'"):
        write(tmp_path, pictures(report.summaries))
    written = write_files(tmp_path, report)
    assert written.complete
    (line,) = written.problems
    assert line.startswith("no pictures: matplotlib is missing")
    assert (tmp_path / "report.md").exists()
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "no pictures: matplotlib is missing; pip install" in page
    assert '<figure class="picture">' not in page
    assert not list(tmp_path.glob("*.png"))


def test_a_fault_of_the_drawing_costs_the_pictures_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> Iterator[Picture]:
        yield Picture("x", lambda: 1 / 0)

    monkeypatch.setattr(sweep, "pictures", broken)
    records = throwing_run()
    written = write_files(tmp_path, Report(summarise(records, METRICS), records))
    (told,) = written.problems
    assert told == "the pictures could not be drawn: ZeroDivisionError: division by zero"
    assert not written.complete
    assert (tmp_path / "report.md").exists()
    assert told in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_one_picture_for_all_laws_over_releases_and_its_colours(tmp_path: Path) -> None:
    records = [
        *row("fall", 0.2, 0.2, 0.2, 0.2, phenomenon="free motion"),
        *row("tower", 0.1, 0.1, None, 0.1),
        *asked("glide", "2.0", 50.0),
    ]
    (laws,) = found = Report.of(RunContents(records=tuple(records))).histories
    with drawing():
        (axis,) = draw_laws(laws).axes
        cells = [[to_hex(cell) for cell in line] for line in axis.images[0].get_array()]
    kept = cells[0][0]
    assert cells[0] == [kept] * 4
    assert cells[1] == [kept, kept, FAILS, kept]
    assert cells[2][:3] == [NOT_ASKED] * 3
    assert cells[2][3] not in (kept, FAILS, NOT_ASKED)
    weights = [label.get_fontweight() for label in axis.get_yticklabels()]
    assert weights == ["normal", "bold", "normal"]
    assert {text.get_text() for text in axis.texts} >= {"fails", "0.1x", "free motion", "sliding"}
    assert not write_files(tmp_path, Report(records=records, histories=found)).problems
    assert [path.name[:19] for path in tmp_path.glob("*.png")] == ["engine_laws_history"]


@pytest.mark.parametrize("error", ["some", 0.0, None])
def test_each_phenomenon_over_time_steps_has_two_pictures(
    tmp_path: Path, error: float | str | None
) -> None:
    """Also of one simulator that is exact, or fails, at every step: the law has its panel."""
    alone = [law("a", "fall", error, step=h) for h in (1e-3, 2e-3)] if error != "some" else SWEPT
    paths = write(tmp_path, sweep.pictures(swept(alone)))
    assert [p.name for p in paths] == ["sweep_free_motion_step.png", "sweep_free_motion_cost.png"]
    assert all(path.stat().st_size > 1000 for path in paths)


def keep(run: Path, made: Record, **phases: str) -> Record:
    """An album in a run folder: pictures of one colour each, by phase."""
    album = Album()
    for time, (phase, colour) in enumerate(phases.items()):
        if colour:
            album.add(phase, time, np.full((36, 48, 3), COLOURS[colour], dtype=np.uint8))
    album.write(run, f"pictures/{file_stem_of(made)}.npz")
    return made


def seen(sheet: bytes) -> np.ndarray:
    return (imread(io.BytesIO(sheet), format="png")[:, :, :3] * 255).astype(int)


def test_pictures_stand_by_simulator_and_by_the_time_of_what_they_show(tmp_path: Path) -> None:
    """Columns: pick, impact, place. Only the second simulator hit anything."""
    kept = [
        keep(tmp_path, record("drake"), pick="red", impact="", place="green"),
        keep(tmp_path, record("mujoco"), pick="blue", impact="green", place="blue"),
        record("dart"),
    ]
    drawn, problems = sheets(tmp_path, kept)
    assert problems == []
    assert list(drawn) == ["stacking"]
    picture = seen(drawn["stacking"])
    height, width = picture.shape[:2]
    places = [
        [tuple(picture[int(height * share), int(width - 220 * (2.5 - k))]) for k in range(3)]
        for share in (0.3, 0.75)
    ]
    red, green, blue = COLOURS.values()
    assert places == [[red, WHITE, green], [blue, green, blue]]


def test_the_sheet_is_in_the_folder_and_on_the_page(tmp_path: Path) -> None:
    kept = [keep(tmp_path, record("drake"), pick="red")]
    assert not write_files(tmp_path, Report(summarise(kept, METRICS), kept)).problems
    assert (tmp_path / sheet_name("stacking")).read_bytes().startswith(b"\x89PNG")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.count('src="data:image/png;base64,iVBOR') == 1
    assert "img-src data:;" in page


def test_hostile_names_do_no_harm_and_what_cannot_be_read_is_told(tmp_path: Path) -> None:
    for text in HOSTILE:
        made = record(text, test=f"t[{text}]")
        album = Album()
        album.add(text, 0.0, np.zeros((3, 4, 3), dtype=np.uint8))
        album.write(tmp_path, f"pictures/{file_stem_of(made)}.npz")
        drawn, problems = sheets(tmp_path, [made])
        assert problems == []
        assert drawn["stacking"].startswith(b"\x89PNG")
    made = keep(tmp_path, record("drake"), pick="red")
    (tmp_path / "pictures" / f"{file_stem_of(made)}.npz").write_text("no zip")
    drawn, (problem,) = sheets(tmp_path, [made])
    assert drawn == {}
    assert "holds no arrays" in problem


@pytest.mark.parametrize("least", [0.0, 3e-4])
def test_the_front_of_a_search_has_plain_numbers_at_its_axes(least: float) -> None:
    points = [(0.0114, 0.019), (0.0139, 4e-4), (0.0204, least), (0.03, 0.09)]
    with drawing():
        figure = front.draw(points, points[:3], (0.018, 0.0128), "cpu_cost", "m")
        figure.canvas.draw()
        (axis,) = figure.axes
        texts = [
            [label.get_text() for label in labels if label.get_text()]
            for labels in (axis.get_xticklabels(), axis.get_yticklabels())
        ]
    assert all(float(text) >= 0 for row in texts for text in row)
    inside = [x for x in map(float, texts[0]) if 0.0114 <= x <= 0.03]
    assert inside
    assert axis.get_ylim()[0] >= 0
