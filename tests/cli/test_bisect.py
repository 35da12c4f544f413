"""The first worse release, from planted records."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.cli import bisect
from pytest_simbench.cli.values import Span
from pytest_simbench.records.description import TaskDescription
from pytest_simbench.records.folder import RunFolder
from tests.approval import assert_approved_line
from tests.cli.test_bisect_ends import RELEASES, Recorded
from tests.records.build import METRICS, failed, record

FOUND = "the first worse release is 1.10: 1.9 landing_error "
LOST = "0.1 m, 1.10 landing_error is not there"


@pytest.mark.parametrize(
    ("errors", "noise", "said"),
    [
        ((0.1, 0.1, None, 0.5, 0.5), 0.0, f"{LOST}\n"),
        ((0.1, 0.1, "crashed", 0.5, 0.5), 0.0, f"{LOST}, 6 crashed\n"),
        ((0.1, 0.1, 0.7, 0.5, 0.5), 0.0, "0.1 m, 1.10 landing_error 0.7 m (p = 0.016)\n"),
        ((0.1, 0.2, 0.31, 0.4, 0.5), 0.15, " (p = 0.12, which does not tell the two apart)\n"),
        ((0.1, 0.1, 0.1, 0.1, 0.1 + 1e-9), 0.0, " do not show that it is worse (by less than mean"),
    ],
)
def test_what_the_repetitions_show(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    errors: tuple[Any, ...],
    noise: float,
    said: str,
) -> None:
    monkeypatch.setattr(bisect, "Search", Recorded)
    monkeypatch.setattr(bisect, "_releases", lambda wanted: RELEASES)
    run = RunFolder(tmp_path)
    run.describe(TaskDescription("stacking", METRICS))
    for place, (release, error) in enumerate(zip(RELEASES, errors, strict=True)):
        named = {"simulator": f"sim=={release}", "test": f"test_stacking[sim=={release}-headless]"}
        for k in range(6):
            value = error + noise * ((k + place) % 3) if isinstance(error, float) else None
            made = record(k, metrics={"landing_error": value}, **named)
            run.append(failed(k, **named) if error == "crashed" else made)
    status = bisect.bisect(Span("sim", "1.8", "1.12"), "landing_error", tmp_path, [])
    told = capsys.readouterr().out
    assert said in told
    assert_approved_line("bisect", told.replace(f"{tmp_path}", "DIR").replace("\n", " | "))
    assert status == (FOUND not in told)
