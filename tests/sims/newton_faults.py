"""Newton with one planted fault: a world that differs from the scene in one quantity.

Loaded by workers as `tests.sims.newton_faults:FaultyNewton`, since Newton lives in an interpreter
of its own; the setting `fault` names the quantity.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pytest_simbench.sims.newton.adapter import Newton

from .planted import Plant, Planting


def geom(s: Any, name: str) -> Any:
    return s.solver.mj_model.geom(s._geom(name))


def body(s: Any, name: str) -> Any:
    numbers = s.solver.mjc_body_to_newton.numpy()[0].tolist()
    labels = [label.rpartition("/")[2] for label in s.model.body_label]
    return s.solver.mj_model.body(numbers.index(labels.index(name)))


def joint(s: Any, name: str = "panda_joint4") -> int:
    """MuJoCo's number of a joint."""
    numbers = s.solver.mjc_jnt_to_newton_jnt.numpy()[0].tolist()
    labels = [label.rpartition("/")[2] for label in s.model.joint_label]
    return int(numbers.index(labels.index(name)))


def effort_limit(s: Any) -> None:
    model = s.solver.mj_model
    model.actuator_forcerange[model.actuator_trnid[:, 0] == joint(s)] *= 2.0
    model.jnt_actfrcrange[joint(s)] *= 2.0


def rubbing(s: Any) -> None:
    model = s.solver.mj_model
    model.dof_frictionloss[model.jnt_dofadr[joint(s)]] = 0.5


def one_finger_shape(s: Any) -> None:
    model = s.solver.mj_model
    shapes = np.flatnonzero(model.geom_bodyid == body(s, "panda_leftfinger").id)
    model.geom_friction[shapes[-1], 0] = 0.3


def uncouple(s: Any) -> None:
    s.solver.mj_data.eq_active[:] = 0


def in_geom(name: str, array: str, value: Any) -> Plant:
    """Sets an array's rows of all geoms of a link, or of the one of a body or the ground."""

    def plant(s: Any) -> None:
        model = s.solver.mj_model
        link = name.startswith("panda")
        rows = model.geom_bodyid == body(s, name).id if link else [geom(s, name).id]
        getattr(model, array)[rows] = value

    return plant


def ghost(name: str) -> Plant:
    def plant(s: Any) -> None:
        for array in ("geom_contype", "geom_conaffinity"):
            in_geom(name, array, 0)(s)

    return plant


def lifted_ground(s: Any) -> None:
    ground = geom(s, "ground").id
    s.solver.mj_model.geom_pos[ground, 2] = 0.01
    s.solver.mj_model.geom_sameframe[ground] = 0  # else MuJoCo takes the body's frame


def centre(s: Any) -> None:
    s.solver.mj_model.body_ipos[body(s, "cube_05").id, 0] += 0.01
    s.solver.mj_model.body_sameframe[body(s, "cube_05").id] = 0


def damped(s: Any) -> None:
    start = body(s, "cube_05").dofadr[0]
    s.solver.mj_model.dof_damping[start : start + 6] = 0.1


def weightless(name: str) -> Plant:
    return lambda s: s.solver.mj_model.body_gravcomp.__setitem__(body(s, name).id, 1.0)


BOUNCY = (0.02, 0.1)
"""MuJoCo's time constant and damping ratio of a contact that gives back most of the speed."""

FAULTS: dict[str, Plant] = {
    "ground/restitution": in_geom("ground", "geom_solref", BOUNCY),
    "body/cube_05/restitution": in_geom("cube_05", "geom_solref", BOUNCY),
    "body/cube_05/margin": in_geom("cube_05", "geom_margin", 0.002),
    "body/cube_05/touches": ghost("cube_05"),
    "body/cube_05/com": centre,
    "body/cube_05/damping": damped,
    "body/cube_05/gravity": weightless("cube_05"),
    "link/panda_link4/restitution": in_geom("panda_link4", "geom_solref", BOUNCY),
    "link/panda_link4/margin": in_geom("panda_link4", "geom_margin", 0.002),
    "link/panda_link4/touches": ghost("panda_link4"),
    "link/panda_link4/damping": lambda s: setattr(s.solver.mj_model.opt, "viscosity", 0.1),
    "link/panda_link4/gravity": weightless("panda_link4"),
    "joint/panda_joint4/friction": rubbing,
    "gravity": lambda s: s.solver.mj_model.opt.gravity.__setitem__(2, -9.7),
    "timestep": lambda s: setattr(s.solver.mj_model.opt, "timestep", 0.005),
    "ground/height": lifted_ground,
    "joint/panda_joint4/effort_limit": effort_limit,
    "link/panda_leftfinger/friction": one_finger_shape,
    "gripper/coupled": uncouple,
}


class FaultyNewton(Planting, Newton):
    faults = FAULTS
