"""The first worse release, from planted records."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.cli import bisect
from pytest_simbench.cli.values import BadInput, Span
from pytest_simbench.records.description import TaskDescription
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.metrics import Metric
from tests.approval import assert_approved_line
from tests.cli.test_bisect_ends import RELEASES, Recorded
from tests.records.build import METRICS, failed, record


@pytest.mark.parametrize(
    ("errors", "noise"),
    [((0.1, 0.1, None, 0.5, 0.5), 0.0), ((0.1, 0.1, "crashed", 0.5, 0.5), 0.0),
     ((0.1, 0.1, 0.7, 0.5, 0.5), 0.0), ((0.1, 0.2, 0.31, 0.4, 0.5), 0.15),
     ((0.1, 0.1, 0.1, 0.1, 0.1 + 1e-9), 0.0),
     ((0.1, 0.1, 0.7, 0.5, 0.5), None), ((0.1, 0.1, 0.1, 0.1, 0.1), None)],  # nothing is drawn
)  # fmt: skip
def test_what_the_repetitions_show(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
    errors: tuple[Any, ...], noise: float | None,
) -> None:  # fmt: skip
    monkeypatch.setattr(bisect, "Search", Recorded)
    monkeypatch.setattr(bisect, "_releases", lambda wanted: RELEASES)
    run = RunFolder(tmp_path)
    run.describe(TaskDescription("stacking", METRICS))
    for place, (release, error) in enumerate(zip(RELEASES, errors, strict=True)):
        named = {"simulator": f"sim=={release}", "test": f"test_stacking[sim=={release}-headless]"}
        for k in range(1 if noise is None else 6):
            value = error + (noise or 0.0) * ((k + place) % 3) if isinstance(error, float) else None
            made = record(k, metrics={"landing_error": value}, **named)
            made = failed(k, **named) if error == "crashed" else made
            run.append(made.noting(sole=noise is None))
    status = bisect.bisect(Span("sim", "1.8", "1.12"), "landing_error", tmp_path, [])
    told = capsys.readouterr().out
    assert_approved_line("bisect", told.replace(f"{tmp_path}", "DIR").replace("\n", " | "))
    assert status == ("the first worse release is" not in told)


def test_a_test_with_two_tasks(tmp_path: Path) -> None:
    """The metric says which is meant; one that both have is refused, and the other one's
    repetitions are not taken where its own are missing."""
    run, test = RunFolder(tmp_path), "test_stacking[sim==1.8-headless]"
    run.describe(TaskDescription("stacking", METRICS))
    run.describe(TaskDescription("other", (Metric("spilt", "spilt", better="lower"),)))
    run.append(record(1, simulator="sim==1.8", test=test))
    run.append(record(1, simulator="sim==1.8", test=test, task="other", metrics={"spilt": 0.5}))
    run.append(record(1, simulator="sim==1.9", test=test.replace("8", "9")))
    spilt = Recorded("sim", "spilt", RELEASES, tmp_path, [])
    spilt.run(0, 1)
    assert spilt.result(0).records[0].task == "other"
    with pytest.raises(BadInput, match="no test with spilt has run on sim==1.9"):
        spilt.result(1)
    for name in ("crashed", "ram"):
        with pytest.raises(BadInput, match="repeat each in a test of its own"):
            replace(spilt, metric_name=name).result(0)
    alone = replace(spilt, ran={"test_stacking[sim==1.9-headless]": ""}, releases=("1.9",))
    assert replace(alone, metric_name="crashed").metric().name == "crashed"
    with pytest.raises(BadInput, match="no metric is named 'nosuch'"):
        replace(alone, metric_name="nosuch").metric()


def test_an_option_with_a_file_is_no_file_of_tests(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(pytest, "main", lambda words, plugins: asked.append((words, plugins)) or 3)
    words = ["tests", "--ignore=gone.py", "--policies=mine.py:walk"]
    assert bisect.start(Span("sim", "1.8", "1.12"), "landed", words) == 3
    assert asked == [([*words, "--sim-bisect", "sim:1.8..1.12", "landed"], [bisect])]
