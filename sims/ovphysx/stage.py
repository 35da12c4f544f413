"""The scene as a USD stage in text, in the schemas that Omniverse PhysX reads.

USD counts angles in degrees: limits of revolute joints, and the gains of their drives per degree.
A fixed base is a fixed joint to the world that carries the articulation's root. Prims are named by
their index (`/World/body_3`, `/World/link_0`), so that any name of the scene is allowed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.description.links import frames, reduced
from pytest_simbench.description.mesh_check import read_stl
from pytest_simbench.description.urdf import Link, MovingJoint, Shape
from pytest_simbench.scene import (
    Body,
    Box,
    Capsule,
    Closure,
    ConvexMesh,
    Coupling,
    Cylinder,
    FloatArray,
    Joint,
    Pose,
    Scene,
    Sphere,
)
from pytest_simbench.scene.robot import FREE
from pytest_simbench.simulator import NotSupportedError, PreparedRobot

from . import usd_text as usd

GROUND, ROOT = "/World/ground", "/World/root_joint"

_COLLIDER = ("PhysicsCollisionAPI", "PhysxCollisionAPI", "MaterialBindingAPI")
_HULL = (*_COLLIDER, "PhysicsMeshCollisionAPI")
_BODY = ("PhysicsRigidBodyAPI", "PhysxRigidBodyAPI", "PhysicsMassAPI")
BOUNDLESS = 1e9
"""Largest effort of a joint's spring whose drive leaves it free [N m or N]."""

COMBINED = {"mean": "average", "maximum": "max", "minimum": "min"}
"""PhysX's words for rules of friction."""

_REPORT = "float physxContactReport:threshold = 0"


def body_path(index: int) -> str:
    """Prim of the scene's body of that index."""
    return f"/World/body_{index}"


def shape_name(number: int) -> str:
    """Prim of a body's shape of that number, within the body's."""
    return f"shape_{number}" if number else "shape"


def link_path(index: int) -> str:
    """Prim of the prepared robot's link of that index; 0 is the root."""
    return f"/World/link_{index}"


def joint_path(index: int) -> str:
    """Prim of the robot's joint of that index."""
    return f"/World/joint_{index}"


def reports_contacts(scene: Scene) -> bool:
    """Whether PhysX is asked to report the contacts of bodies: not where there is a robot. In the
    scene of stacking, reports are a third and more of the stepping."""
    return scene.robot is None


class Stage:
    """Writer of one scene.

    Args:
        attributes: of PhysX's schemas, by their prefix (`physxScene`, `physxRigidBody`,
            `physxArticulation`, `physxCollision`) and name; None keeps the schema's default.
    """

    def __init__(
        self,
        scene: Scene,
        prepared: PreparedRobot | None,
        attributes: Mapping[str, Mapping[str, Any]],
    ) -> None:
        self.scene = scene
        self.prepared = prepared
        links = () if prepared is None else prepared.links
        self._paths = {
            "ground": GROUND,
            **{f"body/{body.name}": body_path(i) for i, body in enumerate(scene.bodies)},
            **{f"link/{name}": link_path(i) for i, name in enumerate(links)},
        }
        self._apart = [(self._paths[first], self._paths[second]) for first, second in scene.apart]
        self._lines = {
            prefix: usd.attributes(prefix, values) for prefix, values in attributes.items()
        }

    def text(self) -> str:
        """The stage as `.usda` text."""
        prims = [self._physics(), *self._materials(), self._ground()]
        prims += [self._body(box) for box in self.scene.bodies]
        if self.prepared is not None:
            prims += self._robot(self.prepared)
        units = "metersPerUnit = 1\n kilogramsPerUnit = 1"
        header = f'(defaultPrim = "World"\n {units}\n upAxis = "Z")'
        return f"#usda 1.0\n{header}\n\n{usd.prim('Xform', 'World', (), [], prims)}\n"

    def _physics(self) -> str:
        magnitude = float(np.linalg.norm(self.scene.gravity))
        direction = np.asarray(self.scene.gravity) / magnitude if magnitude else (0, 0, -1)
        lines = [
            f"vector3f physics:gravityDirection = {usd.numbers(direction)}",
            f"float physics:gravityMagnitude = {magnitude!r}",
            *self._lines["physxScene"],
        ]
        return usd.prim("PhysicsScene", "physics", ("PhysxSceneAPI",), lines)

    def _materials(self) -> list[str]:
        """One material a pair of coefficients, static and dynamic friction alike, that PhysX
        combines by the scene's rule. Of restitution it takes the average."""
        surfaces = {(body.friction, body.restitution) for body in self.scene.bodies}
        surfaces.add((self.scene.ground_friction, self.scene.ground_restitution))
        if self.scene.robot is not None:
            surfaces.add((self.scene.robot.friction, 0.0))
        mode = COMBINED.get(self.scene.friction_rule, "average")  # of equal ones all are the same
        return [
            usd.prim(
                "Material",
                _material(friction, restitution),
                ("PhysicsMaterialAPI", "PhysxMaterialAPI"),
                [
                    f'uniform token physxMaterial:frictionCombineMode = "{mode}"',
                    f"float physics:staticFriction = {float(friction)!r}",
                    f"float physics:dynamicFriction = {float(friction)!r}",
                    f"float physics:restitution = {float(restitution)!r}",
                ],
            )
            for friction, restitution in sorted(surfaces)
        ]

    def _surface(self, friction: float, restitution: float = 0.0) -> list[str]:
        material = _material(friction, restitution)
        bound = f"rel material:binding:physics = </World/{material}>"
        return [bound, *self._lines["physxCollision"]]

    def _ground(self) -> str:
        lines = [
            'uniform token axis = "Z"',
            *self._surface(self.scene.ground_friction, self.scene.ground_restitution),
        ]
        return self._collider("ground", "Plane", _COLLIDER, lines)

    def _collider(
        self,
        name: str,
        kind: str,
        schemas: Sequence[str],
        lines: Sequence[str],
        children: Sequence[str] = (),
    ) -> str:
        """The prim of "ground", `body/NAME` or `link/NAME`, and what it is kept apart from."""
        path = self._paths[name]
        others = [f"<{second}>" for first, second in self._apart if first == path]
        if others:
            schemas = (*schemas, "PhysicsFilteredPairsAPI")
            lines = [*lines, f"rel physics:filteredPairs = [{', '.join(others)}]"]
        return usd.prim(kind, path.rpartition("/")[2], schemas, lines, children)

    def _body(self, box: Body) -> str:
        """A rigid body; kinematic where it has no mass: PhysX reports nothing of static ones."""
        surface, shapes = self._surface(box.friction, box.restitution), []
        for k, part in enumerate(box.parts):
            kind, size = _solid(part)
            collider = _COLLIDER if kind != "Mesh" else _HULL
            shapes.append(usd.prim(kind, shape_name(k), collider, [*size, *surface]))
        lines = [*usd.placed(box.pose), *self._rigid(box)]
        schemas: tuple[str, ...] = _BODY
        if reports_contacts(self.scene):
            schemas, lines = (*_BODY, "PhysxContactReportAPI"), [*lines, _REPORT]
        if not box.mass:
            lines.append("bool physics:kinematicEnabled = true")
        else:
            lines += usd.mass_lines(box.mass, np.zeros(3), np.diag(box.inertia()))
            spin = np.degrees(box.angular_velocity)
            lines.append(f"vector3f physics:velocity = {usd.numbers(box.linear_velocity)}")
            lines.append(f"vector3f physics:angularVelocity = {usd.numbers(spin)}")
        return self._collider(f"body/{box.name}", "Xform", schemas, lines, shapes)

    def _rigid(self, body: Body) -> list[str]:
        """The engine's settings of a body, and its own damping where it has one."""
        lines = self._lines["physxRigidBody"]
        if not body.damping.any():
            return lines
        own = dict(zip(("linearDamping", "angularDamping"), body.damping.tolist(), strict=True))
        kept = [line for line in lines if not any(name in line for name in own)]
        return [*kept, *usd.attributes("physxRigidBody", own)]

    def _robot(self, prepared: PreparedRobot) -> list[str]:
        robot, names = prepared.robot, list(prepared.links)
        self._shares = prepared.gravity
        poses = {prepared.root: Pose()}
        for joint in prepared.joints:
            poses[joint.child] = poses[joint.parent] * joint.origin
        prims = [self._link(prepared.links[name], poses[name], robot.friction) for name in names]
        root = [
            f"rel physics:body1 = <{link_path(names.index(prepared.root))}>",
            f"bool physxArticulation:enabledSelfCollisions = {str(robot.self_collide).lower()}",
            *self._lines["physxArticulation"],
        ]
        schemas = ("PhysicsArticulationRootAPI", "PhysxArticulationAPI")
        prims.append(usd.prim("PhysicsFixedJoint", ROOT.rpartition("/")[2], schemas, root))
        kinds = {joint.name: joint.kind for joint in prepared.joints}
        mimics = {
            pair.follower: _mimic(pair, robot.joint_names.index(pair.leader), kinds)
            for pair in (*robot.gripper.couplings, *robot.couplings)
        }
        for joint in prepared.joints:
            index = robot.joint_names.index(joint.name)
            limits, mimic = prepared.limits[joint.name], mimics.get(joint.name, [])
            prims.append(_joint(index, joint, robot.joints[index], limits, names, mimic))
        for k, closure in enumerate(reduced(prepared)):
            prims.append(_closure(k, closure, frames(prepared, closure), names))
        return prims

    def _link(self, link: Link, pose: Pose, friction: float) -> str:
        lines = [*usd.placed(pose), *self._lines["physxRigidBody"]]
        if self._shares.get(link.name, 1.0) != 1:  # what it feels is a force of each step
            lines += usd.attributes("physxRigidBody", {"disableGravity": True})
        if link.mass > 0:
            lines += usd.mass_lines(link.mass, link.centre, link.inertia)
        shapes = [self._shape(i, shape, friction) for i, shape in enumerate(link.shapes)]
        return self._collider(f"link/{link.name}", "Xform", _BODY, lines, shapes)

    def _shape(self, index: int, shape: Shape, friction: float) -> str:
        """A box, or the convex hull of a mesh, which PhysX makes (at most 64 corners)."""
        name, surface = f"shape_{index}", self._surface(friction)
        if shape.size is not None:
            return usd.prim("Cube", name, _COLLIDER, [*usd.cube(shape.size, shape.pose), *surface])
        triangles = read_stl(Path(str(shape.mesh)).read_bytes())
        corners, faces = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
        lines = [*usd.placed(shape.pose), *usd.hull(corners, faces.reshape(-1, 3))]
        return usd.prim("Mesh", name, _HULL, [*lines, *surface])


def _solid(body: Body) -> tuple[str, list[str]]:
    """USD's kind of a shape, and the lines of its place and size; along z where it has an axis."""
    at = [] if body.pose == Pose() else usd.placed(body.pose)
    match body:
        case Box():
            return "Cube", usd.cube(body.size, body.pose)
        case Sphere():
            return "Sphere", [*at, f"double radius = {float(body.radius)!r}"]
        case Cylinder() | Capsule():
            radius, length = float(body.radius), float(body.length)
            lines = [f"double radius = {radius!r}", f"double height = {length!r}"]
            return type(body).__name__, [*at, *lines, 'uniform token axis = "Z"']
        case ConvexMesh():
            return "Mesh", [*at, *usd.hull(body.hull.points, np.array(body.hull.triangles))]
    raise NotSupportedError(f"ovphysx has no {type(body).__name__}")


def _material(friction: float, restitution: float) -> str:
    name = f"friction_{float(friction)!r}"
    if restitution:
        name += f"_bouncing_{float(restitution)!r}"
    return name.translate(str.maketrans(".-+", "pmp"))


def _closure(number: int, closure: Closure, ends: tuple[Pose, Pose], links: Sequence[str]) -> str:
    """A ball joint or a weld beside the articulation, which is a tree."""
    lines = [
        f"rel physics:body0 = <{link_path(links.index(closure.first))}>",
        f"rel physics:body1 = <{link_path(links.index(closure.second))}>",
        f"point3f physics:localPos0 = {usd.numbers(closure.first_point)}",
        f"point3f physics:localPos1 = {usd.numbers(closure.second_point)}",
        "bool physics:excludeFromArticulation = true",
    ]
    if closure.rigid:
        for k, end in enumerate(ends):
            lines.append(f"quatf physics:localRot{k} = {usd.numbers(end.quaternion)}")
    kind = "PhysicsFixedJoint" if closure.rigid else "PhysicsSphericalJoint"
    return usd.prim(kind, f"closure_{number}", (), lines)


def _mimic(pair: Coupling, leader: int, kinds: Mapping[str, str]) -> list[str]:
    """Lines that couple a joint: q + gearing q_reference + offset = 0."""
    follower, led = (
        math.pi / 180 if kinds[name] == "revolute" else 1.0 for name in (pair.follower, pair.leader)
    )
    return [
        f"float physxMimicJoint:rotX:gearing = {-pair.ratio * led / follower!r}",
        f"float physxMimicJoint:rotX:offset = {-pair.offset / follower!r}",
        f"rel physxMimicJoint:rotX:referenceJoint = <{joint_path(leader)}>",
    ]


def _joint(
    index: int,
    joint: MovingJoint,
    drive: Joint,
    limits: FloatArray,
    links: Sequence[str],
    mimic: Sequence[str],
) -> str:
    """A joint about or along the x axis of its frames, with drive, rotor and coupling; `mimic` is
    empty without one. Drive and spring of the joint are one spring."""
    revolute = joint.kind == "revolute"
    axis, unit = ("angular", math.pi / 180) if revolute else ("linear", 1.0)
    start = drive.initial_position / unit
    stiffness, passive = drive.stiffness + drive.spring, drive.passive_damping * unit
    pull = drive.spring * (drive.rest - drive.initial_position)
    target = start + (pull / stiffness / unit if pull else 0.0)
    limit = BOUNDLESS if drive.spring and drive.effort_limit <= FREE else drive.effort_limit
    turned = Pose(quaternion=usd.turn_from_x(np.asarray(joint.axis)))
    before = joint.origin * turned
    lower, upper = (float(limit) / unit for limit in limits)
    lines = [
        f"rel physics:body0 = <{link_path(links.index(joint.parent))}>",
        f"rel physics:body1 = <{link_path(links.index(joint.child))}>",
        f"point3f physics:localPos0 = {usd.numbers(before.position)}",
        f"quatf physics:localRot0 = {usd.numbers(before.quaternion)}",
        f"quatf physics:localRot1 = {usd.numbers(turned.quaternion)}",
        'uniform token physics:axis = "X"',
        f"float physics:lowerLimit = {lower!r}",
        f"float physics:upperLimit = {upper!r}",
        f'uniform token drive:{axis}:physics:type = "force"',
        f"float drive:{axis}:physics:stiffness = {stiffness * unit!r}",
        f"float drive:{axis}:physics:damping = {drive.damping * unit!r}",
        f"float drive:{axis}:physics:maxForce = {limit!r}",
        f"float drive:{axis}:physics:targetPosition = {target!r}",
        f"float physxJointAxis:{axis}:armature = {drive.armature!r}",
        f"float physxJointAxis:{axis}:staticFrictionEffort = {drive.friction!r}",
        f"float physxJointAxis:{axis}:dynamicFrictionEffort = {drive.friction!r}",
        f"float physxJointAxis:{axis}:viscousFrictionCoefficient = {passive!r}",
        f"float state:{axis}:physics:position = {start!r}",
    ]
    apis = ("PhysicsDriveAPI", "PhysxJointAxisAPI", "PhysicsJointStateAPI")
    schemas = [f"{api}:{axis}" for api in apis]
    if mimic:
        schemas.append("PhysxMimicJointAPI:rotX")
        lines += mimic
    kind = "PhysicsRevoluteJoint" if revolute else "PhysicsPrismaticJoint"
    return usd.prim(kind, f"joint_{index}", schemas, lines)
