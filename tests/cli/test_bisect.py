"""The first worse release, from planted records."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_simbench.cli import bisect
from pytest_simbench.cli.values import Span
from pytest_simbench.records.description import TaskDescription
from pytest_simbench.records.folder import RunFolder
from tests.cli.test_bisect_ends import RELEASES, Recorded
from tests.records.build import METRICS, failed, record


@pytest.mark.parametrize(
    ("third", "said"),
    [
        (None, "1.10 landing_error is not there\n"),
        ("crashed", "1.10 landing_error is not there, 6 crashed\n"),
        (0.7, "1.10 landing_error 0.7 m (p = 0.016)\n"),
    ],
)
def test_a_release_without_a_value_is_worse(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    third: float | str | None,
    said: str,
) -> None:
    monkeypatch.setattr(bisect, "Search", Recorded)
    monkeypatch.setattr(bisect, "_releases", lambda wanted: RELEASES)
    run = RunFolder(tmp_path)
    run.describe(TaskDescription("stacking", METRICS))
    for release, error in zip(RELEASES, (0.1, 0.1, third, 0.5, 0.5), strict=True):
        named = {"simulator": f"sim=={release}", "test": f"test_stacking[sim=={release}-headless]"}
        for k in range(6):
            made = record(k, metrics={"landing_error": error}, **named)
            run.append(failed(k, **named) if error == "crashed" else made)
    assert bisect.bisect(Span("sim", "1.8", "1.12"), "landing_error", tmp_path, []) == 0
    told = capsys.readouterr().out
    assert f"the first worse release is 1.10: 1.9 landing_error 0.1 m, {said}" in told
