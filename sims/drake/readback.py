"""What Drake says of the world that was built, for the parity check."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pytest_simbench.description.links import subspace
from pytest_simbench.description.shapes import OUTLINES, Outline, a_box, a_cylinder, a_mesh, a_round
from pytest_simbench.parity import readback
from pytest_simbench.parity.readback import felt, one_value
from pytest_simbench.scene import Body, Coupling, FloatArray, Pose
from pytest_simbench.simulator import heavy, lazy_import

from .world import World, transform

geometry = lazy_import("pydrake.geometry")
math = lazy_import("pydrake.math")
trees = lazy_import("pydrake.multibody.tree")


@dataclass(frozen=True)
class Part:
    """The ground, a body or a link.

    Attributes:
        shapes: its own, or those of the world that are meant.
        frame: in the body's; that of a fixed body, which is a shape of the world, is the shape's.
    """

    body: Any
    shapes: Sequence[Any]
    frame: Any


class ReadBack(readback.ReadBack):
    """Reads the quantities of `parity.quantities` from plant, shapes and context."""

    def __init__(self, simulator: Any) -> None:
        self.made: World = simulator.world
        self.plant, self.context = simulator.plant, simulator.context
        shapes = self.plant.get_geometry_query_input_port().Eval(self.context)
        self.inspector = shapes.inspector()
        own = math.RigidTransform()
        super().__init__(
            simulator,
            Part(self.plant.world_body(), self.made.shapes["ground"], own),
            {body.name: self._body(body) for body in simulator.scene.bodies},
            {
                name: Part(body, self.made.shapes.get(name, ()), own)
                for name, body in self.made.links.items()
            },
        )

    def _body(self, body: Body) -> Part:
        made, shapes = self.made.bodies[body.name], self.made.shapes[body.name]
        frame = math.RigidTransform()
        if made.index() == self.plant.world_body().index():
            first = transform(body.parts[0].pose)
            frame = self.inspector.GetPoseInFrame(shapes[0]) @ first.inverse()
        return Part(made, shapes, frame)

    def world(self) -> dict[str, Any]:
        ground = self.inspector.GetPoseInFrame(self.ground.shapes[0])
        return {
            "gravity": self.plant.gravity_field().gravity_vector(),
            "timestep": self.plant.time_step(),
            "ground/height": ground.translation()[2],
        }

    def body(self, part: Part, name: str) -> dict[str, Any]:
        body = part.body
        light = body.default_mass() < heavy(self.scene)  # else it moves as prescribed
        free = light and body.index() != self.plant.world_body().index()
        found: dict[str, Any] = {"dynamic": float(free and not body.is_locked(self.context))}
        if free:
            found |= self.inertial(part)
            speed = self.plant.EvalBodySpatialVelocityInWorld(self.context, body)
            found["velocity"] = [*speed.translational(), *speed.rotational()]
            joint = self.made.floating_joint(body)
            found["damping"] = [
                joint.default_translational_damping() / found["mass"],
                joint.default_angular_damping() / np.max(found["inertia"]),
            ]
        return found

    def joint(self, name: str) -> dict[str, Any]:
        joint, drive = self.made.joints[name], self.made.drives[name]
        gains, own = drive.get_controller_gains(), self.made.springs.get(name)
        brake = self.made.brakes.get(name)
        return ({} if own is None else {"rest": _rest(own, self.context)}) | {
            "axis": _axis(joint),
            "limits": [joint.position_lower_limits()[0], joint.position_upper_limits()[0]],
            "effort_limit": drive.effort_limit(),
            "stiffness": gains.p + (0.0 if own is None else _stiffness(own, self.context)),
            "damping": gains.d + joint.GetDampingVector(self.context)[0],
            "friction": 0.0 if brake is None else brake.effort_limit(),
            "armature": drive.calc_reflected_inertia(self.context),
            "initial_position": joint.GetOnePosition(self.context),
        }

    def coupled(self, pairs: tuple[Coupling, ...]) -> bool:
        active = self.plant.GetConstraintActiveStatus
        return all(active(self.context, made) for made in self.made.couplings[: len(pairs)])

    def pose(self, part: Part) -> list[float]:
        place = self.plant.EvalBodyPoseInWorld(self.context, part.body) @ part.frame
        return [*place.translation(), *place.rotation().ToQuaternion().wxyz()]

    def shapes(self, part: Part) -> list[Outline]:
        """Each sphere in a corner (`world`) is one with what it sticks out of least: a box, where
        there are any."""
        found = [self._shape(made, part.frame) for made in self._solids(part)]
        found.sort(key=lambda shape: OUTLINES.index(shape[0]))
        own = [reached for kind, reached in found if kind == found[0][0]]
        for made in part.shapes:
            if made in self.made.spheres:
                _, sphere = self._shape(made, part.frame)
                k = int(np.argmin([np.max(sphere - reached) for reached in own]))
                found[k] = found[k][0], np.maximum(found[k][1], sphere)
        return found

    def _shape(self, made: Any, frame: Any) -> Outline:
        """Kind and reach of a shape in `frame`."""
        shape = self.inspector.GetShape(made)
        place = frame.inverse() @ self.inspector.GetPoseInFrame(made)
        pose = Pose.from_array([*place.translation(), *place.rotation().ToQuaternion().wxyz()])
        if isinstance(shape, geometry.Sphere):
            return a_round(shape.radius(), 0.0, pose)
        if isinstance(shape, geometry.Capsule):
            return a_round(shape.radius(), shape.length(), pose)
        if isinstance(shape, geometry.Cylinder):
            return a_cylinder(shape.radius(), shape.length(), pose)
        if isinstance(shape, geometry.Box):
            return a_box(shape.size(), pose)
        hull = self.inspector.GetConvexHull(made)
        corners = [hull.vertex(k) for k in range(hull.num_vertices())]
        return a_mesh(np.array(corners), pose)

    def inertial(self, part: Part) -> dict[str, Any]:
        inertia = part.body.CalcSpatialInertiaInBodyFrame(self.context)
        com = inertia.get_com()
        central = inertia.Shift(com).CalcRotationalInertia()
        field, port = self.plant.gravity_field(), self.plant.get_applied_spatial_force_input_port()
        pulls = port.Eval(self.context) if port.HasValue(self.context) else ()
        own = (pull for pull in pulls if pull.body_index == part.body.index())
        force = sum((pull.F_Bq_W.translational() for pull in own), np.zeros(3))
        share = felt(force, inertia.get_mass(), field.gravity_vector())
        return {
            "mass": inertia.get_mass(),
            "com": com,
            "inertia": central.CopyToFullMatrix3(),
            "gravity": field.is_enabled(part.body.model_instance()) + share,
        }

    def surface(self, part: Part) -> dict[str, Any]:
        surfaces = [self.inspector.GetProximityProperties(made) for made in part.shapes]
        frictions = [s.GetProperty("material", "coulomb_friction") for s in surfaces]
        margins = [s.GetPropertyOrDefault("hydroelastic", "margin", 0.0) for s in surfaces]
        return {
            "friction": one_value([[f.static_friction(), f.dynamic_friction()] for f in frictions]),
            "margin": one_value(margins),
        }

    def collide(self, first: Part, second: Part) -> Any:
        return [
            [not self.inspector.CollisionFiltered(x, y) for y in self._solids(second)]
            for x in self._solids(first)
        ]

    def _solids(self, part: Part) -> list[Any]:
        """Its shapes but the spheres in corners, which do not collide with each other."""
        return [made for made in part.shapes if made not in self.made.spheres]


def _stiffness(spring: Any, context: Any) -> float:
    """Of a spring in a joint; those of hinges tell it as a parameter from release to release."""
    told = spring.GetStiffness(context) if hasattr(spring, "GetStiffness") else spring.stiffness()
    return float(told)


def _rest(spring: Any, context: Any) -> float:
    """Where it is without load, told likewise."""
    if hasattr(spring, "GetNominalAngle"):
        return float(spring.GetNominalAngle(context))
    hinge = hasattr(spring, "nominal_angle")
    return float(spring.nominal_angle() if hinge else spring.nominal_position())


def _axis(joint: Any) -> FloatArray:
    """Motion subspace of a joint in the frame of its child."""
    frame = joint.frame_on_child().GetFixedPoseInBodyFrame()
    slides = isinstance(joint, trees.PrismaticJoint)
    axis = joint.translation_axis() if slides else joint.revolute_axis()
    return subspace(frame.rotation() @ axis, frame.translation(), slides=slides)
