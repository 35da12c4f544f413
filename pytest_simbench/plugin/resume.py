"""`--sim-resume [RUN]`: which interrupted run is completed."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_simbench.cli.runs import RUNS
from pytest_simbench.experiment.resumed import NotResumed, run_to_resume
from pytest_simbench.plugin import options


def folder_to_resume(config: pytest.Config) -> Path | None:
    """The run folder that `--sim-resume` means; None without that option.

    Raises:
        pytest.UsageError: there is no such run, or none at all.
    """
    given = options.value(config, "sim_resume")
    if given is None:
        return None
    given = "" if given is True else given  # the option without a value
    output = options.value(config, "sim_output")
    if given and output and given != output:
        raise pytest.UsageError(
            f"--sim-resume {given} and --sim-output {output}: a run is completed in its own "
            "folder, so leave out --sim-output"
        )
    folder = Path(config.invocation_params.dir, given or output) if given or output else None
    with options.refusing(NotResumed):
        return run_to_resume(folder, config.rootpath / RUNS)
