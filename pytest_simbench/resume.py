"""`--sim-resume [RUN]`: complete an interrupted run without repeating what is recorded."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from pytest_simbench import options
from pytest_simbench.measure.differences import differences
from pytest_simbench.measure.record import Record, RecordError
from pytest_simbench.measure.records import RECORDS_NAME, read_records

if TYPE_CHECKING:
    from pytest_simbench.session.case import Case
    from pytest_simbench.tasks.base import Task

COMPARED = ("profile", "protocol", "jitter", "settings", "versions")
"""What of a record must be the same in a run that is completed or joined."""


def folder_to_resume(config: pytest.Config) -> Path | None:
    """The run folder that `--sim-resume` means; None without that option.

    Raises:
        pytest.UsageError: there is no such run, or none at all.
    """
    given = config.getoption("sim_resume")
    if given is None:
        return None
    given = "" if given is True else given  # the option without a value
    output = options.value(config, "sim_output")
    if given and output and given != output:
        raise pytest.UsageError(
            f"--sim-resume {given} and --sim-output {output}: a run is completed in its own "
            "folder, so leave out --sim-output"
        )
    if given or output:
        folder = Path(config.invocation_params.dir, given or output)
        if not (folder / RECORDS_NAME).is_file():
            raise pytest.UsageError(
                f"there is no run to resume in {folder} (it has no {RECORDS_NAME}); write "
                "--sim-resume=RUN with the folder of a run"
            )
        return folder
    runs = sorted(config.rootpath.glob(f".simbench/*/{RECORDS_NAME}"))
    if not runs:
        raise pytest.UsageError(
            f"there is no run to resume in {config.rootpath / '.simbench'}; write "
            "--sim-resume=RUN with the folder of a run"
        )
    return runs[-1].parent


class Resumed:
    """What an interrupted run has recorded.

    Args:
        folder: of the run.

    Attributes:
        records: those of repetitions that came to an end; interrupted ones are run again.

    Raises:
        pytest.UsageError: its records cannot be read.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            reading = read_records(folder)
        except RecordError as error:
            raise pytest.UsageError(f"--sim-resume: {error}") from None
        self.records = [r for r in reading.records if r.status != "interrupted"]

    def refusal(self, case: Case, task: Task, *, run_more: bool) -> str:
        """Why this test cannot go on here, as one sentence; nothing when it can.

        Args:
            case: as asked for now.
            task: to be performed.
            run_more: whether repetitions are missing; a worker is then started for a moment, to
                learn the simulator's settings and versions.
        """
        of_test = [r for r in self.records if r.test == case.test]
        seeds = _seeds(of_test, case.seed)
        if seeds:
            return self._sentence(case, [seeds])
        # A repetition that failed at its start knows neither settings nor versions.
        of_test = [r for r in of_test if r.ok]
        others = [
            r for r in self.records if r.ok and (r.simulator, r.mode) == (case.simulator, case.mode)
        ]
        if not run_more or not others:
            return ""
        from pytest_simbench.session.repetition import Repetition

        now, error = Repetition(case, task, 0).probe()
        if error is not None:
            raise error
        if of_test:
            found = differences({case.test: (of_test, [now])}, COMPARED)
        else:  # another test of the same simulator: its task and its settings are its own
            found = differences({case.test: (others, [now])}, ("versions",))
        return self._sentence(case, [text.rpartition(" (")[0] for text in found])

    def _sentence(self, case: Case, found: list[str]) -> str:
        if not found:
            return ""
        name = case.test.rpartition("::")[2]
        return (
            f"{name} of the run {self.folder} is not resumed, since its repetitions would not be "
            f"comparable: {'; '.join(found)}"
        )


def _seeds(records: Iterable[Record], base: int) -> str:
    for record in records:
        if record.seed != base + record.repetition - 1:
            return f"--sim-seed was {record.seed - record.repetition + 1}, is {base}"
    return ""
