"""MuJoCo with a slowdown planted in its stepping: the same results for 30 % more work."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mujoco
from pytest_simbench.sims.mujoco.adapter import MuJoCo

from pytest_simbench.scene import Scene

EVERY, MORE = 10, 3
"""After every 10 steps, 3 more on a copy of the state."""


class Slower(MuJoCo):
    info = replace(MuJoCo.info, name="slower")

    def load(self, scene: Scene) -> None:
        super().load(scene)
        self._copy: Any = mujoco.MjData(self.model)
        self._count = 0

    def step(self) -> None:
        super().step()
        self._count += 1
        if self._count % EVERY == 0:
            mujoco.mj_copyData(self._copy, self.model, self.data)
            for _ in range(MORE):
                mujoco.mj_step(self.model, self._copy)
