"""Parity: does the world that the engine built equal the scene?

Quantities have names: `gravity`, `timestep`, `ground/height`, `ground/friction`,
`body/NAME/{mass,inertia,size,pose,friction}`, `joint/NAME/{limits,effort_limit,stiffness,damping,
armature,initial_position}`, `link/NAME/{mass,inertia,friction}`, and `gripper/coupled` (1 when
the fingers are). Links are those of the prepared robot (`simulator.urdf`), in which fixed joints
are merged. Inertias are principal moments, ascending for links, along x, y, z for boxes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from pytest_simbench.scene import Robot, Scene
from pytest_simbench.simulator.errors import ParityError
from pytest_simbench.simulator.info import Deviation
from pytest_simbench.simulator.settings import Settings
from pytest_simbench.simulator.urdf import PreparedRobot

RELATIVE_TOLERANCE = 1e-4
ABSOLUTE_TOLERANCE = 1e-6
"""Single-precision engines keep 7 digits; a wrong mass or height differs by far more."""


def expected_quantities(scene: Scene, settings: Settings) -> dict[str, Any]:
    """Every quantity that an engine should report of a scene."""
    quantities: dict[str, Any] = {
        "gravity": scene.gravity,
        "timestep": settings.timestep,
        "ground/height": 0.0,
        "ground/friction": scene.ground_friction,
    }
    for body in scene.bodies:
        prefix = f"body/{body.name}"
        quantities[f"{prefix}/size"] = body.size
        quantities[f"{prefix}/pose"] = body.pose.as_array()
        quantities[f"{prefix}/friction"] = body.friction
        if not body.fixed:
            quantities[f"{prefix}/mass"] = body.mass
            quantities[f"{prefix}/inertia"] = body.inertia()
    if scene.robot is not None:
        quantities.update(_robot_quantities(scene.robot))
    return quantities


def _robot_quantities(robot: Robot) -> dict[str, Any]:
    prepared = PreparedRobot(robot)
    quantities: dict[str, Any] = {"gripper/coupled": 1.0}
    for joint in robot.joints:
        prefix = f"joint/{joint.name}"
        quantities[f"{prefix}/limits"] = prepared.limits[joint.name]
        quantities[f"{prefix}/effort_limit"] = joint.effort_limit
        quantities[f"{prefix}/stiffness"] = joint.stiffness
        quantities[f"{prefix}/damping"] = joint.damping
        quantities[f"{prefix}/armature"] = joint.armature
        quantities[f"{prefix}/initial_position"] = joint.initial_position
    for link in prepared.moving_links:
        quantities[f"link/{link.name}/mass"] = link.mass
        quantities[f"link/{link.name}/inertia"] = link.principal_inertia()
        quantities[f"link/{link.name}/friction"] = robot.friction
    return quantities


def check(
    expected: Mapping[str, Any],
    reported: Mapping[str, Any],
    deviations: Iterable[Deviation],
    simulator: str,
) -> list[str]:
    """Compare; return a sentence for each excused difference.

    Raises:
        ParityError: a quantity differs, or is neither reported nor declared as a deviation; the
            message gives both values of each (the first ten).
    """
    excused, wrong = [], []
    for name, value in expected.items():
        deviation = next((d for d in deviations if d.excuses(name)), None)
        if name not in reported:
            if deviation is None:
                wrong.append(f"{name}: {simulator} reports nothing, and declares no deviation")
            continue
        if _equal(name, value, reported[name]):
            continue
        text = f"{name}: scene {_text(value)}, {simulator} {_text(reported[name])}"
        if deviation is None:
            wrong.append(text)
        else:
            excused.append(f"{text} (declared: {deviation.reason})")
    wrong += [
        f"{name}: reported, but not part of the scene" for name in set(reported) - set(expected)
    ]
    if wrong:
        more = f"; and {len(wrong) - 10} more" if len(wrong) > 10 else ""
        raise ParityError(
            f"{simulator} built another world than the scene describes: "
            + "; ".join(wrong[:10])
            + more
        )
    return excused


def one_value(values: Any) -> Any:
    """The number that all values are (frictions of a body's shapes, both ends of a force range).

    Where they differ: all of them, as an array (n,), which no scene asks for.
    """
    different = np.unique(values)
    return different[0] if len(different) == 1 else different


def _equal(name: str, expected: Any, reported: Any) -> bool:
    a, b = np.asarray(expected, dtype=float), np.asarray(reported, dtype=float)
    if a.shape != b.shape:
        return False
    if name.endswith("/pose") and np.dot(a[3:], b[3:]) < 0:
        b = np.concatenate([b[:3], -b[3:]])  # q and -q are the same rotation
    if name.endswith(("/inertia", "/mass")):
        return bool(np.allclose(a, b, rtol=RELATIVE_TOLERANCE, atol=1e-12))
    return bool(np.allclose(a, b, rtol=RELATIVE_TOLERANCE, atol=ABSOLUTE_TOLERANCE))


def _text(value: Any) -> str:
    return np.array2string(np.asarray(value, dtype=float), precision=6, separator=", ")
