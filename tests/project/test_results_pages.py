"""The published numbers: made of docs/data by docs/made.py, on seeds nobody chose on."""

from __future__ import annotations

import csv
import re
import sys
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.plugin.options import MOST_REPETITIONS
from pytest_simbench.records.tuned_on import FIRST_SEED
from tests.records.build import record

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
sys.path.append(str(DOCS))  # for the scripts, which are no package

import made  # noqa: E402
import make_contact  # noqa: E402
import make_results  # noqa: E402
import make_tasks  # noqa: E402
import make_truth  # noqa: E402
import published_runs  # noqa: E402
import tables  # noqa: E402

SITE = [
    path for path in DOCS.rglob("*.md") if not {"_build", "data"} & {*path.relative_to(DOCS).parts}
]
MARKS = [(path, words) for path in SITE for words in made.MARK.findall(path.read_text("utf-8"))]


def test_the_table_of_the_readme_is_up_to_date() -> None:
    text = made.README.read_text("utf-8")
    assert "<!-- made: overview -->" in text
    assert text == made.readme(), "run `python docs/made.py`"


@pytest.mark.parametrize(
    "words", sorted({words for _, words in MARKS} - {"raw"}), ids=lambda w: w.replace(" ", "_")
)
def test_each_mark_of_a_page_becomes_a_table(words: str) -> None:
    text = made.filled(f"before\n\n<!-- made: {words} -->\n\nafter\n")
    first, *lines, last = (line for line in text.splitlines() if line)
    assert (first, last) == ("before", "after")
    assert len(lines) > 2
    assert all(line.startswith("|") for line in lines if line != "Nothing failed.")


def test_a_table_that_stands_in_git_is_replaced_and_its_neighbour_is_not_lost() -> None:
    text = "<!-- made: planted -->\n\n<!-- made: raw -->\n\nold\n\n<!-- end -->\n\n## After\n"
    found = made.filled(text)
    assert "planted fault" in found
    assert "data/ours_tuned_stacking.md" in found
    assert "old" not in found.split()
    assert found.endswith("\n\n## After\n")


def test_each_table_stands_on_a_page() -> None:
    words = {words for _, words in MARKS}
    told = {name for name in make_results.TABLES if not name.startswith(("engine", "overview"))}
    assert words >= told
    assert {word.split()[0] for word in words} >= made.TABLES.keys()


def test_pages_are_made_beside_the_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(made, "PAGES", {"laws": lambda: "# Laws\n"})
    monkeypatch.setattr(made, "DATA", tmp_path)
    made.write_pages()
    assert (tmp_path / "laws.md").read_text("utf-8") == "# Laws\n"


def test_laws_over_time_steps_are_as_old_as_the_laws() -> None:
    """Other commands measured them; what a law asks had changed since then."""
    kept, swept = (
        {
            (line["simulator"], line["law"], line["timestep"]): float(line["ratio"] or "inf")
            for line in of.lines(profile="tuned")
        }
        for of in (make_truth.TRUTH, make_truth.SWEEP)
    )
    both = kept.keys() & swept.keys()
    assert len(both) > 500
    assert [swept[one] for one in both] == pytest.approx([kept[one] for one in both], abs=1e-4)


def test_the_rows_of_kept_tables_are_as_wide_as_their_headings() -> None:
    for name, text in made.kept_pages().items():
        assert text.startswith("# "), name
        for block in text.split("\n\n"):
            bars = {len(re.findall(r"(?<!\\)\|", line)) for line in block.splitlines()}
            assert len(bars) == 1 or not block.startswith("|"), (name, block)


def test_pages_tell_how_many_laws_there_are() -> None:
    told = {
        int(number)
        for path in (ROOT / "README.md", DOCS / "truth.md", DOCS / "index.md")
        for number in re.findall(r"\b(\d+) (?:small\s+cases|laws\b)", path.read_text("utf-8"))
        if int(number) > 20
    }
    assert told - {709} == {len(make_truth.LAWS)}  # 709: of nine simulators
    assert made.PAGES["laws"]().count("\n| ") == len(make_truth.LAWS) + 2


@pytest.mark.parametrize("words", [words for _, words in MARKS if words.startswith("pushing")])
def test_ode_is_in_each_table_of_pushing(words: str) -> None:
    assert "\n| ODE |" in made.filled(f"<!-- made: {words} -->\n")


def test_other_arms_are_of_new_seeds() -> None:
    lines = make_tasks.ARMS.lines()
    assert {line["robot"] for line in lines} == {"ur5", "xarm7", "so101"}
    assert {line["seed"] for line in lines} == {str(920001 + k) for k in range(10)}


def test_genesis_keeps_what_it_was_asked_over_time_steps() -> None:
    found = [make_truth.phenomena("tuned"), make_truth.phenomena("default")]
    found += [make_truth.over_steps("steps")]
    kept = [re.findall(r"\n\| genesis \| (\d+)/\1 (\S+)", text) for text in found]
    assert [worst[-2:].strip("0123456789.") for ((_, worst),) in kept] == ["x", "x", "ms"]


def test_real_experiments_are_of_held_out_motions() -> None:
    tosses = {int(line["number"]) for line in make_tasks.EXPERIMENTS["tossing"].lines()}
    assert len(tosses) == 95
    assert all(number % 2 for number in tosses)
    impacts = {int(line["number"]) for line in make_tasks.EXPERIMENTS["impacting"].lines()}
    assert len(impacts) == 72
    assert all(number // 100 % 2 for number in impacts)
    runs = {int(line["number"]) for line in make_tasks.EXPERIMENTS["arm_pushing"].lines()}
    assert runs == {3, 7, 11, 15, 19, 31}
    for task in make_tasks.FOLLOWING:
        names = {line["number"] for line in make_tasks.EXPERIMENTS[task].lines()}
        assert len(names) == 12
        assert all(int(name[-4:]) // 2 % 2 for name in names)


def test_no_profile_was_chosen_on_a_published_seed() -> None:
    seeds = defaultdict(set)
    for task in (*published_runs.TASKS, "pushing"):
        for line in csv.DictReader((DOCS / "data" / f"{task}.csv").open(encoding="utf-8")):
            seeds[line["simulator"], task].add(int(line["seed"]))
    seen = [
        ((path.parent.name, task), range(int(first), int(last) + 1))
        for path in (ROOT / "sims").glob("*/settings.py")
        for task, first, last in re.findall(
            r'Seen\.seeds\("(\w+)", (\d+), (\d+)\)', path.read_text(encoding="utf-8")
        )
    ]
    assert len(seen) >= len(make_results.SIMULATORS)
    assert seeds.keys() & {name for name, _ in seen}
    assert [found for found in seen if seeds[found[0]].intersection(found[1])] == []
    default = range(FIRST_SEED, FIRST_SEED + MOST_REPETITIONS)
    assert not set().union(*seeds.values()).intersection(default)


@pytest.fixture
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of published numbers that holds nothing yet."""
    monkeypatch.setattr(tables, "DATA", tmp_path)
    kept = (*published_runs.PUBLISHED.values(), *make_tasks.KEPT, make_contact.CONTACT)
    for one in (*kept, make_truth.TRUTH, make_truth.SWEEP):
        (tmp_path / f"{one.name}.csv").write_text(f"{','.join(one.columns)}\n")
    return tmp_path


def write(folder: Path, *records: Any) -> None:
    folder.mkdir(parents=True)
    (folder / "records.jsonl").write_text("".join(f"{r.to_json()}\n" for r in records))


def stacking(seed: int, placed: float, **changes: Any) -> Any:
    return replace(
        record(simulator="mujoco"),
        task="stacking",
        seed=seed,
        repetition=seed,
        profile="tuned",
        metrics={"placed": placed, "failed_picks": 2.0},
        **changes,
    )


def test_runs_become_lines_and_lines_become_tables(data: Path, tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    details = {
        "picks": [{"tower": 0, "level": 0}, {"tower": 0, "level": 1}],
        "failed_picks": [{"tower": 0, "level": 1}, {"tower": 2, "level": 4}],
    }
    done = [stacking(seed, 2 / 3, details=details) for seed in range(1, 21)]
    write(runs / "ours", *reversed(done))
    lost = [replace(one, status="failed", metrics={}, stepping={}) for one in done[:3]]
    cut = replace(done[3], status="interrupted", metrics={})
    write(runs / "study", *lost, *done[4:], cut)

    for rules in ("ours", "study"):
        made.main(["--as", rules, "abc1234", str(runs / rules)])
    found = published_runs.load()

    ours, study = (found[rules, "tuned", "stacking", "mujoco"] for rules in ("ours", "study"))
    assert [line["seed"] for line in ours.lines] == [str(seed) for seed in range(1, 21)]
    assert {line["commit"] for line in ours.lines} == {"abc1234"}
    assert {line["profile"] for line in ours.lines} == {"tuned"}
    assert ours.values("placed") == dict.fromkeys(range(1, 21), 10 / 15)  # not 0.666667
    assert ours.mean("spare_places") == 1.0  # the one that failed first and was filled then
    assert (ours.repetitions, study.repetitions) == ("20", "19, 3 failed")
    row = make_results.stacking(found, "ours", "tuned").splitlines()[-1]
    assert row.startswith("| [MuJoCo](engines/mujoco.md) | 20 | 67 [")
    costs = [one.cost("cpu_cost") for one in study.records()]
    assert costs[2:4] == [None, pytest.approx(7.9 / 140, rel=1e-5)]


def test_a_repetition_replaces_what_was_known_of_it_alone(data: Path, tmp_path: Path) -> None:
    for number, placed in enumerate((0.2, 0.8)):
        runs = tmp_path / f"runs-{number}"
        others = [] if number else [replace(stacking(1, 1.0), simulator="sapien")]
        write(runs, stacking(1, placed), *others)
        made.main(["--as", "ours", f"commit-{number}", str(runs)])
    found = published_runs.load()
    known = {
        name: (run.lines[0]["commit"], run.mean("placed")) for (*_, name), run in found.items()
    }
    assert known == {"mujoco": ("commit-1", 0.8), "sapien": ("commit-0", 1.0)}


def test_what_differs_for_certain_from_the_study_is_bold(data: Path, tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    for rules, first, second in (("ours", 1.0, 1.0), ("study", 0.6, 14 / 15)):
        for simulator, placed in (("mujoco", first), ("sapien", second)):
            values = [placed if simulator == "mujoco" or seed == 3 else 1.0 for seed in range(20)]
            found = [
                replace(stacking(seed, value), simulator=simulator)
                for seed, value in enumerate(values)
            ]
            write(runs / rules / simulator, *found)
            made.main(["--as", rules, "abc1234", str(runs / rules / simulator)])

    rows = make_results.against_study(published_runs.load(), "stacking", ("placed",)).splitlines()

    assert rows[2:] == [
        "| MuJoCo `tuned` | 20, 20 | **100 → 60** |",
        "| SAPIEN `tuned` | 20, 20 | 100 → 99.7 |",  # one cube of 300 is not for certain
    ]


def test_a_run_without_a_word_of_rules_leaves_published_numbers_alone(
    data: Path, tmp_path: Path
) -> None:
    pushed = replace(
        record(simulator="mujoco"),
        task="pushing",
        settings={"task.turn": 0.0},
        robot={"name": "ur5"},
        metrics={"position_error": 0.00123456789, "tipped": False},
    )
    write(tmp_path / "run", stacking(1, 1.0), pushed)

    made.main([str(tmp_path / "run")])

    assert published_runs.load() == {}
    (line,) = make_tasks.PUSHING.lines(robot="ur5", way="line")
    assert (line["position_error"], line["simulator"]) == ("0.00123457", "mujoco")
    assert make_tasks.ARMS.lines() == []
