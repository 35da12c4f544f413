"""Forces of MuJoCo's contacts and joints; MuJoCo's adapter and Newton's share it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pytest_simbench.scene import FloatArray
from pytest_simbench.simulator import lazy_import

from .readback import Numbers

mujoco = lazy_import("mujoco")


def contact_forces(model: Any, data: Any, at: Numbers) -> Iterator[tuple[str, str, FloatArray]]:
    """Both names of each contact, and the wrench on the first about the world's origin."""
    names = {at.ground: "ground"} | {geom: f"body/{name}" for name, geom in at.boxes.items()}
    links = {body: f"link/{name}" for name, body in at.links.items()}
    local = np.empty(6)
    for k in range(data.ncon):
        contact = data.contact[k]
        first, second = (
            names.get(geom) or links[int(model.geom_bodyid[geom])]
            for geom in (int(contact.geom1), int(contact.geom2))
        )
        mujoco.mj_contactForce(model, data, k, local)  # on the second, in the contact's frame
        frame = np.reshape(contact.frame, (3, 3))  # its axes are rows
        force, torque = local[:3] @ frame, local[3:] @ frame
        yield second, first, np.concatenate([force, torque + np.cross(contact.pos, force)])


def joint_wrenches(model: Any, data: Any, at: Numbers) -> FloatArray:
    """Of the driven joints, on the links below about their origins, (n_joints, 6)."""
    mujoco.mj_rnePostConstraint(model, data)
    bodies = model.jnt_bodyid[list(at.joints.values())]
    torque, force = np.hsplit(data.cfrc_int[bodies], 2)
    centres = data.subtree_com[model.body_rootid[bodies]]  # which MuJoCo's torques are about
    return np.hstack([force, torque + np.cross(centres - data.xpos[bodies], force)])
