"""Changes of a loaded world in a compiled model of MuJoCo: MuJoCo's own, and that of Newton's
solver.

Workers load the adapters as `tests.sims.compiled_faults:FaultyNewton`, since Newton lives in an
interpreter of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from pytest_simbench.sims.mujoco.adapter import MuJoCo
from pytest_simbench.sims.newton.adapter import Newton

from .planted import Plant, Planting

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


def of_mujoco(s: Any) -> Compiled:
    def body(name: str) -> int:
        return int(s.model.body(name).id)

    joint, ground = s.model.joint("panda_joint4").id, s.model.geom("ground").id
    return Compiled(s.model, s.data, body, joint, ground)


def weld(s: Any) -> None:
    import mujoco

    s.model.eq_type[0] = mujoco.mjtEq.mjEQ_WELD
    s.model.eq_obj1id[0] = s.model.body("cube").id


def effort_limit(s: Any) -> None:
    s.model.actuator("panda_joint4").forcerange[1] *= 2  # one end only


def override(array: str, value: Any) -> Plant:
    """MuJoCo's contact parameters that replace those of all geoms."""

    def plant(s: Any) -> None:
        import mujoco

        s.model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_OVERRIDE
        geom = s.model.geom("cube")
        s.model.opt.o_solref, s.model.opt.o_solimp = geom.solref, geom.solimp
        s.model.opt.o_friction[:2] = geom.friction[0]
        getattr(s.model.opt, array)[: len(value)] = value

    return plant


def off(switch: str) -> Plant:
    def plant(s: Any) -> None:
        import mujoco

        s.model.opt.disableflags |= getattr(mujoco.mjtDisableBit, f"mjDSBL_{switch}")

    return plant


class FaultyMuJoCo(Planting, MuJoCo):
    faults: ClassVar[Mapping[str, Plant]] = {
        **faults(of_mujoco),
        "body/cube/dynamic": weld,
        "link/panda_link4/touches, one way": lambda s: geom(LINK, "geom_contype", 0)(of_mujoco(s)),
        "gripper/coupled, to another joint": lambda s: s.model.eq_obj1id.__setitem__(0, 0),
        "body/cube/friction, overridden": override("o_friction", (20.0, 20.0)),
        "link/panda_leftfinger/friction, overridden": override("o_friction", (20.0, 20.0)),
        "ground/restitution, overridden softness": override("o_solimp", (0.1, 0.2)),
        "body/cube/restitution, overridden springs": override("o_solref", (0.2, 1.0)),
        "gravity, switched off": off("GRAVITY"),
        "body/cube/touches, constraints switched off": off("CONSTRAINT"),
        "gripper/coupled, equalities switched off": off("EQUALITY"),
        "joint/panda_joint4/limits, switched off": off("LIMIT"),
        "joint/panda_joint4/stiffness, switched off": off("ACTUATION"),
        "joint/panda_joint4/effort_limit": effort_limit,
    }


def of_newton(s: Any) -> Compiled:
    """MuJoCo has numbers of its own for Newton's bodies and joints."""
    solver = s.solver

    def number(numbers: Any, labels: Any, name: str) -> int:
        known = [label.rpartition("/")[2] for label in labels]
        return int(numbers.numpy()[0].tolist().index(known.index(name)))

    def body(name: str) -> int:
        return number(solver.mjc_body_to_newton, s.model.body_label, name)

    joint = number(solver.mjc_jnt_to_newton_jnt, s.model.joint_label, "panda_joint4")
    return Compiled(solver.mj_model, solver.mj_data, body, joint, s._geom("ground"))


def newtons_effort_limit(s: Any) -> None:
    model, joint = s.solver.mj_model, of_newton(s).joint
    model.actuator_forcerange[model.actuator_trnid[:, 0] == joint] *= 2.0
    model.jnt_actfrcrange[joint] *= 2.0


class FaultyNewton(Planting, Newton):
    faults: ClassVar[Mapping[str, Plant]] = {
        **faults(of_newton),
        "joint/panda_joint4/effort_limit": newtons_effort_limit,
    }
