"""With what a run was made: protocol, seeds, machines, and each simulator's settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pytest_simbench.records.configuration import TASK, text
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import series, told
from pytest_simbench.report.model import tables as columns
from pytest_simbench.report.model.summary import TaskSummary
from pytest_simbench.report.page.cells import Of


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


def setup(summaries: Sequence[TaskSummary], records: Sequence[Record]) -> Setup:
    """The setup of a run."""
    deviations: dict[str, list[str]] = {}
    for name, deviation in columns.deviations(summaries):
        deviations.setdefault(name, []).append(deviation)
    tasks: dict[str, dict[str, list[str]]] = {}
    found: dict[tuple[str, ...], Configured] = {}
    for summary in summaries:
        for row in series(r for r in records if r.task == summary.task):
            known = {key: _shown(value) for key, value in told(row.records).items()}
            parameters = tasks.setdefault(summary.task, {})
            for name, value in _part(known, f"settings.{TASK}").items():
                parameters.setdefault(name, []).append(value)
            settings = {
                key: value
                for key, value in _part(known, "settings.").items()
                if not key.startswith(TASK)
            }
            versions = _part(known, "versions.")
            subject = Of(*row.key[:3])
            same = (*subject, text(settings), text(versions))
            label = f"{subject.simulator} {subject.mode} {subject.profile}"
            found.setdefault(
                same,
                Configured(
                    label, subject, settings, versions, deviations.get(subject.simulator, [])
                ),
            )
    shared = {
        task: {name: _joined(values) for name, values in parameters.items()}
        for task, parameters in tasks.items()
        if parameters
    }
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
