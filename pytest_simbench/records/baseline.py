"""The run to compare with: from a run folder, a record file, or a file of pytest-benchmark."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pytest_simbench.records.record import Record, RecordError
from pytest_simbench.records.record_file import RECORDS_NAME, read_records
from pytest_simbench.records.saved import KEY, from_extra_info
from pytest_simbench.records.series import settled

FORMS = f"a run folder, its {RECORDS_NAME}, or a file written with --benchmark-json"
"""What a baseline may be, for messages."""


class BaselineError(ValueError):
    """A baseline that cannot be used; the message says why and what would be one."""


@dataclass(frozen=True)
class Baseline:
    """A saved run.

    Attributes:
        name: where it comes from, as the user reads it.
        records: at least one.
        problems: lines that could not be read, one sentence each.
    """

    name: str
    records: tuple[Record, ...]
    problems: tuple[str, ...] = ()

    @property
    def metric_names(self) -> tuple[str, ...]:
        """The metrics that any of its repetitions has."""
        return tuple(dict.fromkeys(name for r in self.records for name in r.metrics))


def read_baseline(path: Path) -> Baseline:
    """The run at `path`.

    Raises:
        BaselineError: there is none, it is malformed, or it holds no repetition.
    """
    if not path.exists():
        raise BaselineError(f"there is no baseline {path}; give {FORMS}")
    saved = _benchmark_file(path)
    if saved is not None:
        return from_benchmarks(saved, str(path))
    try:
        reading = read_records(path)
    except RecordError as error:
        raise BaselineError(f"the baseline cannot be read: {error}; give {FORMS}") from None
    if not reading.records:
        raise BaselineError(f"the baseline {path} holds no repetition; give {FORMS}")
    return Baseline(str(path), reading.records, reading.problems)


def _benchmark_file(path: Path) -> dict[str, Any] | None:
    """The content of a file of pytest-benchmark; None when it is none."""
    if not path.is_file():
        return None
    try:
        data = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return None  # a record file, which has a JSON object on each line, or garbage
    return data if isinstance(data, dict) and "benchmarks" in data else None


def from_benchmarks(saved: Mapping[str, Any], name: str) -> Baseline:
    """The run in the content of a pytest-benchmark file; benchmarks of other tests are left out.

    Raises:
        BaselineError: it is malformed, or holds no result of pytest-simbench.
    """
    benchmarks = saved.get("benchmarks")
    if not isinstance(benchmarks, list):
        raise BaselineError(f"the baseline {name} is malformed: 'benchmarks' is not a list")
    records: list[Record] = []
    for benchmark in benchmarks:
        extra = benchmark.get("extra_info") if isinstance(benchmark, Mapping) else None
        if not isinstance(extra, Mapping) or KEY not in extra:
            continue
        where = f"{name}, {benchmark.get('fullname', 'a benchmark without a name')}"
        try:
            records += from_extra_info(extra[KEY], where)
        except RecordError as error:
            raise BaselineError(f"the baseline cannot be read: {error}; give {FORMS}") from None
    if not records:
        raise BaselineError(
            f"the baseline {name} holds no repetition of a simulator that this version can "
            f"compare; give {FORMS}"
        )
    return Baseline(name, tuple(settled(records)))
