"""Completing an interrupted run without repeating what is recorded."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.executor import Executor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.identity import expected
from pytest_simbench.records.configuration import (
    agree,
    differences,
    other_meanings,
    task_parameters,
)
from pytest_simbench.records.description import TaskDescription, by_task
from pytest_simbench.records.folder import RECORDS, TASKS, RunContents, RunFolder
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import configurations, grouped, short


def run_to_resume(folder: Path | None, runs: Path) -> Path:
    """The run in a folder, or without one that of those in `runs` which began last; no search.

    Raises:
        NotResumed: there is none.
    """
    folders = [*runs.glob("[0-9]*")] if folder is None else [folder]
    # One that was killed in its first repetition has only said what it repeats.
    found = [f for path in folders for f in (path / RECORDS, path / TASKS) if f.is_file()]
    if not found:
        where = f"{folder} (it has no {RECORDS})" if folder else runs
        raise NotResumed(f"there is no run to resume in {where}; name the folder of a run")
    second = slice(len("2026-07-01_12-00-00"))  # of one second, the one written to last
    return max(found, key=lambda file: (file.parent.name[second], file.stat().st_mtime)).parent


class NotResumed(Exception):
    """Repetitions that cannot go on in this run; the message is one sentence."""


class Resumed:
    """What an interrupted run has recorded in its folder.

    Attributes:
        records: all of them, interrupted ones too.
        tasks: what their metrics mean, by the name of their task.
        claims: the last ones of tests that have not run again, by test.

    Raises:
        RecordError: its records cannot be read.
    """

    def __init__(self, folder: RunFolder) -> None:
        self.folder = folder
        reading = folder.read() if folder.holds_run else RunContents()
        self.records = reading.every
        self.tasks = reading.tasks
        last = {claim.identity: claim for claim in reading.claims if claim.verdict}
        self.claims = grouped(last.values(), lambda claim: claim.test)
        self._problems = reading.problems
        self._taken: set[int] = set()
        self._checked: set[str] = set()

    def repair(self) -> list[str]:
        """Write the records anew without damaged lines; for one process alone.

        Returns:
            The damaged lines, whose repetitions are run again, and where they are kept.
        """
        try:
            kept = self.folder.repair()
        except OSError as error:  # the lines are left out by every reader
            return [*self._problems, f"{self.folder.path} could not be repaired ({error.strerror})"]
        return [*self._problems, *(f"the damaged lines are kept in {path}" for path in kept)]

    def take(self, experiment: Experiment, wanted: int | None) -> dict[int, Record]:
        """By repetition what came to an end of these repetitions; interrupted ones are run again.

        Settings, seeds, versions and whatever else `records.configuration` lists are held against
        what the options say now, without starting a worker.

        `wanted` repetitions were asked for by number; None: as many as it takes.

        Raises:
            NotResumed: the records are of another configuration.
        """
        case, now = experiment.case, expected(experiment)
        of_test = [
            record
            for record in self.records
            if (record.test, record.task, record.attempt) == (now.test, now.task, now.attempt)
        ]
        same = [record for record in of_test if task_parameters(record) == task_parameters(now)]
        if not same:  # a task that this test repeats besides, or one that was changed
            same = [record for record in of_test if id(record) not in self._taken]
        self._taken |= {id(record) for record in same}
        found = [] if all(agree(r, now, "resume") for r in same) else self._differences(same, now)
        if same:
            ours = by_task([TaskDescription.of(experiment.task)])
            found += other_meanings(self.tasks, ours, "resume")
        found += _seeds(same, case.seed)
        if wanted is not None and any(record.repetition > wanted for record in same):
            most = max(record.repetition for record in same)
            found.append(f"reps was {most} or more, is {wanted}")
        if found:
            raise NotResumed(self._sentence(case, found))
        return {r.repetition: r for r in same if r.status != "interrupted"}

    def check_versions(self, experiment: Experiment, executor: Executor) -> None:
        """Before repetitions are added: ask a worker for what only it can tell, once in a test.

        Raises:
            NotResumed: the versions are not those of the run.
        """
        case = experiment.case
        if case.test in self._checked:
            return
        self._checked.add(case.test)
        # A repetition that failed at its start knows neither settings nor versions.
        ended = [r for r in self.records if r.ok]
        of_test = [r for r in ended if (r.test, r.task) == (case.test, experiment.task.name)]
        others = [r for r in ended if (r.simulator, r.mode) == (case.simulator, case.mode)]
        if not of_test and not others:
            return
        now, error = executor.repetition(experiment, 0).run()
        if error is not None:
            raise error
        # Another test of the same simulator has a task and settings of its own.
        found = self._differences(of_test or others, now, ("versions",))
        if found:
            raise NotResumed(self._sentence(case, found))

    def _differences(
        self, before: Sequence[Record], now: Record, fields: Sequence[str] | None = None
    ) -> list[str]:
        found = []
        for group in configurations(before):
            found += differences({now.test: (group, [now])}, "resume", fields)
        return [text.rpartition(" (")[0] for text in dict.fromkeys(found)]

    def _sentence(self, case: Case, found: list[str]) -> str:
        return (
            f"{short(case.test)} of the run {self.folder.path} is not resumed, since its "
            f"repetitions would not be comparable: {'; '.join(found)}"
        )


def _seeds(records: Iterable[Record], base: int) -> list[str]:
    for record in records:
        if record.seed != base + record.repetition - 1:
            return [f"seed was {record.seed - record.repetition + 1}, is {base}"]
    return []
