"""`--sim-trace`, `--sim-record`, `--sim-pictures`, `--sim-video`: what is kept to be looked at.

Imported at plugin load: standard library and pytest only; everything else is imported late.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import pytest

from pytest_simbench.plugin import options

if TYPE_CHECKING:
    from pytest_simbench.experiment.experiment import Experiment
    from pytest_simbench.records.record import Record

RECORD, TRACE, PICTURES, VIDEO = "sim_record", "sim_trace", "sim_pictures", "sim_video"


def trace_mode(config: pytest.Config) -> str:
    """Which repetitions' motion is kept: `--sim-trace`, or all of them for `--sim-record`."""
    if options.value(config, RECORD) and not options.mentioned(config, [TRACE]):
        return "on"
    return str(options.value(config, TRACE))


def video_mode(config: pytest.Config, simulator: str) -> str:
    """Which repetitions of a simulator are filmed: `--sim-video`, none without a renderer."""
    mode = str(options.value(config, VIDEO))
    if mode != "off":
        from pytest_simbench.experiment.photographer import draws

        mode = "off" if draws(simulator) else mode
    return mode


def photograph(
    config: pytest.Config,
    experiment: Experiment,
    records: Sequence[Record],
    tell: Callable[[str], object],
) -> None:
    """Have the pictures and the film taken that are of a repetition of their own, when the others
    are done: their records say what became of their films. `tell` takes a sentence for the end of
    the run."""
    pictures, video = options.value(config, PICTURES), options.value(config, VIDEO)
    if not pictures and video == "off":
        return
    from pytest_simbench.experiment import photographer

    problem = photographer.draws(experiment.case.simulator)
    if not problem and (pictures or video == "first"):
        problem = photographer.photograph(experiment, pictures=pictures, video=video == "first")
    ended = next((r.notes.video for r in records if r.notes.video), None)
    for text in (problem, f"{experiment.case.simulator}: no video: {ended}" if ended else ""):
        if text:
            tell(text)


def check(config: pytest.Config) -> None:
    """Complain of a recording that cannot be made, before anything runs.

    Raises:
        pytest.UsageError: there will be no motion to record, or what writes is not installed.
    """
    if (video := options.value(config, VIDEO)) != "off":
        from pytest_simbench.recordings import film

        with options.refusing(film.FilmsUnavailable, f"--sim-video={video}"):
            film.check_available()
    if not options.value(config, RECORD):
        return
    if trace_mode(config) == "off":
        raise pytest.UsageError(
            "--sim-record writes what --sim-trace keeps, and that is off; leave --sim-trace=off out"
        )
    from pytest_simbench.recordings.bag import BagsUnavailable, check_available

    with options.refusing(BagsUnavailable, "--sim-record=mcap"):
        check_available()
