"""Settings are chosen on some seeds and published on others; where not, the report says so."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.plugin.options import MOST_REPETITIONS, option
from pytest_simbench.records.notes import Notes
from pytest_simbench.records.record import Record
from pytest_simbench.records.tuned_on import FIRST_SEED, Seen, published_again
from pytest_simbench.report.markdown.run import render_task as written
from pytest_simbench.report.model.summary import summarise
from pytest_simbench.report.terminal.run import render_task
from pytest_simbench.simulator.registry import adapter, registered, seeds_seen
from tests.report.samples import METRICS, record
from tests.tiny import Falling

TASKS = ("stacking", "throwing", "pushing", "pushing_curve", "carrying")
"""On whose seeds settings were chosen."""

SEEN = (Seen.seeds("throwing", 2022, 2041), Seen.seeds("stacking", 100, 100))


def run(seeds: Sequence[int], task: str = "throwing", **changes: object) -> list[Record]:
    return [
        record("pybullet", k, task, seed=seed, notes=Notes(chosen_on=SEEN), **changes)  # type: ignore[arg-type]
        for k, seed in enumerate(seeds, start=1)
    ]


@pytest.mark.parametrize(
    ("seeds", "task", "sentence"),
    [
        (range(2022, 2042), "throwing", "seeds 2022 to 2041 of this task, and 20 of these 20"),
        (range(2037, 2045), "throwing", "seeds 2022 to 2041 of this task, and 5 of these 8"),
        ([2041], "throwing", "seeds 2022 to 2041 of this task, and 1 of these 1"),
        ([100, 101], "stacking", "seed 100 of this task, and 1 of these 2"),
        (range(2042, 2062), "throwing", ""),
        ([2021], "throwing", ""),
        (range(2022, 2042), "stacking", ""),
    ],
)
def test_a_report_on_the_seeds_of_choosing_says_so_under_the_table(
    seeds: Sequence[int], task: str, sentence: str
) -> None:
    (found,) = summarise(run(seeds, task), METRICS)
    whole = f"its settings were chosen on {sentence} repetitions are of them: publish others"
    told = [f"{whole} (--sim-seed)"] if sentence else []
    assert [note for row in found.rows for note in row.notes] == told
    for text in (render_task(found, 200), written(found)):
        assert text.count(sentence or "chosen") == len(told)


@pytest.mark.parametrize(
    ("numbers", "sentence"),
    [
        ((0, 6, 7, 564), "numbers 0 to 564 in steps of 6 of cube_tosses, and 3 of these 4"),
        ((3, 9, 570), ""),
    ],
)
def test_a_report_on_the_data_of_choosing_says_so(numbers: Sequence[int], sentence: str) -> None:
    seen = (Seen.motions("cube_tosses", 0, 564, 6),)
    records = [
        record(
            "pybullet", k, "tossing", notes=Notes(chosen_on=seen, sample=("cube_tosses", number))
        )
        for k, number in enumerate(numbers, start=1)
    ]
    (found,) = summarise(records, METRICS)
    notes = [note for row in found.rows for note in row.notes]
    whole = "its settings were chosen on {} repetitions are held against them: publish others"
    assert notes == ([whole.format(sentence)] if sentence else [])
    assert Seen.motions("cube_tosses", 2, 4).holds("tossing", 6, ("cube_tosses", 3))
    others = [seen[0].holds("tossing", 6, sample) for sample in (("other", 6), None)]
    assert others == [False, False]


def test_only_repetitions_that_count_are_counted() -> None:
    records = [*run([2022, 3000]), *run([2023], status="interrupted")]
    (found,) = summarise(records, METRICS)
    assert "1 of these 2 repetitions" in render_task(found, 200)


def test_nothing_declared_is_nothing_said() -> None:
    assert published_again([("throwing", 2022, None, [])]) == ""
    assert published_again([]) == ""
    assert seeds_seen("pytest_simbench.sims.pybullet.adapter:PyBullet", "default") == ()
    assert seeds_seen("no.such.module:Adapter", "tuned") == ()
    assert seeds_seen("pytest_simbench.sims.pybullet.adapter:Missing", "tuned") == ()


def test_a_record_says_on_what_its_profile_was_chosen(case: Case) -> None:
    made, _ = Repetition(Experiment(case, Falling()), 1).run()
    declared = seeds_seen(case.adapter, case.profile)
    assert declared
    assert Record.from_json(made.to_json()).notes.chosen_on == declared


@pytest.mark.parametrize("name", registered())
def test_every_adapter_speaks_of_profiles_that_it_has(name: str) -> None:
    cls = adapter(name)
    assert cls.chosen_on.keys() <= cls.profiles.keys()
    for seen in (seen for all_seen in cls.chosen_on.values() for seen in all_seen):
        assert seen.data or seen.task in TASKS
        assert 0 <= seen.first <= seen.last


@pytest.mark.parametrize("name", registered())
def test_no_profile_was_chosen_on_the_default_seeds(name: str) -> None:
    default = range(FIRST_SEED, FIRST_SEED + MOST_REPETITIONS)
    assert option("sim_seed").default == FIRST_SEED
    for seen in (seen for all_seen in adapter(name).chosen_on.values() for seen in all_seen):
        assert seen.data or seen.last < FIRST_SEED or default[-1] < seen.first, seen


def test_pybullet_admits_the_seeds_of_its_throw() -> None:
    assert Seen.seeds("throwing", 2022, 2041) in adapter("pybullet").chosen_on["tuned"]
