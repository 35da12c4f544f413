"""All that is told of a run, whatever draws it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pytest_simbench.measure.history import History, histories, law_histories
from pytest_simbench.measure.settling import TASK as SETTLING
from pytest_simbench.measure.settling import Settled, settlings
from pytest_simbench.measure.sweep import Swept, sweeps
from pytest_simbench.measure.transfer import Transfer, transfers
from pytest_simbench.records.folder import RunContents
from pytest_simbench.records.record import Record
from pytest_simbench.report.model import settling, sweep, tables, transfer, truth
from pytest_simbench.report.model.claims import Claims, claims_of
from pytest_simbench.report.model.document import Section
from pytest_simbench.report.model.outcome import Compared, RunOutcome
from pytest_simbench.report.model.summary import TaskSummary, at_own_steps, summarise


@dataclass(frozen=True)
class Report:
    """A run.

    Attributes:
        summaries: of each task and law.
        records: that all was made of, in order.
        histories: of simulators of which there are several releases.
        sweeps: laws over time steps.
        settled: users' scenes, beside their noise.
        transfers: policies on several simulators.
        claims: what the tests claimed, and what came of it, which comes first.
        comparison: with a baseline, where there is one.
    """

    summaries: Sequence[TaskSummary] = ()
    records: Sequence[Record] = ()
    histories: Sequence[History] = ()
    sweeps: Sequence[Swept] = ()
    settled: Sequence[Settled] = ()
    transfers: Sequence[Transfer] = ()
    claims: Claims | None = None
    comparison: Compared | None = None

    @classmethod
    def of(cls, reading: RunContents, outcome: RunOutcome | None = None) -> Report:
        """What a run folder holds, and how the run ended."""
        # However many processes wrote them.
        records = sorted(reading.records, key=lambda r: (r.test, r.repetition))
        # A scene that is left to itself has a section that holds its releases against its noise.
        tests = [record for record in reading.records if record.task != SETTLING]
        outcome = outcome or RunOutcome()
        compared, passed = outcome.compared, outcome.passed
        ended = outcome.ended and not (passed is None and outcome.cut)
        found = summarise(at_own_steps(records), reading.metrics, reading.references)
        return cls(
            [replace(summary, looks=outcome.looks) for summary in found],
            records,
            [*histories(tests, reading.metrics), *law_histories(reading.records)],
            sweeps(reading.records, reading.metrics),
            settlings(reading.records),
            transfers(records),
            claims_of(reading, compared[1] if compared else None, passed, ended),
            compared,
        )

    @property
    def tasks(self) -> list[TaskSummary]:
        """What is no law."""
        return truth.others(self.summaries)

    @property
    def sections(self) -> list[Section]:
        """Users' scenes, policies, laws, time steps, tasks, and releases."""
        laws = filter(None, [truth.section(self.summaries), sweep.section(self.sweeps)])
        told = [Section(f"History: {one.title}", one.sentences()) for one in self.histories]
        first = [*self.scenes, *map(transfer.section, self.transfers)]
        return [*first, *laws, *map(tables.section, self.tasks), *told]

    @property
    def scenes(self) -> list[Section]:
        """Users' scenes, whose first sentences are the answer."""
        return [settling.section(one) for one in self.settled]
