"""What the page tells: the numbers of the other reports, and who is ahead by the same tests."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from pytest_simbench.records.notes import Notes
from pytest_simbench.records.record import Record
from pytest_simbench.report.model.matrix import with_differences
from pytest_simbench.report.model.summary import summarise
from pytest_simbench.report.page import context
from pytest_simbench.report.page.cells import Table, study
from pytest_simbench.report.page.context import Page, command, page
from pytest_simbench.report.page.setup import setup
from tests.report.samples import METRICS, failed, record, stacking_run, throwing_run


def made(records: list[Record], folder: Path) -> Page:
    return page(folder, with_differences(summarise(records, METRICS), records), records)


@pytest.fixture(autouse=True)
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without matplotlib's pictures, which take seconds each."""
    monkeypatch.setattr(context, "pictures", lambda summary: ([], ""))


def verdicts(table: Table) -> dict[str, list[str]]:
    """By heading, down the rows."""
    return {
        heading.text: [line.cells[place].verdict for line in table.lines]
        for place, heading in enumerate(table.headings)
    }


def test_cells_are_coloured_by_the_corrected_tests() -> None:
    (summary,) = with_differences(summarise(stacking_run(), METRICS), stacking_run())
    found = verdicts(study(summary))
    assert found["placed %"] == found["at the end %"] == ["ahead", "behind"]
    assert found["crashed"] == found["RAM MB"] == ["open", "open"]
    assert found["x real time"] == found["CPU s/sim s"] == ["", ""]  # no control was recorded
    assert found["CPU %"] == found["start s"] == found["simulator"] == ["", ""]


def test_without_tests_or_with_few_repetitions_nothing_is_coloured() -> None:
    few = [r for r in stacking_run() if r.repetition < 5]
    (summary,) = with_differences(summarise(few, METRICS), few)
    assert {v for column in verdicts(study(summary)).values() for v in column} == {"", "open"}


def test_cells_tell_mean_interval_and_ends_and_sort_by_the_mean() -> None:
    (summary,) = summarise(stacking_run(), METRICS)
    table = study(summary)
    place = [heading.text for heading in table.headings].index("placed %")
    cell = table.lines[1].cells[place]
    assert cell.lines[0] == "65"
    assert cell.lines[1].startswith("[")
    assert cell.lines[2] == "0 to 87"  # three crashed
    spread = summary.rows[1].metrics["placed"]
    assert spread is not None
    assert cell.sort == spread.mean


def test_filters_are_offered_where_there_is_a_choice(tmp_path: Path) -> None:
    assert made(stacking_run(), tmp_path).filters == {"simulator": ["mujoco", "pybullet"]}
    both = made([*stacking_run(), *stacking_run("gui")], tmp_path).filters
    assert list(both) == ["simulator", "mode"]
    one = [r for r in stacking_run() if r.simulator == "mujoco"]
    assert made(one, tmp_path).filters == {}


def test_each_repetition_is_there_once_for_all_plots(tmp_path: Path) -> None:
    found = made([*stacking_run(), *throwing_run()], tmp_path)
    assert len(found.repetitions) == 80
    numbers = {
        dot.number
        for task in found.tasks
        for plot in task.strips
        for line in plot.lines
        for dot in (*line.dots, *line.lost)
    }
    assert numbers == set(range(80))


def test_a_failure_is_told_with_the_end_of_its_log(tmp_path: Path) -> None:
    (task,) = made(stacking_run(), tmp_path).tasks
    hung = next(cause for cause in task.causes if "WorkerHung" in cause.title)
    assert hung.title == "pybullet headless tuned: 2 x WorkerHung in settle"
    assert hung.message == "no answer within 60 s"
    assert hung.repetitions == "8, 9"
    assert hung.tail == "step 3\ndied"


def test_unreadable_results_on_repeatability_are_told(tmp_path: Path) -> None:
    (tmp_path / "repeatability.jsonl").write_text("nonsense\n")
    found = made(stacking_run(), tmp_path)
    (problem,) = found.problems
    assert "repeatability.jsonl" in problem
    assert found.repeatability == []


def test_the_setup_tells_settings_versions_and_machines() -> None:
    records = [
        record(
            repetition=k,
            settings={"timestep": 0.002, "task.settle": 60.0},
            versions={"mujoco": "3.3"},
            host={"cores": 2 + k},
        )
        for k in (1, 2)
    ]
    found = setup(summarise(records, METRICS), records)
    assert found.tasks == {"stacking": {"settle": "60.0"}}
    (simulator,) = found.simulators
    assert simulator.settings == {"timestep": "0.002"}
    assert simulator.versions == {"mujoco": "3.3"}
    assert found.run["machine"] == "cores: 3; cores: 4"
    assert found.run["seeds"] == "1001 to 1002 (2)"
    assert found.run["protocol"] == "fast"


def test_the_command_runs_the_same_seed_again() -> None:
    given = record(test="suites/test_x.py::test_x[a b-'c]", mode="gui", jitter=0.5)
    assert shlex.split(command(given)) == [
        "pytest", "suites/test_x.py::test_x[a b-'c]", "--sim-name=mujoco", "--sim-seed=1001",
        "--sim-reps=1", "--sim-profile=tuned", "--sim-protocol=fast", "--sim-jitter=0.5",
        "--sim-gui",
    ]  # fmt: skip


def test_the_command_runs_one_of_several_profiles_and_time_steps_alone() -> None:
    test = "suites/test_x.py::test_x[mujoco-headless-default-dt=0.5ms-fall]"
    settings, notes = {"timestep": 0.0005}, Notes(own_timestep=0.001)
    given = record(test=test, profile="default", settings=settings, notes=notes)
    words = shlex.split(command(given))
    assert words[1] == "suites/test_x.py::test_x[mujoco-headless-fall]"
    assert {"--sim-profile=default", "--sim-set=mujoco.timestep=0.0005"} <= set(words)


@pytest.mark.parametrize(
    "test",
    ["test_x[mujoco]", "-p evil.py::x", "/etc/x.py::y", "../x.py::y", "a/../../x.py::y",
     "x.py::y\nrm", "x.py::y\x1b[2J", "--pdb", "x.txt::y", "x.py::"],
)  # fmt: skip
def test_an_id_that_is_no_plain_test_gives_no_command(test: str) -> None:
    assert command(record(test=test)) == ""


def test_only_failures_still_make_a_page(tmp_path: Path) -> None:
    found = made([failed("WorkerDied", "load", "gone")], tmp_path)
    (task,) = found.tasks
    assert task.strips == []
    assert len(task.causes) == 1
