"""MuJoCo with one planted fault each: engines that claim determinism and do not keep it."""

from __future__ import annotations

from typing import Any, ClassVar

from pytest_simbench.sims.mujoco.adapter import MuJoCo

from pytest_simbench.scene import FloatArray, Scene
from tests.testing.wrong import Noisy as Noisy


class Haunted(MuJoCo):
    """Gravity remembers how many worlds the process has seen."""

    worlds: ClassVar[int] = 0

    def load(self, scene: Scene) -> None:
        super().load(scene)
        self.model.opt.gravity[0] = 1e-9 * Haunted.worlds
        Haunted.worlds += 1


class Forgetful(MuJoCo):
    """Restores positions, but not velocities."""

    def restore(self, state: FloatArray) -> None:
        now = self.data.qvel.copy()
        super().restore(state)
        self.data.qvel[:] = now


class Refusing(MuJoCo):
    """Cannot be restored."""

    def restore(self, state: Any) -> None:
        raise RuntimeError("no way back")


class Windowed(MuJoCo):
    """Computes something else when it has a window (which it only pretends to open)."""

    def _open_window(self) -> None:
        self._viewer = None
        self.model.opt.gravity[0] = 1e-9


class Stale(MuJoCo):
    """Restores what was saved a short while ago; what is older than 0.2 s a little wrong."""

    def restore(self, state: FloatArray) -> None:
        old = self.data.time
        super().restore(state)
        if old - self.data.time > 0.2:
            self.data.qvel[self._body_v] += 1e-9
