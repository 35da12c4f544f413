"""What moves on joints in a file, as one tree of links: a robot without a hand, fixed in the world.

Cabinets, doors and arms of a file are branches of that tree, so every engine holds them as it holds
any robot. The drive of a joint is what its actuators make of it.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pytest_simbench.description.carried import APPROXIMATED, CARRIED
from pytest_simbench.description.mesh_check import written_stl
from pytest_simbench.description.robot_files import digest, keep
from pytest_simbench.description.shapes import capsule_hull, cylinder_hull
from pytest_simbench.description.urdf import Link, MovingJoint, Shape, write_joint, write_link
from pytest_simbench.scene import FloatArray, Gripper, Joint, Polytope, Pose, Robot
from pytest_simbench.scene.pose import vector3
from pytest_simbench.scene.robot import FARTHEST, FASTEST, FREE, WIDEST
from pytest_simbench.simulator import lazy_import

from .actuators import Drive, drive_of
from .constraints import Constraints
from .shapes import hull_of, refused

if TYPE_CHECKING:
    from .reading import Reading

mujoco = lazy_import("mujoco")

MOUNT = "mount"
"""The link that is fixed in the world."""

BETWEEN = 1e-3
"""Share of a body's mass and inertia that a link between two of its joints has."""

LEAST = 1e-9
"""Mass [kg] and moments [kg m^2] that such a link has in addition: a marker weighs next to nothing,
and engines refuse less."""


@dataclass(frozen=True)
class OnJoint:
    """A link of the tree.

    Attributes:
        body: number of the model's body that the joint moves.
        joint: number of the joint.
        above: the link that it hangs on; None: the mount.
        told: name of the joint.
        whole: whether it is the body; else it is between two of the body's joints.
    """

    body: int
    joint: int
    above: OnJoint | None
    name: str
    told: str
    whole: bool


def on_joints(reading: Reading) -> list[OnJoint]:
    """All links, parents first.

    Raises:
        DescriptionError: a body moves on a ball joint, or hangs on one that flies.
    """
    model, kinds = reading.model, mujoco.mjtJoint
    free = {int(model.jnt_bodyid[j]) for j in np.flatnonzero(model.jnt_type == kinds.mjJNT_FREE)}
    found: list[OnJoint] = []
    of_body: dict[int, OnJoint | None] = {0: None}
    joint_names: dict[str, int] = {}
    for body in range(1, model.nbody):
        count, first = int(model.body_jntnum[body]), int(model.body_jntadr[body])
        if not count or body in free | reading.soft:
            continue
        name, joints = reading.name("body", body), range(first, first + count)
        balls = [j for j in joints if model.jnt_type[j] == kinds.mjJNT_BALL]
        if balls:
            raise reading.refuse(
                f"{name} moves on the ball joint {reading.name('joint', balls[0])}, and a link of "
                "a scene moves on a hinge or a slider"
            )
        above = reading.root(int(model.body_parentid[body]))
        if above in free:
            raise reading.refuse(
                f"{name} hangs on {reading.name('body', above)}, which moves freely; in a scene "
                "what has joints is fixed in the world"
            )
        own, link = reading.own_name("body", body), of_body[above]
        for joint in joints:
            told, last = reading.own_name("joint", joint, joint_names), joint == joints[-1]
            link = OnJoint(body, joint, link, own if last else f"{own} on {told}", told, last)
            found.append(link)
        of_body[body] = link
        if count > 1:
            reason = f"a link of {BETWEEN:g} of its mass and inertia stands between two joints"
            reading.tell("body with several joints", APPROXIMATED, reason, [own])
    return found


class Tree:
    """The links as a robot.

    Attributes:
        drives, limits: of the joints, in their order.
    """

    def __init__(self, reading: Reading, links: list[OnJoint]) -> None:
        self.reading, self.links, self.model = reading, links, reading.model
        self._bodies = {link.body for link in links}
        self._meshes: dict[str, bytes] = {}
        self._coarse: dict[str, float] = {}
        self.drives: list[Drive] = []
        self.limits: list[list[float]] = []

    def robot(self, lift: float, self_collide: bool) -> Robot | None:
        """The robot, its mount at the file's origin, that height above the world's [m]; None: the
        file has no links."""
        root = ET.Element("robot", name="tree")
        ET.SubElement(root, "link", name=MOUNT)
        joints = []
        for link in self.links:
            above = Pose() if link.above is None else self._frame(link.above)
            origin = above.inverse() * self._frame(link)
            hinge = self.model.jnt_type[link.joint] == mujoco.mjtJoint.mjJNT_HINGE
            axis = vector3(self.model.jnt_axis[link.joint])
            kind = "revolute" if hinge else "prismatic"
            on = MOUNT if link.above is None else link.above.name
            moving = MovingJoint(link.told, kind, on, link.name, origin, axis)
            limits = self._limits(link, WIDEST if hinge else FARTHEST)
            self.limits.append(limits)
            joint = self._joint(link, limits)
            write_link(root, self._link(link))
            write_joint(root, moving, limits, joint.effort_limit, FASTEST)
            joints.append(joint)
        geoms = [g for link in self.links if link.whole for g in self.reading.geoms_of(link)]
        frictions = self.model.geom_friction[geoms, 0] if geoms else np.ones(1)
        self.constraints = constraints = Constraints(self, [j.initial_position for j in joints])
        if not joints:
            return None
        self._tell(frictions)
        ET.indent(root)
        return Robot(
            name="tree",
            urdf=str(keep(ET.tostring(root, encoding="unicode"), self._meshes)),
            packages={},
            srdf="",
            joints=tuple(joints),
            gripper=Gripper((), 0.0, 0.0, 0.0),
            tool_frame=self.links[-1].name,
            base=Pose.at(0.0, 0.0, lift),
            friction=float(frictions.max()),
            closures=tuple(constraints.closures),
            self_collide=self_collide,
            couplings=tuple(constraints.couplings),
        )

    def link_of(self, root: int) -> str | None:
        """The link that a moving body of the file is (0: the mount); None: it is none."""
        if not root:
            return MOUNT
        return next((k.name for k in self.links if k.body == root and k.whole), None)

    def frame_of(self, name: str, data: Any) -> Pose:
        """Of the link of that name, in the file's world, where the joints are in the data."""
        found = (self._frame(link, data) for link in self.links if link.name == name)
        return next(found, Pose())

    def _frame(self, link: OnJoint, data: Any = None) -> Pose:
        """Of the link, at its joint, in the file's world."""
        return self.reading.pose(link.body, data) * Pose(vector3(self.model.jnt_pos[link.joint]))

    def _link(self, link: OnJoint) -> Link:
        mass, centre, tensor = self.reading.inertial(link.body)
        anchor = self.model.jnt_pos[link.joint]
        if not link.whole:
            mass, tensor = BETWEEN * mass + LEAST, BETWEEN * tensor + np.diag([LEAST] * 3)
            return Link(link.name, mass, centre - anchor, tensor)
        frame = self._frame(link).inverse()
        geoms = [(g, frame * self.reading.geom_pose(g)) for g in self.reading.geoms_of(link)]
        shapes = [self._shape(geom, pose, link) for geom, pose in geoms]
        return Link(link.name, mass, centre - anchor, tensor, shapes)

    def _shape(self, geom: int, pose: Pose, link: OnJoint) -> Shape:
        """A box as a box, all else as a hull of corners; `pose` of the geom in the link."""
        kinds, (a, b, c) = mujoco.mjtGeom, (float(size) for size in self.model.geom_size[geom])
        kind = kinds(self.model.geom_type[geom])
        if kind == kinds.mjGEOM_BOX:
            return Shape(pose, size=(2 * a, 2 * b, 2 * c))
        if kind == kinds.mjGEOM_CYLINDER:
            points, gap = cylinder_hull(a, b)
        elif kind in (kinds.mjGEOM_SPHERE, kinds.mjGEOM_CAPSULE):
            points, gap = capsule_hull(a, b if kind == kinds.mjGEOM_CAPSULE else 0.0)
        elif kind == kinds.mjGEOM_MESH:
            corners, own = hull_of(self.reading, geom)
            points, gap, pose = np.array(corners), 0.0, pose * own
        else:
            raise refused(self.reading, geom)
        if gap:
            self._coarse[link.name] = max(gap, self._coarse.get(link.name, 0.0))
        hull = Polytope(points)
        data = written_stl(hull.points[np.array(hull.triangles)])
        name = f"{digest(data)}.stl"
        self._meshes[name] = data
        return Shape(pose, mesh=name)

    def _limits(self, link: OnJoint, widest: float) -> list[float]:
        """From the posture in which the file is written [rad or m]."""
        model, tell = self.model, self.reading.tell
        if model.jnt_limited[link.joint]:
            start = float(model.qpos0[model.jnt_qposadr[link.joint]])
            low, high = (float(end) - start for end in model.jnt_range[link.joint])
            if not low <= 0.0 <= high:
                reason = "it starts outside of its range, here at the nearest end"
                tell("joint range (start)", APPROXIMATED, reason, [link.told])
            return [low, high]
        at = int(model.jnt_qposadr[link.joint])
        ways = np.abs(model.key_qpos[:, at] - model.qpos0[at])
        if ways.max(initial=0.0) > widest:
            widest = float(ways.max()) + 1.0  # no keyframe stands at a stop
        reason = f"joints without limits stop at {widest:g} rad or m to each side"
        tell("joint range (none)", APPROXIMATED, reason, [link.told])
        return [-widest, widest]

    def _joint(self, link: OnJoint, limits: list[float]) -> Joint:
        model, joint = self.model, link.joint
        dof, at = int(model.jnt_dofadr[joint]), int(model.jnt_qposadr[joint])
        drive = drive_of(self.reading, joint)
        self.drives.append(drive)
        return Joint(
            link.told,
            drive.stiffness,
            drive.damping,
            drive.limit if len(drive.numbers) else FREE,
            float(model.dof_armature[dof]) + drive.rotor,
            min(max(0.0, limits[0]), limits[1]),
            passive_damping=float(np.ravel(model.dof_damping[dof])[0]) + drive.resistance,
            friction=float(model.dof_frictionloss[dof]),
            spring=float(np.ravel(model.jnt_stiffness[joint])[0]),
            rest=float(model.qpos_spring[at]) - drive.zero,
            gravity=1.0 - self.reading.compensated(link.body),
            file_zero=drive.zero,
        )

    def _tell(self, frictions: FloatArray) -> None:
        tell = self.reading.tell
        names = [link.told for link in self.links]
        told = "joint pos, axis, range, armature, damping, frictionloss, stiffness, springref"
        tell(told, CARRIED, f"{len(names)} hinges and sliders", names)
        if shifted := [k.told for k, d in zip(self.links, self.drives, strict=True) if d.zero]:
            tell("joint ref", CARRIED, "it is 0 here; logs (.npz, .csv) are moved by it", shifted)
        borne = [b for b in range(1, self.model.nbody) if self.reading.root(b) in self._bodies]
        if self.model.body_gravcomp[borne].any():
            reason = "links feel the rest of gravity"
            names = [self.reading.name("body", b) for b in borne if self.model.body_gravcomp[b]]
            tell("body gravcomp (of links)", CARRIED, reason, names)
        if frictions.min() < frictions.max():
            reason = f"links have one friction: the largest of {sorted(set(frictions.tolist()))}"
            tell("geom friction (sliding)", APPROXIMATED, reason)
        if self._coarse:
            gap = 1000 * max(self._coarse.values())
            reason = f"round shapes of links are hulls of corners, up to {gap:.2g} mm smaller"
            tell("geom size (round, of links)", APPROXIMATED, reason, self._coarse)
