"""`simbench.run`: what it takes, what it keeps, and how it ends. Nearly all without an engine."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import pytest_simbench as simbench
from pytest_simbench.cli.main import main
from pytest_simbench.client.errors import Unavailable, Where, WorkerError, WorkerExited
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.motion.registry import find
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.record import Failure
from pytest_simbench.scene.policy import LoopError
from pytest_simbench.simulator.registry import registered
from pytest_simbench.tasks import Carrying, Stacking, Throwing
from tests.conftest import workers
from tests.made_up import MadeUp
from tests.tiny import Falling

TWO = ("mujoco", "pybullet")


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[dict[str, Any]]:
    """Repetitions are made up, and every simulator is ready; what their second one ends with, by
    simulator."""
    faults: dict[str, Any] = {}
    opened: list[MadeUp] = []

    def end(experiment: Experiment, number: int) -> tuple[dict[str, Any], BaseException | None]:
        case, kind = experiment.case, faults.get(experiment.case.simulator)
        if number != 2 or kind is None:
            return {"metrics": {"landed": 0.5}, "status": "ok"}, None
        where = [Where(case.simulator, case.mode)] if issubclass(kind, WorkerError) else []
        told = {"error": Failure(kind.__name__, "no such luck", "fall")}
        told["status"] = "interrupted" if kind is KeyboardInterrupt else "failed"
        return told, kind("no such luck", *where)

    class Opened(MadeUp):
        def __init__(self, jobs: int) -> None:
            super().__init__(jobs, end)
            opened.append(self)

        def close(self) -> None:
            opened.remove(self)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("pytest_simbench.api.running.LocalExecutor", Opened)
    monkeypatch.setattr("pytest_simbench.client.environments.missing", lambda info: None)
    yield faults
    assert not opened


def test_records_are_those_of_a_pytest_run(scripted: dict[str, Any]) -> None:
    run = simbench.run(
        Falling(), TWO, reps=3, seed=70, jitter=2, settings={"mujoco": {"timestep": 0.004}}
    )
    assert run.folder.parent == Path(".simbench")
    kept = run.contents.records
    assert [(r.simulator, r.seed) for r in kept] == [(s, n) for s in TWO for n in (70, 71, 72)]
    assert {r.test for r in kept} == {f"test_falling[{name}-headless]" for name in TWO}
    assert {(r.function, r.variant, r.jitter) for r in kept} == {("test_falling", "", 2.0)}
    assert [r.settings["timestep"] for r in kept][::3] == [0.004, 1 / 240]
    assert RunFolder(run.folder).read().metrics["falling"] == Falling().metrics
    assert json.loads((run.folder / "outcome.json").read_text())["passed"] is None
    assert run.problems == ()


@pytest.mark.parametrize("asked", [(), ("all",), ("mujoco,all",)])
def test_all_are_all_that_are_ready_each_once(scripted: dict[str, Any], asked: Any) -> None:
    kept = simbench.run(Falling(), *asked, reps=1).contents.records
    assert [record.simulator for record in kept] == sorted(registered())


def test_how_often_is_as_in_pytest(scripted: dict[str, Any]) -> None:
    fast = simbench.run(Falling(), "mujoco").contents.records
    assert {(r.jitter, r.mode, r.profile) for r in fast} == {(1.0, "headless", "tuned")}
    assert [r.seed for r in fast] == list(range(10001, 10021))
    assert len(simbench.run(Falling(), "mujoco", protocol="smoke").contents.records) == 1
    (one,) = simbench.run(
        Falling(), "mujoco", 1, protocol="paper", timeout=7, jitter=0, profile="real"
    ).contents.records
    limits = {"timeout": 7.0, "stall_timeout": 60.0, "memory_limit": None}
    assert (one.protocol, one.limits) == ("paper", limits)
    assert (one.jitter, one.profile) == (0.0, "real")


def test_profiles_and_robots_stand_in_the_ids(scripted: dict[str, Any]) -> None:
    both = simbench.run(Falling(), "mujoco", 1, profile="tuned,default")
    names = [r.name for r in both.contents.records]
    assert names == ["test_falling[mujoco-headless]", "test_falling[mujoco-headless-default]"]
    for robot in ("ur5", find("ur5")):
        arm = simbench.run(Stacking(), "mujoco", 1, robot=robot)
        assert arm.contents.records[0].test == "test_stacking[mujoco-headless-ur5]"


def test_a_crash_is_recorded_and_the_others_go_on(scripted: dict[str, Any]) -> None:
    scripted["mujoco"] = WorkerExited
    run = simbench.run(Falling(), TWO, reps=3)
    assert [r.status for r in run.contents.records] == ["ok", "failed", "ok", *["ok"] * 3]
    assert "CRASHED falling, mujoco" in str(run.table())


def test_what_a_simulator_lacks_is_told_and_the_others_go_on(scripted: dict[str, Any]) -> None:
    scripted["mujoco"] = Unavailable
    run = simbench.run(Falling(), TWO, reps=2)
    assert len(run.contents.records) == 3
    assert run.problems == ("mujoco: no such luck",)
    assert "mujoco: no such luck" in str(run.table())
    assert "mujoco: no such luck" in run.table().html


def test_a_simulator_without_a_window_is_told(
    scripted: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DISPLAY", ":0")
    run = simbench.run(Falling(), ("mujoco", "ode"), reps=1, gui=True)
    assert [(r.simulator, r.mode) for r in run.contents.records] == [("mujoco", "gui")]
    assert run.problems == ("ode has no window",)
    two = "nothing was simulated: ode has no window; ovphysx has no window$"
    with pytest.raises(simbench.BadInput, match=two):
        simbench.run(Falling(), "ode,ovphysx", reps=1, gui=True)


@pytest.mark.parametrize("fault", [KeyboardInterrupt, ZeroDivisionError])
def test_what_ends_the_run_early_keeps_the_records(
    scripted: dict[str, Any], fault: type[BaseException]
) -> None:
    scripted["pybullet"] = fault
    with pytest.raises(fault) as stopped:
        simbench.run(Falling(), TWO, reps=3, folder="out")
    assert stopped.value.__notes__ == ["records are kept: folder='out', resume=True goes on"]
    assert len(simbench.load("out").contents.every) == 5
    del scripted["pybullet"]
    again = simbench.run(Falling(), TWO, reps=4, folder="out", resume=True)
    assert sum(record.ok for record in again.contents.records) == 8 - (fault is ZeroDivisionError)


def test_a_policy_that_cannot_be_asked_is_one_sentence(scripted: dict[str, Any]) -> None:
    scripted["mujoco"] = LoopError
    run = simbench.run(Falling(), TWO, reps=2)
    assert run.problems == ("mujoco: no such luck",)
    assert [r.status for r in run.contents.every] == ["ok"] * 3  # it is no crash


def test_a_jitter_that_makes_starts_overlap_is_no_crash(scripted: dict[str, Any]) -> None:
    simbench.run(Throwing(), "mujoco", reps=4, jitter=7, folder="out")
    told = "the jitter 10 is too large for the task 'throwing': seed 10001: scene 'throwing': "
    with pytest.raises(simbench.BadInput, match=f"^{told}'pyramid_2' and 'pyramid_3' overlap by"):
        simbench.run(Throwing(), "mujoco", reps=4, jitter=10, folder="none")
    assert not RunFolder(Path("none")).holds_run


def test_a_run_is_gone_on_with(scripted: dict[str, Any]) -> None:
    first = simbench.run(Falling(), "mujoco", reps=2, folder="")
    shutil.copytree(first.folder, ".simbench/tune-mujoco-falling")  # a search is no run
    more = simbench.run(Falling(), "mujoco", reps=3, resume=True)  # the newest
    assert more.folder == first.folder
    assert [r.repetition for r in more.contents.every] == [1, 2, 3]
    assert "judged 2 times" in str(more.table())
    with pytest.raises(simbench.BadInput, match="not resumed, .*: seed was 10001, is 5"):
        simbench.run(Falling(), "mujoco", reps=3, seed=5, resume=True)
    with pytest.raises(simbench.BadInput, match="reps was 3 or more, is 2"):
        simbench.run(Falling(), "mujoco", reps=2, resume=True)


def test_the_command_merges_and_reports(
    scripted: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    for folder, seed in (("a", 1), ("b", 3)):
        simbench.run(Falling(), TWO, reps=2, seed=seed, folder=folder, quiet=True)
    capsys.readouterr()
    assert main(["merge", "a", "b", "--output", "c"]) == main(["report", "c"]) == 0
    assert capsys.readouterr().out.count("falling: 4 repetitions each, protocol fast") == 2
    assert len(simbench.load("c").contents.records) == 8


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "class": ({"task": Falling}, "a class instead of a task: write run(Falling())"),
    "task": ({"task": 3}, "run(3) takes a task, for instance run(Throwing())"),
    "misspelt": ({"simulators": "mojuco"}, "unknown simulator 'mojuco'; choose from "),
    "none": ({"simulators": []}, "give a name (simbench list)"),
    "names": ({"simulators": None}, "simulators=None: give names of simulators, or leave it out"),
    "number": ({"simulators": 5}, "simulators=5: give names of simulators"),
    "list": ({"settings": [1]}, "settings=[1]: give those of each simulator by its name, for "),
    "folder": ({"folder": 5}, "folder=5: give the path of a folder, or leave it out"),
    "build": ({"simulators": "mujoco@/no/python"}, "there is no such file"),
    "reps": ({"reps": 0}, "reps=0: give a whole number from 1 to 100000"),
    "protocol": ({"protocol": "slow"}, "protocol=slow: choose from fast, paper, smoke"),
    "profile": ({"profile": "best"}, "no simulator has a settings profile 'best'; choose from "),
    "setting": ({"settings": {"mujoco": {"step": 1}}}, "choose from "),
    "flat": ({"settings": {"timestep": 1}}, "by its name: {'mujoco': {'timestep': 1}}"),
    "seed": ({"seed": -1}, "seed=-1: give a whole number"),
    "jitter": ({"jitter": -1}, "jitter=-1: give a number"),
    "timeout": ({"timeout": 0}, "timeout=0: give a number"),
    "jobs": ({"jobs": 0}, "jobs=0: give a whole number"),
    "hand": ({"task": Carrying(), "robot": "so101"}, "robot: robot 'so101'"),
    "robot": ({"robot": "ur99"}, "robot=ur99: "),
    "robots": ({"robot": "all"}, "robot=all: give one of "),
    "resume": ({"resume": True}, "there is no run to resume in .simbench"),
    "resumed": ({"resume": True, "folder": "."}, "it has no records.jsonl"),
    "file": ({"folder": "file"}, "(file is a file); give another folder"),
    "taken": ({"folder": "taken"}, "taken already holds a run: give resume=True, or another"),
}


@pytest.mark.parametrize("bad", BAD)
def test_what_cannot_be_is_one_sentence(scripted: dict[str, Any], bad: str) -> None:
    Path("file").touch()
    Path("taken").mkdir()
    Path("taken/records.jsonl").write_text("{}\n")
    changes, sentence = BAD[bad]
    asked: dict[str, Any] = {"task": Falling(), "simulators": "mujoco", "reps": 1, **changes}
    with pytest.raises(simbench.BadInput) as refused:
        simbench.run(**asked)
    assert sentence in str(refused.value)
    assert "\n" not in str(refused.value)
    assert refused.value._render_traceback_() == [str(refused.value)]  # all that IPython shows
    assert not Path(".simbench").exists()


def test_a_simulator_that_is_not_here_says_how_to_get_it() -> None:
    with pytest.raises(simbench.BadInput, match=r"mujoco==99\.0 needs an environment .*: simbench"):
        simbench.run(Falling(), "mujoco==99.0")


def test_a_machine_without_any_says_where_to_look(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pytest_simbench.client.environments.missing", lambda info: "not here")
    with pytest.raises(simbench.BadInput, match="no simulator is ready here: `simbench list`"):
        simbench.run(Falling())


def test_names_are_imported_when_they_are_asked_for() -> None:
    """An unrelated pytest run pays for nothing of it."""
    code = (
        "import sys, pytest_simbench as s;"
        " print(len([m for m in sys.modules if m.startswith('pytest_simbench')]));"
        " s.run, s.load, s.Run; print('run' in dir(s),"
        " [m for m in sys.modules if m.startswith(('pytest.', '_pytest', 'pytest_simbench.plu'))])"
    )
    command = [sys.executable, "-c", code]
    found = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    assert found == ["1", "True", "[]"]
    with pytest.raises(AttributeError, match="has no attribute 'rum'"):
        _ = simbench.rum


SCRIPT = """
import pytest_simbench as simbench
from tests.tiny import Falling
simbench.run(Falling(1e5), "mujoco", reps=3, folder="out", jobs=JOBS)
"""


@pytest.mark.engine
@pytest.mark.parametrize("jobs", [1, 2])
def test_ctrl_c_keeps_records_and_ends_workers(tmp_path: Path, jobs: int) -> None:
    before = workers()
    script = SCRIPT.replace("JOBS", str(jobs))
    child = subprocess.Popen(
        [sys.executable, "-c", script],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    until = time.monotonic() + 60
    while len(list(tmp_path.glob("out/logs/*"))) < jobs and time.monotonic() < until:
        time.sleep(0.1)
    time.sleep(3)
    child.send_signal(signal.SIGINT)
    _, told = child.communicate(timeout=60)
    assert told.rstrip().endswith("records are kept: folder='out', resume=True goes on"), told
    kept = simbench.load(tmp_path / "out").contents.every
    assert [record.status for record in kept] == ["interrupted"] * jobs
    assert workers() <= before


def test_pytest_compares_with_it(pytester: pytest.Pytester) -> None:
    simbench.run(Falling(0.1), "mujoco", reps=2, folder="before", quiet=True)
    pytester.makepyfile(
        """
        from tests.tiny import Falling

        def test_falling(repeat):
            repeat(Falling(0.1))
        """
    )
    options = ("--sim=mujoco", "--reps=2", "--sim-baseline=before", "--sim-output=now")
    result = pytester.runpytest_subprocess(*options)
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["baseline: *before", "*landed *0 % *0 % *no clear change"])
    result.stdout.no_fnmatch_line("*different in the baseline*")
    again = simbench.load("now").compare("before")
    assert "landed" in str(again)
    same = [simbench.load(name).contents.records[0].to_dict() for name in ("before", "now")]
    differ = {key for key in same[0] if same[0][key] != same[1][key]}
    assert differ <= {"test", "function", "seconds", "stepping", "timeline", "resources", "notes"}


def test_a_profile_of_a_file_goes_wherever_a_name_does(
    scripted: dict[str, Any], tmp_path: Path
) -> None:
    (tmp_path / "quick.toml").write_text('simulator = "mujoco"\n[settings]\ntimestep = 0.004\n')
    run = simbench.run(Falling(), TWO, 1, profile="quick.toml,tuned")
    names = [r.name for r in run.contents.records]
    (label,) = (r.profile for r in run.contents.records if r.settings["timestep"] == 0.004)
    assert label.startswith("quick-")
    assert names == [
        f"test_falling[mujoco-headless-{label}]",
        "test_falling[mujoco-headless]",
        "test_falling[pybullet-headless]",
    ]
    assert "quick.toml is a profile of mujoco, not of pybullet" in " ".join(run.problems)
    with pytest.raises(simbench.BadInput, match="cannot read the profile no.toml: No such file"):
        simbench.run(Falling(), "mujoco", profile="no.toml")
