"""The picture of laws over releases, and where the report tells of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_simbench.records.folder import Reading
from pytest_simbench.report.figures.laws import FAILS, NOT_ASKED, draw_laws
from pytest_simbench.report.figures.task import drawing
from pytest_simbench.report.files import write_files
from pytest_simbench.report.model import history
from tests.measure.test_law_history import asked, row

pytest.importorskip("matplotlib")


def test_one_picture_for_all_laws_and_its_colours(tmp_path: Path) -> None:
    from matplotlib.colors import to_hex

    records = [
        *row("fall", 0.2, 0.2, 0.2, 0.2, phenomenon="free motion"),
        *row("tower", 0.1, 0.1, None, 0.1),
        *asked("glide", "2.0", 50.0),
    ]
    reading = Reading(records=tuple(records))
    found = history.of_run(reading)
    (laws,) = found
    with drawing():
        (axis,) = draw_laws(laws).axes
        cells = [[to_hex(cell) for cell in line] for line in axis.images[0].get_array()]
    kept = cells[0][0]
    assert cells[0] == [kept] * 4
    assert cells[1] == [kept, kept, FAILS, kept]
    assert cells[2][:3] == [NOT_ASKED] * 3
    assert cells[2][3] not in (kept, FAILS, NOT_ASKED)
    assert [label.get_fontweight() for label in axis.get_yticklabels()] == [
        "normal", "bold", "normal",
    ]  # fmt: skip
    assert {text.get_text() for text in axis.texts} >= {"fails", "0.1x", "free motion", "sliding"}

    written = write_files(tmp_path, [], records, histories=found)
    assert not written.problems
    assert [path.name[:19] for path in tmp_path.glob("*.png")] == ["engine_laws_history"]
    assert history.lines(found, 60)[:2] == [
        "engine, 3 laws (headless tuned): 4 releases, 1.2 to 2.0",
        "  1.10: tower fails (0.1x before): WorkerHung: no answer for",
    ]
