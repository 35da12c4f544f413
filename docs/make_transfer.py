"""How well simulators rank policies, from docs/data/transfer.csv: a line for each simulator and
policy, with a sign for each seed from `FIRST` on: 1 success, 0 none, x crashed."""

from __future__ import annotations

import csv
from collections.abc import Iterable

import numpy as np
from tables import DATA, NAMES, table

from pytest_simbench.measure.transfer import METRIC, POLICY, Ceiling
from pytest_simbench.records.record import Record
from pytest_simbench.report.model.transfer import interval

FILE, TASK = DATA / "transfer.csv", "pushing_to_goal"
FIRST, LAST = 2000, 10_000
"""Seeds; those of a run that names none begin after them."""


def signs() -> dict[tuple[str, str], str]:
    """By simulator and policy."""
    with FILE.open(encoding="utf-8", newline="") as file:
        return {(line["simulator"], line["policy"]): line["seeds"] for line in csv.DictReader(file)}


def read(records: Iterable[Record]) -> None:
    """Put runs of suites/policies/ladder.py into the file; seeds follow those that are there."""
    found = {key: dict(enumerate(kept, FIRST)) for key, kept in signs().items()}
    for r in records:
        late = r.task != TASK or r.settings["task.command_latency"]
        if not late and r.profile == "tuned" and r.seed <= LAST and r.status != "interrupted":
            sign = "x" if r.status == "failed" else f"{r.metrics[METRIC]:.0f}"
            found.setdefault((r.simulator, str(r.settings[POLICY])), {})[r.seed] = sign
    with FILE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("simulator", "policy", "seeds"))
        for key in sorted(found):
            seeds = range(FIRST, FIRST + len(found[key]))
            writer.writerow((*key, "".join(found[key][seed] for seed in seeds)))


def ceilings() -> str:
    """A row for each simulator: success of the best and the worst but the limp one, and how far its
    rankings can be trusted."""
    kept, rows = signs(), []
    for simulator, name in NAMES.items():
        of = [np.array([*line]) == "1" for (whose, _), line in kept.items() if whose == simulator]
        if of:
            ceiling = Ceiling(np.array(of, dtype=float))
            shares = sorted(100 * line.mean() for line in of)
            spread = f"{shares[1]:.0f} to {shares[-1]:.0f}"
            told = interval(ceiling.tau)
            rows.append((name, str(len(of[0])), spread, told, f"{ceiling.needed or 'any'}"))
    return table(("simulator", "seeds", "success %", "ceiling of tau-b", "seeds it takes"), rows)
