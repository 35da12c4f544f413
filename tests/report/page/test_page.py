"""What the page tells: the numbers of the other reports; and a dot for each repetition, where its
value says, and none on top of another."""

from __future__ import annotations

import itertools
import shlex
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.records.notes import Notes
from pytest_simbench.records.record import Record
from pytest_simbench.report.model import cells, tables
from pytest_simbench.report.model.claims import command
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.model.summary import summarise
from pytest_simbench.report.page import context
from pytest_simbench.report.page.context import Shown, page
from pytest_simbench.report.page.setup import setup
from pytest_simbench.report.page.strips import HEIGHT, LEFT, LOST, MOST, RIGHT, Strip, strips
from tests.report.samples import METRICS, REFERENCES, failed, record, stacking_run, throwing_run


def made(records: list[Record], folder: Path) -> Shown:
    return page(folder, Report(summarise(records, METRICS), records))


@pytest.fixture(autouse=True)
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without matplotlib's pictures, which take seconds each."""
    monkeypatch.setattr(context, "drawn", lambda pictures: ([], ""))


def test_cells_tell_mean_interval_and_ends_and_sort_by_the_mean() -> None:
    (summary,) = summarise(stacking_run(), METRICS)
    columns = {column.heading: column for column in tables.study(summary, cells.mean_first)}
    cell = columns["placed %"].cells[1]
    assert cell.lines == ["65", "[40, 78]", "0 to 87"]  # three crashed
    spread = summary.rows[1].metrics["placed"]
    assert (cell.sort, cell.verdict) == (spread.mean, "behind")
    assert [cell.of for cell in columns["simulator"].cells] == [row.of for row in summary.rows]


def test_filters_are_offered_where_there_is_a_choice(tmp_path: Path) -> None:
    assert made(stacking_run(), tmp_path)["filters"] == {"simulator": ["mujoco", "pybullet"]}
    both = made([*stacking_run(), *stacking_run("gui")], tmp_path)["filters"]
    assert list(both) == ["simulator", "mode"]
    one = [r for r in stacking_run() if r.simulator == "mujoco"]
    assert made(one, tmp_path)["filters"] == {}


def test_each_repetition_is_there_once_for_all_plots(tmp_path: Path) -> None:
    found = made([*stacking_run(), *throwing_run()], tmp_path)
    assert len(found["repetitions"]) == 80
    numbers = {
        dot.number
        for task in found["tasks"]
        for plot in task["strips"]
        for line in plot.lines
        for dot in (*line.dots, *line.lost)
    }
    assert numbers == set(range(80))
    told = [r["cause"] for r in found["repetitions"] if r["status"] == "failed"]
    assert told == ["WorkerDied in pick: the worker was killed by SIGSEGV",
                    *["WorkerHung in settle: no answer within 60 s"] * 2]  # fmt: skip


def test_a_failure_is_told_with_the_end_of_its_log(tmp_path: Path) -> None:
    (task,) = made(stacking_run(), tmp_path)["tasks"]
    hung = next(cause for cause in task["causes"] if "WorkerHung" in cause["title"])
    assert hung["title"] == "pybullet headless tuned: 2 x WorkerHung in settle"
    assert hung["message"] == "no answer within 60 s"
    assert hung["repetitions"] == "8, 9"
    assert hung["tail"] == "step 3\ndied"


def test_only_failures_make_a_page_that_tells_unreadable_results_too(tmp_path: Path) -> None:
    (tmp_path / "repeatability.jsonl").write_text("nonsense\n")
    found = made([failed("WorkerDied", "load", "gone")], tmp_path)
    (task,) = found["tasks"]
    assert (task["strips"], len(task["causes"])) == ([], 1)
    (problem,) = found["problems"]
    assert "repeatability.jsonl" in problem
    assert found["repeatability"] == []


def test_the_setup_tells_settings_versions_and_machines() -> None:
    records = [
        record(
            seed=seed,
            settings={"timestep": 0.002, "task.settle": 61.0},
            versions={"mujoco": "3.3"},
            host={"cores": cores, "cpu": "x"},
            limits={"wall": 9.0, "memory": None, "cpu": cores},
        )
        for seed, cores in ((1001, 3), (1003, 4), (1007, 3))
    ]
    other = {"protocol": "slow", "jitter": 0.25, "deviations": ["no spin"]}
    other |= {name: {} for name in ("settings", "versions", "host", "limits")}
    found = setup(summarise([*records, record("bullet", seed=4, **other)], METRICS))
    assert found["tasks"] == {"stacking": {"settle": "61.0"}}
    both = (
        ("bullet", {}, {}, ["no spin"]),
        ("mujoco", {"timestep": "0.002"}, {"mujoco": "3.3"}, []),
    )
    assert found["simulators"] == [
        {"label": f"{name} headless tuned", "of": (name, "headless", "tuned"),
         "settings": settings, "versions": versions, "deviations": told}
        for name, settings, versions, told in both
    ]  # fmt: skip
    assert found["run"] == {
        "protocol": "slow; fast", "jitter": "0.25; 0", "seeds": "4 to 1007 (4)",
        "limits": "wall 9.0, cpu 3; wall 9.0, cpu 4",
        "machine": "cores: 3, cpu: x; cores: 4, cpu: x",
    }  # fmt: skip
    assert setup(summarise(records[:1], METRICS))["run"]["seeds"] == "1001"


def test_each_configuration_has_its_own_deviations_of_all_tasks() -> None:
    """The page said of a profile what another one of its simulator deviates in."""
    records = [
        record(profile=profile, task=task, deviations=(told,))
        for profile, task, told in (("tuned", "stacking", "cut"), ("tuned", "throwing", "soft"),
                                    ("default", "stacking", "soft"))
    ]  # fmt: skip
    shown = setup(summarise(records, METRICS))["simulators"]
    found = {one["label"]: one["deviations"] for one in shown}
    assert found == {
        "mujoco headless default": ["soft"], "mujoco headless tuned": ["cut", "soft"],
    }  # fmt: skip


def test_the_command_runs_the_same_seed_again() -> None:
    robot = {"name": "ur5", "digest": "1"}
    given = record(test="suites/test_x.py::test_x[a b-'c]", mode="gui", jitter=0.5, robot=robot)
    assert shlex.split(command(given)) == [
        "pytest", "suites/test_x.py::test_x[a b-'c]", "--sim-name=mujoco", "--sim-seed=1001",
        "--sim-reps=1", "--sim-profile=tuned", "--sim-protocol=fast", "--sim-jitter=0.5",
        "--sim-robot=ur5", "--sim-gui",
    ]  # fmt: skip


def test_the_command_runs_one_of_several_profiles_and_time_steps_alone() -> None:
    test = "suites/test_x.py::test_x[mujoco-headless-default-dt=0.5ms-fall]"
    settings, notes = {"timestep": 0.0005}, Notes(own_timestep=0.001)
    given = record(test=test, profile="default", settings=settings, notes=notes)
    words = shlex.split(command(given))
    assert words[1] == "suites/test_x.py::test_x[mujoco-headless-fall]"
    assert {"--sim-profile=default", "--sim-set=mujoco.timestep=0.0005"} <= set(words)


def test_the_command_names_the_interpreter_of_a_build() -> None:
    needs = ("--sim-name=mujoco@mine=/opt/python",)
    given = record(test="test_x.py::test_x", simulator="mujoco@mine", notes=Notes(needs=needs))
    named = [word for word in shlex.split(command(given)) if word.startswith("--sim-name")]
    assert named == [*needs]


@pytest.mark.parametrize(
    "test",
    ["test_x[mujoco]", "-p evil.py::x", "/etc/x.py::y", "../x.py::y", "a/../../x.py::y",
     "x.py::y\nrm", "x.py::y\x1b[2J", "--pdb", "x.txt::y", "x.py::"],
)  # fmt: skip
def test_an_id_that_is_no_plain_test_gives_no_command(test: str) -> None:
    assert command(record(test=test)) == ""


def plots(records: list[Record]) -> dict[str, Strip]:
    """By title; a record's number is its repetition."""
    (summary,) = summarise(records, METRICS, REFERENCES)
    return {plot.title: plot for plot in strips(summary, lambda r: r.repetition)}


def test_every_repetition_of_every_row_has_a_mark() -> None:
    for title, plot in plots(stacking_run()).items():
        assert [line.label for line in plot.lines] == ["mujoco", "pybullet"]
        for line in plot.lines:
            marks = sorted(dot.number for dot in (*line.dots, *line.lost))
            assert marks == list(range(1, 21)), title
        assert sorted(dot.number for dot in plot.lines[1].lost) == [3, 8, 9]


def test_shares_lie_between_nothing_and_all() -> None:
    plot = plots(stacking_run())["placed %"]
    assert plot.study
    assert plot.ticks == [(LEFT, "0"), *plot.ticks[1:4], (RIGHT, "100")]
    first = next(dot for dot in plot.lines[0].dots if dot.number == 5)
    assert first.value == "93 %"
    assert first.x == pytest.approx(LEFT + (RIGHT - LEFT) * 14 / 15, abs=0.01)
    line = plot.lines[0]
    assert line.low < line.mean < line.high <= RIGHT


def test_the_bar_is_the_mean_of_the_tables_with_the_crashed_ones() -> None:
    (summary,) = summarise(stacking_run(), METRICS)
    for row, line in zip(summary.rows, plots(stacking_run())["placed %"].lines, strict=True):
        mean = row.metrics["placed"].mean
        assert line.mean == pytest.approx(LEFT + (RIGHT - LEFT) * mean, abs=0.01)


def test_values_keep_their_order_and_the_reference_has_its_place() -> None:
    plot = plots(throwing_run())["landing x m"]
    assert max(dot.x for dot in plot.lines[1].dots) < plot.reference
    assert min(dot.x for dot in plot.lines[0].dots) > plot.reference
    assert not plot.study
    assert all(LEFT <= dot.x <= RIGHT for line in plot.lines for dot in line.dots)
    assert [dot.x for dot in plot.lines[1].lost] == [LOST]


def test_rounding_is_not_drawn_as_a_spread() -> None:
    """Nanometres went from one end to the other, above five ticks that all said 0."""
    records = [
        record(repetition=k, task="throwing", metrics={"landing_error": 1e-9 * k}) for k in range(9)
    ]
    plot = plots(records)["landing error m"]
    assert {dot.x for dot in plot.lines[0].dots} == {LEFT}
    assert [text for _, text in plot.ticks] == ["0", "0.00025", "0.0005", "0.00075", "0.001"]


def test_costs_that_differ_widely_are_logarithmic() -> None:
    def of(most: float) -> Strip:
        records = [
            record(repetition=k + 1, stepping={"cpu": cpu, "simulated": 1.0, "wall": 1.0})
            for k, cpu in enumerate((0.01, 0.1, most))
        ]
        return plots(records)["CPU s per simulated s"]

    assert not of(0.15).logarithmic
    plot = of(1.0)
    assert plot.logarithmic
    x = [dot.x for dot in sorted(plot.lines[0].dots, key=lambda dot: dot.number)]
    assert x[1] - x[0] == pytest.approx(x[2] - x[1], abs=0.02)


def test_a_metric_that_nothing_has_is_left_out() -> None:
    assert "placed %" not in plots([record(metrics={"at_end": 1.0})])


def test_of_very_many_some_are_drawn_and_all_counted() -> None:
    """The ends are among them, mean and interval are of all, and the line says so."""
    records = [record(repetition=k, metrics={"placed": k % 15 / 15}) for k in range(1, 1000)]
    records[500] = record(repetition=501, metrics={"placed": 1.0})
    (line,) = plots(records)["placed %"].lines
    assert MOST - 2 <= len(line.dots) <= MOST
    assert line.left_out == f"{len(line.dots)} of 999 repetitions drawn"
    assert 501 in {dot.number for dot in line.dots}
    (few,) = plots(records[:MOST])["placed %"].lines
    assert (len(few.dots), few.left_out) == (MOST, "")
    shares = [r.metrics["placed"] or 0.0 for r in records]
    assert line.mean == pytest.approx(LEFT + (RIGHT - LEFT) * sum(shares) / 999, abs=0.01)


@given(st.lists(st.sampled_from([0.0, 0.2, 0.2001, 0.5, 1.0]), min_size=1, max_size=40))
def test_no_two_dots_lie_on_each_other(values: list[float]) -> None:
    records = [record(repetition=k, metrics={"placed": v}) for k, v in enumerate(values)]
    (line,) = plots(records)["placed %"].lines
    assert len(line.dots) == len(values)
    assert all(0 <= dot.y <= HEIGHT for dot in line.dots)
    for a, b in itertools.combinations(line.dots, 2):
        assert (a.x, a.aside, a.y) != (b.x, b.aside, b.y)
        if abs(a.x - b.x) < 0.1:
            assert abs(a.aside - b.aside) >= 6 or abs(a.y - b.y) >= 6
