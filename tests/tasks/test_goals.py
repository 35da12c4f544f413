"""The tasks of a policy: goals, what counts as reached, and the episode on a real engine."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, make_dataclass, replace
from fractions import Fraction
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.motion.kinematics import DOWNWARD
from pytest_simbench.motion.registry import known_robot
from pytest_simbench.scene import Pose
from pytest_simbench.scene.policy import Command, Observation, as_policy
from pytest_simbench.tasks import GoalTask, Jitter, PickAndPlace, PushingToGoal, Reaching
from pytest_simbench.tasks.base import Count, Outcome
from pytest_simbench.tasks.recorded import code_of, digest, recorded
from tests.conftest import performed
from tests.tasks.scripted import Mishap, ScriptedProcess, ScriptedWorld, put

TASKS = (Reaching, PushingToGoal, PickAndPlace)


def limp(seen: Observation) -> None:
    """Does nothing."""


def to_the_goal(seen: Observation) -> Command:
    """Straight there, the tool pointing down."""
    return Command(tool=Pose(seen.goal.position, DOWNWARD.quaternion))


@given(st.integers(0, 10**6))
def test_each_seed_has_its_goal_within_the_arms_reach(seed: int) -> None:
    for kind in TASKS:
        task = kind(limp)
        goal = task.goal(seed)
        assert goal == task.goal(seed) != task.goal(seed + 1)
        x, y, z = goal.position
        assert 0.2 < np.hypot(x, y) < 0.75
        assert 0.0 < z <= 0.5


@given(st.integers(0, 10**6))
def test_the_way_of_a_push_is_as_long_as_it_says(seed: int) -> None:
    task = PushingToGoal(limp)
    way = np.subtract(task.goal(seed).position, task.begin(seed).position)
    assert 0.08 <= np.linalg.norm(way) <= 0.15
    assert way[2] == 0.0
    assert abs(np.arctan2(way[1], way[0])) <= 2.1


@given(st.integers(0, 10**6))
def test_what_is_to_be_placed_stands_apart_from_its_place(seed: int) -> None:
    cube, stand = PickAndPlace(limp).scene(seed, Jitter()).bodies
    assert np.linalg.norm(np.subtract(cube.pose.position, stand.pose.position)[:2]) > 0.1
    assert PickAndPlace(limp).goal(seed).position[2] == pytest.approx(0.075)


@pytest.mark.parametrize(
    ("kind", "scale"), [(Reaching, 0.5), (PushingToGoal, 0.5), (PickAndPlace, 0.4)]
)
def test_a_small_arm_has_a_similar_scene(kind: type[GoalTask], scale: float) -> None:
    """At the same density, and it must come as much nearer."""
    small, full, still = kind(limp, robot=known_robot("so101")), kind(limp), Jitter(0.0, 0.0)
    goal, near = small.goal(1), small.tolerance * scale
    assert goal.position == pytest.approx(np.multiply(scale, full.goal(1).position))
    for body, other in zip(small.scene(1, still).bodies, full.scene(1, still).bodies, strict=True):
        assert body.extents == pytest.approx(np.multiply(scale, other.extents))
        assert body.pose.position == pytest.approx(np.multiply(scale, other.pose.position))
        assert body.mass == pytest.approx(scale**3 * other.mass)
    for off, there in ((0.99 * near, True), (1.01 * near, False)):
        at = goal.translated(off)
        seen: Any = SimpleNamespace(tool=at, pose=lambda name, at=at: at)
        assert small.reached(seen, 1) == there
    assert f"within {100 * near:g} cm of the goal" in small.metrics[0].doc


def test_a_record_tells_which_policy_it_was() -> None:
    found = Reaching(limp, command_latency=0.1).parameters()
    assert (found["task.policy"], found["task.command_latency"]) == ("limp", 0.1)
    assert found["task.policy_digest"] == digest(limp) != digest(to_the_goal)
    assert "task.robot" not in found

    class Held:
        gain = 1.0

        def __init__(self, gain: Any) -> None:
            self.gain = gain

        def act(self, seen: Observation) -> float:
            return self.gain

    large = np.zeros(2000)
    for one, other in (
        (1.0, 2.0), ([1], (2,)), (np.float32(1), np.float32(2)), ([large], [large + 1e-12]),
    ):  # fmt: skip
        assert digest(Held(one)) == digest(Held(one)) != digest(Held(other))
    kept = [Held(1.0), Held(1.0)]  # each stands somewhere else in memory
    assert digest(Held(kept[:1])) == digest(Held(kept[1:]))

    def before() -> Any:
        class Steady:
            def act(self, seen: Observation) -> float:
                return 1.0

        return Steady()

    def after() -> Any:
        class Steady:
            def act(self, seen: Observation) -> float:
                return 2.0

        return Steady()

    assert digest(before()) == digest(before()) != digest(after())

    def closed(gain: float) -> Callable[[Observation], float]:
        return lambda seen: gain

    assert digest(closed(1.0)) == digest(closed(1.0)) != digest(closed(2.0))

    def open_loop(gain: float, seen: Observation) -> float:
        return gain

    called = type("Called", (Held,), {"act": None, "__call__": Held.act})
    for bound in (  # functions with an argument, methods, and objects that are called
        lambda gain: as_policy(called(gain)),
        lambda gain: as_policy(partial(open_loop, gain)),
        lambda gain: as_policy(partial(partial(open_loop), gain=gain)),
        lambda gain: as_policy(Held(gain).act),
    ):
        assert digest(bound(1.0)) == digest(bound(1.0)) != digest(bound(2.0))

    def circle(gain: float) -> Held:
        inner = Held(gain)
        inner.around = [{"held": Held(inner)}]  # type: ignore[attr-defined]
        return inner

    class Weights:
        """As large as a network's."""

        shape, tolist = (10**6,), None

        def __init__(self, gain: float) -> None:
            self.gain = gain

        def reshape(self, *_: int) -> Any:
            return np.full(self.shape, self.gain)

    for held in (
        Held, closed, circle, Weights,
        lambda gain: partial(open_loop, Held(gain)),
        lambda gain: lambda seen, gain=gain: gain,
        lambda gain: Fraction(gain),
        lambda gain: [{frozenset({gain})}, np.array([Held(gain)])],
    ):  # fmt: skip
        assert digest(Held(held(1.0))) == digest(Held(held(1.0))) != digest(Held(held(2.0)))
    quiet, loud = lambda seen: None, lambda seen: 1.0
    assert digest(quiet) != digest(loud)
    one, other = (make_dataclass(name, ["gain"], frozen=True)(1.0) for name in ("One", "Other"))
    assert recorded(one) == recorded(replace(one)) != recorded(other)
    filtered = Held(Held(1.0))
    before = digest(filtered)
    filtered.gain.gain = 2.0  # by acting
    assert digest(filtered) == before


def test_what_a_policy_is_given_and_what_is_scored(monkeypatch: pytest.MonkeyPatch) -> None:
    """The policy acts for 1 s of 3. Then the cube comes to 20 mm from its place."""
    task = PickAndPlace(limp, 3.0, rate=5.0, command_latency=0.1, observation_delay=0.2, settle=0.3)
    given = {"rate": 5.0, "command_latency": 0.1, "observation_delay": 0.2, "at_most": 3.0}
    goal, asked, counts = task.goal(4), {}, []
    slips = Mishap("settle", 0.1, put("cube", goal.translated(0.02)))
    world = ScriptedWorld(ScriptedProcess([slips]), task.scene(4, Jitter()))

    def control(policy: Any, **how: Any) -> None:
        asked.update(how, policy=policy)
        for period in (0.4, 0.6):  # it is there after the first one, and has stayed after both
            world.wait(period)
            how["until"](SimpleNamespace(time=world.time, pose=lambda _: goal))

    monkeypatch.setattr(world, "control", control)
    assert task.perform(world, 4, lambda *count: counts.append(count)) == Outcome(
        {"success": 1.0, "distance": pytest.approx(0.02), "time": pytest.approx(0.4)},
        {"goal": [*goal.position], "acted": pytest.approx(1.0)},
    )
    stays = asked.pop("until")
    assert asked == {**given, "policy": limp, "seed": 4, "inside": False, "goal": goal}
    marks = {"start": 0.2, "end": pytest.approx(1.2)}
    assert (counts, world.process.marks, world.time) == ([(1, 1)], marks, pytest.approx(1.5))
    ways = (0.0, 0.0), (0.02, 0.49), (0.03, 0.6), (0.02, 0.7), (0.02, 1.1), (0.02, 1.2)
    seen = [SimpleNamespace(time=t, pose=lambda _, x=x: goal.translated(x)) for x, t in ways]
    assert [stays(one) for one in seen] == [False] * 5 + [True]


def test_who_is_there_for_the_last_moment_alone_did_not_stay(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of 1.01 s, which are no whole periods, the policy has 1 s; it is there from 0.7 s on."""
    task = PickAndPlace(limp, 1.01)
    goal, world = task.goal(4), ScriptedWorld(ScriptedProcess(), task.scene(4, Jitter()))

    def control(policy: Any, until: Any, **how: Any) -> None:
        world.wait(0.7)
        assert not until(SimpleNamespace(time=world.time, pose=lambda _: goal))
        put("cube", goal)(world.process)
        world.wait(0.3)

    monkeypatch.setattr(world, "control", control)
    metrics = task.perform(world, 4, lambda *count: None).metrics
    assert (metrics["success"], metrics["time"]) == (1.0, None)


@pytest.mark.engine
def test_who_gets_there_succeeds_and_is_done_early(case: Case) -> None:
    record = performed(case, Reaching(to_the_goal, rate=10.0))
    assert record.metrics["success"] == 1.0
    assert record.metrics["distance"] < 1e-3
    assert 0.1 <= record.metrics["time"] <= 1.0
    assert record.details["acted"] == pytest.approx(record.metrics["time"] + 0.5)
    assert record.seconds["policy"] > 0
    assert not record.reasons


@pytest.mark.engine
@pytest.mark.parametrize("kind", TASKS)
def test_who_does_nothing_fails(case: Case, kind: type[GoalTask]) -> None:
    record = performed(case, kind(limp, seconds=1.0))
    assert (record.metrics["success"], record.metrics["time"]) == (0.0, None)
    assert record.metrics["distance"] > 0.05
    assert record.details["acted"] == pytest.approx(1.0)
    assert record.reasons == (f"{kind.moved or 'tool'} not at its goal",)


@pytest.mark.engine
def test_the_motion_is_kept_for_the_replay(case: Case) -> None:
    performed(replace(case, trace="on"), Reaching(limp, seconds=1.0))
    (trace,) = (case.folder / "traces").glob("*.npz")
    times = np.load(trace)["time"]
    assert times.size >= 75
    assert (np.diff(times) > 0).all()


@dataclass(frozen=True)
class Own(Reaching):
    """A task of one's own."""

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        world.control(self.policy, until=self.seconds, rate=self.rate)
        return Outcome({"success": 1.0, "distance": 0.0, "time": None})


@pytest.mark.engine
@pytest.mark.parametrize("kind", [Reaching, Own])
def test_what_a_policy_gathers_in_one_repetition_is_not_in_the_next(
    case: Case, kind: type[Reaching]
) -> None:
    class Gathering:
        def __init__(self) -> None:
            self.rows, self.sum = [0.0], np.zeros(1)
            self.same, self.way, self.ways = self.rows, self.gather, [self.gather]
            self.count = 1

        def act(self, seen: Observation) -> None:
            self.way(seen.time)
            self.ways[0](seen.time)
            assert len(self.same) == len(self.rows) == self.count

        def gather(self, time: float) -> None:
            self.rows.append(time)
            self.sum += len(self.rows)
            self.count += 1

    policy = Gathering()
    record = performed(case, kind(policy, seconds=0.2, rate=10.0))
    assert [*policy.rows, *policy.sum] == [0.0, 0.0]
    assert record.settings["task.policy_digest"] == digest(Gathering())


def test_the_code_of_a_task_of_ours_is_its_version() -> None:
    """Another one's is told: what it counts may change between a run and its resumption."""
    mine = make_dataclass("Mine", [], bases=(Reaching,), frozen=True)
    assert code_of(Reaching(limp)) == ""
    assert code_of(mine(limp)) == code_of(mine(to_the_goal)) != ""
