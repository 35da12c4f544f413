"""The table of claims, from claims.csv and the words of `suites/test_claims.py`."""

from __future__ import annotations

import csv
from datetime import date

from pytest_simbench.suites import claims_ours, test_claims
from pytest_simbench.suites.referee import verdict
from tables import DATA, Line, table

from pytest_simbench.records.folder import RunContents

FILE = DATA / "claims.csv"
COLUMNS = (
    "claim", "part", "simulator", "way", "relation", "limit", "verdict", "mean", "low", "high",
    "n", "version", "date",
)  # fmt: skip
CLAIMS = {
    name.removeprefix("test_"): test
    for name, test in vars(test_claims).items()
    if hasattr(test, "words")
}
HEADS = ("claim", "who says what", "asked", "verdict", "numbers")
SHOWN = 2
"""Parts of a claim in its row; those that decide come first."""


def lines() -> list[Line]:
    with FILE.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def read(run: RunContents) -> bool:
    """Put a run's claims of the suite into the file, in place of what was known of them; whether
    there are any. The records of such a run are of no published table."""
    new, today = [], date.today().isoformat()
    for claim in run.claims:
        name = claim.function.rpartition("::test_")[2]
        if name in CLAIMS:
            part, way = claim.variant.rsplit(": ", 1)
            told = next(r.versions for r in run.every if r.simulator == claim.simulator)
            version = next(v for k, v in told.items() if k not in ("python", "pytest-simbench"))
            numbers = ["" if v is None else f"{v:.6g}" for v in (claim.mean, claim.low, claim.high)]
            asked = (name, part, claim.simulator, way, str(claim.relation), f"{claim.threshold:g}")
            row = (*asked, claim.verdict, *numbers, str(claim.n), version, today)
            new.append(dict(zip(COLUMNS, row, strict=True)))
    if new:
        names = {line["claim"] for line in new}
        kept = [line for line in lines() if line["claim"] not in names]
        with FILE.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows([*kept, *new])
    return bool(new)


def claims(what: str) -> str:
    """One table: `verdicts` on claims, or `versions` of who was asked (releases: the parts)."""
    known, rows = lines(), []
    if what == "versions":
        asked = {
            (n["simulator"], n["version"], n["date"]) for n in known if "==" not in n["simulator"]
        }
        return table(("simulator", "version", "asked on"), sorted(asked), 3)
    for name, test in CLAIMS.items():
        parts: dict[str, list[Line]] = {}
        for line in (one for one in known if one["claim"] == name):
            parts.setdefault(line["part"], []).append(line)
        found = verdict({k: [line["verdict"] for line in of] for k, of in parts.items()})
        first = sorted(parts, key=lambda k: [n["verdict"] != "FAIL" for n in parts[k]])
        told = [_numbers(part, parts[part]) for part in first[:SHOWN]]
        more = [f"and {len(first) - SHOWN} more"] if len(first) > SHOWN else []
        limits = " ".join((test.__doc__ or claims_ours.keeps.__doc__ or "").split())
        cells = (f"`{name}`", f"{test.by}: {test.words}", limits, f"**{found}**")
        rows.append([*cells, "; ".join(told + more)])
    for by, words, why in test_claims.NOT_HERE:
        rows.append(["-", f"{by}: {words}", why, "cannot be decided here", ""])
    return table(HEADS, rows, len(HEADS))


def _numbers(part: str, of: list[Line]) -> str:
    """Of all ways in which a part was asked: their means, and the ends of their intervals."""
    means = sorted(float(line["mean"]) for line in of)
    told = " to ".join(dict.fromkeys(f"{mean:.4g}" for mean in (means[0], means[-1])))
    low = min(float(line["low"] or line["mean"]) for line in of)
    high = max(float(line["high"] or line["mean"]) for line in of)
    ends = f" [{low:.3g}, {high:.3g}]" if low < high else ""
    kept = sum(line["verdict"] == "PASS" for line in of)
    none = " (misses)" if all(line["verdict"] == "FAIL" for line in of) else " (undecided)"
    share = "" if kept == len(of) else f" ({kept} of {len(of)} ways)" if kept else none
    return f"{part} {told}{ends}{share}"
