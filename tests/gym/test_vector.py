"""Environments side by side."""

from __future__ import annotations

import os
import signal
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError, InvalidAction

from pytest_simbench.gym.making import make_vec
from tests.gym.scripted import AWAY, NEAR, Loop, Written
from tests.gym.test_env import SHORT, made, played


@pytest.mark.engine
def test_several_at_once_are_as_one_after_the_other() -> None:
    actions = np.random.default_rng(2).uniform(-1, 1, (7, 2, 5))
    with made("pushing", num_envs=2, **SHORT) as envs:
        assert envs.metadata["autoreset_mode"] is gymnasium.vector.AutoresetMode.NEXT_STEP
        steps = played(envs, 5, actions)
        assert steps[0][0] in envs.observation_space
        assert steps[4][3].all()
        assert not steps[5][3].any()
        assert (steps[5][1] == 0).all()
        os.kill(envs.envs[1].env._handle._process.pid, signal.SIGKILL)
        *_, truncated, infos = envs.step(actions[0])
        assert truncated.tolist() == [False, True]
        assert "SIGKILL" in infos["crashed"][1]
        with pytest.raises(InvalidAction):
            envs.step(actions[0, 0])
    with made("pushing", **SHORT) as env:
        for k in range(2):
            single = played(env, 5 + k, actions[:4, k])
            seen, info = env.reset()
            single += [(seen, 0.0, False, False, info), *(env.step(row) for row in actions[5:, k])]
            for one, many in zip(single, steps, strict=True):
                for name, row in one[0].items():
                    np.testing.assert_array_equal(many[0][name][k], row)
                if many is not steps[0]:
                    assert [told[k] for told in many[1:4]] == list(one[1:4])


def test_side_by_side_nothing_begins_with_too_few_seeds_or_once_closed() -> None:
    envs = make_vec("pushing", "mujoco", 2, python="p")
    for seeds in ([1], [1, 2, 3]):
        with pytest.raises(ValueError, match="^seed=.*: give one number, or one for each of 2 env"):
            envs.reset(seed=seeds)
    assert not any(hasattr(env, "coming") for env in envs.envs)
    envs.close()
    for ask in (envs.reset, lambda: envs.step(np.zeros((2, 5)))):
        with pytest.raises(ClosedEnvironmentError, match="^these environments are closed: make"):
            ask()


def together(monkeypatch: pytest.MonkeyPatch, seconds: float, *worlds: Written) -> Any:
    """Environments side by side, of these worlds."""
    envs = make_vec("pushing", "mujoco", len(worlds), python="p", seconds=seconds)

    def loop(process: Any, *more: Any, **given: Any) -> Loop:
        (world,) = (one for one in worlds if one.process is process)
        return Loop(world, process, *more, **given)

    monkeypatch.setattr("pytest_simbench.gym.env.ClosedLoop", loop)
    for env, world in zip(envs.envs, worlds, strict=True):
        env.env._handle = world
    return envs


def test_who_was_at_the_goal_for_long_enough_begins_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    near, away = Written(*[NEAR] * 9), Written(*[AWAY] * 9)
    envs = together(monkeypatch, 9.0, near, away)
    envs.reset(seed=1)
    ends = [envs.step(np.zeros((2, 5)))[2].tolist() for _ in range(6)]
    assert ends == [*[[False, False]] * 4, [True, False], [False, False]]
    assert [len(world.seen) for world in (near, away)] == [1, 7]


def test_several_begin_together_and_each_anew_once_it_is_over(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Seeds count from a number on, or are given; one that is masked out is left as it is."""
    worlds = [Written(*[(0.1 * n + 0.1, 0.0, 0.0)] * 20) for n in range(2)]
    envs = together(monkeypatch, 0.2, *worlds)
    actions = np.array([[0.5, 0, 0, 0, 1], [-0.5, 0, 0, 0, 1]])
    _, info = envs.reset(seed=np.int64(5))
    assert info["seed"].tolist() == [5, 6]
    seen, reward, *_ = envs.step(actions)
    assert reward == pytest.approx([-0.1, -0.2])
    assert seen["achieved_goal"].shape == (2, 3)
    assert [w.done[-1].tool_change[0] for w in worlds] == pytest.approx([0.025, -0.025])
    mask = np.array([False, True])
    assert envs.reset(seed=[1, 9], options={"reset_mask": mask})[1]["seed"].tolist()[1] == 9
    assert [len(w.seen) for w in worlds] == [2, 1]
    assert envs.step(actions)[3].tolist() == [True, False]
    assert envs.step(actions)[3].tolist() == [False, True]  # the first one has begun anew
    assert [len(w.seen) for w in worlds] == [1, 3]
    assert envs.step(actions)[3].tolist() == [False, False]
    assert [len(w.seen) for w in worlds] == [2, 1]
    envs.reset()
    assert [len(w.seen) for w in worlds] == [1, 1]
    envs.close()
    assert [w.done[-1] for w in worlds] == ["closed"] * 2
