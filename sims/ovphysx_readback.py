"""What PhysX says that it built, by the names of `parity.expected_quantities`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from pytest_simbench.sims import ovphysx_stage as usd
from pytest_simbench.sims.ovphysx_session import Session

from pytest_simbench.scene import FloatArray, Pose, Scene
from pytest_simbench.simulator import PreparedRobot, one_value

_FRICTIONS = ("staticFriction", "dynamicFriction")


def read_back(
    session: Session, scene: Scene, prepared: PreparedRobot | None, units: FloatArray
) -> dict[str, Any]:
    """Every quantity that PhysX can tell.

    Args:
        session: to be asked.
        scene: the names of what was built; no value is taken from it.
        prepared: the names of the robot's joints and links.
        units: of the sessions' joint positions, (n_joints,) [rad or m].
    """
    reported: dict[str, Any] = {"ground/height": session.height(usd.GROUND)}
    names = ("position", "orientation", "mass", "inertia", "shapeCount", *_FRICTIONS)
    values = session.read("RIGID_BODY", *names)
    for index, box in enumerate(scene.bodies):
        path, prefix = usd.body_path(index), f"body/{box.name}"
        x, y, z, w = values["orientation"][path]
        pose = Pose.from_array([*values["position"][path], w, x, y, z])
        reported[f"{prefix}/pose"] = pose.as_array()
        reported[f"{prefix}/size"] = session.size(f"{path}/shape", pose)
        reported[f"{prefix}/friction"] = _friction(values, path)
        if not box.fixed:
            reported[f"{prefix}/mass"] = values["mass"][path]
            reported[f"{prefix}/inertia"] = np.diag(values["inertia"][path].reshape(3, 3))
    if prepared is not None:
        reported |= _joints(session, prepared, units)
        reported |= _links(session, prepared)
    return reported


def _joints(session: Session, prepared: PreparedRobot, units: FloatArray) -> dict[str, Any]:
    ones = np.ones_like(units)
    attributes = {
        "jointLimit": ("limits", units),
        "jointMaxForce": ("effort_limit", ones),
        "jointStiffness": ("stiffness", 1 / units),
        "jointDamping": ("damping", 1 / units),
        "jointArmature": ("armature", ones),
        "jointPosition": ("initial_position", units),
    }
    values = session.read("ARTICULATION_JOINT", *attributes)
    return {
        f"joint/{name}/{quantity}": values[attribute][usd.joint_path(i)][0] * scale[i]
        for attribute, (quantity, scale) in attributes.items()
        for i, name in enumerate(prepared.robot.joint_names)
    }


def _links(session: Session, prepared: PreparedRobot) -> dict[str, Any]:
    values = session.read("ARTICULATION_LINK", "mass", "inertia", "shapeCount", *_FRICTIONS)
    reported: dict[str, Any] = {}
    for index, name in enumerate(prepared.links):
        if name != prepared.root:
            path = usd.link_path(index)
            tensor = values["inertia"][path].reshape(3, 3)
            reported[f"link/{name}/mass"] = values["mass"][path]
            reported[f"link/{name}/inertia"] = np.sort(np.linalg.eigvalsh(tensor))
            reported[f"link/{name}/friction"] = _friction(values, path)
    return reported


def _friction(values: Mapping[str, Mapping[str, FloatArray]], path: str) -> Any:
    """The one coefficient of all shapes of a prim, static and dynamic; else all of them."""
    count = int(values["shapeCount"][path])
    return one_value([np.atleast_1d(values[name][path])[:count] for name in _FRICTIONS])
