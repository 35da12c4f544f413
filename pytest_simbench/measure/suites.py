"""`simbench stats`: what the suites' claims let pass."""

from __future__ import annotations

from pytest_simbench.measure.power import alike_rate, least_supported, passing_rate
from pytest_simbench.measure.verdicts import confidence
from pytest_simbench.records.metrics import CRASHED, Metric


def stats() -> int:
    """Print what the suites' claims let pass, for docs/gate.md."""
    yes, share = (
        Metric("hit", "hit", kind="yes_no"),
        Metric("placed", "placed", kind="share", of=15),
    )
    claims = [
        ("crashed at most 15 %", 0.85, CRASHED),
        ("`hit` at least 80 %", 0.8, yes),
        ("`placed`, `at_end` at least 80 %", 0.8, share),
        ("`moved` at least 20 %", 0.2, share),
    ]
    columns = ("claim", "repetitions", "supported by", "passes half of the time", "1 in 20 times")
    print(f"| {' | '.join([*columns, 'fails if all repetitions are alike'])} |")
    print("|:--|--:|--:|--:|--:|--:|")
    for name, least, metric in claims:
        for n in (5, 20, 80):
            level = confidence(metric)
            needed = least_supported(least, metric, n, level)
            rates = [passing_rate(least, metric, n, chance, level) for chance in (0.5, 0.05)]
            alike = f"below {100 * alike_rate(least, metric, n, level):.0f} %"
            if metric is CRASHED:
                rates = [1 - rate for rate in rates]
            text = "none" if needed is None else f"{needed} of {n}"
            if needed is not None and metric is CRASHED:
                text = f"{n - needed} crashed"
            cells = [name, n, text, *(f"{100 * rate:.0f} %" for rate in rates)]
            print(f"| {' | '.join(map(str, [*cells, alike if metric is share else '']))} |")
    return 0
