"""Pictures and a film by the engine's own renderer, of a repetition of their own: what was measured
stays without them, and goes the same way where the engine is deterministic."""

from __future__ import annotations

import os

from pytest_simbench.client.errors import WorkerError
from pytest_simbench.experiment.camera import Camera
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.identity import file_stem
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.recordings import film
from pytest_simbench.records.paths import FolderError, inside
from pytest_simbench.simulator import Capability
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.worker.wire import named


def draws(simulator: str) -> str:
    """Why there are no pictures by this simulator, as a sentence, or nothing."""
    if Capability.OFFSCREEN in adapter(simulator).info.capabilities:
        return ""
    return f"{simulator} has no renderer of its own: no pictures and no videos"


def photograph(experiment: Experiment, *, pictures: bool = True, video: bool = False) -> str:
    """Repeat the first seed once more for an album, a film or both, in `pictures/` and `videos/` of
    the run folder; what is there already stays.

    Returns:
        Why there is none, as a sentence, or nothing.
    """
    case = experiment.case
    if told := draws(case.simulator):
        return told
    stem = file_stem(experiment, 1)
    names = f"{film.PICTURES}/{stem}.npz", f"{film.FOLDER}/{stem}.mp4"
    try:
        there = [os.path.lexists(inside(case.folder, name)) for name in names]
    except FolderError as wrong:
        return f"{case.simulator}: no pictures and no videos: {wrong}"
    taken = film.Album() if pictures and not there[0] else None
    filmed = film.Film(case.folder, names[1]) if video and not there[1] else None
    if taken is None and filmed is None:
        return ""
    camera = Camera(taken, filmed, experiment.task.pictured)
    beside = experiment.in_case(folder=case.folder / film.PICTURES, trace="off", video="first")
    _, error = Repetition(beside, 1, camera=camera).run()
    if error is not None and not isinstance(error, Exception):
        raise error
    if taken is not None and taken.pictures:
        try:
            taken.write(case.folder, names[0])
        except OSError as wrong:
            error = error or wrong
    problem = camera.problem
    if error is not None:  # without the log's last lines, and their traceback
        what = error.what if isinstance(error, WorkerError) else ""
        problem = f"{type(error).__name__}: {what}" if what else named(error)
    return f"{case.simulator}: pictures end early: {problem}" if problem else ""
