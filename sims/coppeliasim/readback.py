"""What CoppeliaSim says that it built, for the parity check.

All comes from the program's own getters. What its engines made of that, they tell nobody.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from ctypes import byref, c_bool, c_double, c_int
from typing import Any

import numpy as np

from pytest_simbench.description.links import subspace
from pytest_simbench.description.shapes import (
    Outline,
    a_box,
    a_cylinder,
    a_mesh,
    a_round,
    placed,
    reach,
)
from pytest_simbench.parity import readback
from pytest_simbench.scene import Coupling, FloatArray, Pose

from .library import (
    SCENE,
    call,
    doubles,
    get_bool,
    get_float,
    get_floats,
    get_int,
    get_pose,
    get_vector,
    integers,
    library,
    local_pose,
)
from .world import CAPSULE, CUBOID, CYLINDER, REVOLUTE, SPHEROID, Part


def is_box(corners: FloatArray) -> bool:
    """Whether a part is one: eight corners, (n, 3), equally far from their middle."""
    far = np.linalg.norm(corners - corners.mean(axis=0), axis=1)
    return len(corners) == 8 and bool(np.ptp(far) < 1e-6)


class _Component(ctypes.Structure):
    """SShapeVizInfo (simTypes.h)."""

    _fields_ = (
        ("vertices", ctypes.POINTER(c_double)),
        ("vertices_size", c_int),
        ("indices", ctypes.c_void_p),
        ("indices_size", c_int),
        ("shading_angle", c_double),
        ("normals", ctypes.c_void_p),
        ("rest", ctypes.c_char * 256),
    )


class ReadBack(readback.ReadBack):
    """Reads the quantities of `parity.quantities` that CoppeliaSim tells."""

    def __init__(self, simulator: Any) -> None:
        super().__init__(simulator, simulator._ground, simulator._bodies, simulator._links)
        self.surfaces, self.drives = simulator._surface, simulator._drives
        self.joints = simulator._joints
        self.engine = simulator.settings.engine

    def world(self) -> dict[str, Any]:
        at = get_pose(self.ground.handle)
        return {
            "gravity": get_vector(SCENE, "gravity"),
            "timestep": get_float(SCENE, "dynamicsStepSize"),
            "ground/height": at.position[2] + self._sizes(self.ground)[1][2] / 2,
        }

    def body(self, part: Part, name: str) -> dict[str, Any]:
        if not get_bool(part.handle, "dynamic"):
            return {"dynamic": 0.0}
        started = np.concatenate(self.surfaces.thrown(part))
        return {"dynamic": 1.0, "velocity": started, **self.inertial(part)}

    def pose(self, part: Part) -> FloatArray:
        return part.pose().as_array()

    def shapes(self, part: Part) -> Iterator[Outline]:
        if not get_bool(part.handle, "respondable"):
            return
        frame = part.frame.inverse()
        kind, size = self._sizes(part)
        if get_bool(part.handle, "compound"):
            for corners in self._components(part):
                yield "boxes" if is_box(corners) else "meshes", reach(placed(corners, frame))
        elif kind == CUBOID:
            yield a_box(size, frame)
        elif kind == SPHEROID:
            yield a_round(size[0] / 2, 0.0, frame)
        elif kind == CYLINDER:
            yield a_cylinder(size[0] / 2, size[2], frame)
        elif kind == CAPSULE:
            yield a_round(size[0] / 2, size[2] - size[0], frame)
        else:
            (corners,) = self._components(part)
            yield a_mesh(corners, frame)

    def _sizes(self, part: Part) -> tuple[int, FloatArray]:
        """Kind of a shape that is one primitive, and its sizes [m], (3,)."""
        numbers, values = integers([0] * 5), doubles([0.0] * 5)
        call("simGetShapeGeomInfo_D", part.handle, numbers, values, None)
        return numbers[0], np.array(values[:3])

    def _components(self, part: Part) -> list[FloatArray]:
        """Corners of each mesh in a shape, in its frame, (n, 3) [m]."""
        found: list[FloatArray] = []
        component = _Component()
        while call("simGetShapeViz_D", part.handle, len(found), byref(component)):
            count = component.vertices_size
            found.append(np.array(component.vertices[:count]).reshape(-1, 3))
            for data in (component.vertices, component.indices, component.normals):
                library().simReleaseBuffer(ctypes.cast(data, ctypes.c_void_p))
        return found

    def surface(self, part: Part) -> dict[str, Any]:
        """Of a pair with others like it."""
        handle = part.handle
        if self.engine == "mujoco":
            return {"friction": get_floats(handle, "mujoco.friction")[0]}
        if self.engine == "newton":
            friction = get_float(handle, "newton.kineticFriction")
            return {"friction": friction**2, "restitution": get_float(handle, "newton.restitution")}
        friction = get_float(handle, self.surfaces.friction_name) ** 2
        if self.engine == "ode":
            return {"friction": friction}
        bounce = get_float(handle, "bullet.restitution") ** 2
        return {"friction": friction, "restitution": bounce}

    def inertial(self, part: Part) -> dict[str, Any]:
        mass, centre, inertia = part.weight()
        frame = part.frame.inverse()
        turn = frame.rotation()
        return {
            "mass": mass,
            "com": placed(centre[None], frame)[0],
            "inertia": turn @ inertia @ turn.T,
            **self._damping(part),
            "gravity": 1.0 - self._borne(part),
        }

    def _damping(self, part: Part) -> dict[str, Any]:
        return {} if self.engine == "mujoco" else {"damping": self.surfaces.damping(part.handle)}

    def _borne(self, part: Part) -> float:
        """Share of gravity that does not act on a link."""
        return get_float(part.handle, "mujoco.gravcomp") if self.engine == "mujoco" else 0.0

    def joint(self, name: str) -> dict[str, Any]:
        handle, drives = self.joints[name], self.drives
        k = drives.handles.index(handle)
        cyclic, interval, force = c_bool(), doubles([0.0] * 2), c_double()
        call("simGetJointInterval_D", handle, byref(cyclic), interval)
        call("simGetJointTargetForce_D", handle, byref(force))
        found = {
            "axis": self._motion(handle, drives.ends[k][1]),
            "limits": [interval[0], interval[0] + interval[1]],
            "initial_position": drives.position(k),
            "effort_limit": abs(force.value),  # its sign is the speed's
            **dict.fromkeys(("stiffness", "damping", "armature", "friction"), 0.0),
        }
        if self.engine == "mujoco":
            found["armature"] = get_float(handle, "mujoco.armature")
            found["friction"] = get_float(handle, "mujoco.frictionLoss")
            found["damping"] = get_float(handle, "mujoco.springDamping")
            found["stiffness"] = get_float(handle, "mujoco.springStiffness")
            if get_float(handle, "mujoco.springStiffness"):
                found["rest"] = get_float(handle, "mujoco.springRef")
        if drives.forced[k]:
            found["stiffness"] += drives.stiffness[k]
            found["effort_limit"] = drives.limits[k]
        return found

    def _motion(self, handle: int, child: Part) -> FloatArray:
        """Velocity of the child's frame at unit joint speed, in that frame: angular, linear."""
        # By where the child was put: an engine lets bodies drift from their joints.
        frame: Pose = (local_pose(child.handle) * child.frame).inverse()
        slides = get_int(handle, "jointType") != REVOLUTE
        return subspace(frame.rotation()[:, 2], np.asarray(frame.position), slides=slides)

    def coupling(self, pair: Coupling) -> FloatArray | None:
        leader, offset, ratio = c_int(), c_double(), c_double()
        handle = self.joints[pair.follower]
        call("simGetJointDependency_D", handle, byref(leader), byref(offset), byref(ratio))
        if leader.value == self.joints[pair.leader]:
            start = self.drives.offset(pair, ratio.value)
            return np.array([ratio.value, offset.value + start])
        return np.array([1.0, 0.0]) if self.drives.leads(pair) else np.zeros(2)

    def collide(self, first: Part, second: Part) -> Any:
        """As the plug-ins ask: both respondable, and a bit of both masks, by tree."""
        both = all(get_bool(part.handle, "respondable") for part in (first, second))
        masks = [get_int(part.handle, "respondableMask") for part in (first, second)]
        links = [part in self.links.values() for part in (first, second)]
        bits = 0x00FF if all(links) or first is second else 0xFF00
        return [both and bool(masks[0] & masks[1] & bits)]
