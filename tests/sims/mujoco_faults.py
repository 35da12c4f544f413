"""Changes of a loaded world in MuJoCo itself, in the compiled model."""

from __future__ import annotations

from typing import Any

import numpy as np
from pytest_simbench.sims.mujoco.adapter import MuJoCo

from .planted import Plant, Planting


def geom(name: str, array: str, value: Any) -> Plant:
    def plant(s: Any) -> None:
        body = s.model.body(name).id if name != "ground" else -1
        geoms = s.model.geom_bodyid == body if body >= 0 else [s.model.geom("ground").id]
        getattr(s.model, array)[geoms] = value

    return plant


def body(name: str, array: str, value: Any) -> Plant:
    return lambda s: getattr(s.model, array).__setitem__(s.model.body(name).id, value)


def height(s: Any) -> None:
    ground = s.model.geom("ground").id
    s.model.geom_pos[ground, 2] = 0.01
    s.model.geom_sameframe[ground] = 0


def com(s: Any) -> None:
    cube = s.model.body("cube").id
    s.model.body_ipos[cube, 0] = 0.01
    s.model.body_sameframe[cube] = 0


def damping(s: Any) -> None:
    start = s.model.body("cube").dofadr[0]
    s.model.dof_damping[start : start + 6] = 0.1


def joint(array: str, value: Any) -> Plant:
    return lambda s: getattr(s.model, array).__setitem__(
        s.model.joint("panda_joint4").dofadr[0], value
    )


def weld(s: Any) -> None:
    import mujoco

    s.model.eq_type[0] = mujoco.mjtEq.mjEQ_WELD
    s.model.eq_obj1id[0] = s.model.body("cube").id


def effort_limit(s: Any) -> None:
    s.model.actuator("panda_joint4").forcerange[1] *= 2  # one end only


def finger_shape(s: Any) -> None:
    finger = s.model.body("panda_leftfinger").id
    s.model.geom_friction[np.flatnonzero(s.model.geom_bodyid == finger)[-1], 0] = 0.3


BOUNCY = (0.02, 0.1)
"""MuJoCo's time constant and damping ratio of a contact that gives back most of the speed."""


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


FAULTS: dict[str, Plant] = {
    "timestep": lambda s: setattr(s.model.opt, "timestep", 0.005),
    "ground/height": height,
    "ground/restitution": geom("ground", "geom_solref", BOUNCY),
    "body/cube/restitution": geom("cube", "geom_solref", BOUNCY),
    "body/cube/margin": geom("cube", "geom_margin", 0.002),
    "body/cube/touches": geom("cube", "geom_conaffinity", 0),
    "body/cube/com": com,
    "body/cube/damping": damping,
    "body/cube/gravity": body("cube", "body_gravcomp", 1.0),
    "body/cube/dynamic": weld,
    "link/panda_link4/restitution": geom("panda_link4", "geom_solref", BOUNCY),
    "link/panda_link4/margin": geom("panda_link4", "geom_margin", 0.002),
    "link/panda_link4/touches": geom("panda_link4", "geom_contype", 0),
    "link/panda_link4/damping": lambda s: setattr(s.model.opt, "viscosity", 0.1),
    "link/panda_link4/gravity": body("panda_link4", "body_gravcomp", 1.0),
    "joint/panda_joint4/friction": joint("dof_frictionloss", 0.5),
    "gripper/coupled": lambda s: s.data.eq_active.__setitem__(0, 0),
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
    "link/panda_leftfinger/friction, one shape": finger_shape,
}


class FaultyMuJoCo(Planting, MuJoCo):
    faults = FAULTS
