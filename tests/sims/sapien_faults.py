"""Changes of a loaded world in SAPIEN itself, on PhysX's components."""

from __future__ import annotations

from typing import Any

import numpy as np
from pytest_simbench.sims.sapien.adapter import SAPIEN

from pytest_simbench.testing.faults import true_scene

from .planted import Plant, Planting


def shape(name: str, setter: str, *values: Any) -> Plant:
    """A setter of the last shape of a body or link called."""

    def plant(s: Any) -> None:
        component = s._ground if name == "ground" else {**s._bodies, **s._links}[name]
        getattr(component.collision_shapes[-1], setter)(*values)

    return plant


def stuff(name: str, friction: float, restitution: float) -> Plant:
    """Of the last shape."""

    def plant(s: Any) -> None:
        import sapien

        material = sapien.physx.PhysxMaterial(friction, friction, restitution)
        shape(name, "set_physical_material", material)(s)

    return plant


def body(name: str, attribute: str, value: Any) -> Plant:
    return lambda s: setattr({**s._bodies, **s._links}[name], attribute, value)


def com(s: Any) -> None:
    import sapien

    s._bodies["cube"].cmass_local_pose = sapien.Pose([0.01, 0, 0])


FAULTS: dict[str, Plant] = {
    "timestep": lambda s: setattr(s._system, "timestep", 0.005),
    "ground/height": lambda s: s._ground.entity.set_pose(raised(s._ground.entity.pose)),
    "body/cube/margin": shape("cube", "set_rest_offset", 0.002),
    "body/cube/touches": shape("cube", "set_collision_groups", [0, 0, 0, 0]),
    "body/cube/com": com,
    "body/cube/gravity": body("cube", "disable_gravity", True),
    "body/cube/dynamic": body("cube", "kinematic", True),
    "link/panda_link4/restitution": stuff("panda_link4", true_scene().ground_friction, 0.5),
    "link/panda_leftfinger/friction, one shape": stuff("panda_leftfinger", 0.5, 0.0),
    "link/panda_link4/margin": shape("panda_link4", "set_rest_offset", 0.002),
    "link/panda_link4/touches": shape("panda_link4", "set_collision_groups", [0, 0, 0, 0]),
    "link/panda_link4/damping": body("panda_link4", "angular_damping", 0.1),
    "link/panda_link4/gravity": body("panda_link4", "disable_gravity", True),
    "joint/panda_joint4/friction": lambda s: s._joints[3].set_friction(0.5),
}


def raised(pose: Any) -> Any:
    import sapien

    return sapien.Pose(pose.p + np.array([0, 0, 0.01]), pose.q)


class FaultySAPIEN(Planting, SAPIEN):
    faults = FAULTS
