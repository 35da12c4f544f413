"""Whole runs word for word: in this process, and of repetitions that are made up."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from pytest_simbench.client.display import Displays
from pytest_simbench.report.files import write_outcome
from pytest_simbench.report.model.outcome import begun
from tests.approval import assert_approved
from tests.plugin.inner import wrapper
from tests.plugin.whole import prepare, run

TESTS = """
import pytest
from tests.tiny import Falling

@pytest.mark.parametrize("duration", [0.1, 0.2], ids=["low", "high"])
def test_claims(repeat, threshold, duration):
    result = repeat(Falling(duration))
    result.assert_at_least("landed", threshold("landed", 0.3))

def test_two_tasks(repeat):
    first, second = repeat(Falling(0.3)), repeat(Falling(0.4))
    first.assert_at_least("landed", 0.1)
    first.assert_at_least("landed", 0.1)
    second.assert_at_most("ram", 100)

@pytest.mark.xfail_sim("mujoco", reason="known")
def test_is_expected_to_fail(repeat):
    repeat(Falling(0.5)).assert_at_least("landed", 0.99)

@pytest.mark.reps(3)
@pytest.mark.sim_crashes(0.5)
def test_one_may_crash(repeat):
    assert len(repeat(Falling(0.6)).records) == 3

@pytest.mark.reps(5)
def test_no_crash(repeat):
    repeat(Falling(0.7))

@pytest.mark.skip_sim("pybullet", "drake")
@pytest.mark.xfail_sim("ode")
def test_as_a_whole(repeat):
    repeat(Falling(0.8))
    assert 1 == 2, "not\\nequal"

@pytest.mark.skip_sim("mujoco", reason="not here")
def test_is_left_out(repeat):
    pass

@pytest.mark.needs("gpu")
def test_needs(repeat):
    pass
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    prepare(tmp_path, monkeypatch, TESTS)


def test_what_each_test_says() -> None:
    text = run("--sim-output=out")
    assert_approved("run", text + Path("out/claims.jsonl").read_text())


def test_a_worse_one() -> None:
    run("--sim-output=out -k claims")
    limits = "landed:5%,ram:50%"
    text = run(f"--sim-baseline=out --sim-output=now --sim-compare-fail={limits} -k claims", 0.0)
    _, _, page = Path("summary.md").read_text().partition("## Compared with ")
    assert_approved("run-worse", text + page.partition("\n\n")[2].partition("**FAIL")[0])


def test_one_that_is_cut_and_completed() -> None:
    text = run("--sim-output=cut -k claims", cut=4)
    for more in ("claims", "low --reps=5", "whole", "low"):  # what failed has not run again
        text += run(f"--sim-resume=cut -k {more}")
    assert_approved("run-cut", text)


@pytest.mark.parametrize("killed", [False, True])
def test_one_that_is_cut_and_completed_in_part_has_not_passed(killed: bool) -> None:
    run("--sim-output=cut -k high", cut=4)
    if killed:
        name = "test_runs.py::test_claims[mujoco-headless-high]"
        write_outcome(Path("cut"), begun(Path("new"), [name]))
    text = run("--sim-resume=cut -k low")
    assert "exit code 0" in text
    assert "UNDECIDED   1 of 1 claims hold; the run did not end: resume it; 0 of 11" in text
    assert '"message": "mujoco: 11 repetitions, not judged", "color": "lightgrey"' in text
    assert '"color": "brightgreen"' in run("--sim-resume=cut -k high")


def test_one_whose_failed_test_is_mended(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also one that repeats nothing."""
    words, tests = (
        "-k 'whole or high or none'",
        f"{TESTS}\ndef test_none(sim_name): assert 1 == 2\n",
    )
    Path("test_runs.py").write_text(tests)
    text = run(f"--sim-output=out {words}")
    Path("test_runs.py").write_text(tests.replace("assert 1 == 2", "assert 2 == 2"))
    monkeypatch.delitem(sys.modules, "test_runs")
    text += run(f"--sim-resume=out {words}")
    assert_approved("run-mended", text + run("--sim-resume=out -k high"))


def test_who_tells_no_task_that_it_repeats_fails() -> None:
    test = '@pytest.mark.parametrize("a", [3])\n@pytest.mark.repeats("a")\ndef test_it(repeat, a):'
    Path("test_runs.py").write_text(
        f"import pytest\nfrom tests.tiny import Falling\n{test} repeat(Falling())\n"
    )
    told = "test_it[mujoco-headless-3]: repeats needs the name of a parameter that holds a task; "
    assert f"Failed: test_runs.py::{told}choose from a" in run("--sim-jobs=2")


def test_one_whose_page_cannot_be_written() -> None:
    Path("out/report.html").mkdir(parents=True)
    assert_approved("run-unwritten", run("--sim-output=out -k low"))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("thresholds", "--sim-threshold=landed=0.6,nosuch=1 -k claims"),
        ("threshold", "--sim-threshold=landed=2 -k claims"),
        ("stopped", "--sim-threshold=nosuch=1 -x -k 'no_crash or left'"),
        ("steps", "--sim-profile=default,tuned --sim-sweep=0.001,0.002 --reps=auto:12 -k low"),
    ],
)
def test_others(name: str, words: str) -> None:
    assert_approved(f"run-{name}", run(f"--sim-output=out {words}"))


ASKED = """
import pytest
from pytest_simbench.records.repeatability import Line, append
from pytest_simbench.tasks import Throwing
from tests.tiny import Falling

class TestOwn:
    @pytest.fixture
    def sim_settings(self):
        return {"noslip_iterations": 3}

    @pytest.mark.sim_timeout(50)
    @pytest.mark.repeats("task")
    @pytest.mark.reps(1)
    @pytest.mark.parametrize("task", [Falling()], ids=["b"])
    def test_own(self, repeat, task):
        repeat(task)

@pytest.mark.policies("")
def test_files(repeat, policy, scene_file):
    assert scene_file().free_bodies
    assert policy is not None
    repeat(Falling(0.2))

def test_one_and_another(repeat):
    repeat(Falling(0.3))
    repeat(Falling(0.4))

def test_one_end(output_path):
    found = {"sentence": "5 mm in x change it"}
    append(output_path, Line("search", "t", "ode", "headless", "tuned", "a", 1, {}, {}, found))

def test_arm(repeat):
    repeat(Throwing())

def test_arm_alone(robot):
    assert robot.name

def test_arm_here(sim_case, robot):
    assert sim_case.robot in ("", robot.name)

class Rolling(Falling):
    name, study_timeout = "rolling", 30  # no decimal point

@pytest.mark.parametrize("task", [Falling(0.1), Rolling(0.7)])
@pytest.mark.repeats("task")
@pytest.mark.reps(1)
def test_alone(repeat, task):
    repeat(task)
"""

BOX = '<body pos="0 0 1"><freejoint/><geom type="box" size=".1 .1 .1"/></body>'

TYPED = (
    "--sim-profile=tuned,own.toml --sim-set=mujoco.timestep=0.004 --sim-seed=3 "
    "--sim-timeout=7 --sim-stall-timeout=9 --sim-memory-limit=500 --jitter=2 --sim-fresh "
    "--sim-trace=off --protocol=paper --sim-jobs=2 --policies=mine.py:one,mine.py:two --gui "
    "--sim-scene=scene.xml"
)


@pytest.mark.parametrize(
    ("name", "words"),
    [("scene", "--sim-record=mcap --sim-scene=scene.xml -k step"),
     ("typed", f"test_runs.py -k one {TYPED}"),
     ("robots", "--robot=all --protocol=smoke --headless -k arm"),
     ("build", "test_runs.py --sim=mujoco@mine=bin/python -k 'mine and alone'"),
     ("plain", "test_runs.py --sim-video=retain-on-failure --sim-jobs=2")],
)  # fmt: skip
def test_how_repetitions_are_run(name: str, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the options, the ini file, the test's marks, settings and files say of them; and that
    the same command finds none to be missing."""
    pytest.importorskip("av", reason="videos need the extra 'video'")
    monkeypatch.setattr(Displays, "environment", lambda self: {})
    Path("test_runs.py").write_text(ASKED)
    Path("mine.py").write_text("policies = {'one': lambda seen: None, 'two': lambda seen: None}")
    wrapper(Path("bin/python"))
    Path("own.toml").write_text('simulator = "mujoco"\n[settings]\nnoslip_iterations = 5\n')
    Path("scene.xml").write_text(f"<mujoco><worldbody>{BOX}</worldbody></mujoco>")
    text = run(f"--sim-output=out {words}")
    size = Path("cases").stat().st_size
    cases = re.sub(r"<.*? object at 0x\w+>", "OBJECT", Path("cases").read_text())
    assert "exit code 0" in run(f"--sim-resume=out {words}")
    assert Path("cases").stat().st_size == size
    assert_approved(f"run-asked-{name}", text + cases.replace(f"{Path.cwd()}/", "DIR/"))


FILES = """
from tests.tiny import Falling

def test_unknown(data_set):
    data_set("nosuch")

def test_missing(data_set):
    data_set("cube_tosses")

def test_none(scene_file):
    scene_file()

def test_end(repeat, scene_file):
    scene = scene_file("scene.xml")
    {}
"""


def test_files_that_cannot_be_used(monkeypatch: pytest.MonkeyPatch) -> None:
    """A scene, its starts or its log end the run; a data set concerns its test alone."""
    Path("data").mkdir()
    Path("scene.xml").write_text(f"<mujoco><worldbody>{BOX}</worldbody></mujoco>")
    ends = ['scene_file("scene.xml", starts="keyframes")', 'scene_file.log("no.csv", scene)']
    text = ""
    for k, end in enumerate([*ends, 'scene_file("scene.xml", starts="no.npz")']):
        Path("test_runs.py").write_text(FILES.format(end))
        monkeypatch.delitem(sys.modules, "test_runs", raising=False)
        text += run(f"--sim-data=data --sim-output=out{k}")
    assert_approved("run-files", text)
