"""The run: its folder, its records, its progress line, and the report at the end."""

from __future__ import annotations

import json
import threading
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from pytest_simbench.client.display import Displays
from pytest_simbench.plugin import options
from pytest_simbench.records.text import for_terminal

if TYPE_CHECKING:
    from pytest_simbench.experiment.case import Case
    from pytest_simbench.plugin.resume import Resumed
    from pytest_simbench.records.folder import Claim
    from pytest_simbench.records.record import Record
    from pytest_simbench.report.progress import Progress
    from pytest_simbench.tasks.base import Task
    from pytest_simbench.tasks.metrics import Metric

RUNS = ".simbench"
"""Where runs without an `--sim-output` lie, in pytest's root folder."""


class Run:
    """One pytest invocation, or one xdist worker's share of it.

    Attributes:
        folder: of this run; made by `use`, before the first test that needs it.
        problem: why the folder cannot be used, as a sentence, for tests that need it.
        records: made or received by this process; all of the run once it is complete.
        resumed: the interrupted run that this one completes, if it does.
    """

    def __init__(self, config: pytest.Config) -> None:
        self.config = config
        self._shared_by: dict[str, Any] | None = getattr(config, "workerinput", None)
        self.folder = self._choose_folder()
        self.problem: str = (self._shared_by or {}).get("simbench_problem", "")
        self.displays = Displays()
        self.records: list[Record] = []
        self._claim: Claim | None = None
        self._attempts: Counter[tuple[str, str, str]] = Counter()
        self._file: Any = None
        self._lock = threading.Lock()
        self._progress: Progress | None = None
        self._metrics: dict[str, list[Metric]] = {}
        self._references: dict[str, dict[str, float]] = {}
        self._problems: list[str] = []
        self.resumed: Resumed | None = None
        if config.getoption("sim_resume") is not None:
            from pytest_simbench.plugin.resume import Resumed

            self.resumed = Resumed(self.folder)

    def _choose_folder(self) -> Path:
        if self._shared_by is not None and "simbench_folder" in self._shared_by:
            return Path(self._shared_by["simbench_folder"])
        if self.config.getoption("sim_resume") is not None:
            from pytest_simbench.plugin.resume import folder_to_resume

            folder = folder_to_resume(self.config)
            if folder is not None:
                return folder
        given = options.value(self.config, "sim_output")
        if given:
            return Path(self.config.invocation_params.dir, given)
        from pytest_simbench.records.folder import new_name

        return new_name(self.config.rootpath / RUNS)

    def claim(self) -> None:
        """Make the folder this run's own; may be called again.

        Raises:
            pytest.UsageError: it holds another run, another run is under way in it, or it cannot
                be written to.
        """
        if self._claim is not None:
            return
        from pytest_simbench.records.folder import Claim, FolderError, holds_run

        try:
            self._claim = Claim(self.folder, shared=self._shared_by is not None)
        except FolderError as error:
            raise pytest.UsageError(str(error)) from None
        if self._shared_by is not None:
            return
        if self.resumed is not None:
            self.resumed.repair()
            self._problems += self.resumed.problems
        elif holds_run(self.folder):
            self._claim.close()
            self._claim = None
            raise pytest.UsageError(self.occupied())

    def occupied(self) -> str:
        """That the folder holds another run, as a sentence with what to do; empty if it does not.

        For xdist's controller, which does not know whether any test needs the folder.
        """
        from pytest_simbench.records.folder import holds_run

        if self._claim is not None or self.resumed is not None or not holds_run(self.folder):
            return ""
        return (
            f"{self.folder} already holds a run; complete that one with --sim-resume="
            f"{self.folder}, or give another --sim-output"
        )

    def use(self) -> Path:
        """The folder, for a test that writes to it; the test fails where it cannot be used."""
        if not self.problem:
            try:
                self.claim()
            except pytest.UsageError as error:
                self.problem = str(error)
        if self.problem:
            pytest.fail(self.problem, pytrace=False)
        return self.folder

    @property
    def progress(self) -> Progress:
        """The live line; silent in xdist workers, which have no terminal."""
        if self._progress is None:
            from pytest_simbench.report.progress import Progress

            reporter = self.config.pluginmanager.get_plugin("terminalreporter")
            width = reporter._tw.fullwidth if reporter else 80
            tty = bool(reporter and reporter.isatty)
            self._progress = Progress(self._write, is_tty=tty, width=width)
        return self._progress

    def _write(self, text: str) -> None:
        reporter = self.config.pluginmanager.get_plugin("terminalreporter")
        capture = self.config.pluginmanager.get_plugin("capturemanager")
        if reporter is None or hasattr(self.config, "workerinput"):
            return
        with self._lock:
            if capture is None:
                reporter._tw.write(text, flush=True)
            else:
                with capture.global_and_fixture_disabled():
                    reporter._tw.write(text, flush=True)

    def begin_lines(self) -> None:
        """Start a new line before the first progress of a test."""
        reporter = self.config.pluginmanager.get_plugin("terminalreporter")
        capture = self.config.pluginmanager.get_plugin("capturemanager")
        if reporter is not None and capture is not None:
            with capture.global_and_fixture_disabled():
                reporter.ensure_newline()

    def keep(self, record: Record) -> None:
        """Keep a record in memory and in the run folder; called as each repetition ends."""
        from pytest_simbench.records.record_file import RECORDS_NAME, RecordFile

        with self._lock:
            self.records.append(record)
            if self._file is None:
                self._file = RecordFile(self.folder / RECORDS_NAME)
            self._file.append(record)

    def begin(self, case: Case, task: Task) -> int:
        """How often this process has begun these repetitions, with this time.

        More than once when a plugin reruns a failed test, or a test repeats a task twice.
        """

        key = (case.test, task.name, json.dumps(task.parameters(), default=str))
        self._attempts[key] += 1
        return self._attempts[key]

    def take(self, case: Case, task: Task, wanted: int | None) -> dict[int, Record]:
        """By repetition what the run that is completed has recorded; of this run from now on.

        Raises:
            NotResumed: it was of another configuration.
        """
        if self.resumed is None:
            return {}
        found = self.resumed.take(case, task, wanted)
        self.records += found.values()
        return found

    def declare(self, task: Task) -> None:
        """Remember a task's metrics and references for the report."""
        self._metrics.setdefault(task.name, list(task.metrics))
        self._references.setdefault(task.name, dict(task.references))

    @property
    def metrics(self) -> dict[str, list[Metric]]:
        """The metrics of each task that was performed, by its name."""
        return self._metrics

    def declared(self) -> dict[str, Any]:
        """What was declared, as plain data, to travel with a report."""
        return {
            name: {"metrics": [m.to_wire() for m in found], "references": self._references[name]}
            for name, found in self._metrics.items()
        }

    def receive_declared(self, tasks: dict[str, Any]) -> None:
        """Take over what an xdist worker declared."""
        from pytest_simbench.tasks.metrics import Metric

        for name, found in tasks.items():
            self._metrics.setdefault(name, [Metric(**item) for item in found["metrics"]])
            self._references.setdefault(name, dict(found["references"]))

    def of_test(self, test: str) -> list[str]:
        """Records of one test as JSON lines, to travel with its report."""
        return [r.to_json() for r in self.records if r.test == test]

    def receive(self, lines: Iterable[str]) -> None:
        """Take over records that came with a report, from an xdist worker for instance."""
        from pytest_simbench.records.record import Record

        self.records += [Record.from_json(line) for line in lines]

    def _read_folder(self) -> list[Record]:
        """Records that other processes wrote; what is wrong with them becomes a problem."""
        from pytest_simbench.records.record_file import RECORDS_NAME, RecordError, scan

        path = self.folder / RECORDS_NAME
        if not path.is_file():
            return []
        try:
            reading = scan(path)
        except RecordError as error:
            self._problems.append(str(error))
            return []
        self._problems += [*reading.problems, *reading.refused]
        return list(reading.every)

    def complete(self) -> None:
        """Gather what other processes recorded; called when all tests have ended."""
        from pytest_simbench.records.series import settled

        if (self.records or self._shared()) and not self.problem:
            # Those in memory come last: they are there although the disk may be full.
            self.records = settled([*self._read_folder(), *self.records])
        if self.records:
            self._declare_known()

    def summarise(self, reporter: pytest.TerminalReporter, comparison: str = "") -> None:
        """Print the tables and write the report files.

        Args:
            reporter: prints.
            comparison: with a baseline, as Markdown, for the summary page of a CI job.
        """
        if not self.records:
            return
        from pytest_simbench.report import markdown
        from pytest_simbench.report.files import write_report
        from pytest_simbench.report.github import append_summary
        from pytest_simbench.report.matrix import with_wins
        from pytest_simbench.report.summary import summarise
        from pytest_simbench.report.tables import render_run

        records = sorted(self.records, key=lambda r: (r.test, r.repetition))
        summaries = with_wins(summarise(records, self._metrics, self._references), records)
        written = write_report(self.folder, summaries, records)
        unsaved = self._unsaved()
        problems = [*self._problems, *written.problems]
        problems.append(append_summary("\n".join([comparison, markdown.render_run(summaries)])))
        reporter.write_sep("=", "simulator comparison")
        whole = written.complete and not unsaved
        folder = self.folder if whole else None
        reporter.write_line(render_run(summaries, reporter._tw.fullwidth, folder))
        if not whole:
            problems.insert(0, f"\nwhat could be written is in {self.folder}")
        for line in [*map(for_terminal, filter(None, problems)), *unsaved]:
            reporter.write_line(line)

    def _shared(self) -> bool:
        return self.config.pluginmanager.has_plugin("dsession")

    def _declare_known(self) -> None:
        """Metrics of our own tasks; an xdist controller performed none itself."""
        names = {record.task for record in self.records} - set(self._metrics)
        if names:
            from pytest_simbench.tasks import Stacking, Throwing

            for task in (Stacking(), Throwing()):
                if task.name in names:
                    self.declare(task)

    def _unsaved(self) -> list[str]:
        if self._file is None:
            return []
        report = self._file.close()
        return [*report.problems, *report.unsaved]

    def close(self) -> None:
        """End what the run started."""
        self.displays.close()
        if self._file is not None:
            self._file.close()
        if self._claim is not None:
            self._claim.close()
