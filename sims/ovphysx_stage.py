"""The scene as a USD stage in text, in the schemas that Omniverse PhysX reads.

USD counts angles in degrees: limits of revolute joints, and the gains of their drives per degree.
A fixed base is a fixed joint to the world that carries the articulation's root. Prims are named by
their index (`/World/body_3`, `/World/link_0`), so that any name of the scene is allowed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.scene import Box, FloatArray, Joint, Pose, Scene
from pytest_simbench.simulator import PreparedRobot
from pytest_simbench.simulator.urdf import Link, MovingJoint, Shape

GROUND, ROOT = "/World/ground", "/World/root_joint"


def body_path(index: int) -> str:
    """Prim of the scene's body of that index."""
    return f"/World/body_{index}"


def link_path(index: int) -> str:
    """Prim of the prepared robot's link of that index; 0 is the root."""
    return f"/World/link_{index}"


def joint_path(index: int) -> str:
    """Prim of the robot's joint of that index."""
    return f"/World/joint_{index}"


def stage_text(
    scene: Scene,
    prepared: PreparedRobot | None,
    options: Mapping[str, Any],
    bodies: Mapping[str, Any],
    articulation: Mapping[str, Any],
    collision: Mapping[str, Any],
) -> str:
    """The whole stage as `.usda` text.

    Args:
        scene: the world to write.
        prepared: its robot.
        options: attributes of PhysxSceneAPI, by name without prefix.
        bodies: those of PhysxRigidBodyAPI, for free bodies and links alike.
        articulation: those of PhysxArticulationAPI.
        collision: those of PhysxCollisionAPI.
    """
    prims = [_scene(scene, options), *_materials(scene), _ground(scene, collision)]
    prims += [_box(i, box, bodies, collision) for i, box in enumerate(scene.bodies)]
    if prepared is not None:
        prims += _robot(prepared, bodies, articulation, collision)
    world = _prim("Xform", "World", (), [], prims)
    header = '(defaultPrim = "World"\n metersPerUnit = 1\n kilogramsPerUnit = 1\n upAxis = "Z")'
    return f"#usda 1.0\n{header}\n\n{world}\n"


def _scene(scene: Scene, options: Mapping[str, Any]) -> str:
    magnitude = float(np.linalg.norm(scene.gravity))
    direction = np.asarray(scene.gravity) / magnitude if magnitude else (0, 0, -1)
    lines = [
        f"vector3f physics:gravityDirection = {_tuple(direction)}",
        f"float physics:gravityMagnitude = {magnitude!r}",
        *_attributes("physxScene", options),
    ]
    return _prim("PhysicsScene", "physics", ("PhysxSceneAPI",), lines)


def _materials(scene: Scene) -> list[str]:
    """One material a coefficient, static and dynamic friction alike, no restitution."""
    return [
        _prim(
            "Material",
            _material(friction),
            ("PhysicsMaterialAPI",),
            [
                f"float physics:staticFriction = {friction!r}",
                f"float physics:dynamicFriction = {friction!r}",
                "float physics:restitution = 0",
            ],
        )
        for friction in sorted(
            {scene.ground_friction}
            | {box.friction for box in scene.bodies}
            | ({scene.robot.friction} if scene.robot else set())
        )
    ]


def _material(friction: float) -> str:
    return "friction_" + repr(float(friction)).translate(str.maketrans(".+-", "_pm"))


def _surface(friction: float, collision: Mapping[str, Any]) -> tuple[tuple[str, ...], list[str]]:
    """Schemas and attributes of a collider with that friction."""
    schemas = ("PhysicsCollisionAPI", "PhysxCollisionAPI", "MaterialBindingAPI")
    bound = f"rel material:binding:physics = </World/{_material(friction)}>"
    return schemas, [bound, *_attributes("physxCollision", collision)]


def _ground(scene: Scene, collision: Mapping[str, Any]) -> str:
    schemas, lines = _surface(scene.ground_friction, collision)
    return _prim("Plane", "ground", schemas, ['uniform token axis = "Z"', *lines])


def _box(
    index: int, box: Box, bodies: Mapping[str, Any], collision: Mapping[str, Any]
) -> str:
    """A rigid body; kinematic where it is fixed, since PhysX reports nothing of static ones."""
    schemas, lines = _surface(box.friction, collision)
    shape = _prim("Cube", "shape", schemas, [*_cube(box.size), *lines])
    lines = [*_placed(box.pose), *_attributes("physxRigidBody", bodies)]
    if box.fixed:
        lines.append("bool physics:kinematicEnabled = true")
    else:
        lines += _mass(box.mass, np.zeros(3), np.diag(box.inertia()))
    schemas = ("PhysicsRigidBodyAPI", "PhysxRigidBodyAPI", "PhysicsMassAPI")
    return _prim("Xform", f"body_{index}", schemas, lines, [shape])


def _robot(
    prepared: PreparedRobot,
    bodies: Mapping[str, Any],
    articulation: Mapping[str, Any],
    collision: Mapping[str, Any],
) -> list[str]:
    robot, names = prepared.robot, list(prepared.links)
    poses = {prepared.root: Pose()}
    for joint in prepared.joints:
        poses[joint.child] = poses[joint.parent] * joint.origin
    prims = [
        _link(i, prepared.links[name], poses[name], robot.friction, bodies, collision)
        for i, name in enumerate(names)
    ]
    root = [
        f"rel physics:body1 = <{link_path(names.index(prepared.root))}>",
        "bool physxArticulation:enabledSelfCollisions = false",
        *_attributes("physxArticulation", articulation),
    ]
    schemas = ("PhysicsArticulationRootAPI", "PhysxArticulationAPI")
    prims.append(_prim("PhysicsFixedJoint", ROOT.rpartition("/")[2], schemas, root))
    first, second = robot.finger_indices
    for joint in prepared.joints:
        index = robot.joint_names.index(joint.name)
        limits = prepared.limits[joint.name]
        coupled_to = first if index == second else None
        prims.append(_joint(index, joint, robot.joints[index], limits, names, coupled_to))
    return prims


def _link(
    index: int,
    link: Link,
    pose: Pose,
    friction: float,
    bodies: Mapping[str, Any],
    collision: Mapping[str, Any],
) -> str:
    lines = [*_placed(pose), *_attributes("physxRigidBody", bodies)]
    if link.mass > 0:
        lines += _mass(link.mass, link.centre, link.inertia)
    shapes = [_shape(i, shape, friction, collision) for i, shape in enumerate(link.shapes)]
    schemas = ("PhysicsRigidBodyAPI", "PhysxRigidBodyAPI", "PhysicsMassAPI")
    return _prim("Xform", f"link_{index}", schemas, lines, shapes)


def _shape(index: int, shape: Shape, friction: float, collision: Mapping[str, Any]) -> str:
    schemas, lines = _surface(friction, collision)
    name = f"shape_{index}"
    if shape.size is not None:
        return _prim("Cube", name, schemas, [*_cube(shape.size, shape.pose), *lines])
    points = read_stl(Path(str(shape.mesh)))
    corners, faces = np.unique(points.reshape(-1, 3), axis=0, return_inverse=True)
    lines += [
        *_placed(shape.pose),
        'uniform token physics:approximation = "convexHull"',
        f"point3f[] points = [{', '.join(_tuple(point) for point in corners)}]",
        f"int[] faceVertexCounts = [{', '.join(['3'] * len(points))}]",
        f"int[] faceVertexIndices = [{', '.join(str(i) for i in faces.ravel())}]",
    ]
    return _prim("Mesh", name, (*schemas, "PhysicsMeshCollisionAPI"), lines)


def _joint(
    index: int,
    joint: MovingJoint,
    drive: Joint,
    limits: FloatArray,
    links: Sequence[str],
    coupled_to: int | None,
) -> str:
    """A joint about or along the x axis of its frames, with drive, rotor and coupling."""
    revolute = joint.kind == "revolute"
    axis, unit = ("angular", math.pi / 180) if revolute else ("linear", 1.0)
    start = drive.initial_position / unit
    turned = Pose(quaternion=_from_x(np.asarray(joint.axis)))
    before = joint.origin * turned
    lower, upper = (float(limit) / unit for limit in limits)
    lines = [
        f"rel physics:body0 = <{link_path(links.index(joint.parent))}>",
        f"rel physics:body1 = <{link_path(links.index(joint.child))}>",
        f"point3f physics:localPos0 = {_tuple(before.position)}",
        f"quatf physics:localRot0 = {_tuple(before.quaternion)}",
        f"quatf physics:localRot1 = {_tuple(turned.quaternion)}",
        'uniform token physics:axis = "X"',
        f"float physics:lowerLimit = {lower!r}",
        f"float physics:upperLimit = {upper!r}",
        f'uniform token drive:{axis}:physics:type = "force"',
        f"float drive:{axis}:physics:stiffness = {drive.stiffness * unit!r}",
        f"float drive:{axis}:physics:damping = {drive.damping * unit!r}",
        f"float drive:{axis}:physics:maxForce = {drive.effort_limit!r}",
        f"float drive:{axis}:physics:targetPosition = {start!r}",
        f"float physxJointAxis:{axis}:armature = {drive.armature!r}",
        f"float state:{axis}:physics:position = {start!r}",
    ]
    apis = ("PhysicsDriveAPI", "PhysxJointAxisAPI", "PhysicsJointStateAPI")
    schemas = [f"{api}:{axis}" for api in apis]
    if coupled_to is not None:
        # q + gearing q_reference + offset = 0; the instance's name is idle at a linear joint.
        schemas.append("PhysxMimicJointAPI:rotX")
        lines += [
            "float physxMimicJoint:rotX:gearing = -1",
            f"rel physxMimicJoint:rotX:referenceJoint = <{joint_path(coupled_to)}>",
        ]
    kind = "PhysicsRevoluteJoint" if revolute else "PhysicsPrismaticJoint"
    return _prim(kind, f"joint_{index}", schemas, lines)


def read_stl(path: Path) -> FloatArray:
    """Triangles of a binary STL file, (n, 3, 3) [m].

    Raises:
        ValueError: the file is no binary STL.
    """
    data = path.read_bytes()
    count = int.from_bytes(data[80:84], "little")
    if len(data) != 84 + 50 * count:
        raise ValueError(f"{path} is no binary STL file")
    kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("colour", "<u2")])
    return np.asarray(np.frombuffer(data, kind, offset=84)["corners"], dtype=float)


def _from_x(axis: FloatArray) -> tuple[float, float, float, float]:
    """Quaternion of the shortest turn from the x axis to `axis`."""
    x, y, z = axis / np.linalg.norm(axis)
    if x < -1 + 1e-12:
        return (0.0, 0.0, 0.0, 1.0)
    quaternion = np.array([1 + x, 0.0, -z, y])
    w, x, y, z = (float(value) for value in quaternion / np.linalg.norm(quaternion))
    return (w, x, y, z)


def _mass(mass: float, centre: FloatArray, inertia: FloatArray) -> list[str]:
    moments, axes = np.linalg.eigh(inertia)
    if np.allclose(inertia, np.diag(np.diag(inertia)), rtol=0, atol=1e-15):
        moments, axes = np.diag(inertia), np.eye(3)
    if np.linalg.det(axes) < 0:
        axes[:, 0] *= -1
    return [
        f"float physics:mass = {float(mass)!r}",
        f"point3f physics:centerOfMass = {_tuple(centre)}",
        f"float3 physics:diagonalInertia = {_tuple(moments)}",
        f"quatf physics:principalAxes = {_tuple(_quaternion(axes))}",
    ]


def _quaternion(rotation: FloatArray) -> FloatArray:
    """Quaternion w, x, y, z of a rotation matrix: the eigenvector of Bar-Itzhack's matrix."""
    r = rotation
    k = np.array(
        [
            [r[0, 0] + r[1, 1] + r[2, 2], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
            [r[2, 1] - r[1, 2], r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
            [r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], r[1, 1] - r[0, 0] - r[2, 2], r[1, 2] + r[2, 1]],
            [r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], r[2, 2] - r[0, 0] - r[1, 1]],
        ]
    )
    return np.asarray(np.linalg.eigh(k)[1][:, -1])


def _placed(pose: Pose) -> list[str]:
    return [
        f"double3 xformOp:translate = {_tuple(pose.position)}",
        f"quatd xformOp:orient = {_tuple(pose.quaternion)}",
        'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient"]',
    ]


def _cube(size: Sequence[float], pose: Pose | None = None) -> list[str]:
    """A cube of edge 1, scaled."""
    placed = _placed(pose or Pose())[:2]
    order = '["xformOp:translate", "xformOp:orient", "xformOp:scale"]'
    return [
        "double size = 1",
        *placed,
        f"float3 xformOp:scale = {_tuple(size)}",
        f"uniform token[] xformOpOrder = {order}",
    ]


_TYPES = {bool: "bool", int: "int", float: "float", str: "uniform token"}


def _attributes(prefix: str, values: Mapping[str, Any]) -> list[str]:
    """Attributes of a PhysX schema; those that are None keep the schema's default."""
    lines = []
    for name, value in values.items():
        if value is not None:
            text = {bool: str(value).lower(), str: f'"{value}"'}.get(type(value), repr(value))
            lines.append(f"{_TYPES[type(value)]} {prefix}:{name} = {text}")
    return lines


def _tuple(values: Iterable[float]) -> str:
    return "(" + ", ".join(repr(float(value)) for value in values) + ")"


def _prim(
    kind: str,
    name: str,
    schemas: Sequence[str],
    lines: Sequence[str],
    children: Sequence[str] = (),
) -> str:
    listed = ", ".join(f'"{schema}"' for schema in schemas)
    head = f'def {kind} "{name}"' + (f" (prepend apiSchemas = [{listed}])" if schemas else "")
    return "\n".join([head, "{", *lines, *children, "}"])
