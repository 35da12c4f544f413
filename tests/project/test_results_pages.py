"""The published numbers: made by docs/make_results.py of docs/data, on seeds nobody chose on."""

from __future__ import annotations

import csv
import re
import sys
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.records.build import record

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
sys.path.append(str(DOCS))  # for the scripts, which are no package

import make_arms  # noqa: E402
import make_pushing  # noqa: E402
import make_reality  # noqa: E402
import make_results  # noqa: E402
import make_truth  # noqa: E402
import published_runs  # noqa: E402


def test_the_tables_are_up_to_date() -> None:
    pages = make_results.pages()
    assert {ROOT / "README.md", DOCS / "results.md", DOCS / "study.md"} < pages.keys()
    assert {path for path in pages if path.parent.name == "engines"} == {
        DOCS / "engines" / f"{name}.md" for name in make_results.SIMULATORS
    }
    for path, text in pages.items():
        assert path.read_text("utf-8") == text, "run `python docs/make_results.py --tables`"


def test_the_tables_of_pushing_are_up_to_date() -> None:
    told = "run `python docs/make_pushing.py`"
    assert make_pushing.PAGE.read_text("utf-8") == make_pushing.page(), told
    assert make_pushing.page().count("| ODE |") == 5  # tuned, default, UR5, xArm 7, SO-101


def test_the_tables_of_other_arms_are_up_to_date_and_of_new_seeds() -> None:
    told = "run `python docs/make_arms.py`"
    assert make_arms.PAGE.read_text("utf-8") == make_arms.page(), told
    lines = make_arms.lines()
    assert {line["robot"] for line in lines} == {"ur5", "xarm7", "so101"}
    assert {line["seed"] for line in lines} == {str(920001 + k) for k in range(10)}


def test_the_tables_of_laws_are_up_to_date() -> None:
    for page in make_truth.PAGES:
        assert page.read_text("utf-8") == make_truth.page(page), "run `docs/make_truth.py`"
    kept = re.findall(r"\n\| genesis \| (\d+)/\1 (\S+)", make_truth.page())
    assert len([1 for _, worst in kept if worst.endswith("x")]) == 2  # tuned and default
    assert len([1 for _, worst in kept if worst.endswith("ms")]) == 1  # over time steps


def test_the_tables_of_real_experiments_are_up_to_date_and_of_held_out_motions() -> None:
    told = "run `python docs/make_reality.py`"
    assert make_reality.PAGE.read_text("utf-8") == make_reality.page(), told
    tossed = make_reality.rows("tossing").values()
    tosses = {int(line["number"]) for rows in tossed for line in rows}
    assert len(tosses) == 95
    assert all(number % 2 for number in tosses)
    runs = {int(line["number"]) for r in make_reality.rows("arm_pushing").values() for line in r}
    assert runs == {3, 7, 11, 15, 19, 31}
    for task in make_reality.FOLLOWING:
        names = {line["number"] for rows in make_reality.rows(task).values() for line in rows}
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


@pytest.fixture
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of published numbers that holds nothing yet."""
    for task in published_runs.TASKS:
        (tmp_path / f"{task}.csv").write_text("rules,profile,simulator\n")
    monkeypatch.setattr(published_runs, "DATA", tmp_path)
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
    write(runs / "ours-tuned-stacking" / "mujoco", *reversed(done))
    lost = [replace(one, status="failed", metrics={}, stepping={}) for one in done[:3]]
    cut = replace(done[3], status="interrupted", metrics={})
    write(runs / "study-tuned-stacking" / "mujoco", *lost, *done[4:], cut)

    published_runs.read_folders(runs, "abc1234")
    found = published_runs.load()

    ours, study = (found[rules, "tuned", "stacking", "mujoco"] for rules in ("ours", "study"))
    assert [line["seed"] for line in ours.lines] == [str(seed) for seed in range(1, 21)]
    assert {line["commit"] for line in ours.lines} == {"abc1234"}
    assert ours.values("placed") == dict.fromkeys(range(1, 21), 10 / 15)  # not 0.666667
    assert ours.mean("spare_places") == 1.0  # the one that failed first and was filled then
    assert (ours.repetitions, study.repetitions) == ("20", "19, 3 failed")
    row = make_results.stacking(found, "ours", "tuned").splitlines()[-1]
    assert row.startswith("| [MuJoCo](engines/mujoco.md) | 20 | 67 [")
    costs = [one.cost("cpu_cost") for one in study.records()]
    assert costs[2:4] == [None, pytest.approx(7.9 / 140, rel=1e-5)]


def test_a_folder_replaces_what_was_known_of_it_alone(data: Path, tmp_path: Path) -> None:
    for number, placed in enumerate((0.2, 0.8)):
        runs = tmp_path / f"runs-{number}"
        write(runs / "ours-tuned-stacking" / "mujoco", stacking(1, placed))
        if not number:
            sapien = replace(stacking(1, 1.0), simulator="sapien")
            write(runs / "ours-tuned-stacking" / "sapien", sapien)
        published_runs.read_folders(runs, f"commit-{number}")
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
            write(runs / f"{rules}-tuned-stacking" / simulator, *found)
    published_runs.read_folders(runs, "abc1234")

    rows = make_results.against_study(published_runs.load(), "stacking", ("placed",)).splitlines()

    assert rows[2:] == [
        "| MuJoCo `tuned` | 20, 20 | **100 → 60** |",
        "| SAPIEN `tuned` | 20, 20 | 100 |",  # 99.7 %: one cube of 300
    ]
