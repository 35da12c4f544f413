"""Changes of a loaded world in a compiled model of MuJoCo, for all adapters that step one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .planted import Plant

BOUNCY = (0.02, 0.1)
"""MuJoCo's time constant and damping ratio of a contact that gives back most of the speed."""

CUBE, LINK = "cube", "panda_link4"


@dataclass(frozen=True)
class Compiled:
    """An adapter's model, with the numbers that its parts have there.

    Attributes:
        model, data: MuJoCo's.
        body: number of a body or link.
        joint: number of `panda_joint4`.
        ground: number of the ground's geom.
    """

    model: Any
    data: Any
    body: Callable[[str], int]
    joint: int
    ground: int

    def geoms(self, name: str) -> Any:
        """Of a body, a link or the ground."""
        if name == "ground":
            return [self.ground]
        return np.flatnonzero(self.model.geom_bodyid == self.body(name))


Change = Callable[[Compiled], None]


def geom(name: str, array: str, value: Any) -> Change:
    return lambda c: getattr(c.model, array).__setitem__(c.geoms(name), value)


def body(name: str, array: str, value: Any) -> Change:
    return lambda c: getattr(c.model, array).__setitem__(c.body(name), value)


def height(c: Compiled) -> None:
    c.model.geom_pos[c.ground, 2] = 0.01
    c.model.geom_sameframe[c.ground] = 0  # else MuJoCo takes the body's frame


def com(c: Compiled) -> None:
    c.model.body_ipos[c.body(CUBE), 0] += 0.01
    c.model.body_sameframe[c.body(CUBE)] = 0


def friction(c: Compiled) -> None:
    c.model.dof_frictionloss[c.model.jnt_dofadr[c.joint]] = 0.5


def ghost(c: Compiled) -> None:
    for array in ("geom_contype", "geom_conaffinity"):
        geom(LINK, array, 0)(c)


def finger_shape(c: Compiled) -> None:
    c.model.geom_friction[c.geoms("panda_leftfinger")[-1], 0] = 0.3


CHANGES: dict[str, Change] = {
    "timestep": lambda c: setattr(c.model.opt, "timestep", 0.005),
    "ground/height": height,
    "body/cube/margin": geom(CUBE, "geom_margin", 0.002),
    "body/cube/touches": geom(CUBE, "geom_conaffinity", 0),
    "body/cube/com": com,
    "body/cube/gravity": body(CUBE, "body_gravcomp", 1.0),
    "link/panda_link4/restitution": geom(LINK, "geom_solref", BOUNCY),
    "link/panda_link4/margin": geom(LINK, "geom_margin", 0.002),
    "link/panda_link4/touches": ghost,
    "link/panda_link4/damping": lambda c: setattr(c.model.opt, "viscosity", 0.1),
    "link/panda_link4/gravity": body(LINK, "body_gravcomp", 1.0),
    "joint/panda_joint4/friction": friction,
    "link/panda_leftfinger/friction, one shape": finger_shape,
    "gripper/coupled": lambda c: c.data.eq_active.__setitem__(slice(None), 0),
}


def faults(of: Callable[[Any], Compiled]) -> dict[str, Plant]:
    """All of them, for an adapter whose compiled model `of` tells."""

    def plant(change: Change) -> Plant:
        return lambda s: change(of(s))

    return {quantity: plant(change) for quantity, change in CHANGES.items()}
