"""What throwing is: what is planned, asked for and measured, and the study's throw."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pytest_simbench.motion.files import read_robot
from pytest_simbench.motion.kinematics import DECIMALS
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import Pose
from pytest_simbench.tasks import Jitter, Throwing
from pytest_simbench.tasks.throwing import perfect_throw
from tests.motion.small_arm import small_arm
from tests.tasks.flying import GRAVITY, PROJECTILE, FlyingProcess
from tests.tasks.scripted import perform
from tests.tasks.test_throwing import TASK, parabola, thrown


def test_what_a_robot_cannot_do_is_a_sentence(tmp_path: Path) -> None:
    robot = read_robot(small_arm(tmp_path))
    problem = TASK.on(robot).problem()
    assert "'small' has no swing for the throw: write one into its file" in problem
    swing = robot.column("initial_position")[:3]
    problem = TASK.on(replace(robot, swing=(tuple(swing), tuple(swing)))).problem()
    assert "'small' cannot handle a cube at (" in problem
    assert TASK.problem() is None


def test_references_are_the_trajectorys() -> None:
    """Not constants: another release lands elsewhere."""
    for fraction in (0.4, 0.5, 0.55):
        task = Throwing(release_fraction=fraction)
        throw = perfect_throw(panda(), fraction, True)
        landing = parabola(throw.position, throw.velocity)
        assert task.references["landing_x"] == pytest.approx(landing, abs=1e-4)
        assert task.references["release_speed"] == pytest.approx(np.linalg.norm(throw.velocity))
    study = Throwing().study()
    throw = perfect_throw(panda(), 0.5, False)
    assert study.references["landing_x"] == pytest.approx(
        parabola(throw.position, throw.velocity), abs=1e-4
    )
    assert study.references["landing_x"] == pytest.approx(1.352, abs=0.001)  # REFERENCE_STUDY


def test_what_is_planned_is_the_reference() -> None:
    """The throw that a world is asked for is the one that it is held against."""
    for task in (TASK, replace(TASK, feasible=False)):
        outcome, process = thrown(task=task, jitter=Jitter())
        swing = next(a for a in process.asked if a.phase == "throw" and a.kind == "follow")
        timed = perfect_throw(panda(), 0.5, task.feasible).timed
        for name, decimals in zip(("position", "velocity"), DECIMALS, strict=False):
            told, half = swing.arguments[name][:, :7], 10.0**-decimals / 2
            assert np.allclose(told, getattr(timed, name), 0.0, 1.01 * half)
        release = outcome.details["release"]
        assert release["reference_landing_x"] == pytest.approx(task.references["landing_x"])


def test_the_studys_throw() -> None:
    """Each constant with its source in docs/study.md; it asks for more than the motors give."""
    study = Throwing(settle=1.0).study()
    assert study == Throwing(settle=1.0).study().study()
    assert study.settle == 1.0
    outcome, process = thrown(task=study)
    follows = [asked for asked in process.asked if asked.kind == "follow"]
    wind_up = next(asked for asked in follows if asked.phase == "wind up")
    speeds = np.abs(wind_up.arguments["velocity"][:, :7])
    limits = np.array([2.175] * 4 + [2.61] * 3)
    assert 0.4 < (speeds / limits).max() <= 0.5 + 1e-6
    pick = [asked.arguments["velocity"][:, :7] for asked in follows if asked.phase == "pick"]
    assert max((np.abs(rows) / limits).max() for rows in pick) <= 0.5 + 1e-6
    swing = next(asked for asked in follows if asked.phase == "throw")
    assert swing.duration == pytest.approx(1.464, abs=0.0041)
    assert outcome.metrics["limits"] > 115.0
    assert outcome.details["limits"]["torque"] == pytest.approx(1.2, abs=0.05)


def test_the_projectile_may_be_anywhere_within_the_jitter() -> None:
    outcome, _ = thrown(jitter=Jitter(), pushed={"pyramid_6": (0.1, 0.0, 0.0)})
    assert outcome.metrics["hit"] == 1.0
    assert outcome.metrics["landing_error"] < 0.003
    assert isinstance(outcome.details["projectile_end"][0], float)
    assert Pose(tuple(outcome.details["projectile_end"])).position[2] < 0.05


@pytest.mark.parametrize("seed", [3, 500001])
def test_all_its_motions_are_feasible(seed: int) -> None:
    """With the cube in the hand; the study's swing alone is not."""
    shares = {}
    for task in (TASK, TASK.study()):
        _, process = perform(task, seed=seed, process=FlyingProcess())
        model, cube = process.model, process.scene.body(PROJECTILE)
        for asked in process.asked:
            if asked.kind == "follow":
                position, velocity = (asked.arguments[k][:, :7] for k in ("position", "velocity"))
                change = np.gradient(velocity, 0.004, axis=0)
                share = np.abs(model.effort_shares(GRAVITY, position, velocity, change, cube))
                key = task.feasible, asked.phase
                shares[key] = max(shares.get(key, 0.0), float(share.max()))
    assert shares.pop((False, "throw")) > 1.1
    assert max(shares.values()) <= 0.905
    assert shares[True, "throw"] == pytest.approx(0.90, abs=0.01)


def test_phases_are_named() -> None:
    """Errors, progress and resource samples go by them, and times by the marks."""
    _, process = thrown()
    phases = list(dict.fromkeys(asked.phase for asked in process.asked))
    assert phases == ["settle start", "pick", "wind up", "throw", "settle"]
    assert TASK.name == "throwing"
    assert TASK.study_timeout == 600.0


def test_the_throw_is_seen_at_every_step_and_the_settling_20_times_a_second() -> None:
    _, process = thrown(task=replace(TASK, full_wait=True))
    waits = [asked for asked in process.asked if asked.kind == "wait"]
    for phase, seconds, period in (("throw", 1.0, 0.0), ("settle", 3.0, 0.05)):
        parts = [asked for asked in waits if asked.phase == phase]
        assert sum(asked.duration for asked in parts) == pytest.approx(seconds)
        assert {asked.arguments["log_period"] for asked in parts} == {period}
