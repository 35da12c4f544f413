"""How well simulators rank policies, from docs/data/transfer.csv: a line for each simulator and
policy, with a sign for each seed from `FIRST` on: 1 success, 0 none, x crashed."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from itertools import combinations

import numpy as np
from tables import DATA, NAMES, table

from pytest_simbench.measure.comparison import ALPHA, holm
from pytest_simbench.measure.transfer import METRIC, POLICY, Ceiling, Transfer
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
    rows = []  # all of them first: a seed that is missing must not cost the file
    for key in sorted(found):
        seeds = range(FIRST, FIRST + len(found[key]))
        rows.append((*key, "".join(found[key][seed] for seed in seeds)))
    with FILE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerows([("simulator", "policy", "seeds"), *rows])


OWN = [name for name in NAMES if any(name == who for who, _ in signs())]


def transfer(*own: str) -> Transfer:
    """Of simulators, with the seeds that all of them have; policies by success, best first."""
    kept = {(who, policy): line for (who, policy), line in signs().items() if who in own}
    policies = sorted({policy for _, policy in kept})
    seeds = min(map(len, kept.values()))
    rows = [[[*kept[who, policy][:seeds]] for policy in policies] for who in own]
    outcomes = (np.array(rows) == "1").astype(float)
    order = np.argsort(-outcomes.sum((0, 2)))
    whole = [(who, "headless", "tuned") for who in own]
    return Transfer(TASK, [policies[k] for k in order], whole, outcomes[:, order])


def matrix() -> str:
    """Success of each policy on each simulator with all of its seeds, and how far its rankings can
    be trusted."""
    kept, found, rows = signs(), transfer(*OWN), []
    for who, _, _ in found.simulators:
        outcomes = np.array([[*kept[who, policy]] for policy in found.policies]) == "1"
        ceiling = Ceiling(outcomes.astype(float))
        shares = [f"{100 * share:.0f}" for share in outcomes.mean(1)]
        told = str(outcomes.shape[1]), interval(ceiling.tau), f"{ceiling.needed or 'any'}"
        rows.append((NAMES[who], *shares, *told))
    heads = "seeds", "ceiling of tau-b", "seeds it takes"
    return table(("success %", *found.policies, *heads), rows)


def ranks() -> str:
    """tau-b of each two simulators with the seeds that both have; bold: they rank differently."""
    pairs = {pair: transfer(*pair) for pair in combinations(OWN, 2)}
    p_values = holm([found.pairs[0, 1].p_value for found in pairs.values()])
    told = {}
    for (pair, found), p_value in zip(pairs.items(), p_values, strict=True):
        cell = f"{found.pairs[0, 1].tau.mean:.2f} ({found.seeds})"
        told[pair] = f"**{cell}**" if p_value <= ALPHA else cell
    rows = [[NAMES[one], *(told.get((one, other), "") for other in OWN[1:])] for one in OWN[:-1]]
    return table(("tau-b (seeds)", *(NAMES[who] for who in OWN[1:])), rows)
