"""The run: its folder, its records, its progress line, and the report at the end."""

from __future__ import annotations

import json
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.cli import runs
from pytest_simbench.cli.runs import RUNS
from pytest_simbench.client.display import Displays
from pytest_simbench.experiment.executor import Executor, LocalExecutor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.resumed import NotResumed, Resumed, run_to_resume
from pytest_simbench.experiment.slots import Slots
from pytest_simbench.ground.text import for_terminal
from pytest_simbench.plugin import cluster, options, recording, thresholds
from pytest_simbench.plugin.compare import Comparison
from pytest_simbench.plugin.history import folder_of, on_other_machines
from pytest_simbench.records.claims import Claim
from pytest_simbench.records.description import Threshold
from pytest_simbench.records.folder import RunContents, RunFolder
from pytest_simbench.records.paths import FolderError, new_name
from pytest_simbench.records.record import Record, RecordError
from pytest_simbench.records.repeatability import NAME
from pytest_simbench.report.files import write_badge, write_files, write_outcome
from pytest_simbench.report.markdown import run as markdown
from pytest_simbench.report.markdown.github import append_summary
from pytest_simbench.report.model.outcome import RunOutcome, begun, cut_at, looks_at
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.page import PAGE_NAME
from pytest_simbench.report.terminal.progress import Progress
from pytest_simbench.tasks.base import Task


class Run:
    """One pytest invocation, or one xdist worker's share of it.

    Attributes:
        folder: of this run; locked by `use`, before the first test that needs it.
        problem: why the folder cannot be used, as a sentence, for tests that need it.
        reading: what the folder holds once the run is `complete`; empty before.
        mistake: in what was typed, found when the tests had ended; one sentence, told last.
        resumed: the interrupted run that this one completes, if it does.
        failing: whether a test of the resumed run that did not run again had failed.
        page: to look at, once the whole report is written.
        unwritten: whether a file, the badge among them, could not be written.
        told: sentences for the end of the run; True where one is of a file that was not written.
        expected: what later tests will ask for; set before the first one asks.
        judged: tests that came to their end.
    """

    def __init__(self, config: pytest.Config) -> None:
        self.config = config
        self._shared_by: dict[str, Any] | None = getattr(config, "workerinput", None)
        self.told: dict[str, bool] = {}
        self.folder = RunFolder(self._choose_path())
        self.problem: str = (self._shared_by or {}).get("simbench_problem", "")
        self.displays = Displays()
        self.reading = RunContents()
        self.mistake = ""
        self.failing = False
        self.page: Path | None = None
        self.unwritten = False
        self.judged: set[str] = set()
        self.expected: Callable[[], Iterable[Experiment]] = tuple
        self._attempts: Counter[tuple[str, str, str]] = Counter()
        self._lock = threading.Lock()
        self.resumed: Resumed | None = None
        kept = options.value(config, "sim_history") is not None and self.folder.holds_run
        if options.given(config, "sim_resume") or kept:
            with options.refusing(RecordError, "--sim-resume"):
                self.resumed = Resumed(self.folder)

    def _choose_path(self) -> Path:
        """Of the folder.

        Raises:
            pytest.UsageError: there is no run to resume, or it lies elsewhere than the output.
        """
        if self._shared_by is not None and "simbench_folder" in self._shared_by:
            return Path(self._shared_by["simbench_folder"])
        config, here = self.config, self.config.invocation_params.dir
        output, resume = (options.value(config, f"sim_{name}") for name in ("output", "resume"))
        if resume is not None:
            given = "" if resume is True else resume  # the option without a value
            typed = given and options.given(config, "sim_output")
            if typed and Path(here, given) != Path(here, output):
                raise pytest.UsageError(
                    f"--sim-resume {given} and --sim-output {output}: a run is completed in its "
                    "own folder, so leave out --sim-output"
                )
            folder = Path(here, given or output) if given or output else None
            with options.refusing(NotResumed):
                return run_to_resume(folder, config.rootpath / RUNS)
        if output:
            return Path(here, output)
        history = options.value(config, "sim_history")
        if history is not None:
            self.tell(on_other_machines(config, history.name))
            return folder_of(config, history.name)
        return new_name(config.rootpath / RUNS)

    def lock(self) -> None:
        """Make the folder this run's own; may be called again.

        Raises:
            pytest.UsageError: it holds another run, another run is under way in it, or it cannot
                be written to.
        """
        if self.folder.locked:
            return
        with options.refusing(FolderError, "--sim-output"):
            self.folder.lock(shared=self._shared_by is not None)
        if self._shared_by is not None:
            return
        if self.resumed is not None:
            self.told |= dict.fromkeys(self.resumed.repair(), False)
        elif self.folder.holds_run:
            self.folder.release()
            raise pytest.UsageError(
                f"{self.folder.path} already holds a run; complete that one with --sim-resume="
                f"{self.folder.path}, or give another --sim-output"
            )

    def use(self) -> Path:
        """The folder, for a test that writes to it; the test fails where it cannot be used."""
        if not self.problem:
            try:
                self.lock()
            except pytest.UsageError as error:
                self.problem = str(error)
        if self.problem:
            pytest.fail(self.problem, pytrace=False)
        return self.folder.path

    @cached_property
    def executor(self) -> Executor:
        """Where repetitions are carried out."""
        if cluster.asked(self.config):
            from pytest_simbench.cluster.executor import ClusterExecutor

            return ClusterExecutor(cluster.pool(self.config), self.tell)
        jobs = options.value(self.config, "sim_jobs")
        slots = (self._shared_by or {}).get("simbench_slots", "")
        return LocalExecutor(jobs, expected=self.expected(), slots=slots)

    @cached_property
    def slots(self) -> Slots | None:
        """What `--sim-jobs` gives to all workers of xdist together; None without that option."""
        if cluster.asked(self.config) or not options.mentioned(self.config, ["sim_jobs"]):
            return None
        return Slots(options.value(self.config, "sim_jobs"))

    @cached_property
    def progress(self) -> Progress:
        """The live line; silent in xdist workers, which have no terminal."""
        reporter = self._reporter
        width = reporter._tw.fullwidth if reporter else 80
        return Progress(self._write, is_tty=bool(reporter and reporter.isatty), width=width)

    def _write(self, text: str) -> None:
        if self._reporter is not None and self._shared_by is None:
            with self._lock, self._uncaptured():
                self._reporter._tw.write(text, flush=True)

    def begin_lines(self) -> None:
        """Start a new line before the first progress of a test."""
        if self._reporter is not None:
            with self._uncaptured():
                self._reporter.ensure_newline()

    @property
    def _reporter(self) -> Any:
        """Of the terminal, where there is one."""
        return self.config.pluginmanager.get_plugin("terminalreporter")

    def _uncaptured(self) -> AbstractContextManager[None]:
        """What is printed in this block reaches the terminal."""
        capture = self.config.pluginmanager.get_plugin("capturemanager")
        return capture.global_and_fixture_disabled() if capture else nullcontext()

    def begin(self, experiment: Experiment) -> int:
        """How often this process has begun these repetitions, with this time.

        More than once when a plugin reruns a failed test, or a test repeats a task twice.
        """
        case, parameters = experiment.case, json.dumps(experiment.task.parameters(), default=str)
        key = (case.test, experiment.task.name, parameters)
        self._attempts[key] += 1
        return self._attempts[key]

    def take(self, experiment: Experiment, wanted: int | None) -> dict[int, Record]:
        """By repetition what the run that is completed has recorded; of this run from now on, while
        what it said of the test's claims counts no more.

        Raises:
            NotResumed: it was of another configuration.
        """
        if self.resumed is None:
            return {}
        found = self.resumed.take(experiment, wanted)
        self.folder.take_over(found.values())
        for claim in self.resumed.claims.pop(experiment.case.test, ()):
            self.folder.claim(replace(claim, verdict=""))
        return found

    def describe(self, task: Task) -> None:
        """Before a task is performed: write what its numbers mean.

        The test fails where `--sim-threshold` gives one of its metrics a value that can never fail.
        """
        self.folder.describe(task)
        tests = {test for test, *_ in self._attempts}
        write_outcome(self.folder.path, begun(self.folder.path, tests))
        if wrong := thresholds.bad_value(self._thresholds, task.metrics):
            pytest.fail(wrong, pytrace=False)

    def ask(self, test: str, metric: str, value: float) -> None:
        """Write a threshold that a test asked for."""
        self.use()
        self.folder.ask(Threshold(test, metric, value))

    @property
    def _thresholds(self) -> dict[str, float]:
        """Those on the command line: the ini file's hold for other tests too."""
        given = options.given(self.config, "sim_threshold")
        return thresholds.typed(self.config) if given else {}

    def check_thresholds(self, session: pytest.Session) -> None:
        """When all tests have ended: fail the run for a threshold that none asked for."""
        ended = session.exitstatus in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED)
        if not ended or session.shouldstop or session.shouldfail:
            return  # some tests have not run, and may know it
        if self._thresholds and (self.reading.records or self.reading.thresholds):
            passed = session.exitstatus == pytest.ExitCode.OK
            self.mistake = for_terminal(thresholds.problem(self._thresholds, self.reading, passed))
            if self.mistake:
                session.exitstatus = pytest.ExitCode.USAGE_ERROR

    def tell(self, problem: str, *, unwritten: bool = False) -> None:
        """A sentence for the end of the run."""
        if problem:
            self.told[problem] = unwritten

    def tell_how_to_go_on(self) -> None:
        """What completes a run that was interrupted."""
        folder = "" if options.value(self.config, "sim_output") else f"={self.folder.path}"
        self.tell(f"interrupted: the same command with --sim-resume{folder} completes the run")

    def of_test(self, test: str) -> list[str]:
        """Records of one test as JSON lines, to travel with its report: the disk may be full."""
        return [r.to_json() for r in self.folder.own if r.test == test]

    def receive(self, lines: Iterable[str]) -> None:
        """Take over records that came with a report, from an xdist worker for instance."""
        self.folder.take_over(Record.from_json(line) for line in lines)

    def judge(self, failed: Iterable[Mapping[str, Any]], passed: set[str]) -> None:
        """Keep which tests failed as a whole; those of the resumed run that pass now do so no more,
        and of what they claim no more nothing is open.

        A run in which nothing was recorded keeps nothing.
        """
        if not self.folder.locked or not (self.folder.used or self.folder.holds_run):
            return
        for test in failed:
            self.folder.claim(Claim.from_dict(test))
            passed.discard(test["test"])  # its teardown failed
        for claim in {claim.identity: claim for claim in self.folder.claims([])}.values():
            if claim.verdict == "FAIL" and not claim.metric:
                self.failing |= claim.test not in passed
                if claim.test in passed:
                    self.folder.claim(replace(claim, verdict="PASS", advice=""))
            elif not claim.verdict and claim.test in passed:  # and claims it no more
                whole = replace(claim, task="", metric="", relation=None, threshold=None, number=0)
                self.folder.claim(replace(whole, verdict="PASS"))

    def complete(self) -> None:
        """Read what all processes wrote; called when all tests have ended."""
        shared = self.config.pluginmanager.has_plugin("dsession")
        if (self.folder.used or shared) and not self.problem:
            self.reading = self.folder.scan()

    def summarise(
        self, reporter: pytest.TerminalReporter, comparison: Comparison | None, passed: bool
    ) -> None:
        """Print the result and write the report files; the badge says whether tests and limits
        passed."""
        if not self.reading.records and not (self.folder.path / NAME).is_file():
            return
        path, records = self.folder.path, self.reading.records
        wanted = options.value(self.config, recording.RECORD)
        made = runs.recordings(path, path, records, self.progress) if wanted else ([], True)
        found = comparison.found if comparison else None
        before = self.resumed.records if self.resumed else ()
        looks, cut = looks_at(path, before, records), cut_at(path, before, records, self.judged)
        passed = passed and not self.failing
        judged = None if passed and cut else passed  # one that was cut short is not judged yet
        outcome = RunOutcome(judged, found, looks, cut=cut)
        written = write_files(path, Report.of(self.reading, outcome))
        unsaved = self.folder.flush()
        problems = [*self.told, *self.reading.problems, *self.reading.refused]
        problems += [*written.problems, cluster.lost_nodes(records)]
        if written.summaries or written.sweeps:
            changes = comparison.markdown() if comparison else ""
            page = markdown.render_run(written)
            problems.append(append_summary("\n".join([changes, page])))
        verbose = self.config.get_verbosity() > 0
        claims = written.claims and written.claims.seen_from(
            self.config.invocation_params.dir, self.config.rootpath
        )
        here = replace(written, claims=claims)
        for title, text in runs.sections(here, reporter._tw.fullwidth, verbose):
            reporter.write_sep("=", title)
            reporter.write_line(text)
        lost = [write_outcome(path, outcome)]
        if badge := options.value(self.config, "sim_badge"):
            lost.append(write_badge(Path(badge), records, outcome.passed, self.reading.claims))
        whole = written.complete and made[1] and not unsaved
        self.unwritten = not whole or any([*lost, *self.told.values()])
        problems += [*lost, *made[0]]
        if written.complete and not unsaved:
            self.page = path / PAGE_NAME
        else:
            problems.insert(0, f"\nwhat could be written is in {path}")
        for line in [*map(for_terminal, filter(None, problems)), *unsaved]:
            reporter.write_line(line)

    def close(self) -> None:
        """End what the run started."""
        if "executor" in vars(self):
            self.executor.close()
        slots: Slots | None = vars(self).get("slots")
        if slots is not None:
            slots.close()
        self.displays.close()
        self.folder.close()
