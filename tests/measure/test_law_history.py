"""Laws over releases: what was planted is told, and what a tolerance does not decide is not."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pytest_simbench.measure.history import LawHistory, histories, law_histories
from pytest_simbench.records.phenomena import PHENOMENON
from pytest_simbench.records.record import Record
from tests.records.build import failed, record

RELEASES = ("1.2", "1.9", "1.10", "2.0")


def asked(
    law: str, version: str, *ratios: float | None, phenomenon: str = "sliding"
) -> list[Record]:
    """A law asked of a release or a build (`@mine`), once for each ratio; None is a repetition that
    failed."""
    name = f"engine{version}" if version[0] == "@" else f"engine=={version}"
    named = {
        "simulator": name,
        "test": f"test_law[{name}-headless-{law}]",
        "function": "test_law",
        "variant": law,
        "task": law,
        "settings": {PHENOMENON: phenomenon},
    }
    return [
        replace(failed(k), **named)
        if ratio is None
        else record(k, metrics={"error": ratio / 8, "ratio": ratio}, **named)
        for k, ratio in enumerate(ratios)
    ]


def row(law: str, *ratios: float | None, phenomenon: str = "sliding") -> list[Record]:
    """A law over the releases."""
    pairs = zip(RELEASES, ratios, strict=True)
    return [r for v, ratio in pairs for r in asked(law, v, ratio, phenomenon=phenomenon)]


def only(records: list[Record]) -> LawHistory:
    (found,) = law_histories(records)
    return found


def test_what_each_release_changed() -> None:
    found = [*row("glide", 0.5, 0.5, 4.0, 4.0), *row("drop", 8.0, 0.4, 0.4, 0.4),
             *row("tower", 0.1, 0.1, None, 0.1), *row("slip", 3.0, 3.0, 3.0, 30.0),
             *row("fall", 0.2, 0.2, 0.2, 0.2, phenomenon="free motion")]  # fmt: skip
    history = only(found)
    assert history.releases == RELEASES
    assert history.title == "engine, 5 laws (headless tuned)"
    assert [law.name for law in history.laws] == ["fall", "glide", "drop", "tower", "slip"]
    assert history.sentences() == [
        "1.9: drop is kept (8x -> 0.4x)",
        "1.10: glide is broken (0.5x -> 4x); "
        "tower fails (0.1x before): WorkerHung: no answer for 30 s",
        "2.0: tower is kept (fails -> 0.1x); slip is missed by more (3x -> 30x)",
        "kept by all: 1 of 5 laws",
        "broken by all: slip",
    ]


def test_a_law_that_one_release_ran_is_not_kept_or_broken_by_all() -> None:
    last = [*asked("tower", "2.0", 0.5), *asked("spin", "2.0", 9.0)]
    assert only([*row("glide", 0.5, 0.5, 0.5, 0.5), *last]).sentences()[-2:] == [
        "kept by all that ran it: 2 of 3 laws",
        "broken by all that ran it: spin",
    ]


def twice(*last: float) -> list[Record]:
    """Two repetitions of each release, of the last one these."""
    sets = ((0.2, 0.3), (0.3, 0.2), (0.2, 0.2), last)
    return [r for v, told in zip(RELEASES, sets, strict=True) for r in asked("glide", v, *told)]


@pytest.mark.parametrize(
    ("found", "told"),
    [
        *(
            (row("glide", *ratios), "no release changed a law")
            for ratios in (
                (0.9, 1.9, 0.9, 1.9),  # within the bound of a tolerance
                (1.1, 2.1, 1.1, 2.1),  # less than twice as far
                (30.0, 40.0, 50.0, 59.0),
                (0.001, 0.9, 0.001, 0.9),  # kept is kept
                (None, None, None, None),
            )
        ),
        # What grows a little with each release.
        (row("glide", 3.0, 4.0, 5.0, 6.5), "2.0: glide is missed by more (3x -> 6.5x)"),
        (row("glide", 9.0, 9.0, 9.0, 3.0), "2.0: glide is missed by less (9x -> 3x)"),
        # Two releases are enough, and a build comes after them.
        ([*asked("glide", "1.9", 3.0), *asked("glide", "1.10", 0.5)],
         "1.10: glide is kept (3x -> 0.5x)"),
        ([*asked("glide", "@mine", 8.0), *asked("glide", "1.9", 0.5)],
         "@mine: glide is broken (0.5x -> 8x)"),
        # Several repetitions must all have changed.
        (twice(5.0, 0.2), "no release changed a law"),
        (twice(5.0, 6.0), "2.0: glide is broken (0.3x -> 6x)"),
        # A law that a release was not asked counts for nothing.
        ([*row("fall", 0.1, 0.1, 0.1, 0.1), *asked("glide", "1.2", 0.5), *asked("glide", "2.0", 5)],
         "2.0: glide is broken (0.5x -> 5x)"),
        # Nor does one that the user ended.
        ([*row("glide", 0.5, 0.5, 0.5, 0.5)[:3],
          *(replace(r, status="interrupted") for r in asked("glide", "2.0", None))],
         "no release changed a law"),
    ],
)  # fmt: skip
def test_what_is_a_change(found: list[Record], told: str) -> None:
    assert only(found).sentences()[0] == told


def test_a_release_that_changed_no_bit() -> None:
    told = only([*row("glide", 0.5, 0.5, 0.6, 0.6), *row("drop", 0.1, 0.1, 0.1, 0.1)]).sentences()
    assert "not one reading changed, to the last bit, with 1.9, 2.0" in told


def test_laws_are_in_no_other_history() -> None:
    found = row("glide", 0.5, 0.5, 4.0, 4.0)
    assert histories(found, {}) == []
    assert law_histories(found[:1]) == []
    assert law_histories([replace(r, settings={}) for r in found]) == []
