"""What MuJoCo says that it built, for the parity check, and the forces of its contacts and joints;
MuJoCo's adapter and Newton's share it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pytest_simbench.description.links import subspace
from pytest_simbench.description.shapes import NO_REACH, Outline, a_box, a_cylinder, a_mesh, a_round
from pytest_simbench.parity import readback
from pytest_simbench.parity.readback import one_value
from pytest_simbench.scene import Body, Coupling, FloatArray, Pose
from pytest_simbench.scene.pose import quaternion_of
from pytest_simbench.simulator import heavy, lazy_import

from .bounces import bounce
from .world import closed, gain

mujoco = lazy_import("mujoco")

LEAST = 1e-12
"""Mass [kg] and moments [kg m^2] of a body of a user's file that has none but that of its parts."""


@dataclass(frozen=True)
class Numbers:
    """MuJoCo's numbers of what a scene names.

    Attributes:
        ground: of its geom.
        boxes: geoms of each body.
        links: body of each link.
        joints: joint of each driven joint.
    """

    ground: int
    boxes: Mapping[str, list[int]]
    links: Mapping[str, int]
    joints: Mapping[str, int]


@dataclass(frozen=True)
class Part:
    """The ground, a body or a link.

    Attributes:
        body: MuJoCo's number of what it is a part of; 0: the world.
        place, turn: of its frame in the world, (3,) [m] and (3, 3).
    """

    body: int
    geoms: list[int]
    place: FloatArray
    turn: FloatArray


class ReadBack(readback.ReadBack):
    """Reads the quantities of `parity.quantities` from a model and the state of `data`."""

    def __init__(self, simulator: Any, model: Any, data: Any, at: Numbers) -> None:
        self.model, self.at = model, at
        self.off = {name for name in _OFF if _flag(model.opt.disableflags, f"mjDSBL_{name}")}
        self.overridden = _flag(model.opt.enableflags, "mjENBL_OVERRIDE")
        held = not self.off & {"CONSTRAINT", "EQUALITY"}
        self.active = np.array(data.eq_active, dtype=bool) & held
        self.data = mujoco.MjData(model)  # of its own: what is read must not change the world
        self.data.qpos[:], self.data.qvel[:] = data.qpos, data.qvel
        mujoco.mj_kinematics(model, self.data)
        mujoco.mj_comPos(model, self.data)
        mujoco.mj_comVel(model, self.data)
        types, affinities, owners = model.geom_contype, model.geom_conaffinity, model.geom_bodyid
        ends = np.minimum.outer(owners, owners), np.maximum.outer(owners, owners)
        excluded = np.isin((ends[0] << 16) + ends[1], model.exclude_signature)
        masks = types[:, None] & affinities | affinities[:, None] & types
        self._collide = (masks != 0) & ~excluded
        a, b = model.pair_geom1, model.pair_geom2  # they collide whatever their masks
        self._collide[a, b] = self._collide[b, a] = True
        self._collide &= not self.off & {"CONTACT", "CONSTRAINT"}
        scene = simulator.scene
        super().__init__(
            simulator,
            Part(0, [at.ground] if at.ground >= 0 else [], np.zeros(3), np.eye(3)),
            {body.name: self._body(body) for body in scene.bodies},
            {name: self._link(body) for name, body in at.links.items()},
        )

    def world(self) -> dict[str, Any]:
        return {
            "gravity": np.zeros(3) if "GRAVITY" in self.off else self.model.opt.gravity,
            "timestep": self.model.opt.timestep,
            "ground/height": self.data.geom_xpos[self.at.ground, 2],
        }

    def closures(self) -> list[tuple[FloatArray, bool]]:
        return closed(self.model, self.active)

    def coupling(self, pair: Coupling) -> FloatArray:
        """Of an active constraint between both joints, else not a number."""
        model, joints = self.model, [self.at.joints[n] for n in (pair.follower, pair.leader)]
        for k in np.flatnonzero((model.eq_type == mujoco.mjtEq.mjEQ_JOINT) & self.active):
            offset, ratio, *higher = model.eq_data[k, :5]
            if [model.eq_obj1id[k], model.eq_obj2id[k]] == joints and not any(higher):
                return np.array([ratio, offset])
        return np.full(2, np.nan)

    def body(self, part: Part, name: str) -> dict[str, Any]:
        model, body = self.model, part.body
        light = model.body_mass[body] < heavy(self.scene)  # else it moves as prescribed
        found: dict[str, Any] = {"dynamic": float(light and self._can_move(body))}
        if model.body_dofnum[body] and light:
            found |= self.inertial(part) | {"velocity": self._velocity(body)}
            dof = model.body_dofadr[body] + np.arange(6)
            passive = np.ravel(model.dof_damping[dof])[:6]
            found["damping"] += [
                passive[:3].max() / max(model.body_mass[body], LEAST),
                passive[3:].max() / max(model.body_inertia[body].max(), LEAST),
            ]
        return found

    def _link(self, body: int) -> Part:
        geoms = np.flatnonzero(self.model.geom_bodyid == body).tolist()
        return Part(body, geoms, self.data.xpos[body], self.data.xmat[body].reshape(3, 3))

    def _body(self, body: Body) -> Part:
        """A fixed one may have no frame of its own: it is then where its first shape has it."""
        geoms = self.at.boxes[body.name]
        number = int(self.model.geom_bodyid[geoms[0]])
        if number == 0:
            place, turn = self._frame(geoms[0])
            first = body.parts[0].pose.inverse()
            return Part(0, geoms, place + turn @ first.position, turn @ first.rotation())
        return replace(self._link(number), geoms=geoms)

    def _frame(self, geom: int) -> tuple[FloatArray, FloatArray]:
        """Place and turn of a body's frame: its shape's, but for a mesh, whose corners MuJoCo moves
        to their centre and principal axes, and tells by how much."""
        model = self.model
        place, turn = self.data.geom_xpos[geom], self.data.geom_xmat[geom].reshape(3, 3)
        if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH:
            return place, turn
        mesh, own = model.geom_dataid[geom], np.empty(9)
        mujoco.mju_quat2Mat(own, model.mesh_quat[mesh])
        turn = turn @ own.reshape(3, 3).T
        return place - turn @ model.mesh_pos[mesh], turn

    def pose(self, part: Part) -> FloatArray:
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, part.turn.ravel())
        return np.concatenate([part.place, quaternion])

    def shapes(self, part: Part) -> Iterator[Outline]:
        for geom in part.geoms:
            place = part.turn.T @ (self.data.geom_xpos[geom] - part.place)
            turn = part.turn.T @ self.data.geom_xmat[geom].reshape(3, 3)
            yield self._shape(geom, Pose.from_array([*place, *quaternion_of(turn)]))

    def _shape(self, geom: int, pose: Pose) -> Outline:
        radius, half, _ = size = self.model.geom_size[geom]
        match mujoco.mjtGeom(self.model.geom_type[geom]).name:
            case "mjGEOM_BOX":
                return a_box(2 * size, pose)
            case "mjGEOM_SPHERE":
                return a_round(radius, 0.0, pose)
            case "mjGEOM_CAPSULE":
                return a_round(radius, 2 * half, pose)
            case "mjGEOM_CYLINDER":
                return a_cylinder(radius, 2 * half, pose)
            case "mjGEOM_MESH":
                mesh = self.model.geom_dataid[geom]
                first = self.model.mesh_vertadr[mesh]
                points = self.model.mesh_vert[first : first + self.model.mesh_vertnum[mesh]]
                return a_mesh(points.astype(float), pose)
        return "boxes", NO_REACH

    def surface(self, part: Part) -> dict[str, Any]:
        model, geoms = self.model, part.geoms
        return {
            "friction": self._friction(geoms),
            "restitution": self._restitution(geoms),
            "margin": one_value(
                model.opt.o_margin if self.overridden else model.geom_margin[geoms]
            ),
        }

    def inertial(self, part: Part) -> dict[str, Any]:
        model, body = self.model, part.body
        axes = part.turn.T @ self.data.ximat[body].reshape(3, 3)
        medium = model.opt.viscosity + model.opt.density + np.abs(model.opt.wind).sum()
        return {
            "mass": model.body_mass[body],
            "com": part.turn.T @ (self.data.xipos[body] - part.place),
            "inertia": axes @ np.diag(model.body_inertia[body]) @ axes.T,
            "damping": np.full(2, medium),
            "gravity": 1.0 - model.body_gravcomp[body],
        }

    def _velocity(self, body: int) -> FloatArray:
        """Of a body's centre of mass, then angular, in the world's axes, (6,)."""
        found = np.empty(6)
        kind = mujoco.mjtObj.mjOBJ_BODY
        mujoco.mj_objectVelocity(self.model, self.data, kind, body, found, 0)
        return np.roll(found, 3)

    def _friction(self, geoms: list[int]) -> Any:
        """Sliding friction of geoms, and of pairs with an own one that they are part of; or the one
        that overrides them all."""
        model = self.model
        if self.overridden:
            return one_value(model.opt.o_friction[:2])
        ends = zip(model.pair_geom1, model.pair_geom2, strict=True)
        own = [k for k, pair in enumerate(ends) if set(pair) & set(geoms)]
        return one_value([*model.geom_friction[geoms, 0], *model.pair_friction[own, :2].flat])

    def _restitution(self, geoms: list[int]) -> Any:
        """Speed after a bounce over that before it, of the contacts' springs and dampers.

        Not a number where others override them.
        """
        model, option = self.model, self.model.opt
        if self.overridden and not (
            np.array_equal(model.geom_solref[geoms], [option.o_solref] * len(geoms))
            and np.array_equal(model.geom_solimp[geoms], [option.o_solimp] * len(geoms))
        ):
            return np.nan
        return one_value([bounce(*model.geom_solref[geom]) for geom in geoms])

    def _can_move(self, body: int) -> bool:
        """Whether the body has six degrees of freedom and nothing holds it."""
        model = self.model
        welds = model.eq_type == mujoco.mjtEq.mjEQ_WELD
        held = (welds | (model.eq_type == mujoco.mjtEq.mjEQ_CONNECT)) & self.active
        ends = {*model.eq_obj1id[held], *model.eq_obj2id[held]}
        return bool(model.body_dofnum[body] == 6 and body not in ends)

    def collide(self, first: Part, second: Part) -> Any:
        return self._collide[first.geoms][:, second.geoms]

    def joint(self, name: str) -> dict[str, Any]:
        model, joint = self.model, self.at.joints[name]
        dof = model.jnt_dofadr[joint]
        slides = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE
        drive = int(np.flatnonzero(model.actuator_trnid[:, 0] == joint)[0])
        gear = model.actuator_gear[drive, 0]
        bias = model.actuator_biasprm[drive]
        held, pulled = -bias[1] * gear**2, model.actuator_gainprm[drive, 0] * gear
        limited = model.jnt_limited[joint] and not self.off & {"LIMIT", "CONSTRAINT"}
        limits = model.jnt_range[joint] if limited else [-np.inf, np.inf]
        drives = "ACTUATION" not in self.off
        ranges = [
            (model.actuator_forcerange[drive] * gear, model.actuator_forcelimited[drive]),
            (model.jnt_actfrcrange[joint], model.jnt_actfrclimited[joint]),
        ]
        ends = [abs(end) for range_, limited in ranges if limited for end in range_]
        spring = np.ravel(model.jnt_stiffness[joint])[0]
        rest = {"rest": model.qpos_spring[model.jnt_qposadr[joint]]} if spring else {}
        return rest | {
            "axis": subspace(model.jnt_axis[joint], model.jnt_pos[joint], slides=slides),
            "limits": limits,
            "effort_limit": one_value(ends or np.inf),
            "stiffness": spring + drives * one_value([held, held + (pulled - gain(held))]),
            "damping": np.ravel(model.dof_damping[dof])[0] - drives * bias[2] * gear**2,
            "friction": model.dof_frictionloss[dof],
            "armature": model.dof_armature[dof],
            "initial_position": self.data.qpos[model.jnt_qposadr[joint]],
        }


_OFF = ("GRAVITY", "CONTACT", "CONSTRAINT", "EQUALITY", "LIMIT", "ACTUATION")
"""What can be switched off as a whole, and is looked for."""


def _flag(flags: int, name: str) -> bool:
    """Whether one of MuJoCo's switches, on or off, is set."""
    kind = mujoco.mjtEnableBit if name.startswith("mjENBL") else mujoco.mjtDisableBit
    return bool(flags & getattr(kind, name))


def contact_forces(model: Any, data: Any, at: Numbers) -> Iterator[tuple[str, str, FloatArray]]:
    """Both names of each contact, and the wrench on the first about the world's origin."""
    names = {at.ground: "ground"} | {
        geom: f"body/{name}" for name, geoms in at.boxes.items() for geom in geoms
    }
    links = {body: f"link/{name}" for name, body in at.links.items()}
    local = np.empty(6)
    for k in range(data.ncon):
        contact = data.contact[k]
        first, second = (
            names.get(geom) or _link_of(links, model, int(model.geom_bodyid[geom]))
            for geom in (int(contact.geom1), int(contact.geom2))
        )
        mujoco.mj_contactForce(model, data, k, local)  # on the second, in the contact's frame
        frame = np.reshape(contact.frame, (3, 3))  # its axes are rows
        force, torque = local[:3] @ frame, local[3:] @ frame
        yield second, first, np.concatenate([force, torque + np.cross(contact.pos, force)])


def _link_of(links: Mapping[int, str], model: Any, body: int) -> str:
    """The link that a body is, or is fixed on; a further plane of a user's file is ground."""
    return links.get(body) or links.get(int(model.body_weldid[body]), "ground")


def joint_wrenches(model: Any, data: Any, at: Numbers) -> FloatArray:
    """Of the driven joints, on the links below about their origins, (n_joints, 6).

    MuJoCo tells accelerations without what its implicit integrators damp. Actuators, of which each
    driven joint has one, tell the velocities with which the last step began.
    """
    applied = data.xfrc_applied.copy()  # of which MuJoCo knows here, and not of gravcomp
    told, joints = data.qacc.copy(), list(at.joints.values())
    if model.opt.integrator != mujoco.mjtIntegrator.mjINT_RK4:
        dofs = model.jnt_dofadr[joints]
        gained = data.qvel[dofs] - data.actuator_velocity[: len(dofs)]
        data.qacc[dofs] = gained / model.opt.timestep
    lifted = (model.body_gravcomp * model.body_mass)[:, None] * model.opt.gravity
    data.xfrc_applied[:, :3] -= lifted
    mujoco.mj_rnePostConstraint(model, data)
    data.xfrc_applied[:], data.qacc[:] = applied, told
    bodies = model.jnt_bodyid[joints]
    torque, force = np.hsplit(data.cfrc_int[bodies], 2)
    centres = data.subtree_com[model.body_rootid[bodies]]  # which MuJoCo's torques are about
    return np.hstack([force, torque + np.cross(centres - data.xpos[bodies], force)])
