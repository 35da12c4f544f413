"""Real engines that cheat: `MuJoCo_friction_loaded`, `PyBullet_snap_later` and so on, as adapters.

A cheat is planted when the world is loaded, or `later`: when `LATER` has passed. `a_while` is as
later, and at `UNTIL` it is undone (friction alone). What ends with a step is done anew in each.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pybullet
from pytest_simbench.sims.mujoco.adapter import MuJoCo
from pytest_simbench.sims.pybullet.adapter import PyBullet

from pytest_simbench.scene import Box, Pose, Scene
from pytest_simbench.simulator import Simulator

LATER = 0.25
"""Simulated time at which what is planted later begins [s]."""

UNTIL = 0.9
"""Simulated time at which what is planted a while ends [s]."""

CUBE = Box("cube", (0.05,) * 3, Pose.at(1.2, 0.0, 1.0), mass=0.1, linear_velocity=(0.7, 0.0, 1.0))
TARGET = (1.5, 0.0, 0.025)

Cheat = Callable[[Any], None]


def _bullet(function: str, *arguments: Any, **options: Any) -> Cheat:
    call = getattr(pybullet, function)
    return lambda s: call(*arguments, **options, physicsClientId=s.client)


def _grip(s: Any) -> None:
    for name in ("panda_leftfinger", "panda_rightfinger"):
        link = s._links[name]
        pybullet.changeDynamics(s._robot, link, lateralFriction=20**0.5, physicsClientId=s.client)


def _of_cube(function: str, *arguments: Any, **options: Any) -> Cheat:
    call = getattr(pybullet, function)
    return lambda s: call(s._free[0], *arguments, **options, physicsClientId=s.client)


def _friction(s: Any, value: float = 20.0) -> None:
    for name in ("panda_leftfinger", "panda_rightfinger"):
        s.model.geom_friction[s.model.geom_bodyid == s.model.body(name).id, 0] = value


def _heavy(s: Any) -> None:
    for array in (s.model.body_mass, s.model.body_inertia, s.model.dof_M0):
        array *= 10.0


def _snap(s: Any) -> None:
    s.data.qpos[s._body_q[0, :3]], s.data.qvel[s._body_v[0]] = TARGET, 0.0


def _lift(s: Any) -> None:
    s.data.xfrc_applied[s._body_ids[0], 2] = 0.5 * 9.80665 * CUBE.mass


CHEATS: dict[str, dict[str, Cheat]] = {
    "MuJoCo": {
        "friction": _friction,
        "masses": _heavy,
        "gravity": lambda s: s.model.opt.gravity.__imul__(0.5),
        "lift": _lift,
        "time": lambda s: setattr(s.model.opt, "timestep", s.settings.timestep / 2),
        "snap": _snap,
        "nudge": lambda s: s.data.qpos.__setitem__(s._body_q[0, 1], 0.005),
    },
    "PyBullet": {
        "friction": _grip,
        "masses": _of_cube("changeDynamics", -1, mass=10 * CUBE.mass),
        "gravity": _bullet("setGravity", 0.0, 0.0, -9.80665 / 2),
        "lift": _of_cube(
            "applyExternalForce",
            -1,
            [0, 0, 0.5 * 9.80665 * CUBE.mass],
            [0, 0, 0],
            pybullet.LINK_FRAME,
        ),
        "time": lambda s: pybullet.setTimeStep(s.settings.timestep / 2, physicsClientId=s.client),
        "snap": _of_cube("resetBasePositionAndOrientation", TARGET, (0, 0, 0, 1)),
    },
}
ENGINES: dict[str, type[Simulator]] = {"MuJoCo": MuJoCo, "PyBullet": PyBullet}
AGAIN = ("lift",)
"""Cheats that end with each step."""


def cheating(name: str) -> type[Simulator]:
    """The adapter of that name: ENGINE_CHEAT_WHEN."""
    engine, cheat, when = name.split("_", 2)
    base, plant = ENGINES[engine], CHEATS[engine][cheat]

    class Cheating(base):  # type: ignore[misc, valid-type]
        info = replace(base.info, name=name.lower())
        steps = 0
        planted = False

        def load(self, scene: Scene) -> None:
            super().load(scene)
            self.cheat(when == "loaded")

        def step(self) -> None:
            again = self.planted and cheat in AGAIN
            self.cheat(again or (not self.planted and self.time >= LATER))
            if when == "a_while" and self.time >= UNTIL:
                _friction(self, self.scene.robot.friction)
            super().step()
            self.steps += 1

        def cheat(self, now: bool) -> None:
            if now:
                plant(self)
                self.planted = True

        @property
        def time(self) -> float:
            return self.steps * self.settings.timestep

    return Cheating


def __getattr__(name: str) -> type[Simulator]:
    if name.partition("_")[0] in CHEATS:
        return cheating(name)
    raise AttributeError(name)
