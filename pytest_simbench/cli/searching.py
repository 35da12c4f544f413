"""What `simbench tune` and `simbench fit` begin with: a profile, and a run folder to go on with."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from pathlib import Path

from pytest_simbench.cli.runs import printed
from pytest_simbench.cli.selection import profiles_of
from pytest_simbench.cli.values import BadInput, refusing
from pytest_simbench.experiment.executor import Executor
from pytest_simbench.experiment.resumed import NotResumed, Resumed
from pytest_simbench.experiment.variants import USUAL
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.paths import FolderError
from pytest_simbench.records.record import RecordError
from pytest_simbench.simulator.profile_file import ProfileFile
from pytest_simbench.tuning.trials import Runs

BUDGET = 1800.0
"""[s]"""


def begins_with(
    sim: object, profile: Sequence[str] | None
) -> tuple[tuple[str, ...], Mapping[str, ProfileFile]]:
    """The label of the one profile, and the file that it may be of.

    Raises:
        BadInput: no simulator, or several profiles.
    """
    if sim is None:
        raise BadInput("name a simulator: --sim NAME (simbench list tells which there are)")
    labels, files = profiles_of(profile or (USUAL,))
    if len(labels) > 1:
        raise BadInput("give one profile: the search begins with it")
    return labels, files


@contextmanager
def runs_in(path: Path, executor: Executor, command: str) -> Iterator[Runs]:
    """Repetitions whose records lie in a folder, which is locked; what it holds of the same command
    is gone on with.

    Raises:
        BadInput: it cannot be; or it holds another run.
    """
    folder = RunFolder(path)
    with refusing(FolderError, "--output"):
        folder.lock()
    advice = "begin anew in another folder: --output DIR"
    with closing(folder), refusing(NotResumed, kind=lambda why: BadInput(f"{why}; {advice}")):
        with refusing(RecordError):
            resumed = Resumed(folder) if folder.holds_run else None
        for record in resumed.records if resumed else ():
            if not record.function.startswith(command):
                raise NotResumed(f"{path} holds another run, of {record.test:.80}")
        yield Runs(executor, printed(True), folder, resumed)
