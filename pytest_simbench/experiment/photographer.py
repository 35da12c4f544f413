"""Pictures by the engine's own renderer, of a repetition of their own: what was measured stays
without them, and goes the same way where the engine is deterministic."""

from __future__ import annotations

from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.identity import file_stem
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.recordings.album import FOLDER, Album
from pytest_simbench.simulator import Capability
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.worker.text import named


def photograph(experiment: Experiment) -> str:
    """Repeat the first seed once more, with pictures, into `pictures/` of the run folder.

    Returns:
        Why there is none, as a sentence, or nothing.
    """
    case = experiment.case
    if Capability.OFFSCREEN not in adapter(case.simulator).info.capabilities:
        return f"{case.simulator} has no renderer of its own: no pictures"
    path = case.folder / FOLDER / f"{file_stem(experiment, 1)}.npz"
    if path.exists():
        return ""
    album = Album()
    beside = experiment.in_case(folder=case.folder / FOLDER, trace="off")
    _, error = Repetition(beside, 1, album=album).run()
    if error is not None and not isinstance(error, Exception):
        raise error
    if album.pictures:
        try:
            album.write(path)
        except OSError as wrong:
            error = wrong
    return "" if error is None else f"{case.simulator}: pictures end early: {named(error)}"
