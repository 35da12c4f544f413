"""A simulator's releases over time: what each of them changed."""

from __future__ import annotations

from collections.abc import Sequence

from pytest_simbench.measure.history import History, histories
from pytest_simbench.measure.law_history import LawHistory, law_histories
from pytest_simbench.records.folder import Reading
from pytest_simbench.report.model.document import Section

AnyHistory = History | LawHistory


def of_run(reading: Reading) -> list[AnyHistory]:
    """The histories in a run: of each test, and one of all laws."""
    return [*histories(reading.records, reading.metrics), *law_histories(reading.records)]


def sections(found: Sequence[AnyHistory]) -> list[Section]:
    """What is told of each."""
    return [Section(f"History: {history.title}", history.sentences()) for history in found]
