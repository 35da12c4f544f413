"""With what a run was made: protocol, seeds, machines, and each simulator's settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pytest_simbench.records.configuration import TASK, text
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import told
from pytest_simbench.report.model import tables
from pytest_simbench.report.model.document import Of
from pytest_simbench.report.model.summary import TaskSummary


@dataclass(frozen=True)
class Configured:
    """One row's simulator: settings and versions, by name."""

    label: str
    of: Of
    settings: Mapping[str, str]
    versions: Mapping[str, str]
    deviations: Sequence[str]


@dataclass(frozen=True)
class Setup:
    """What holds for the whole run, each with all its values, and what for single simulators.

    Attributes:
        run: protocol, jitter, seeds, limits, machines.
        tasks: parameters of each task, by its name.
    """

    run: Mapping[str, str]
    tasks: Mapping[str, Mapping[str, str]]
    simulators: Sequence[Configured]


def setup(summaries: Sequence[TaskSummary]) -> Setup:
    """The setup of a run."""
    deviations: dict[str, list[str]] = {}
    for name, deviation in tables.deviations(summaries):
        deviations.setdefault(name, []).append(deviation)
    tasks: dict[str, dict[str, list[str]]] = {}
    found: dict[tuple[str, ...], Configured] = {}
    for summary in summaries:
        for row in summary.rows:
            known = {key: _shown(value) for key, value in told(row.records).items()}
            for name, value in _part(known, f"settings.{TASK}").items():
                tasks.setdefault(summary.task, {}).setdefault(name, []).append(value)
            settings = _part(known, "settings.")
            settings = {k: v for k, v in settings.items() if not k.startswith(TASK)}
            versions, of = _part(known, "versions."), row.of
            found.setdefault(
                (*of, text(settings), text(versions)),
                Configured(" ".join(of), of, settings, versions, deviations.get(of.simulator, [])),
            )
    shared = {
        task: {name: _joined(values) for name, values in parameters.items()}
        for task, parameters in tasks.items()
    }
    records = [record for summary in summaries for row in summary.rows for record in row.records]
    return Setup(_run(records), shared, list(found.values()))


def _run(records: Sequence[Record]) -> dict[str, str]:
    seeds = sorted({record.seed for record in records})
    named = {
        "protocol": [record.protocol for record in records],
        "jitter": [f"{record.jitter:g}" for record in records],
        "limits": [
            ", ".join(f"{k} {_shown(v)}" for k, v in r.limits.items() if v is not None)
            for r in records
        ],
        "machine": [", ".join(f"{k}: {_shown(v)}" for k, v in r.host.items()) for r in records],
    }
    found = {name: _joined(values) for name, values in named.items()}
    if seeds:
        many = f"{seeds[0]} to {seeds[-1]} ({len(seeds)})"
        found["seeds"] = many if len(seeds) > 1 else str(seeds[0])
    return {name: value for name, value in found.items() if value}


def _part(known: Mapping[str, str], start: str) -> dict[str, str]:
    return {k.removeprefix(start): value for k, value in known.items() if k.startswith(start)}


def _joined(values: Sequence[str]) -> str:
    """Each different value once."""
    return "; ".join(dict.fromkeys(filter(None, values)))


def _shown(value: object) -> str:
    return value if isinstance(value, str) else text(value)
