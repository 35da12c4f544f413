"""`--sim-data` and the fixture `data_set`: measured data sets."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.cli.values import refusing
from pytest_simbench.ground.text import for_terminal
from pytest_simbench.plugin import options
from pytest_simbench.plugin.arguments import failing


def folder(config: pytest.Config) -> Path:
    """Where data sets are looked for and brought to."""
    from pytest_simbench.data.sets import default_folder

    given = options.value(config, "sim_data")
    return Path(given) if given else default_folder()


def check(config: pytest.Config) -> None:
    """Complain of a folder that somebody named and that is not there: else its tests are skipped.

    Raises:
        pytest.UsageError: no such folder.
    """
    if not options.given(config, "sim_data"):
        return  # what reads data sets is not imported in runs without any
    given = folder(config)
    if not given.is_dir():
        raise pytest.UsageError(
            f"--sim-data: {for_terminal(str(given))} is no folder; name the one that holds the "
            "data sets, or bring them there with simbench download NAME --data DIR"
        )


def read_or_skip(config: pytest.Config, name: str) -> Any:
    """A data set; without it the test is skipped, with a broken one or a wrong name it fails."""
    from pytest_simbench.data import DataError, DataMissing, read

    with failing(DataError), refusing(DataMissing, kind=pytest.skip.Exception):
        return read(name, folder(config))
