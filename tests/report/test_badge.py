"""The badge: what shields.io needs, and a colour that a reader can trust."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pytest_simbench.records.record import Record
from pytest_simbench.report.files import write_badge
from pytest_simbench.report.markdown.badge import badge
from tests.hostile import HOSTILE, assert_harmless_terminal

from .samples import failed, record

FINE = [record(name, k) for name in ("a", "b") for k in range(10)]
ONE_FAILED = [*FINE, failed("WorkerDied", "load", "gone", repetition=11)]


@pytest.mark.parametrize(
    ("records", "passed", "message", "colour"),
    [
        (FINE, True, "2 simulators: 20 repetitions passed", "brightgreen"),
        (FINE[:10], True, "a: 10 repetitions passed", "brightgreen"),
        (ONE_FAILED, True, "3 simulators: 1 of 21 repetitions crashed", "yellow"),
        (ONE_FAILED, False, "3 simulators: failing", "red"),
        (FINE, False, "2 simulators: failing", "red"),
        (FINE, None, "2 simulators: 20 repetitions, not judged", "lightgrey"),
        ([record(status="interrupted")], True, "nothing measured", "lightgrey"),
        ([], False, "nothing measured", "lightgrey"),
    ],
)
def test_message_and_colour(
    records: list[Record], passed: bool | None, message: str, colour: str
) -> None:
    assert json.loads(badge(records, passed)) == {
        "schemaVersion": 1,
        "label": "simulators",
        "message": message,
        "color": colour,
    }


@pytest.mark.parametrize("text", HOSTILE, ids=lambda text: ascii(text)[:20])
def test_a_name_is_short_plain_text(text: str) -> None:
    message = json.loads(badge([record(text)], True))["message"]
    assert_harmless_terminal(message)
    assert len(message) <= 60


def test_what_cannot_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / "badge.json").mkdir()
    problem = write_badge(tmp_path / "badge.json", FINE, True)
    assert problem.startswith("no badge: ")
    assert write_badge(tmp_path / "new" / "badge.json", FINE, True) == ""
    assert json.loads((tmp_path / "new" / "badge.json").read_text())["color"] == "brightgreen"
