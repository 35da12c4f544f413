"""Claims: the page says what the kept numbers say, and a verdict follows its rule."""

from __future__ import annotations

import re
import sys
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "docs"))

import made  # noqa: E402
import make_claims  # noqa: E402
from pytest_simbench.suites.referee import FAR, over, verdict  # noqa: E402


def test_the_page_says_what_the_numbers_say() -> None:
    parts: dict[str, dict[str, list[str]]] = {name: {} for name in make_claims.CLAIMS}
    for line in make_claims.lines():
        parts[line["claim"]].setdefault(line["part"].strip(), []).append(line["verdict"])
    found = {name: verdict(of) for name, of in parts.items()}
    kinds = Counter(found.values())
    kept, missed, open_ = (kinds[k] for k in ("holds", "does not hold", "cannot be decided"))
    told = f"{kept} hold, {missed} do not hold, and {open_} cannot be decided**"
    page = (made.DOCS / "claims.md").read_text("utf-8")
    assert f"**Of {len(found)} claims {told}" in page
    named = re.findall(r"^- `(\w+)`: ", page, re.M)
    assert sorted(named) == sorted(n for n, of in found.items() if of == "does not hold")
    table = made.filled(page)
    assert all(f"| `{name}` |" in table for name in found)


@pytest.mark.parametrize(
    ("one", "other", "found"),
    [
        (["PASS", "PASS"], ["PASS"], "holds"),
        (["PASS", "FAIL"], ["PASS"], "cannot be decided"),  # two steps disagree
        (["PASS", "UNDECIDED"], ["PASS"], "cannot be decided"),
        (["PASS", "UNDECIDED"], ["FAIL", "FAIL"], "does not hold"),
    ],
)
def test_a_verdict_on_a_claim(one: list[str], other: list[str], found: str) -> None:
    assert verdict({"one": one, "other": other}) == found
    assert verdict({}) == "cannot be decided"


def test_what_is_not_off_at_all_is_beaten_by_nobody() -> None:
    """Seeds at which the other one had an error of 0 were left out."""
    sides = {1: 2.0, 2: 1.0, 3: 0.0, 4: 0.0, 5: 1.0}, {1: 4.0, 2: 0.0, 3: 0.0, 4: 1.0}
    a, b = (SimpleNamespace(by_seed=lambda _, of=of: of, crashed=()) for of in sides)
    assert over(a, b) == [0.5, FAR, 1.0, 0.0]  # type: ignore[arg-type]


def test_a_number_that_nobody_can_judge_is_not_told_as_missed() -> None:
    def told(*verdicts: str) -> str:
        line = {"mean": "0.2", "low": "0.1", "high": "0.9"}
        return make_claims._numbers("cost", [{**line, "verdict": found} for found in verdicts])

    assert told("UNDECIDED", "UNDECIDED") == "cost 0.2 [0.1, 0.9] (undecided)"
    assert told("UNDECIDED", "FAIL") == "cost 0.2 [0.1, 0.9] (undecided)"
    assert told("FAIL", "FAIL") == "cost 0.2 [0.1, 0.9] (misses)"
    assert told("PASS", "UNDECIDED") == "cost 0.2 [0.1, 0.9] (1 of 2 ways)"
