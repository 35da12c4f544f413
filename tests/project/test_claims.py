"""Claims: the page is what the script makes of the kept numbers, and a verdict follows its rule."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "docs"))

import made  # noqa: E402
import make_claims  # noqa: E402
from pytest_simbench.suites.referee import verdict  # noqa: E402


def test_the_page_is_what_the_script_makes() -> None:
    page = made.DOCS / "claims.md"
    assert page.read_text("utf-8") == made.readme(page), "run `python docs/made.py`"
    assert {line["claim"] for line in make_claims.lines()} == set(make_claims.CLAIMS)


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
