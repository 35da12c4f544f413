"""PyBullet's settings, and the scene's bodies as those of Bullet."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.description.shapes import write_stl
from pytest_simbench.description.urdf import body_urdf
from pytest_simbench.scene import (
    Body,
    Box,
    Capsule,
    Closure,
    Compound,
    ConvexMesh,
    Cylinder,
    FloatArray,
    Pose,
    Sphere,
)
from pytest_simbench.simulator import NotSupportedError, lazy_import

from .settings import PyBulletSettings

pybullet = lazy_import("pybullet")

ROBOT, WORLD = 1, 2
"""Collision groups: the robot's links touch everything but, unless asked, each other."""


def _single(number: float) -> float:
    """Rounded to single precision, as Bullet's own default damping of 0.04 is."""
    return float(np.float32(number))


def add_body(client: int, box: Body, settings: PyBulletSettings, most: float) -> int:
    """A body; Bullet's number of it. A prescribed one weighs `most` [kg]."""
    c = client
    mass = most if box.prescribed else box.mass
    body = _load_compound(c, box, mass) if isinstance(box, Compound) else _make_body(c, box, mass)
    set_surface(c, body, settings, box.friction, box.restitution, box.damping)
    # Bullet takes a capsule for the box around it.
    if box.moments is not None or box.prescribed or not isinstance(box, Box):
        inertia = [most] * 3 if box.prescribed else list(box.inertia())
        pybullet.changeDynamics(body, -1, localInertiaDiagonal=inertia, physicsClientId=c)
    if isinstance(box, ConvexMesh):  # it rests on a layer of 1 mm by default
        pybullet.changeDynamics(body, -1, collisionMargin=0.0, physicsClientId=c)
    if box.velocity.any():  # setting none changes the last bits of what follows
        pybullet.resetBaseVelocity(
            body, box.linear_velocity, box.angular_velocity, physicsClientId=c
        )
    return body


def _make_body(c: int, box: Body, mass: float) -> int:
    """A body of one shape."""
    kind, size, length = _shape(box)
    lengths: dict[str, Any] = {} if length is None else {"height": length}
    shape = pybullet.createCollisionShape(kind, **size, **lengths, physicsClientId=c)
    lengths = {} if length is None else {"length": length}
    if isinstance(box, ConvexMesh):
        lengths = {"indices": np.ravel(box.hull.triangles).tolist()}
    picture = pybullet.createVisualShape(
        kind, **size, **lengths, rgbaColor=box.colour, physicsClientId=c
    )
    w, x, y, z = box.pose.quaternion
    body: int = pybullet.createMultiBody(
        mass, shape, picture, box.pose.position, [x, y, z, w], physicsClientId=c
    )
    return body


def _load_compound(c: int, body: Compound, mass: float) -> int:
    """A body of several shapes, by a URDF: of a list PyBullet takes 16, and drops the others. Its
    meshes are STL files: Bullet tells no corners of an OBJ among other shapes."""
    w, x, y, z = body.pose.quaternion
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "compound.urdf"
        text = body_urdf(
            body.changed(prescribed=False, mass=mass or 1.0, moments=(1.0,) * 3),
            lambda name, hull: write_stl(path.with_name(f"{name}.stl"), hull),
        )
        path.write_text(text, encoding="utf-8")
        made: int = pybullet.loadURDF(
            str(path),
            body.pose.position,
            [x, y, z, w],
            useFixedBase=not mass,
            flags=pybullet.URDF_USE_IMPLICIT_CYLINDER,
            physicsClientId=c,
        )
    pybullet.changeVisualShape(made, -1, rgbaColor=body.colour, physicsClientId=c)
    return made


def set_surface(
    client: int,
    body: int,
    settings: PyBulletSettings,
    friction: float,
    restitution: float = 0.0,
    damping: FloatArray | None = None,
    *,
    link: int = -1,
    group: int = WORLD,
    touches: int = WORLD | ROBOT,
) -> None:
    """Surface and damping of a body or link, its collision group and those that it touches."""
    s, c = settings, client
    linear, angular = s.linear_damping, s.angular_damping
    if damping is not None and damping.any():
        linear, angular = damping.tolist()
    pybullet.changeDynamics(
        body,
        link,
        lateralFriction=math.sqrt(friction),  # of a pair, Bullet takes the product
        spinningFriction=s.spinning_friction,
        rollingFriction=0.0,
        restitution=math.sqrt(restitution),  # the product too
        jointDamping=0.0,
        frictionAnchor=int(s.friction_anchor and link >= 0),
        physicsClientId=c,
    )
    if link < 0:
        # In a call for a link, damping or activation state make PyBullet 3.2.7 drop everything
        # else without a word: the fingers kept friction 0.5 until the parity check spoke.
        pybullet.changeDynamics(
            body,
            -1,
            linearDamping=_single(linear),
            angularDamping=_single(angular),
            activationState=(
                pybullet.ACTIVATION_STATE_ENABLE_SLEEPING
                if s.sleeping
                else pybullet.ACTIVATION_STATE_DISABLE_SLEEPING
            ),
            physicsClientId=c,
        )
    pybullet.setCollisionFilterGroupMask(body, link, group, touches, physicsClientId=c)


def _shape(body: Body) -> tuple[int, dict[str, Any], float | None]:
    """Bullet's kind of a body's shape, its size, and its length [m]; None where it has none."""
    match body:
        case Box():
            return pybullet.GEOM_BOX, {"halfExtents": [edge / 2 for edge in body.size]}, None
        case Sphere():
            return pybullet.GEOM_SPHERE, {"radius": body.radius}, None
        case Cylinder():
            return pybullet.GEOM_CYLINDER, {"radius": body.radius}, body.length
        case Capsule():
            return pybullet.GEOM_CAPSULE, {"radius": body.radius}, body.length
        case ConvexMesh():
            return pybullet.GEOM_MESH, {"vertices": body.vertices}, None
    raise NotSupportedError(f"pybullet has no {type(body).__name__}")


STRONGEST = 1e5
"""Largest force of a closure [N]. Bullet's own, 500 N, lets go of heavier links."""


def close_loop(
    client: int, robot: int, links: Mapping[str, int], closure: Closure, frames: Iterable[Pose]
) -> int:
    """Hold the frames' points together, or the frames; Bullet's number of the constraint."""
    first, second = links[closure.first], links[closure.second]
    a, b = (
        inertial_frame(client, robot, link).inverse() * frame
        for link, frame in zip((first, second), frames, strict=True)
    )
    made: int = pybullet.createConstraint(
        robot,
        first,
        robot,
        second,
        pybullet.JOINT_FIXED if closure.rigid else pybullet.JOINT_POINT2POINT,
        [0, 0, 0],
        a.position,
        b.position,
        (*a.quaternion[1:], a.quaternion[0]),
        (*b.quaternion[1:], b.quaternion[0]),
        physicsClientId=client,
    )
    pybullet.changeConstraint(made, maxForce=STRONGEST, physicsClientId=client)
    return made


def points(client: int, constraint: int) -> tuple[FloatArray, bool]:
    """Of a closure, in the frames of its links, (2, 3) [m]; whether it is a weld."""
    info = pybullet.getConstraintInfo(constraint, physicsClientId=client)
    body, ends = info[0], ((info[1], info[6]), (info[3], info[7]))
    found = [(inertial_frame(client, body, link) * Pose(at)).position for link, at in ends]
    return np.array(found), info[4] == pybullet.JOINT_FIXED


def inertial_frame(client: int, body: int, link: int) -> Pose:
    """Of a link or, with -1, a body, in its frame."""
    dynamics = pybullet.getDynamicsInfo(body, link, physicsClientId=client)
    return pose_of(dynamics[3], dynamics[4])


def pose_of(position: Sequence[float], quaternion: Sequence[float]) -> Pose:
    """Of Bullet's quaternions, which end with w."""
    x, y, z, w = quaternion
    return Pose.from_array([*position, w, x, y, z])
