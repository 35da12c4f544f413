"""`--sim-trace` and `--sim-record`: what is kept of the motion of repetitions.

Imported at plugin load: standard library and pytest only; everything else is imported late.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from pytest_simbench.plugin import options

if TYPE_CHECKING:
    from pytest_simbench.records.record import Record

RECORD, TRACE = "sim_record", "sim_trace"


def trace_mode(config: pytest.Config) -> str:
    """Which repetitions' motion is kept: `--sim-trace`, or all of them for `--sim-record`."""
    if options.value(config, RECORD) and not options.mentioned(config, [TRACE]):
        return "on"
    return str(options.value(config, TRACE))


def check(config: pytest.Config) -> None:
    """Complain of a recording that cannot be made, before anything runs.

    Raises:
        pytest.UsageError: there will be no motion to record, or what writes it is not installed.
    """
    if not options.value(config, RECORD):
        return
    if trace_mode(config) == "off":
        raise pytest.UsageError(
            "--sim-record writes what --sim-trace keeps, and that is off; leave --sim-trace=off out"
        )
    from pytest_simbench.recordings.bag import BagsUnavailable, check_available

    try:
        check_available()
    except BagsUnavailable as error:
        raise pytest.UsageError(f"--sim-record=mcap: {error}") from None


def record(config: pytest.Config, run: Path, target: Path, records: Sequence[Record]) -> list[str]:
    """Write the recordings that were asked for.

    Args:
        config: of pytest.
        run: folder of the run, which holds the traces.
        target: folder to write to.
        records: of the run.

    Returns:
        Lines for the terminal.
    """
    if not options.value(config, RECORD):
        return []
    from pytest_simbench.report.files import shown
    from pytest_simbench.report.recorded import FOLDER, write_bags

    count, problems = write_bags(run, target, records)
    if not count:
        return [*problems, "no recordings: the run has no traces; see --sim-trace"]
    many = f"{count} recording{'s' if count > 1 else ''}"
    return [*problems, f"{many}: {shown(target / FOLDER, config.invocation_params.dir)}"]
