"""What Drake says of the world that was built, for the parity check."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import Any

import numpy as np

from pytest_simbench.description.shapes import (
    box_corners,
    cylinder_reach,
    outlines,
    placed,
    reach,
    round_reach,
)
from pytest_simbench.parity import readback
from pytest_simbench.parity.readback import one_value
from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.simulator import heavy, lazy_import

from .world import World, transform

geometry = lazy_import("pydrake.geometry")
math = lazy_import("pydrake.math")
trees = lazy_import("pydrake.multibody.tree")


class ReadBack(readback.ReadBack):
    """Reads the quantities of `parity.quantities` from plant, shapes and context."""

    def __init__(self, simulator: Any) -> None:
        super().__init__(simulator.world)
        self.made: World = simulator.world
        self.plant, self.context = simulator.plant, simulator.context
        shapes = self.plant.get_geometry_query_input_port().Eval(self.context)
        self.inspector = shapes.inspector()

    def world(self) -> dict[str, Any]:
        ground = self.inspector.GetPoseInFrame(self.made.shapes["ground"][0])
        return {
            "gravity": self.plant.gravity_field().gravity_vector(),
            "timestep": self.plant.time_step(),
            "ground/height": ground.translation()[2],
            "ground/friction": self._friction("ground"),
        }

    def body(self, prefix: str, name: str) -> dict[str, Any]:
        """A body; a fixed one is a shape of the world, whose frame is the shape's own."""
        body = self.made.bodies[name]
        free = body.index() != self.plant.world_body().index()
        frame = math.RigidTransform()
        if not free:
            first = transform(self.scene.body(name).parts[0].pose)
            frame = self.inspector.GetPoseInFrame(self.made.shapes[name][0]) @ first.inverse()
        pose = self.plant.EvalBodyPoseInWorld(self.context, body)
        found = self._part(prefix, name, pose, frame)
        light = body.default_mass() < heavy(self.scene)  # else it moves as prescribed
        found[f"{prefix}/dynamic"] = float(free and light and not body.is_locked(self.context))
        if free and light:
            found |= self._inertial(prefix, body)
            speed = self.plant.EvalBodySpatialVelocityInWorld(self.context, body)
            found[f"{prefix}/velocity"] = [*speed.translational(), *speed.rotational()]
            joint = self.made.floating_joint(body)
            found[f"{prefix}/damping"] = [
                joint.default_translational_damping() / found[f"{prefix}/mass"],
                joint.default_angular_damping() / np.max(found[f"{prefix}/inertia"]),
            ]
        return found

    def link(self, prefix: str, name: str) -> dict[str, Any]:
        body = self.made.links[name]
        pose = self.plant.EvalBodyPoseInWorld(self.context, body)
        found = self._part(prefix, name, pose, math.RigidTransform())
        return found if name == self.prepared.root else found | self._inertial(prefix, body)

    def joint(self, prefix: str, name: str) -> dict[str, Any]:
        joint, drive = self.made.joints[name], self.made.drives[name]
        gains = drive.get_controller_gains()
        return {
            f"{prefix}/axis": _axis(joint),
            f"{prefix}/limits": [
                joint.position_lower_limits()[0],
                joint.position_upper_limits()[0],
            ],
            f"{prefix}/effort_limit": drive.effort_limit(),
            f"{prefix}/stiffness": gains.p,
            f"{prefix}/damping": gains.d + joint.GetDampingVector(self.context)[0],
            f"{prefix}/armature": drive.calc_reflected_inertia(self.context),
            f"{prefix}/initial_position": joint.GetOnePosition(self.context),
        }

    def coupled(self, pairs: tuple[tuple[str, str], ...]) -> bool:
        active = self.plant.GetConstraintActiveStatus
        return all(active(self.context, made) for made in self.made.couplings)

    def _part(self, prefix: str, owner: str, pose: Any, frame: Any) -> dict[str, Any]:
        """Pose, shapes and surface of what is in `frame` of a body at `pose` in the world."""
        place = pose @ frame
        shapes = self.made.shapes.get(owner, [])
        found: dict[str, Any] = {
            f"{prefix}/pose": [*place.translation(), *place.rotation().ToQuaternion().wxyz()],
        }
        kinds: dict[Any, list[FloatArray]] = {}
        for made in shapes:
            corner = made in self.made.spheres
            kind = "corner" if corner else type(self.inspector.GetShape(made))
            kinds.setdefault(kind, []).append(self._reach(made, frame))
        boxes, spheres = kinds.pop(geometry.Box, []), kinds.pop("corner", [])
        round_kinds = geometry.Sphere, geometry.Cylinder, geometry.Capsule
        rounds = list(chain(*(kinds.pop(kind, []) for kind in round_kinds)))
        meshes = list(chain(*kinds.values()))
        boxes, meshes = _merged(boxes, meshes, spheres)
        found |= outlines(prefix, boxes, meshes, rounds)
        if shapes:
            found[f"{prefix}/friction"] = self._friction(owner)
            found[f"{prefix}/margin"] = self._margin(owner)
        return found

    def _reach(self, made: Any, frame: Any) -> FloatArray:
        """The reach of a shape in `frame`."""
        shape = self.inspector.GetShape(made)
        place = frame.inverse() @ self.inspector.GetPoseInFrame(made)
        pose = Pose.from_array([*place.translation(), *place.rotation().ToQuaternion().wxyz()])
        if isinstance(shape, geometry.Sphere):
            return round_reach(shape.radius(), 0.0, pose)
        if isinstance(shape, geometry.Capsule):
            return round_reach(shape.radius(), shape.length(), pose)
        if isinstance(shape, geometry.Cylinder):
            return cylinder_reach(shape.radius(), shape.length(), pose)
        if isinstance(shape, geometry.Box):
            return reach(placed(box_corners(shape.size()), pose))
        hull = self.inspector.GetConvexHull(made)
        corners = [hull.vertex(k) for k in range(hull.num_vertices())]
        return reach(placed(np.array(corners), pose))

    def _inertial(self, prefix: str, body: Any) -> dict[str, Any]:
        inertia = body.CalcSpatialInertiaInBodyFrame(self.context)
        com = inertia.get_com()
        central = inertia.Shift(com).CalcRotationalInertia()
        enabled = self.plant.gravity_field().is_enabled(body.model_instance())
        return {
            f"{prefix}/mass": inertia.get_mass(),
            f"{prefix}/com": com,
            f"{prefix}/inertia": central.CopyToFullMatrix3(),
            f"{prefix}/gravity": float(enabled),
        }

    def _friction(self, name: str) -> Any:
        """The one friction coefficient of all shapes of a body; all of them if they differ."""
        values = []
        for made in self.made.shapes[name]:
            surface = self.inspector.GetProximityProperties(made)
            friction = surface.GetProperty("material", "coulomb_friction")
            values += [friction.static_friction(), friction.dynamic_friction()]
        return one_value(values)

    def _margin(self, name: str) -> Any:
        surfaces = (self.inspector.GetProximityProperties(m) for m in self.made.shapes[name])
        return one_value([s.GetPropertyOrDefault("hydroelastic", "margin", 0.0) for s in surfaces])

    def can_touch(self, a: str, b: str) -> bool:
        """Whether the main shapes of two can collide; of two links, whether any can."""
        pairs = [(x, y) for x in self._shapes(a) for y in self._shapes(b)]
        found = (not self.inspector.CollisionFiltered(x, y) for x, y in pairs)
        return any(found) if a[:4] == b[:4] == "link" else bool(pairs) and all(found)

    def _shapes(self, name: str) -> Sequence[Any]:
        """All but the spheres in corners, which do not collide with each other."""
        made = self.made.shapes.get(name.partition("/")[2] or name, [])
        return [m for m in made if m not in self.made.spheres]


def _merged(
    boxes: Sequence[FloatArray], meshes: Sequence[FloatArray], spheres: Sequence[FloatArray]
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Reaches of boxes and meshes, each sphere made one with what it sticks out of least; a box,
    where there are any: meshes of links have no spheres."""
    own = list(boxes or meshes)
    merged = list(own)
    for sphere in spheres:  # which the adapter adds, see `world`
        k = int(np.argmin([np.max(sphere - shape) for shape in own]))
        merged[k] = np.maximum(merged[k], sphere)
    return (merged, list(meshes)) if boxes else ([], merged)


def _axis(joint: Any) -> FloatArray:
    """Motion subspace of a joint in the frame of its child."""
    frame = joint.frame_on_child().GetFixedPoseInBodyFrame()
    still = np.zeros(3)
    if isinstance(joint, trees.PrismaticJoint):
        return np.concatenate([still, frame.rotation() @ joint.translation_axis()])
    axis = frame.rotation() @ joint.revolute_axis()
    return np.concatenate([axis, np.cross(frame.translation(), axis)])
