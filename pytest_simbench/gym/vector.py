"""Environments side by side: each has a worker of its own, and all step at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from pytest_simbench.gym.env import TaskEnv, checked


class TaskVectorEnv(VectorEnv[Any, Any, Any]):
    """Equal environments, stepped in threads: what they do is wait for their workers.

    An episode that is over begins anew at the next step, whose action is not used.
    """

    def __init__(self, envs: Sequence[TaskEnv]) -> None:
        self.envs, self.num_envs, first = envs, len(envs), envs[0]
        self.metadata = {**first.metadata, "autoreset_mode": AutoresetMode.NEXT_STEP}
        self.render_mode = first.render_mode
        self.single_observation_space = first.observation_space
        self.single_action_space = first.action_space
        self.observation_space = batch_space(first.observation_space, self.num_envs)
        self.action_space = batch_space(first.action_space, self.num_envs)
        # One thread each: what was interrupted in an environment ends before the next thing begins.
        self._threads = [ThreadPoolExecutor(1, "simbench-env") for _ in envs]
        self._over: Any = np.zeros(self.num_envs, bool)

    def _each(self, work: Callable[[int], Any]) -> list[Any]:
        """What `work` gives for the number of each environment, all at once."""
        under_way = [thread.submit(work, k) for k, thread in enumerate(self._threads)]
        wait(under_way)
        return [future.result() for future in under_way]

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """All anew; a number is the first one's seed, and the others have those that follow."""
        if seed is None or not isinstance(seed, Sequence):
            seed = [None if seed is None else seed + k for k in range(self.num_envs)]
        found = self._each(lambda k: self.envs[k].reset(seed=seed[k], options=options))
        self._over = np.zeros(self.num_envs, bool)
        seen, infos = zip(*found, strict=True)
        return self._joined(seen), self._infos(infos)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """One period in each; errors as `TaskEnv.step`."""
        rows = checked(actions, self.action_space)

        def work(k: int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
            if self._over[k]:
                seen, info = self.envs[k].reset()
                return seen, 0.0, False, False, info
            return self.envs[k].step(rows[k])

        seen, *told, infos = zip(*self._each(work), strict=True)
        rewards, terminated, truncated = map(np.array, told)
        self._over = terminated | truncated
        return self._joined(seen), rewards, terminated, truncated, self._infos(infos)

    def _joined(self, seen: Sequence[Any]) -> dict[str, Any]:
        return {name: np.stack([one[name] for one in seen]) for name in seen[0]}

    def _infos(self, infos: Sequence[dict[str, Any]]) -> dict[str, Any]:
        joined: dict[str, Any] = {}
        for k, info in enumerate(infos):
            joined = self._add_info(joined, info, k)
        return joined

    def render(self) -> tuple[Any, ...]:
        """A picture of each."""
        return tuple(env.render() for env in self.envs)

    def close_extras(self, **options: Any) -> None:
        """End all workers."""
        self._each(lambda k: self.envs[k].close())
        for thread in self._threads:
            thread.shutdown()
