"""With what a run was made: protocol, seeds, machines, and each simulator's settings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from pytest_simbench.records.configuration import TASK, bare, text
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import told
from pytest_simbench.report.model.summary import TaskSummary


def setup(summaries: Sequence[TaskSummary]) -> dict[str, Any]:
    """What holds for the whole `run`, each with all its values (protocol, jitter, seeds, limits,
    machines), the parameters of each of the `tasks`, and for each of the `simulators` settings,
    versions and deviations."""
    tasks: dict[str, dict[str, list[str]]] = {}
    simulators: dict[tuple[str, ...], dict[str, Any]] = {}
    for summary in summaries:
        for row in summary.rows:
            known = {key: bare(value) for key, value in told(row.records).items()}
            for name, value in _part(known, f"settings.{TASK}").items():
                tasks.setdefault(summary.task, {}).setdefault(name, []).append(value)
            settings, versions = _part(known, "settings."), _part(known, "versions.")
            settings = {k: v for k, v in settings.items() if not k.startswith(TASK)}
            found = {
                "label": " ".join(row.of),
                "of": row.of,
                "settings": settings,
                "versions": versions,
                "deviations": [],
            }
            found = simulators.setdefault((*row.of, text(settings), text(versions)), found)
            found["deviations"] = sorted({*found["deviations"], *row.deviations})
    shared = {
        task: {name: _joined(values) for name, values in parameters.items()}
        for task, parameters in tasks.items()
    }
    records = [record for summary in summaries for row in summary.rows for record in row.records]
    return {"run": _run(records), "tasks": shared, "simulators": list(simulators.values())}


def _run(records: Sequence[Record]) -> dict[str, str]:
    seeds = sorted({record.seed for record in records})
    named = {
        "protocol": _joined(record.protocol for record in records),
        "jitter": _joined(f"{record.jitter:g}" for record in records),
        "limits": _joined(
            ", ".join(f"{k} {bare(v)}" for k, v in r.limits.items() if v is not None)
            for r in records
        ),
        "machine": _joined(
            ", ".join(f"{k}: {bare(v)}" for k, v in r.host.items()) for r in records
        ),
    }
    if seeds:
        many = f"{seeds[0]} to {seeds[-1]} ({len(seeds)})"
        named["seeds"] = many if len(seeds) > 1 else str(seeds[0])
    return {name: value for name, value in named.items() if value}


def _part(known: Mapping[str, str], start: str) -> dict[str, str]:
    return {k.removeprefix(start): value for k, value in known.items() if k.startswith(start)}


def _joined(values: Iterable[str]) -> str:
    """Each different value once."""
    return "; ".join(dict.fromkeys(filter(None, values)))
