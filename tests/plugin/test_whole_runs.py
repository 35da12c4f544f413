"""Whole runs word for word: in this process, and of repetitions that are made up."""

from __future__ import annotations

import io
import re
import sys
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from pytest_simbench.client.display import Displays
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.records.record import Failure
from pytest_simbench.report.files import write_outcome
from pytest_simbench.report.model.outcome import begun
from tests.approval import assert_approved, in_words
from tests.made_up import MadeUp

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

PYTESTS = re.compile(
    r"^[.Fxs]+(?=test_|$| +\[)( +\[100%\])?\n?|^[-=!]+ (gen|Keyb).*\n"
    r"|(?<= in )[\d.]+s.*|^.*Keyb.*\n",
    re.M,
)
"""What pytest itself says."""


class Runs:
    """A plugin: how many landed follows from the test and the repetition's number.

    Attributes:
        landed: share from the second repetition on.
        cut: Ctrl-C comes in the repetition of this number of `test_claims`.
    """

    def __init__(self, landed: float, cut: int) -> None:
        self.landed, self.cut = landed, cut

    def pytest_sessionstart(self, session: pytest.Session) -> None:
        ours: Any = session.config.pluginmanager.get_plugin("simbench-session")
        ours.run.executor = MadeUp(1, self.end)

    def end(self, experiment: Experiment, number: int) -> tuple[dict[str, Any], None]:
        if number == self.cut:
            raise KeyboardInterrupt
        case = experiment.case
        with Path("cases").open("a") as file:
            told = replace(case, robot=case.robot and case.robot.name)
            file.write(f"{in_words(told)}\n" * (number == 1))
        used = {"rss_mb": {"mean": 200.0 + number, "peak": 300.0}, "cpu_percent": {"mean": 50.0}}
        found = {
            "resources": used, "timeline": {"start": 1.0, "end": 1.0 + 0.1 * number},
            "stepping": {"simulated": 0.6, "wall": 0.1 * number, "cpu": 0.1},
        }  # fmt: skip
        if "crash" in experiment.case.test and number == 2:
            error = Failure("WorkerDied", "the worker died", "fall", "its last words")
            return {**found, "status": "failed", "error": error}, None
        landed = 1.0 if number == 1 else self.landed
        return {**found, "status": "ok", "metrics": {"landed": landed}}, None


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", "summary.md")
    monkeypatch.delitem(sys.modules, "test_runs", raising=False)
    for name in ("matplotlib", "trimesh"):  # nothing is drawn
        monkeypatch.setitem(sys.modules, name, None)
    Path("test_runs.py").write_text(TESTS)
    Path("pytest.ini").write_text("[pytest]\nreps = 8\njunit_family = xunit1\n")


def run(words: str, landed: float = 0.5, cut: int = 99) -> str:
    """What was printed, the exit code, the badge, and JUnit's messages and properties."""
    said = io.StringIO()
    plain = "--sim=mujoco -q --tb=no -rN -n0 -p no:warnings --color=no --sim-badge=b.json"
    with redirect_stdout(said), redirect_stderr(said):
        code = pytest.main(
            [*plain.split(), "--junitxml=j.xml", *words.split()], plugins=[Runs(landed, cut)]
        )
    told = [f"$ pytest {words}", PYTESTS.sub("", said.getvalue()), f"exit code {int(code)}"]
    told += [Path("b.json").read_text()] if Path("b.json").exists() else []
    assert Path("j.xml").exists(), told
    for case in ElementTree.parse("j.xml").iter("testcase"):
        properties = [f"{p.get('name')}={p.get('value')}" for p in case.iter("property")]
        lost = [(e.get("message") or "").partition("\n")[0] for e in case if e.get("message")]
        lost += [f"text: {e.text}" for e in case if "Failed: " in (e.get("message") or "")]
        told += [f"{case.get('name')}: {', '.join([*lost, *properties])}"]
    text = "\n".join([*told, ""]).replace(f"{Path.cwd()}/", "DIR/")
    return re.sub(r"\n  (?=\S)", " ", text)  # where lines break the folder's length decides


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


def test_one_whose_page_cannot_be_written() -> None:
    Path("out/report.html").mkdir(parents=True)
    assert_approved("run-unwritten", run("--sim-output=out -k low"))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("thresholds", "--sim-threshold=landed=0.6,nosuch=1 -k claims"),
        ("threshold", "--sim-threshold=landed=2 -k claims"),
        ("steps", "--sim-profile=default,tuned --sim-sweep=0.001,0.002 --reps=auto:12 -k low"),
    ],
)
def test_others(name: str, words: str) -> None:
    assert_approved(f"run-{name}", run(f"--sim-output=out {words}"))


ASKED = """
import pytest
from pytest_simbench.tasks import Throwing
from tests.tiny import Falling

@pytest.fixture
def sim_settings(request):
    return {"noslip_iterations": 3} if request.function is test_own else {}

@pytest.mark.reps(2)
@pytest.mark.sim_timeout(50)
@pytest.mark.parametrize("a", ["b"])
def test_own(repeat, a):
    repeat(Falling())

@pytest.mark.policies("")
def test_files(repeat, policy, scene_file):
    scene_file()
    repeat(Falling(0.2))

def test_arm(repeat):
    repeat(Throwing())

class Rolling(Falling):
    name, study_timeout = "rolling", 30  # no decimal point

@pytest.mark.parametrize("task", [Falling(0.1), Rolling(0.7)])
@pytest.mark.reps(1)
def test_alone(repeat, task):
    repeat(task)
"""

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
     ("plain", "test_runs.py --sim-video=retain-on-failure")],
)  # fmt: skip
def test_how_repetitions_are_run(name: str, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the options, the ini file, the test's marks, settings and files say of them; and that
    the same command finds none to be missing."""
    pytest.importorskip("av", reason="videos need the extra 'video'")
    monkeypatch.setattr(Displays, "environment", lambda self: {})
    Path("test_runs.py").write_text(ASKED)
    Path("mine.py").write_text("policies = {'one': lambda seen: None, 'two': lambda seen: None}")
    Path("own.toml").write_text('simulator = "mujoco"\n[settings]\nnoslip_iterations = 5\n')
    box = '<body pos="0 0 1"><freejoint/><geom type="box" size=".1 .1 .1"/></body>'
    Path("scene.xml").write_text(f"<mujoco><worldbody>{box}</worldbody></mujoco>")
    text = run(f"--sim-output=out {words}")
    size = Path("cases").stat().st_size
    cases = re.sub(r"<.*? object at 0x\w+>", "OBJECT", Path("cases").read_text())
    assert "exit code 0" in run(f"--sim-resume=out {words}")
    assert Path("cases").stat().st_size == size
    assert_approved(f"run-asked-{name}", text + cases.replace(f"{Path.cwd()}/", "DIR/"))
