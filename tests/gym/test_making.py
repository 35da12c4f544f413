"""Environments by name: what they are made of, and what cannot be made."""

from __future__ import annotations

from typing import Any

import gymnasium
import pytest

import pytest_simbench
from pytest_simbench.cli.values import BadInput
from pytest_simbench.gym import IDS, making
from pytest_simbench.gym.making import RATE, make, make_vec
from pytest_simbench.scene.policy import Rhythm
from pytest_simbench.simulator import Capability
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.tasks.base import Jitter
from pytest_simbench.tasks.goals import PushingToGoal
from tests.conftest import ADAPTERS, able_to


def test_what_is_made_of_two_names() -> None:
    env = make("pushing", "mujoco")
    case, how = env._handle.case, ("tool", "dense", None, Jitter(), Rhythm(10.0))
    assert (env._actions, env._reward, env.render_mode, env._jitter, env.rhythm) == how
    assert (case.mode, case.profile, env.task) == (
        "headless",
        "tuned",
        PushingToGoal(None, rate=10),
    )
    assert [make_vec("pushing", "mujoco", *many).num_envs for many in ((), (2,))] == [1, 2]


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"task": "juggling"}, "task='juggling': choose from pick_and_place, pushing, reaching"),
        ({"task": 3}, "task=3: choose from"),
        ({"simulator": "none"}, "unknown simulator 'none'; choose from"),
        ({"rate": 30.1}, "asked every 33.22 ms, which is no multiple of the time step"),
        ({"rate": 0}, "the rate"),
        ({"seconds": 0}, "the seconds of an episode"),
        ({"jitter": -0.1}, "the jitter"),
        ({"jitter": float("nan")}, "the jitter"),
        ({"tolerance": float("nan")}, "the tolerance"),
        ({"reward": "much"}, "reward='much': choose from dense, sparse"),
        ({"actions": None}, "actions=None: choose from joints, tool"),
        ({"render_mode": "human"}, "render_mode='human': choose from None, rgb_array"),
        ({"profile": "best"}, "best"),
        ({"robot": "nobody"}, "unknown robot 'nobody'"),
        ({"colour": 1}, "parameter='colour': choose from command_latency, observation_delay"),
        ({"settle": 1.0}, "parameter='settle': choose from"),  # an episode has no such end
        ({"num_envs": 0}, "num_envs=0: give a whole number from 1 on"),
    ],
    ids=str,
)
def test_bad_input_is_one_sentence(options: dict[str, Any], told: str) -> None:
    with pytest.raises(BadInput) as caught:
        make(**{"task": "pushing", "simulator": "mujoco", **options})
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_without_gymnasium_a_sentence_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(making, "find_spec", lambda name: None)
    with pytest.raises(BadInput, match=r"pip install 'pytest-simbench\[gym\]'"):
        pytest_simbench.make("pushing", "mujoco")
    with pytest.raises(BadInput, match=r"pip install 'pytest-simbench\[gym\]'"):
        make_vec("pushing", "mujoco")


def test_what_is_not_here_or_cannot_do_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(making, "missing", lambda info: f"{info.name} is not here")
    with pytest.raises(BadInput, match="^mujoco is not here$"):
        make("pushing", "mujoco")
    make("pushing", "mujoco", python="p")  # who names an interpreter has it
    monkeypatch.setattr(PushingToGoal, "problem", lambda self: "no arm can")
    with pytest.raises(BadInput, match="^no arm can$"):
        make("pushing", "mujoco", python="p")


@pytest.mark.parametrize("name", sorted(set(ADAPTERS) - set(able_to(Capability.OFFSCREEN))))
def test_what_draws_nothing_says_so(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(making, "missing", lambda info: None)
    with pytest.raises(BadInput, match="draws no pictures"):
        make(PushingToGoal(None), name, render_mode="rgb_array")
    assert make("pushing", name).metadata["render_modes"] == []


def test_the_default_rate_is_whole_steps_of_every_engine() -> None:
    for name in ADAPTERS:
        Rhythm(RATE).steps(adapter(name).profiles["tuned"].timestep)


def test_gymnasium_knows_the_ids() -> None:
    for name, task in IDS.items():
        spec = gymnasium.spec(f"simbench/{name}")
        assert spec.kwargs == {"task": task}
        assert task in making.TASKS
