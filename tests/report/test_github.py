"""The summary of a GitHub job."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_simbench.report.markdown.github import LARGEST, VARIABLE, append_summary


def test_nothing_happens_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    assert append_summary("text") == ""


def test_it_is_appended_to_what_other_steps_wrote(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "summary"
    monkeypatch.setenv(VARIABLE, str(path))
    assert append_summary("one ±") == append_summary("two") == ""
    assert path.read_text(encoding="utf-8") == "one ±\ntwo\n"


def test_what_github_would_refuse_or_cannot_be_written_is_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "summary"))
    assert append_summary("x" * (LARGEST - 1)) == ""
    assert "larger than 1048576 bytes" in append_summary("x")
    assert (tmp_path / "summary").stat().st_size == LARGEST
    monkeypatch.setenv(VARIABLE, str(tmp_path / "none" / "summary"))
    assert "cannot be written to" in append_summary("x")
