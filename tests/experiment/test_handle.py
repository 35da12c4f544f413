"""Episodes: one at a time, and safe after whatever ends them."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis.errors import UnsatisfiedAssumption

from pytest_simbench.client.errors import WorkerExited
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.example import read_example
from pytest_simbench.experiment.handle import SimulatorHandle
from pytest_simbench.repeatability.__main__ import main
from pytest_simbench.scene import Pose, Scene
from pytest_simbench.tasks.base import cube

WHITE = (1.0, 1.0, 1.0, 1.0)
SCENE = Scene("s", (cube("a", Pose.at(0.0, 0.0, 0.2), WHITE),))


@pytest.fixture
def handle(case: Case) -> Iterator[SimulatorHandle]:
    handle = SimulatorHandle(case)
    yield handle
    handle.close()


def test_one_worker_for_all_episodes(handle: SimulatorHandle) -> None:
    pids = set()
    for _ in range(3):
        with handle.episode(SCENE) as world:
            assert world.time == 0
            world.wait(0.1)
            pids.add(world.process.pid)
    assert len(pids) == 1
    assert handle.constructed.settings["timestep"] == 0.001


def test_two_episodes_at_once_are_an_error(handle: SimulatorHandle) -> None:
    with handle.episode(SCENE) as world:
        with (
            pytest.raises(RuntimeError, match="an episode of mujoco is still open"),
            handle.episode(SCENE),
        ):
            pass
        world.wait(0.1)  # the first one goes on
    with handle.episode(SCENE):
        pass


class Interrupted(BaseException):
    """What a time-out of a test raises, anywhere."""


def test_an_interrupted_request_leaves_no_stale_answer(handle: SimulatorHandle) -> None:
    def interrupt(*_: object) -> None:
        raise Interrupted

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        with pytest.raises(Interrupted), handle.episode(SCENE) as world:  # noqa: PT012
            pid = world.process.pid
            signal.setitimer(signal.ITIMER_REAL, 0.3)
            world.wait(10000.0)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    with handle.episode(SCENE) as world:
        assert world.process.pid != pid
        world.wait(0.1)
        assert world.time == pytest.approx(0.1)


def test_a_failing_test_keeps_its_worker_and_tells_how_to_replay(
    handle: SimulatorHandle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(AssertionError) as caught, handle.episode(SCENE) as world:  # noqa: PT012
        pid = world.process.pid
        world.wait(0.3)
        end = world.pose("a").position
        raise AssertionError("too low")
    (note,) = caught.value.__notes__
    (path,) = (tmp_path / "examples").iterdir()
    assert note.startswith("replay this episode: simbench replay ")
    assert note.endswith(path.name)
    with handle.episode(SCENE) as world:
        assert world.process.pid == pid
    assert main([str(path)]) == 0
    told = capsys.readouterr().out
    assert told.startswith("mujoco headless tuned, t = 0.300 s")
    assert f"a: {end[0]:.4f} {end[1]:.4f} {end[2]:.4f} m" in told


def test_a_crash_is_replayed_up_to_it(handle: SimulatorHandle, tmp_path: Path) -> None:
    with pytest.raises(WorkerExited) as caught, handle.episode(SCENE) as world:  # noqa: PT012
        world.wait(0.1)
        assert world.process.pid is not None
        os.kill(world.process.pid, signal.SIGKILL)
        world.wait(0.2)
    assert "replay this episode" in caught.value.__notes__[0]
    (path,) = (tmp_path / "examples").iterdir()
    example = read_example(path, tmp_path)
    assert example.scene == SCENE
    assert [operation.duration for operation in example.tape] == [0.1, 0.2]
    with handle.episode(SCENE) as world:
        world.wait(0.1)


def test_the_last_failure_stays(handle: SimulatorHandle, tmp_path: Path) -> None:
    """As Hypothesis ends with the smallest example."""
    for height in (0.5, 0.3):
        scene = SCENE.with_pose("a", Pose.at(0, 0, height))
        with pytest.raises(AssertionError), handle.episode(scene):
            raise AssertionError
    (path,) = (tmp_path / "examples").iterdir()
    assert read_example(path, tmp_path).scene.body("a").pose.position[2] == 0.3


def test_giving_an_example_up_is_no_failure(handle: SimulatorHandle, tmp_path: Path) -> None:
    with pytest.raises(UnsatisfiedAssumption), handle.episode(SCENE):
        raise UnsatisfiedAssumption
    assert not (tmp_path / "examples").exists()
