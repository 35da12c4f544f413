"""A repetition is watched: what that costs is in no number, and what it finds is told."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from dataclasses import replace
from typing import Any

import pytest
from pytest_simbench.sims.mujoco.adapter import MuJoCo

from pytest_simbench.client import resources
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.laws.loops import FourBarSwing
from pytest_simbench.records.record import Record
from pytest_simbench.scene import Scene
from pytest_simbench.tasks.base import Task
from tests.tiny import Falling

READING = 0.5
"""What a reading takes a slow engine [s]."""

HELPER = """
import sys, time
while sys.stdin.buffer.read(1):
    until = time.process_time() + 0.001
    while time.process_time() < until: pass
    sys.stdout.buffer.write(b"1")
    sys.stdout.buffer.flush()
"""


class SlowToTell(MuJoCo):
    def read_back(self) -> dict[str, Any]:
        if self.time:
            time.sleep(READING)
        return super().read_back()


class Helped(MuJoCo):
    """A helper of its own works 1 ms in each step."""

    def load(self, scene: Scene) -> None:
        super().load(scene)
        self.helper = subprocess.Popen(
            [sys.executable, "-c", HELPER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0
        )

    def step(self) -> None:
        super().step()
        self.helper.stdin.write(b"1")
        self.helper.stdout.read(1)


class Loose(MuJoCo):
    """What holds loops is a hundred times as slow as it was."""

    def load(self, scene: Scene) -> None:
        super().load(scene)
        self.model.eq_solref[:, 0] *= 100


def run(case: Case, adapter: str, task: Task) -> Record:
    record, error = Repetition(Experiment(replace(case, adapter=adapter), task), 1).run()
    assert error is None
    return record


def test_what_reading_takes_is_no_time_of_the_repetition(case: Case) -> None:
    """Once in the first second, and at the end."""
    began = time.perf_counter()
    record = run(case, "tests.experiment.test_watched:SlowToTell", Falling(duration=1.2))
    wall = time.perf_counter() - began
    assert wall - record.seconds["total"] > 2 * READING
    marks = record.timeline
    assert marks["end"] - marks["start"] < record.stepping["wall"] + READING


def test_the_cpu_of_an_engine_s_helper_counts_as_the_sampler_has_it(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A sampler that lists children once a second may miss the helper's first second."""
    monkeypatch.setattr(resources, "LISTING_INTERVAL", 0.0)
    record = run(case, "tests.experiment.test_watched:Helped", Falling(duration=2.5))
    stepping = record.stepping
    assert 1.0 <= stepping["cpu"] / stepping["simulated"] < 2.0
    sampled = record.resources["phases"]["fall"]["cpu_percent"]["mean"] / 100 * stepping["wall"]
    assert stepping["cpu"] == pytest.approx(sampled, rel=0.4)


@pytest.mark.parametrize(("adapter", "opened"), [("MuJoCo", False), ("Loose", True)])
def test_a_loop_that_is_open_at_the_end_is_noted(case: Case, adapter: str, opened: bool) -> None:
    record = run(case, f"tests.experiment.test_watched:{adapter}", FourBarSwing())
    assert (record.notes.opened > 1e-3) == opened


def test_pytest_tells_who_cheats(pytester: pytest.Pytester) -> None:
    """In one sentence, of each engine: planted at loading, and while it runs."""
    cheats = ["MuJoCo_gravity_later", "PyBullet_masses_later", "MuJoCo_time_loaded"]
    site = pytester.mkdir("site")
    info = site / "cheats-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: cheats\nVersion: 1.0\n")
    entries = "".join(f"{name.lower()} = tests.worker.cheats:{name}\n" for name in cheats)
    (info / "entry_points.txt").write_text(f"[pytest_simbench.simulators]\n{entries}")
    pytester.makepyfile(
        """
        from tests.tiny import Falling

        def test_falling(repeat):
            repeat(Falling())
        """
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", os.pathsep.join([str(site), os.environ["PYTHONPATH"]]))
        names = ",".join(map(str.lower, cheats))
        result = pytester.runpytest_subprocess(f"--sim={names}", "--sim-reps=1", "--sim-output=out")
    result.assert_outcomes(failed=3)
    result.stdout.fnmatch_lines_random(
        [
            "*MuJoCo changed gravity while it ran: *-9.80665] when it was loaded, *-4.903325] at*",
            "*PyBullet changed body/left/mass while it ran: 0.1* when it was loaded, 1.* at t = *",
            "*built another world than the scene describes: timestep: scene 0.001, * 0.0005*",
        ]
    )
