"""The runs behind the published numbers, as docs/data/*.csv holds them: see make_results.py."""

from __future__ import annotations

import csv
import statistics
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pytest_simbench.records.metrics import COSTS, Metric
from pytest_simbench.records.record import Failure, Record
from pytest_simbench.report.model import cells
from pytest_simbench.report.model.pooling import spread
from pytest_simbench.tasks import Stacking, Throwing

DATA = Path(__file__).resolve().parent / "data"
TASKS = {"stacking": Stacking(), "throwing": Throwing()}
REPETITIONS = 20

SIMULATORS = {
    "mujoco": "MuJoCo", "pybullet": "PyBullet", "sapien": "SAPIEN", "ovphysx": "Omniverse PhysX",
    "drake": "Drake", "dart": "DART", "newton": "Newton", "genesis": "Genesis",
}  # fmt: skip
PROFILES = ("tuned", "default")
SETTINGS = [(rules, profile) for rules in ("ours", "study") for profile in PROFILES]
RULES = {
    "ours": "ours",
    "study": "**the study's**",
    "attempt": "one attempt for each place",
    "retreat": "count after the retreat",
    "speed": "full speed",
    "drop": "let go at 20 mm",
    "fingers": "fingers 0.020 m closed",
    "swing": "the study's swing",
    "windup": "the study's speeds before the swing",
}
"""Ours, the study's, and ours with one rule of the study's."""

IDENTITY = ("rules", "profile", "simulator", "version", "commit", "seed", "status", "cause")
PARTS = {
    "stacking": ("spare_places",),
    "throwing": ("flight_x", "limits_velocity", "limits_acceleration", "limits_torque"),
}
"""Of a record's details: places that only a further cube filled; where the simulated flight crosses
z = 0.05 [m]; the share of each of the arm's limits that the executed throw took [%]."""

COST_NAMES = ("rtf", "cpu", "cpu_cost", "ram", "ram_peak", "start", "end")


@dataclass(frozen=True)
class Run:
    """The repetitions of one configuration at one task, as lines of the CSV."""

    task: str
    lines: list[dict[str, str]]

    def values(self, name: str) -> dict[int, float]:
        """By seed, of the repetitions that have a value; a crashed one has the worst, if there is
        any, but not by the study's rules."""
        metric = METRICS[self.task].get(name)
        known = [line for line in self.lines if line["status"] == "ok" and line[name]]
        found = {int(line["seed"]): _exact(self.task, name, float(line[name])) for line in known}
        if metric is not None and metric.crashed is not None:
            crashed = [line for line in self.lines if line["status"] == "failed"]
            counted = [line for line in crashed if line.get("rules") != "study"]
            found |= {int(line["seed"]): metric.crashed for line in counted}
        return found

    def mean(self, name: str, scale: float = 1.0) -> float | None:
        found = self.values(name)
        return scale * statistics.fmean(found.values()) if found else None

    def cell(self, name: str) -> str:
        """Mean and 95 % interval; of yes or no how many of how many."""
        metric = METRICS[self.task][name]
        found = spread(self.values(name).values(), metric)
        if metric.kind == "yes_no" and found:
            yes = f"{round(found.mean * found.count)} of {found.count}"
            return f"{yes} {cells.interval(found, metric)}"
        return cells.mean_interval(found, metric).text

    @property
    def repetitions(self) -> str:
        failed = sum(line["status"] == "failed" for line in self.lines)
        return f"{len(self.lines)}{f', {failed} failed' if failed else ''}"

    def records(self) -> list[Record]:
        return [_record(self.task, number, line) for number, line in enumerate(self.lines, 1)]


def _exact(task: str, name: str, value: float) -> float:
    """A share of 6 cubes is a third, and not the 0.333333 of the CSV."""
    metric = METRICS[task].get(name)
    return round(value * metric.of) / metric.of if metric and metric.of else value


METRICS: dict[str, dict[str, Metric]] = {
    name: {metric.name: metric for metric in (*task.metrics, *COSTS)}
    for name, task in TASKS.items()
}
Runs = dict[tuple[str, str, str, str], Run]
"""By rules, profile, task and simulator."""


def read_folders(runs: Path, commit: str) -> None:
    """Put what the run folders hold into the CSV."""
    for task in TASKS:
        known = load().items()
        lines = {key: run.lines for key, run in known if key[2] == task}
        for folder in sorted(runs.glob(f"*-*-{task}/*/")):
            rules, profile, _ = folder.parent.name.split("-")
            path = folder / "records.jsonl"
            text = path.read_text("utf-8") if path.exists() else ""
            records = [Record.from_json(line) for line in text.splitlines()]
            records = [r for r in records if r.status != "interrupted"]
            if records:
                found = sorted(records, key=lambda r: r.seed)
                key = (rules, profile, task, folder.name)
                lines[key] = [_line(record, rules, commit) for record in found]
        names = [metric.name for metric in TASKS[task].metrics]
        with (DATA / f"{task}.csv").open("w", encoding="utf-8", newline="") as file:
            columns = [*IDENTITY, *names, *PARTS[task], *COST_NAMES]
            writer = csv.DictWriter(file, columns, lineterminator="\n")
            writer.writeheader()
            for key in sorted(lines, key=_order):
                writer.writerows(lines[key])


def _line(record: Record, rules: str, commit: str) -> dict[str, str]:
    details = record.details
    known: dict[str, Any] = {
        **{"rules": rules, "profile": record.profile, "simulator": record.simulator},
        **{"version": record.versions.get(record.simulator, ""), "commit": commit},
        **{"seed": record.seed, "status": record.status, **record.metrics},
        **{"cause": record.error.cause if record.error else ""},
        **{name: record.cost(name) for name in COST_NAMES},
    }
    if record.task == "stacking":
        missed = {(pick["tower"], pick["level"]) for pick in details.get("failed_picks", ())}
        stood = {(pick["tower"], pick["level"]) for pick in details.get("picks", ())}
        known["spare_places"] = len(missed & stood)
    else:
        known["flight_x"] = details.get("flight_landing_x")
        for name, share in details.get("limits", {}).items():
            known[f"limits_{name}"] = 100 * share
    return {name: _short(value) for name, value in known.items()}


def _short(value: Any) -> str:
    if value is None or isinstance(value, str):
        return value or ""
    return str(value) if isinstance(value, int) else f"{value:.6g}"


def load() -> Runs:
    """What docs/data/*.csv holds."""
    found: Runs = {}
    for task in TASKS:
        path = DATA / f"{task}.csv"
        with path.open(encoding="utf-8", newline="") as file:
            for line in csv.DictReader(file):
                key = (line["rules"], line["profile"], task, line["simulator"])
                found.setdefault(key, Run(task, [])).lines.append(line)
    return {key: found[key] for key in sorted(found, key=_order)}


def _order(key: tuple[str, str, str, str]) -> tuple[int, ...]:
    rules, profile, task, simulator = key
    places = (list(RULES).index(rules), PROFILES.index(profile), list(TASKS).index(task))
    return (*places, list(SIMULATORS).index(simulator))


def _record(task: str, number: int, line: dict[str, str]) -> Record:
    value = {name: float(text) for name, text in line.items() if name in COST_NAMES and text}
    names = [metric.name for metric in TASKS[task].metrics if line[metric.name]]
    metrics = {name: _exact(task, name, float(line[name])) for name in names}
    wall, cpu = 1 / value.get("rtf", 1.0), value.get("cpu_cost", 0.0)
    stepping = {"simulated": 1.0, "wall": wall, "cpu": cpu}
    cause, _, phase = line["cause"].partition(" in ")
    return Record(
        test=task,
        function=task,
        task=task,
        simulator=line["simulator"],
        mode="headless",
        profile=line["profile"],
        protocol="paper" if line["rules"] == "study" else "fast",
        repetition=number,
        seed=int(line["seed"]),
        status=line["status"],  # type: ignore[arg-type]
        error=Failure(cause, phase=phase) if cause else None,
        metrics=metrics,
        stepping=stepping if "rtf" in value else {},
        timeline={name: value[name] for name in ("start", "end") if name in value},
        resources={
            "cpu_percent": {"mean": value.get("cpu")},
            "rss_mb": {"mean": value.get("ram"), "peak": value.get("ram_peak")},
            "samples": 1,
        },
    )
