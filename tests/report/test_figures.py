"""Pictures of a run: of tasks, releases, time steps, and the contact sheet of each task."""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from matplotlib.axis import Axis
from matplotlib.image import imread
from matplotlib.spines import Spine
from matplotlib.ticker import FixedLocator

from pytest_simbench.experiment.identity import file_stem_of
from pytest_simbench.measure.change_points import ChangePoint
from pytest_simbench.measure.history import MetricCourse, TaskHistory, law_histories
from pytest_simbench.measure.transfer import transfers
from pytest_simbench.recordings.film import Album
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.record import Record
from pytest_simbench.report.figures import front, history, sweep, task, transfer
from pytest_simbench.report.figures.drawing import FiguresUnavailable, Picture, drawing, write
from pytest_simbench.report.figures.sheet import sheet_name, sheets
from pytest_simbench.report.figures.task import pictures
from pytest_simbench.report.files import write_files
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.model.summary import summarise
from tests.approval import assert_approved
from tests.hostile import HOSTILE
from tests.measure.test_law_history import asked, row
from tests.measure.test_transfer import compared, whole

from .model.test_laws import law, swept
from .samples import METRICS, REFERENCES, STACKING, failed, record, stacking_run, throwing_run

COLOURS = {"red": (255, 0, 0), "green": (0, 255, 0), "blue": (0, 0, 255)}
WHITE = (255, 255, 255)

HELD = (
    "text", "label", "xydata", "position", "offsets", "sizes", "segments", "xy", "width", "height",
    "array", "color", "facecolor", "alpha", "linewidth", "linestyle", "marker", "markersize",
    "markeredgewidth", "solid_capstyle", "zorder", "fontsize", "fontweight", "rotation", "ha", "va",
    "clim", "cmap", "frame_on",
)  # fmt: skip
"""Of whatever is drawn: what it says, where it is, and how it looks."""


def told(found: Any) -> str:
    if isinstance(found, np.ndarray | list | tuple):
        return f"[{' '.join(map(told, np.ma.filled(found, np.nan)))}]"
    return f"{found:.4g}" if isinstance(found, float) else str(getattr(found, "name", found))


def looks(artist: Any) -> str:
    get = {name: getattr(artist, f"get_{name}", lambda: None) for name in HELD}
    values = {name: told(of()) for name, of in get.items()}
    what = (f"{name}={value!r}" for name, value in values.items() if value not in ("", "None"))
    return f"{type(artist).__name__} {' '.join(what)}"


def in_words(picture: Picture) -> Iterator[str]:
    """What it shows; of ticks those that it chose, and how those of logarithms are written."""
    yield f"\n{picture.name}: {picture.caption}"
    if (figure := picture.draw()) is None:
        return
    yield f"{told(figure.get_size_inches())} {figure.get_suptitle()!r}"
    for panel in figure.axes:
        yield f"panel {told(panel.margins())} {panel.get_visible()} {panel.get_aspect()}"
        for side, ends in ((panel.xaxis, panel.get_xlim()), (panel.yaxis, panel.get_ylim())):
            yield f"{side.get_scale()} {told(ends)} {side.get_tick_params()} {looks(side.label)}"
            if isinstance(side.get_major_locator(), FixedLocator) or side.get_scale() != "linear":
                small = (text for text in side.get_ticklabels(minor=True) if text.get_text())
                yield from map(looks, [*side.get_ticklabels(), *small])
        inside = [each for each in panel.get_children() if not isinstance(each, Spine | Axis)]
        yield from (looks(each) for each in inside if getattr(each, "get_text", lambda: 1)())
    for legend in filter(None, [*figure.legends, *(panel.get_legend() for panel in figure.axes)]):
        yield f"{looks(legend)} {vars(legend)['_ncols']}"
        yield from map(looks, [*legend.legend_handles, *legend.get_texts()])


def of_tasks() -> Iterator[Picture]:
    used = {
        name: {"cpu_percent": {"mean": cpu}, "rss_mb": {"mean": 2 * cpu}, "samples": 5}
        for name, cpu in (("pick", 90.0), ("place", 95.0))
    }
    kept = [replace(r, resources={**r.resources, "phases": used}) for r in stacking_run()]
    lost = failed("WorkerHung", "load", "no answer", simulator="drake")
    cut = record(status="interrupted", task="cut short")
    records, right = [*kept, lost, cut, *throwing_run()], {"stacking": {"placed": 1.0}}
    for found in summarise(records, METRICS, REFERENCES | right):
        yield from (*task.pictures([found]), *task.on_page(found))


def of_releases() -> Iterator[Picture]:
    """More metrics than there is room for: first what changed, and what the study shows."""
    late, far = Metric("late", "late", "s"), Metric("far", "far", "m", resolution=0.1)
    values = {1: 0.5, 2: 0.75, 3: 1.0}, {}, {1: 1.0}, {1: 0.25, 2: 0.5, 3: 0.25}
    courses = [MetricCourse(metric, values) for metric in (late, far, *STACKING)]
    courses[3] = replace(courses[3], changes=(ChangePoint(2, 0.75, 0.3, 0.01),))
    courses[2] = MetricCourse(far, [{1: 1.0, 2: 1.01 + k / 100} for k in range(4)])
    one = TaskHistory("engine", "stacking", "t", "v", ("1", "2", "3", "4"), (), tuple(courses))
    ratios = ((0.5, 1.5, 10.0, 40.0), (400.0, 0.5, None, 0.5), (0.5, 0.5, 0.5, 4.0))
    laws = [r for k, each in enumerate(ratios) for r in row(f"law {k}", *each)]
    laws += row("fall", 0.2, 0.2, 0.2, 0.2, phenomenon="free motion") + asked("glide", "2.0", 50.0)
    return history.pictures([one, *law_histories(laws)])


def of_steps() -> Iterator[Picture]:
    """More laws than stand beside each other; of two there is nothing to draw."""
    (found,) = swept()
    (exact,), (fails,) = (
        swept([law("a", "fall", ratio, step=h) for h in (1e-3, 2e-3)]) for ratio in (0.0, None)
    )
    more = [replace(found, law=f"law {k}", unit="%") for k in range(2)]
    none = replace(exact, law="exact", unit=""), replace(fails, law="fails")
    return sweep.pictures([found, *none, *more])


def of_ranks() -> Iterator[Picture]:
    success = np.array([[0, 0, 0, 0, 1], [0, 1, 1, 0, 1], [1, 1, 1, 1, 1]], dtype=float)
    one = compared(np.array([success, success[::-1], success[[0, 2, 1]]]))
    alike = compared(np.array([success, success[[0, 2, 1]]]))
    return transfer.pictures([one, one, alike])


def of_a_search() -> Iterator[Picture]:
    points = [(0.0114, 0.019), (0.0139, 4e-4), (0.0204, 0.0), (0.03, 0.09)]
    yield Picture("some", partial(front.draw, points, points[:3], points[3], "cpu_cost", "m"))
    yield Picture("off", partial(front.draw, points[:2], points[:1], points[3], "ram", ""))
    yield Picture("none", partial(front.draw, points[2:3], points[2:3], points[2], "ram", ""))


@pytest.mark.skipif(matplotlib.__version_info__[:2] != (3, 11), reason="others draw otherwise")
@pytest.mark.parametrize("made", [of_tasks, of_releases, of_steps, of_ranks, of_a_search])
def test_pictures_show_what_somebody_approved(made: Any) -> None:
    with drawing():
        lines = [line for picture in made() for line in in_words(picture)]
    assert_approved(f"pictures-{made.__name__}", "\n".join(lines))


def test_the_folder_holds_all_pictures(tmp_path: Path) -> None:
    """Also of a law that is kept exactly at each step: no logarithm is drawn."""
    records = stacking_run() + throwing_run()
    report = Report(
        summarise(records, METRICS, REFERENCES), records, transfers=transfers(whole()),
        histories=law_histories(row("fall", 0.2, 0.2, 9.0, 0.2)),
        sweeps=swept([law("a", "fall", 0.0, step=h) for h in (1e-3, 2e-3)]),
    )  # fmt: skip
    written = write_files(tmp_path, report)
    assert (written.problems, written.complete) == ([], True)
    drawn = [f"{task}_{name}.png" for task in ("stacking", "throwing")
             for name in ("metrics", "resources", "times")]  # fmt: skip
    ours = ["report.csv", "report.html", "report.md"]
    steps = ["sweep_free_motion_cost.png", "sweep_free_motion_step.png"]
    drawn = [*drawn[:3], *steps, *drawn[3:], "transfer_pushing.png"]
    first, *names = sorted(path.name for path in tmp_path.iterdir())
    assert (first.partition("-")[0], names) == ("engine_laws_history", [*ours, *drawn])
    told, page = ((tmp_path / ours[k]).read_text(encoding="utf-8") for k in (2, 1))
    for name in (first, *drawn):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
        assert f"]({name})" in told
    assert (transfer.CAPTION in page, "<image" in page) == (True, False)  # it takes vectors alone


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
    (tmp_path / sheet_name("stacking")).unlink()
    (tmp_path / sheet_name("stacking")).mkdir()
    (problem,) = write_files(tmp_path, Report(summarise(kept, METRICS), kept)).problems
    assert f"{sheet_name('stacking')} could not be written" in problem


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
