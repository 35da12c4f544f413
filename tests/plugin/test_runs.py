"""What users type and what they get, with a small task on the real engines."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import psutil
import pytest

from tests.plugin.inner import CLAIMING, FALLING, records, run_pytest


def test_ids_table_records_logs_and_traces(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(CLAIMING)
    result = run_pytest(
        pytester, "--sim=mujoco,pybullet --reps=2 --sim-output=out --sim-trace=on -v", passed=2
    )
    result.stdout.fnmatch_lines(
        [
            "*::test_falling[[]mujoco-headless[]]*",
            "*::test_falling[[]pybullet-headless[]]*",
            "*simulator comparison*",
            "landed: *100 %*",
        ]
    )
    kept = records(pytester.path / "out")
    assert [(r["simulator"], r["repetition"], r["seed"], r["status"]) for r in kept] == [
        ("mujoco", 1, 10001, "ok"),
        ("mujoco", 2, 10002, "ok"),
        ("pybullet", 1, 10001, "ok"),
        ("pybullet", 2, 10002, "ok"),
    ]
    assert len(list((pytester.path / "out" / "logs").iterdir())) == 4
    for path in (pytester.path / "out" / "traces").glob("*mujoco*"):
        trace = np.load(path)
        assert trace["bodies"].shape == (30, 2, 13)
        assert np.allclose(np.diff(trace["time"]), 0.02)
        assert list(trace["body_names"]) == ["left", "right"]


def test_marks(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        import sys
        import pytest
        from tests.tiny import Falling

        @pytest.mark.only_sim("pybullet")
        @pytest.mark.reps(3)
        def test_only(repeat):
            assert len(repeat(Falling())) == 3
            assert not {"pinocchio", "coal", "ompl"} & {*sys.modules}  # no robot, no planner

        @pytest.mark.skip_sim("pybullet", reason="not today")
        def test_skip(sim_name):
            assert sim_name == "mujoco"

        @pytest.mark.xfail_sim("mujoco", reason="known")
        def test_xfail(sim_name):
            assert sim_name == "pybullet"

        @pytest.mark.needs("gpu")
        def test_needs(sim_name):
            raise AssertionError

        @pytest.mark.parametrize("case", [pytest.param(1, marks=pytest.mark.needs("gpu")), 2])
        def test_a_parameter_needs(sim_name, case):
            assert case == 2
        """
    )
    result = run_pytest(pytester, "--sim=mujoco,pybullet -rs", passed=5, skipped=5, xfailed=1)
    result.stdout.fnmatch_lines(["*pybullet has no gpu*"])


@pytest.mark.parametrize(
    ("typed", "is_"), [("", (3, 50.0)), ("--reps=2 --sim-timeout=40", (2, 40.0))]
)
def test_a_mark_stands_between_the_command_line_and_the_ini_file(
    pytester: pytest.Pytester, typed: str, is_: tuple[int, float]
) -> None:
    pytester.makeini("[pytest]\nreps = 1\nsim_timeout = 30\n")
    marks = "import pytest\npytestmark = [pytest.mark.reps(3), pytest.mark.sim_timeout(50)]\n"
    pytester.makepyfile(marks + FALLING)
    run_pytest(pytester, f"--sim=mujoco --sim-output=o {typed}", passed=1)
    found = records("o")
    assert (len(found), found[0]["limits"]["timeout"]) == is_


def test_benchmark_rounds_are_worker_seconds_and_compare(pytester: pytest.Pytester) -> None:
    mark = '@pytest.mark.benchmark(group="mine")\ndef'
    pytester.makepyfile("import pytest\n" + CLAIMING.replace("def", mark))
    arguments = ["--sim=mujoco", "--reps=3", "--benchmark-autosave"]
    run_pytest(pytester, "--benchmark-json=b.json --sim-output=out", *arguments, passed=1)
    (benchmark,) = json.loads((pytester.path / "b.json").read_text())["benchmarks"]
    kept = records(pytester.path / "out")
    seconds = [r["stepping"]["wall"] for r in kept]
    assert (benchmark["stats"]["rounds"], benchmark["group"]) == (3, "mine")
    assert benchmark["stats"]["min"] == pytest.approx(min(seconds))
    assert benchmark["stats"]["max"] == pytest.approx(max(seconds))
    assert benchmark["extra_info"]["metrics"] == {"landed": [1.0, 1.0, 1.0]}
    assert benchmark["extra_info"]["settings"]["timestep"] == 0.001
    result = run_pytest(pytester, "--benchmark-compare", *arguments, passed=1)
    output = result.stdout.str()
    assert "test_falling[mujoco-headless] (NOW)" in output
    assert "test_falling[mujoco-headless] (0001_" in output


FULL_DISK = """
import errno, os, pathlib

write = os.write

def full(descriptor, data):
    path = pathlib.Path(os.readlink(f"/proc/self/fd/{descriptor}"))
    if path.name == "records.jsonl" and path.parent.name == "out":
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    return write(descriptor, data)

os.write = full
"""


def test_full_disk_loses_nothing(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytester.makepyfile(CLAIMING)
    pytester.makeconftest(FULL_DISK)
    monkeypatch.setenv("TMPDIR", str(pytester.mkdir("spare")))
    result = run_pytest(pytester, "--sim=mujoco --reps=2 --sim-output=out", passed=1)
    result.stdout.fnmatch_lines(["*No space left on device*"])
    (saved,) = (pytester.path / "spare").rglob("*.jsonl")
    assert len(saved.read_text().splitlines()) == 2


def interruptible() -> None:
    """Undo what a shell's `&` does to its children: they would not hear of Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.parametrize(
    ("arguments", "running"),
    [([], {2}), (["--sim-jobs=3"], {2, 3}), (["-n2"], {2})],
    ids=["plain", "jobs", "xdist"],
)
@pytest.mark.parametrize("times", [1, 2])
def test_interrupt_prints_the_table_and_keeps_the_records(
    pytester: pytest.Pytester, arguments: list[str], running: set[int], times: int
) -> None:
    """The first repetition ends, the others never do: so it is known what Ctrl-C meets."""
    pytester.makepyfile(
        """
        from dataclasses import dataclass
        from tests.tiny import Falling

        @dataclass(frozen=True)
        class First(Falling):
            def perform(self, world, seed, count):
                if seed != 10001:
                    world.wait(1e6)
                return super().perform(world, seed, count)

        def test_falling(repeat):
            repeat(First())
        """
    )
    process = subprocess.Popen(
        [sys.executable, "-m", "pytest", "--sim=mujoco", "--sim-output=out", *arguments],
        cwd=pytester.path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=interruptible,
    )
    path, logs = pytester.path / "out" / "records.jsonl", pytester.path / "out" / "logs"
    started = {f"-{number}.log" for number in running}
    for _ in range(600):
        begun = {log.name[log.name.rindex("-") :] for log in logs.glob("*.log")}
        if path.is_file() and path.read_text() and started <= begun:
            break
        time.sleep(0.1)
    children = psutil.Process(process.pid).children(recursive=True)
    for _ in range(times):
        os.killpg(process.pid, signal.SIGINT)
        time.sleep(0.2)
    output, errors = process.communicate(timeout=60)
    assert process.returncode == pytest.ExitCode.INTERRUPTED
    assert "Traceback (" not in output + errors
    if times == 1:  # the second may end the report
        assert output.count("simulator comparison") == 1
        assert "\ninterrupted: the same command with --sim-resume completes the run\n" in output
        assert "PytestBenchmarkWarning" not in output
    statuses = {r["repetition"]: r["status"] for r in records(pytester.path / "out")}
    assert statuses.pop(1) == "ok"
    assert set(statuses) >= running  # and perhaps one that was just being started
    assert set(statuses.values()) == {"interrupted"}
    _, alive = psutil.wait_procs(children, timeout=5)
    assert not alive


@pytest.mark.usefixtures("drawn")
def test_plugin_load_is_light(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        import sys

        def test_light():
            heavy = {"numpy", "scipy", "psutil", "execnet", "pinocchio", "mujoco", "pybullet",
                     "rich.console", "ruckig", "ompl", "matplotlib", "hypothesis.strategies"}
            assert "pytest_simbench.plugin.hooks" in sys.modules
            assert not heavy & set(sys.modules)
        """
    )
    others = ("xdist", "xdist.looponfail", "benchmark", "hypothesispytest")
    plugins = [part for name in others for part in ("-p", f"no:{name}")]
    run_pytest(pytester, "", *plugins, passed=1)


def test_gui_without_any_display_is_a_skip(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytester.makepyfile(CLAIMING)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("PATH", str(pytester.mkdir("empty")))
    result = run_pytest(pytester, "--sim=mujoco --gui --reps=1 -rs", skipped=1)
    result.stdout.fnmatch_lines(["*no display, and no Xvfb*"])


def test_declared_deviations_are_recorded_and_shown(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_it=FALLING)
    result = run_pytest(pytester, "--sim=pybullet --reps=1 -v --sim-output=out", ret=0)
    told = "body/*/gravity link/*/gravity: Bullet has one gravity for all (not told by the engine)"
    assert told in records(pytester.path / "out")[0]["deviations"]
    assert f"pybullet: {told}" in " ".join(result.stdout.str().split())


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="no Xvfb: apt-get install xvfb")
def test_without_a_vulkan_device_a_window_is_a_skip_and_no_failed_repetition(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("sapien")
    for name in ("VK_DRIVER_FILES", "VK_ICD_FILENAMES"):
        monkeypatch.setenv(name, str(pytester.path / "none.json"))
    pytester.makepyfile(
        """
        from pytest_simbench.tasks import Jitter
        from tests.tiny import Falling

        def test_repeated(repeat):
            repeat(Falling()).assert_at_least("landed", 0.1)

        def test_by_hand(simulator):
            with simulator.episode(Falling().scene(0, Jitter())) as world:
                world.wait(0.1)
        """
    )
    arguments = ("--sim=sapien", "--reps=2", "--sim-output=out", "-rs")
    result = run_pytest(pytester, "--gui", *arguments, skipped=2)
    result.stdout.fnmatch_lines(["*SAPIEN draws with Vulkan*mesa-vulkan-drivers*"])
    assert not (pytester.path / "out" / "records.jsonl").exists()
    run_pytest(pytester, "", *arguments, passed=2)
