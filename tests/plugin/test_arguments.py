"""What a test gives our fixtures: a wrong one is one sentence, and nothing is simulated. The
interactive fixtures, under Hypothesis too."""

from __future__ import annotations

import fnmatch
from pathlib import Path

import pytest

from tests.plugin.inner import run_pytest
from tests.plugin.whole import prepare, run

HEAD = """
import math
import pytest
from tests.tiny import Falling
from pytest_simbench.tasks import Throwing

class Other(Falling):
    name = "other"

class Longer(Falling):
    duration = 2.0  # which the dataclass above does not hear of

"""

TESTS = {
    "repeat(Throwing)": "repeat(Throwing) got a class instead of a task: write repeat(Throwing())",
    "repeat(Longer())": "*write @dataclass(frozen=True) above class Longer",
    "repeat(5)": "repeat(5) takes a task, for instance repeat(Throwing())",
    "repeat(None)": "repeat(None) takes a task",
    "repeat('stacking' * 999)": "repeat('stackingstacking*...) takes a task",
    "replay(Throwing)": "replay(Throwing) got a class instead of a task",
    "replay(5)": "replay(5) takes a task",
    "perturb(Throwing)": "perturb(Throwing) got a class instead of a task",
    "perturb([])": "perturb([[]]) takes a task",
    "threshold(5, 1)": "threshold(5, ...) takes the name of a metric as a text",
    "threshold('', 1)": "threshold('', ...) takes the name of a metric as a text",
    "threshold('placed', 'much')": "threshold('placed', *much*) takes a finite number",
    "threshold('placed', math.nan)": "threshold('placed', nan) takes a finite number",
    "threshold('placed', True)": "threshold('placed', True) takes a finite number",
}


SETTINGS = {
    "{'speed': 1}": ": mujoco has no setting 'speed'; choose from timestep=*",
    "{3: 1}": ": mujoco has no setting 3; choose from timestep=*",
    "{'timestep': 'fast'}": ": mujoco.timestep=fast: give a finite number",
    "{'timestep': None}": ": mujoco.timestep=None: give a finite number",
    "{'timestep': float('inf')}": ": mujoco.timestep=inf: give a finite number",
    "{'timestep': 5}": ": mujoco.timestep=5: give a number of seconds from 1e-06 to 0.01667*",
    "{'noslip_iterations': 1.5}": ": mujoco.noslip_iterations=1.5: give a whole number",
    "{'solref': 3}": ": mujoco.solref=3: give 2 numbers, separated by '/'",
    "{'cone': 3}": ": mujoco.cone=3: choose from pyramidal, elliptic",
    "[1]": " gives *1*; it must give a dict of settings by name*",
    "None": " gives None; it must give a dict of settings by name*",
    "'timestep=0.1'": " gives 'timestep=0.1'; it must give a dict of settings by name*",
}
"""What the fixture `sim_settings` gives, and what is said of it."""


def test_wrong_arguments_and_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = [
        f"def test_{number}({call.partition('(')[0]}):\n    {call}\n"
        for number, call in enumerate(TESTS)
    ]
    classes = [
        f"class Test{number}:\n"
        f"    @pytest.fixture\n    def sim_settings(self):\n        return {value}\n\n"
        "    def test_it(self, repeat):\n        repeat(Falling())\n"
        for number, value in enumerate(SETTINGS)
    ]
    prepare(tmp_path, monkeypatch, "\n".join([HEAD, *calls, *classes]))
    lines = run("--sim-output=out").splitlines()
    assert f"{len(TESTS)} failed, {len(SETTINGS)} errors in " in lines
    settings = [f"*the fixture sim_settings{message}" for message in SETTINGS.values()]
    told = [*(f"*{message}*" for message in TESTS.values()), *settings]
    assert [pattern for pattern in told if not fnmatch.filter(lines, f"{pattern}*")] == []
    assert not Path("out").exists()


def test_one_task_twice_in_a_test_and_good_settings(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        HEAD
        + """
import numpy as np
import unittest

class Faster(Falling):
    '''Another one of the same name and parameters.'''

def test_twice(repeat):
    repeat(Falling(duration=0.1))
    repeat(Faster(duration=0.1))

def test_two_tasks(repeat):
    repeat(Falling())
    repeat(Other())

class TestSettings:
    @pytest.fixture
    def sim_settings(self):
        return {"timestep": np.float32(0.01), "noslip_iterations": np.int64(3), "solref": [0.01, 1]}

    def test_it(self, repeat):
        settings = repeat(Falling()).records[0].settings
        assert settings["timestep"] == pytest.approx(0.01)
        assert settings["noslip_iterations"] == 3

class TestCase(unittest.TestCase):
    taken = pytest.fixture(autouse=True)(lambda self, repeat: None)

    def test_it(self):
        pass
"""
    )
    result = run_pytest(pytester, "--sim=mujoco --reps=1", failed=1, passed=2, errors=1)
    result.stdout.fnmatch_lines(["a fixture of a simulator was asked for by a TestCase, *"])
    result.stdout.fnmatch_lines(["repeat() is called for the task 'falling' a second time in one*"])


def test_simulator_is_safe_under_hypothesis(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        from hypothesis import given, settings, strategies as st
        from pytest_simbench.scene import Box, Pose, Scene

        pids = set()

        @settings(max_examples=5, deadline=None)
        @given(height=st.floats(0.1, 0.5))
        def test_falls(simulator, height):
            cube = Box("cube", (0.05, 0.05, 0.05), Pose.at(0, 0, height), mass=0.1)
            with simulator.episode(Scene("s", (cube,))) as world:
                world.wait(1.0)
                assert abs(world.pose("cube").position[2] - 0.025) < 0.002
                pids.add(world.process.pid)

        def test_worker_was_reused():
            assert len(pids) == 2  # one for each simulator
        """
    )
    run_pytest(pytester, "--sim=mujoco,pybullet -p no:randomly", passed=3)


def test_settings_and_resources(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        import time
        import pytest
        from pytest_simbench.scene import Scene

        @pytest.fixture
        def sim_settings():
            return {"timestep": 0.005}

        def test_it(sim, resources, output_path):
            world = sim(Scene("s"))
            use = resources(world)
            world.wait(0.005)
            assert world.stats()["stepping"]["steps"] == 1
            time.sleep(0.5)
            assert use.stop().rss_mb.mean > 20
            assert output_path.is_dir()
        """
    )
    run_pytest(pytester, "--sim=mujoco", passed=1)
