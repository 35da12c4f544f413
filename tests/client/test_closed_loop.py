"""A policy in a world: what it sees, when its commands act, what becomes of one that fails."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from pytest_simbench.client import connection
from pytest_simbench.client.closed_loop import Watched, shipped
from pytest_simbench.client.errors import PolicyFailed, Unavailable, Where, WorkerExited, WorkerHung
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.ground.errors import PolicyError
from pytest_simbench.motion.kinematics import Servo
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import Pose, Scene
from pytest_simbench.scene.policy import Command, Function, LoopError, Observation, Policy
from pytest_simbench.tasks import Reaching
from pytest_simbench.tasks.base import cube
from pytest_simbench.worker import loop
from tests.client.failing import failure
from tests.client.waving import Waving, stalling, still, writing
from tests.conftest import case_of

SCENE = Scene("arm", (cube("a", Pose.at(0.5, 0.3, 0.025), (1.0,) * 4),), panda())
Worlds = Callable[..., World]


@pytest.fixture
def world(case: Case) -> Iterator[Worlds]:
    processes = []

    def made(scene: Scene = SCENE, period: float | None = None, **limits: Any) -> World:
        launch = replace(case, **limits).launch(f"x{len(processes)}")
        processes.append(WorkerProcess(launch, Where(case.simulator, case.mode, 1, 7)))
        processes[-1].construct()
        return World(processes[-1], scene, kinematics=Servo, trace_period=period)

    yield made
    for process in processes:
        process.kill()


def test_inside_the_worker_by_message_or_by_socket_it_is_the_same_to_the_last_bit(
    world: Worlds, monkeypatch: pytest.MonkeyPatch
) -> None:
    ends = []
    for inside in (False, False, True):
        one, policy = world(), Waving(0.3)
        motion = one.control(policy, until=0.5, inside=inside)
        assert policy.seed == (0 if inside else 7)  # the repetition's; inside it is a copy's
        assert motion.time == pytest.approx(np.arange(1, 26) * 0.02)
        ends.append((one.time, one.joints.tobytes(), one.bodies.tobytes()))
    monkeypatch.setattr(connection, "elsewhere", lambda spec: True)
    far = world()
    far.control(Waving(0.3), until=0.5)
    ends.append((far.time, far.joints.tobytes(), far.bodies.tobytes()))
    assert len(set(ends)) == 1
    assert abs(far.joints[0, 3] - panda().joints[3].initial_position) > 0.05


@pytest.mark.parametrize(("rate", "samples"), [(10, 25), (50, 25), (100, 25)])
def test_a_trace_is_as_dense_whatever_the_rate(world: Worlds, rate: int, samples: int) -> None:
    """The motion has the states at each look."""
    one = world(period=0.02)
    motion = one.control(still, until=0.5, rate=rate)
    assert len(motion) == rate // 2
    assert len(one.trace[0]) == samples


def seen_by(world: World, **options: Any) -> list[Observation]:
    """What a policy sees that moves joint 4 by 0.1 rad after 0.1 s."""
    seen = []

    def act(observation: Observation) -> Any:
        seen.append(observation)
        if observation.time < 0.1 - 1e-9:
            return None
        return panda().column("initial_position")[:7] + 0.1 * (np.arange(7) == 3)

    world.control(act, until=0.4, rate=50, **options)
    return seen


def test_commands_act_when_they_shall(world: Worlds) -> None:
    """A command is reached at the end of the period after it; a latency shifts it as it says."""
    start = panda().joints[3].initial_position
    for latency in (0.0, 0.02, 0.03, 0.1):
        seen = seen_by(world(), command_latency=latency)
        told = np.array([row.told[0, 3] for row in seen]) - start
        times = np.array([row.time for row in seen])
        wanted = np.clip((times - 0.1 - latency) / 0.02, 0.0, 1.0) * 0.1
        np.testing.assert_allclose(told, wanted, atol=1e-9)


def test_what_is_shown_is_as_old_as_it_shall_be(world: Worlds) -> None:
    """At first there is nothing so old: the start is shown."""
    for delay in (0.0, 0.02, 0.08):
        times = [row.time for row in seen_by(world(), observation_delay=delay)]
        np.testing.assert_allclose(times, np.maximum(0.0, np.arange(20) * 0.02 - delay), atol=1e-9)


def test_it_ends_when_it_shall(world: Worlds) -> None:
    one = world()
    one.control(still, until=lambda seen: seen.time >= 0.1 - 1e-9, at_most=5.0)
    assert one.time == pytest.approx(0.1)
    one.control(still, until=lambda seen: False, at_most=0.1)
    assert one.time == pytest.approx(0.2)
    one.control(still, until=lambda seen: seen.time >= 0.3 - 1e-9, observation_delay=0.04)
    assert one.time == pytest.approx(0.3)  # what is seen late does not end late
    one.control(SimpleNamespace(act=still), until=0.02)  # whatever has `act`, at the usual rate
    assert one.time == pytest.approx(0.32)


def test_from_a_kept_state_it_acts_as_it_did_there(world: Worlds) -> None:
    one, ways = world(), []
    one.save()
    for _ in range(2):
        ways.append(one.control(Waving(0.3), until=0.5).joints)
        one.restore()
    np.testing.assert_array_equal(*ways)


def test_forces_and_pictures_are_shown_where_they_are_asked_for(world: Worlds) -> None:
    one, shown = world(), []
    one.wait(0.2)
    one.control(shown.append, until=0.04, forces=True, picture=(64, 48))
    weight = shown[-1].forces["body/a", "ground"]
    assert weight[2] == pytest.approx(0.1 * 9.80665, rel=0.02)
    assert shown[-1].forces["ground", "body/a"][2] == pytest.approx(-weight[2])
    assert shown[-1].picture.shape == (48, 64, 3)
    assert shown[-1].picture.std() > 10
    one.control(shown.append, until=0.04)
    assert (shown[-1].picture, shown[-1].forces) == (None, {})


def test_that_an_engine_has_no_pictures_is_no_crash(case: Case, world: Worlds) -> None:
    ode = case_of(case, "ode")
    with pytest.raises(Unavailable, match="ode has no offscreen picture"):
        world(adapter=ode.adapter, python=ode.python).control(still, until=0.1, picture=(64, 48))


def test_a_motor_falls_and_takes_efforts(world: Worlds) -> None:
    """The efforts that hold a real arm hold it here; without them it falls."""
    for effort, goes in ((None, (0.0, 0.01)), (np.zeros(7), (0.3, 10.0))):
        one = world(replace(SCENE, robot=panda().as_motors()))
        before = one.joints[0].copy()
        one.control(lambda seen, e=effort: e if e is None else Command(effort=e), until=0.5)
        low, high = goes
        assert low <= np.abs(one.joints[0] - before)[:7].max() <= high


class Failing(Policy):
    name = "failing"

    def __init__(self, how: str) -> None:
        self.how = how

    def act(self, observation: Observation) -> Any:
        if observation.time < 0.05:
            return None
        if self.how == "stalls":
            time.sleep(30.0)
        if self.how == "exits":
            sys.exit(3)
        if self.how == "raises":
            raise RuntimeError("the network is away")
        return np.full(7, np.nan)


@pytest.mark.parametrize(
    ("how", "told"),
    [
        (
            "raises",
            r"policy failing raised RuntimeError: the network is away \(test_closed_loop.py",
        ),
        ("exits", "policy failing raised SystemExit: 3"),
        ("answers NaN", "the policy answers position with a number that is not finite"),
        ("stalls", "policy failing gave no answer for 2 s"),
    ],
)
def test_one_that_fails_is_told_in_its_own_words(world: Worlds, how: str, told: str) -> None:
    one = world(stall_timeout=2.0)
    with pytest.raises(PolicyFailed, match=told):
        one.control(Failing(how), until=1.0)
    if how != "stalls":
        one.wait(0.1)  # the world is still there
        assert one.process.request("state")["time"] == pytest.approx(0.16, abs=0.021)


def test_inside_too_and_nothing_of_it_delays_the_next(
    world: Worlds, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pytest_simbench.client.process.LOOK_PERIOD", 60.0)
    one = world(stall_timeout=5.0)
    with pytest.raises(PolicyFailed, match=r"raised SystemExit: too far \(waving.py:2"):
        one.control(Waving(9.0), until=1.0, inside=True)
    one.control(still, until=0.1)


def test_one_that_stalls_inside_is_named(world: Worlds) -> None:
    with pytest.raises(WorkerHung, match="policy stalling, which ran inside it"):
        world(stall_timeout=2.0).control(stalling, until=1.0, inside=True)


@pytest.mark.parametrize("inside", [False, True])
def test_what_it_sees_is_not_for_writing(world: Worlds, inside: bool) -> None:
    with pytest.raises(PolicyFailed, match=r"read-only \(waving.py"):
        world().control(writing, until=0.1, inside=inside)


def test_a_repetition_fails_alone(case: Case) -> None:
    kind, phase, message = failure(case, Reaching(Failing("raises")))
    assert (kind, phase) == ("PolicyFailed", "act")
    assert message.startswith("the policy failing raised RuntimeError: the network")


def test_a_worker_that_dies_is_told(world: Worlds) -> None:
    one = world()
    threading.Timer(0.5, os.kill, (one.process.pid, signal.SIGKILL)).start()
    with pytest.raises(WorkerExited, match="SIGKILL"):
        one.control(still, until=1e5)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"rate": 30.0}, "at 30 Hz is asked every 33.33 ms, which is no multiple"),
        ({"until": 0.0}, "the seconds of a closed loop"),
        ({"picture": (0, 48)}, r"picture=\(0, 48\): give its width and height, two whole numbers"),
        ({"picture": "big"}, "picture='big': give its width and height"),
        ({"inside": True, "until": bool}, "inside the worker takes no until=a function"),
        ({"inside": True, "observation_delay": 0.02}, "takes no observation_delay"),
    ],
)
def test_what_cannot_be_asked_for(world: Worlds, options: dict[str, Any], told: str) -> None:
    one = world()
    with pytest.raises(LoopError, match=told):
        one.control(still, **{"until": 0.1, **options})
    one.control(still, until=0.1)
    assert one.time == pytest.approx(0.1)


def test_without_a_robot_there_is_nothing_to_do(world: Worlds) -> None:
    with pytest.raises(LoopError, match="has no robot that a policy could move"):
        world(replace(SCENE, robot=None)).control(still, until=0.1)


@pytest.mark.parametrize(
    ("policy", "told"),
    [
        (Failing("raises"), "cannot run inside the worker: ModuleNotFoundError: No module named"),
        (lambda seen: None, "is not at the top of its module"),
    ],
)
def test_what_cannot_run_inside(world: Worlds, policy: Any, told: str) -> None:
    one = world()
    with pytest.raises(PolicyFailed, match=told):
        one.control(policy, until=0.1, inside=True)


def test_one_inside_needs_no_reset_and_one_that_raises_is_told_in_its_own_words() -> None:
    source = "class Plain:\n    def act(self, seen):\n        return None\n"
    made = {"path": "plain.py", "source": source, "name": "Plain", "state": {}, "seed": 1}
    rows = np.zeros(9), np.zeros(9), np.zeros(9)
    answer = loop.inside(SCENE, rows, 0.1, made | {"goal": None})
    at = answer(0.0, np.zeros((2, 9)), rows, np.zeros((1, 13)))
    assert at is not None
    assert not np.any(at)
    made["source"] += "    def reset(self, seed):\n        raise ValueError(seed)\n"
    with pytest.raises(PolicyError, match=r"policy Plain raised ValueError: 1 \(plain.py:5\)"):
        loop.inside(SCENE, rows, 0.1, made | {"goal": None})


def test_one_that_stalls_is_told_and_holds_up_nobody() -> None:
    process, answer = Mock(where=Where("mujoco", "headless")), threading.Event()
    process.launch.stall_timeout = 0.1
    watched, threads = Watched(process, "slow"), list[threading.Thread]()

    def act() -> None:
        threads.append(threading.current_thread())
        answer.wait(20.0)

    with pytest.raises(PolicyFailed, match="the policy slow gave no answer for 0.1 s"):
        watched.run(lambda: watched.ask(act))
    process.kill.assert_called_once_with()
    assert threads[0].daemon  # or pytest would wait for it at the end
    answer.set()
    threads[0].join()


def test_what_of_a_policy_goes_to_the_worker() -> None:
    """Its source, its name there, and all that it holds."""
    policy, path = Waving(0.1), sys.modules[Waving.__module__].__file__
    told = {"path": path, "source": Path(str(path)).read_text(), "seed": 7}
    found = shipped(policy, 7, Pose.at(1, 2, 3))
    assert [*found.pop("goal")] == [1, 2, 3, 1, 0, 0, 0]
    assert found == {**told, "name": "Waving", "state": {"amplitude": 0.1, "seed": 0}}
    assert shipped(Function(still), 7, None) == {**told, "name": "still", "state": {}, "goal": None}


def test_what_does_not_go_there_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    holding = Waving(0.1)
    holding.lock, holding.act_as = threading.Lock(), len  # type: ignore[attr-defined]
    typed: dict[str, Any] = {"Policy": Policy}
    exec("class Typed(Policy):\n    name, act = 'typed', lambda self, seen: None", typed)
    for policy in (Function(lambda seen: None), holding, typed["Typed"]()):
        with pytest.raises(PolicyError):
            shipped(policy, 1, None)
    monkeypatch.setattr(still, "__module__", "__main__")
    with pytest.raises(PolicyError):
        shipped(Function(still), 1, None)


def test_a_script_does_not_start_itself_again(
    world: Worlds, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(still, "__module__", "__main__")
    with pytest.raises(PolicyFailed, match="would run again inside the worker"):
        world().control(still, until=0.1, inside=True)


def test_what_does_not_travel(world: Worlds) -> None:
    policy = Waving(0.1)
    policy.lock = threading.Lock()
    with pytest.raises(PolicyFailed, match="holds lock, which cannot go to the worker"):
        world().control(policy, until=0.1, inside=True)


@pytest.mark.parametrize("fault", ["Forks", "ForksOn"])
def test_an_engine_that_forks_is_not_asked_by_two(case: Case, fault: str) -> None:
    forking = replace(case, adapter=f"tests.client.faulty:{fault}")
    kind, _, message = failure(forking, Reaching(still, seconds=1.0))
    assert kind == "ProtocolError"
    assert "an engine forks" in message
