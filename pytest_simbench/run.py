"""The run: its folder, its records, its progress line, and the report at the end."""

from __future__ import annotations

import threading
from collections.abc import Iterable
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from pytest_simbench import options
from pytest_simbench.display import Displays
from pytest_simbench.text import for_terminal

if TYPE_CHECKING:
    from pytest_simbench.measure.metrics import Metric
    from pytest_simbench.measure.record import Record
    from pytest_simbench.report.progress import Progress
    from pytest_simbench.resume import Resumed
    from pytest_simbench.tasks.base import Task


class Run:
    """One pytest invocation, or one xdist worker's share of it.

    Attributes:
        folder: of this run; made when the first record is written.
        records: made or received by this process.
        resumed: the interrupted run that this one completes, if it does.
    """

    def __init__(self, config: pytest.Config) -> None:
        self.config = config
        self.folder = self._choose_folder()
        self.displays = Displays()
        self.records: dict[tuple[str, int, int], Record] = {}
        self._file: Any = None
        self._lock = threading.Lock()
        self._progress: Progress | None = None
        self._metrics: dict[str, list[Metric]] = {}
        self._references: dict[str, dict[str, float]] = {}
        self._problems: list[str] = []
        self.resumed: Resumed | None = None
        if config.getoption("sim_resume") is not None:
            from pytest_simbench.resume import Resumed

            self.resumed = Resumed(self.folder)

    def _choose_folder(self) -> Path:
        shared = getattr(self.config, "workerinput", {}).get("simbench_folder")
        if shared:
            return Path(shared)
        if self.config.getoption("sim_resume") is not None:
            from pytest_simbench.resume import folder_to_resume

            folder = folder_to_resume(self.config)
            if folder is not None:
                return folder
        given = options.value(self.config, "sim_output")
        if given:
            return Path(self.config.invocation_params.dir, given)
        stamp = datetime.now().strftime("%Y-%m-%d_%H-%M-%S")
        return self.config.rootpath / ".simbench" / stamp

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
        from pytest_simbench.measure.records import RECORDS_NAME, RecordFile

        with self._lock:
            self.records[_key(record)] = record
            if self._file is None:
                self._file = RecordFile(self.folder / RECORDS_NAME)
            self._file.append(record)

    def resume(self, test: str, task: str) -> dict[int, Record]:
        """By repetition what the run that is completed has recorded of a test; now of this run."""
        found = [] if self.resumed is None else self.resumed.records
        ours = {r.repetition: r for r in found if r.test == test and r.task == task}
        self.records |= {_key(record): record for record in ours.values()}
        return ours

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
        from pytest_simbench.measure.metrics import Metric

        for name, found in tasks.items():
            self._metrics.setdefault(name, [Metric(**item) for item in found["metrics"]])
            self._references.setdefault(name, dict(found["references"]))

    def of_test(self, test: str) -> list[str]:
        """Records of one test as JSON lines, to travel with its report."""
        return [r.to_json() for r in self.records.values() if r.test == test]

    def receive(self, lines: Iterable[str]) -> None:
        """Take over records that came with a report, from an xdist worker for instance."""
        from pytest_simbench.measure.record import Record

        for line in lines:
            record = Record.from_json(line)
            self.records.setdefault(_key(record), record)

    def _read_folder(self) -> list[str]:
        """Records that other processes wrote; problems, as sentences."""
        from pytest_simbench.measure.records import RECORDS_NAME, read_records

        path = self.folder / RECORDS_NAME
        if not path.is_file():
            return []
        try:
            reading = read_records(path)
        except ValueError as error:
            return [str(error)]
        for record in reading.records:
            self.records.setdefault(_key(record), record)
        return list(reading.problems)

    def complete(self) -> None:
        """Gather what other processes recorded; called when all tests have ended."""
        if self.records or self._shared():
            self._problems = self._read_folder()
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

        records = sorted(self.records.values(), key=lambda r: (r.test, r.repetition))
        summaries = with_wins(summarise(records, self._metrics, self._references), records)
        reporter.write_sep("=", "simulator comparison")
        reporter.write_line(render_run(summaries, reporter._tw.fullwidth, self.folder))
        problems = list(self._problems)
        with suppress(OSError):
            problems += write_report(self.folder, summaries, records)
        problems.append(append_summary("\n".join([comparison, markdown.render_run(summaries)])))
        for line in filter(None, [*map(for_terminal, problems), *self._unsaved()]):
            reporter.write_line(line)

    def _shared(self) -> bool:
        return self.config.pluginmanager.has_plugin("dsession")

    def _declare_known(self) -> None:
        """Metrics of our own tasks; an xdist controller performed none itself."""
        names = {record.task for record in self.records.values()} - set(self._metrics)
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


def _key(record: Record) -> tuple[str, int, int]:
    return (record.test, record.repetition, record.seed)
