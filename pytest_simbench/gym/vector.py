"""Environments side by side: each has a worker of its own, and all step at once."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ClosedEnvironmentError
from gymnasium.vector import SyncVectorEnv

from pytest_simbench.gym.env import TaskEnv, checked


class Ahead(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Does in a thread of its own, which waits for a worker, what it is asked for afterwards.

    One thread: what was interrupted ends before the next thing begins.
    """

    coming: Future[Any]

    def __init__(self, env: TaskEnv) -> None:
        super().__init__(env)
        self._thread = ThreadPoolExecutor(1, "simbench-env")

    def begin(self, name: str, *arguments: Any, **more: Any) -> None:
        self.coming = self._thread.submit(getattr(self.env, name), *arguments, **more)

    def step(self, action: Any) -> Any:
        return self.coming.result()

    def reset(self, **how: Any) -> Any:
        return self.coming.result()

    def close(self) -> None:
        self._thread.shutdown()
        super().close()


class TaskVectorEnv(SyncVectorEnv):
    """Gymnasium's own that asks one after the other, of environments that have begun together.

    An episode that is over begins anew at the next step, whose action is not used.
    """

    envs: list[Any]

    def __init__(self, envs: Sequence[TaskEnv]) -> None:
        super().__init__([partial(Ahead, env) for env in envs])
        self._over: Any = np.zeros(self.num_envs, bool)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> Any:
        """All anew; a number is the first one's seed, and the others have those that follow.

        Raises:
            ClosedEnvironmentError: they are closed.
            ValueError: another number of seeds than of environments.
        """
        self._check_open()
        if seed is None or isinstance(seed, int | np.integer):
            seed = [None if seed is None else int(seed) + k for k in range(self.num_envs)]
        if len(seed) != self.num_envs:
            told = f"give one number, or one for each of {self.num_envs} environments"
            raise ValueError(f"seed={seed!r:.80}: {told}")
        for k in np.flatnonzero((options or {}).get("reset_mask", np.ones(self.num_envs))):
            self.envs[k].begin("reset", seed=seed[k], options=options)
            self._over[k] = False
        return super().reset(seed=seed, options=options)

    def step(self, actions: Any) -> Any:
        """One period in each; errors as `TaskEnv.step`, and ClosedEnvironmentError."""
        self._check_open()
        rows = checked(actions, self.action_space)
        for env, over, row in zip(self.envs, self._over, rows, strict=True):
            env.begin("reset") if over else env.begin("step", row)
        result = super().step(rows)
        self._over = result[2] | result[3]
        return result

    def _check_open(self) -> None:
        if self.closed:
            raise ClosedEnvironmentError("these environments are closed: make new ones")
