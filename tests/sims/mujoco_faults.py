"""Changes of a loaded world in MuJoCo itself, in the compiled model."""

from __future__ import annotations

from typing import Any

from pytest_simbench.sims.mujoco.adapter import MuJoCo

from .compiled_faults import LINK, Compiled, faults, geom
from .planted import Plant, Planting


def compiled(s: Any) -> Compiled:
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


FAULTS: dict[str, Plant] = {
    **faults(compiled),
    "body/cube/dynamic": weld,
    "link/panda_link4/touches, one way": lambda s: geom(LINK, "geom_contype", 0)(compiled(s)),
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


class FaultyMuJoCo(Planting, MuJoCo):
    faults = FAULTS
