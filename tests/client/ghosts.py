"""A real engine whose cubes do what no cube can; loaded as `tests.client.ghosts:Sinking`."""

from __future__ import annotations

from pytest_simbench.sims.mujoco.adapter import MuJoCo

AFTER = 0.5
"""Simulated time at which it begins [s]."""


def without_contacts(simulator: MuJoCo) -> None:
    import mujoco

    simulator.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)


class Ghost(MuJoCo):
    def step(self) -> None:
        super().step()
        if self.time >= AFTER:
            self.haunt()

    def haunt(self) -> None:
        raise NotImplementedError


class Sinking(Ghost):
    """Nothing touches anything any more."""

    def haunt(self) -> None:
        without_contacts(self)


class Flying(Ghost):
    """One cube is blown away, through whatever is in the way, at 10 m/s."""

    def haunt(self) -> None:
        self.data.qvel[0] = 10.0


class Merging(Ghost):
    """One cube stands where another one stands, and nothing drives them apart."""

    def haunt(self) -> None:
        without_contacts(self)
        self.model.opt.gravity[:] = 0.0
        self.data.qpos[:3] = self.data.qpos[7:10]
        self.data.qvel[:] = 0.0
