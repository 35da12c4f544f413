"""Policies on several simulators: how often each succeeds, and who ranks them alike."""

from __future__ import annotations

import math

import numpy as np

from pytest_simbench.measure.intervals import Interval
from pytest_simbench.measure.transfer import METRIC, NARROW, Transfer
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.record import Who
from pytest_simbench.report.model import cells
from pytest_simbench.report.model.document import Cell, Column, Section, Table, listed, names
from pytest_simbench.report.model.pooling import spread

NAMED = 3
"""How many pairs of a verdict a sentence names, those with the lowest tau-b first."""

READING = (
    "tau-b is 1 where two simulators order policies alike and -1 where one reverses the other's; "
    "in brackets its 95 % interval. On the diagonal stands the ceiling: a simulator against itself "
    "on other seeds."
)
VIOLATED = (
    "MMRV of each row by each column as reference: success in the reference that the worst wrong "
    "order of a policy costs, mean of the policies; on the diagonal by itself on other seeds. "
    f"Seeds: about how many make the ceiling's interval of tau-b at most {NARROW} wide."
)

COLOURED = {"different": "apart", "open": "open"}

SUCCESS = Metric(METRIC, METRIC, kind="yes_no")


def section(found: Transfer) -> Section:
    """Who ranks alike; success, tau-b, and MMRV."""
    left = {
        "a policy is missing there": listed(names(found.left_out)),
        "too few simulators have it": listed(found.lone),
    }
    notes = [f"not compared, since {why}: {who}" for why, who in left.items() if who]
    shown = [
        Table("success of policies", _success(found), f"{found.seeds} seeds, the same everywhere."),
        Table("tau-b between simulators", _ranks(found), READING),
        Table("MMRV, and seeds that tell", _violations(found), VIOLATED),
    ]
    return Section(f"Transfer of {found.task}", sentences(found), shown, notes, "transfer")


def sentences(found: Transfer) -> list[str]:
    """One for each verdict that a pair of simulators has, and what the worst pair disagrees in."""
    known, own = names(found.simulators), found.ceilings
    places: dict[str, list[tuple[int, int]]] = {}
    for place, _ in sorted(found.pairs.items(), key=lambda item: np.nan_to_num(item[1].tau.mean)):
        places.setdefault(found.verdict(*place), []).append(place)
    untold = sorted({k for pair in places.get("open", ()) for k in pair})
    needed = max([own[k].needed or 0 for k in untold], default=0)
    lost = listed([known[k] for k in untold if not own[k].needed], NAMED)
    heads = {
        "different": "Ranks differ by more than the noise",
        "alike": "As alike as two runs of one engine",
        "open": f"Cannot be told with {found.seeds} seeds"
        + (f", about {_rounded(needed)} are needed" if needed > found.seeds else "")
        + (f"; on {lost} policies succeed too equally for any number" if lost else ""),
    }
    told = []
    for verdict, head in heads.items():
        pairs = [
            f"{known[i]} and {known[j]} (tau-b {interval(found.tau(i, j))}, ceilings "
            f"{cells.two_decimals(own[i].tau.mean)} and {cells.two_decimals(own[j].tau.mean)})"
            for i, j in places.get(verdict, ())
        ]
        told += [f"{head}: {listed(pairs, NAMED)}."] * bool(pairs)
    for i, j in places.get("different", ())[:1]:
        first, second = found.pairs[i, j].crossed
        shares = [
            f"in {100 * rates[first]:.0f} and {100 * rates[second]:.0f} % on {known[k]}"
            for k in (i, j)
            for rates in [found.outcomes[k].mean(1)]
        ]
        both = f"{found.policies[first]} and {found.policies[second]}"
        told.append(f"{both} succeed {' but '.join(shares)}.")
    ties = [known[k] for k, rates in enumerate(found.outcomes.mean(2)) if not np.ptp(rates)]
    if ties:
        told.append(f"There is no tau-b of {listed(ties)}, where all policies succeed as often.")
    return told


def _rounded(seeds: int) -> str:
    return f"{float(f'{seeds:.2g}'):.0f}"


def interval(found: Interval) -> str:
    """Value and ends."""
    mean, *ends = map(cells.two_decimals, (found.mean, found.low, found.high))
    return mean if math.isinf(found.high) else f"{mean} [{', '.join(ends)}]"


def _simulators(found: Transfer) -> Column:
    whole = zip(names(found.simulators), found.simulators, strict=True)
    return Column("simulator", [Cell([name], of=Who(*who[:3])) for name, who in whole], left=True)


def _success(found: Transfer) -> list[Column]:
    columns = [_simulators(found)]
    for policy, of in zip(found.policies, found.outcomes.swapaxes(0, 1), strict=True):
        shown = [cells.mean_interval(spread(values.tolist(), SUCCESS), SUCCESS) for values in of]
        columns.append(Column(f"{policy} %", shown))
    return columns


def _ranks(found: Transfer) -> list[Column]:
    known = names(found.simulators)
    columns = [_simulators(found)]
    for j, name in enumerate(known):
        shown = []
        for i in range(len(known)):
            verdict = COLOURED.get(found.verdict(min(i, j), max(i, j)), "") if i != j else ""
            shown.append(Cell(interval(found.tau(i, j)).split(" ", 1), verdict=verdict))
        columns.append(Column(name, shown))
    return columns


def _violations(found: Transfer) -> list[Column]:
    known, needed = names(found.simulators), [own.needed for own in found.ceilings]
    by = [
        Column(f"by {name}", [interval(found.mmrv(i, j)) for i in range(len(known))])
        for j, name in enumerate(known)
    ]
    seeds = Column("seeds", [cells.MISSING if n is None else _rounded(n) for n in needed])
    return [_simulators(found), *by, seeds]
