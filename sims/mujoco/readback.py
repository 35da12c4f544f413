"""What MuJoCo says that it built, for the parity check, and the forces of its contacts and joints;
MuJoCo's adapter and Newton's share it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pytest_simbench.description.shapes import (
    box_corners,
    cylinder_reach,
    outlines,
    reach,
    round_reach,
)
from pytest_simbench.parity import readback
from pytest_simbench.parity.readback import one_value
from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.simulator import heavy, lazy_import

from .bounces import bounce
from .world import closed

mujoco = lazy_import("mujoco")


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


class ReadBack(readback.ReadBack):
    """Reads the quantities of `parity.quantities` from a model and the state of `data`."""

    def __init__(self, simulator: Any, model: Any, data: Any, at: Numbers) -> None:
        super().__init__(simulator)
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

    def world(self) -> dict[str, Any]:
        ground = self.at.ground
        return {
            "gravity": np.zeros(3) if "GRAVITY" in self.off else self.model.opt.gravity,
            "timestep": self.model.opt.timestep,
            "ground/height": self.data.geom_xpos[ground, 2],
            "ground/friction": self._friction([ground]),
            "ground/restitution": self._restitution([ground]),
        }

    def closures(self) -> list[FloatArray]:
        return closed(self.model, self.active)

    def coupled(self, pairs: tuple[tuple[str, str], ...]) -> bool:
        return all(map(self._coupled, pairs))

    def body(self, prefix: str, name: str) -> dict[str, Any]:
        model, geoms = self.model, self.at.boxes[name]
        body, place, turn = self._placed(name)
        light = self.model.body_mass[body] < heavy(self.scene)  # else it moves as prescribed
        free = light and self._can_move(body)
        found = self._surface(prefix, geoms, place, turn)
        found[f"{prefix}/dynamic"] = float(free)
        if model.body_dofnum[body] and light:
            found |= self._inertial(prefix, body, place, turn)
            found[f"{prefix}/velocity"] = self._velocity(body)
            dof = model.body_dofadr[body] + np.arange(6)
            passive = np.ravel(model.dof_damping[dof])[:6]
            found[f"{prefix}/damping"] += [
                passive[:3].max() / model.body_mass[body],
                passive[3:].max() / model.body_inertia[body].max(),
            ]
        return found

    def _placed(self, name: str) -> tuple[int, FloatArray, FloatArray]:
        """Number, place and turn of a scene's body. A fixed one may have none of its own: its frame
        is then its shape's."""
        geom = self.at.boxes[name][0]
        body = int(self.model.geom_bodyid[geom])
        if body == 0:
            place, turn = self._frame(geom)
            first = self.scene.body(name).parts[0].pose.inverse()
            return body, place + turn @ first.position, turn @ first.rotation()
        return body, self.data.xpos[body], self.data.xmat[body].reshape(3, 3)

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

    def link(self, prefix: str, name: str) -> dict[str, Any]:
        body = self.at.links[name]
        place, turn = self.data.xpos[body], self.data.xmat[body].reshape(3, 3)
        geoms = np.flatnonzero(self.model.geom_bodyid == body).tolist()
        found = self._surface(prefix, geoms, place, turn)
        if self.model.body_dofnum[body]:
            found |= self._inertial(prefix, body, place, turn)
        return found

    def _surface(
        self, prefix: str, geoms: list[int], place: FloatArray, turn: FloatArray
    ) -> dict[str, Any]:
        """Pose, shapes and surface of what `geoms` belong to, whose frame is at place and turn."""
        model, quaternion = self.model, np.empty(4)
        mujoco.mju_mat2Quat(quaternion, turn.ravel())
        found: dict[str, Any] = {f"{prefix}/pose": np.concatenate([place, quaternion])}
        kinds: tuple[list[FloatArray], ...] = ([], [], [])
        for geom in geoms:
            kind = mujoco.mjtGeom(model.geom_type[geom])
            if kind.name[len("mjGEOM_") :] in _ROUND:
                kinds[2].append(self._round(geom, place, turn))
            else:
                mesh = kind == mujoco.mjtGeom.mjGEOM_MESH
                kinds[int(mesh)].append(reach((self._corners(geom) - place) @ turn))
        found |= outlines(prefix, *kinds)
        if geoms:
            found[f"{prefix}/friction"] = self._friction(geoms)
            found[f"{prefix}/restitution"] = self._restitution(geoms)
            margins = model.opt.o_margin if self.overridden else model.geom_margin[geoms]
            found[f"{prefix}/margin"] = one_value(margins)
        return found

    def _round(self, geom: int, place: FloatArray, turn: FloatArray) -> FloatArray:
        """The reach of a sphere, cylinder or capsule in the frame at place and turn."""
        model, quaternion = self.model, np.empty(4)
        mujoco.mju_mat2Quat(quaternion, (turn.T @ self.data.geom_xmat[geom].reshape(3, 3)).ravel())
        centre = turn.T @ (self.data.geom_xpos[geom] - place)
        pose, (radius, half, _) = Pose.from_array([*centre, *quaternion]), model.geom_size[geom]
        kind = model.geom_type[geom]
        if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
            return cylinder_reach(radius, 2 * half, pose)
        return round_reach(radius, 2 * half * (kind == mujoco.mjtGeom.mjGEOM_CAPSULE), pose)

    def _corners(self, geom: int) -> FloatArray:
        """Corners of a box or a mesh in the world, (n, 3)."""
        model = self.model
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.geom_dataid[geom]
            first = model.mesh_vertadr[mesh]
            points = model.mesh_vert[first : first + model.mesh_vertnum[mesh]].astype(float)
        elif model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX:
            points = box_corners(2 * model.geom_size[geom])
        else:
            points = np.full((1, 3), np.nan)  # no scene has such a shape
        return points @ self.data.geom_xmat[geom].reshape(3, 3).T + self.data.geom_xpos[geom]

    def _inertial(
        self, prefix: str, body: int, place: FloatArray, turn: FloatArray
    ) -> dict[str, Any]:
        model = self.model
        axes = turn.T @ self.data.ximat[body].reshape(3, 3)
        medium = model.opt.viscosity + model.opt.density + np.abs(model.opt.wind).sum()
        return {
            f"{prefix}/mass": model.body_mass[body],
            f"{prefix}/com": turn.T @ (self.data.xipos[body] - place),
            f"{prefix}/inertia": axes @ np.diag(model.body_inertia[body]) @ axes.T,
            f"{prefix}/damping": np.full(2, medium),
            f"{prefix}/gravity": 1.0 - model.body_gravcomp[body],
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
        pairs = np.isin(model.pair_geom1, geoms) | np.isin(model.pair_geom2, geoms)
        own = model.pair_friction[pairs, :2].ravel()
        return one_value(np.concatenate([model.geom_friction[geoms, 0], own]))

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
        holding = [mujoco.mjtEq.mjEQ_WELD, mujoco.mjtEq.mjEQ_CONNECT]
        held = np.isin(model.eq_type, holding) & self.active
        ends = {*model.eq_obj1id[held], *model.eq_obj2id[held]}
        return bool(model.body_dofnum[body] == 6 and body not in ends)

    def can_touch(self, a: str, b: str) -> bool:
        """Of two links whether any shapes can, which none shall; else whether all can."""
        model = self.model
        first, second = self._geoms(a), self._geoms(b)
        if not (first and second):
            return False
        kinds = model.geom_contype[first][:, None] & model.geom_conaffinity[second]
        kinds |= model.geom_conaffinity[first][:, None] & model.geom_contype[second]
        low, high = sorted(int(model.geom_bodyid[geoms[0]]) for geoms in (first, second))
        excluded = (low << 16) + high in model.exclude_signature
        if excluded or self.off & {"CONTACT", "CONSTRAINT"}:
            return False
        links = a.startswith("link/") and b.startswith("link/")
        return bool(kinds.any() if links else kinds.all())

    def _geoms(self, name: str) -> list[int]:
        kind, _, rest = name.partition("/")
        if kind == "ground":
            return [self.at.ground]
        if kind == "body":
            return self.at.boxes[rest]
        return np.flatnonzero(self.model.geom_bodyid == self.at.links[rest]).tolist()

    def joint(self, prefix: str, name: str) -> dict[str, Any]:
        model, joint = self.model, self.at.joints[name]
        dof = model.jnt_dofadr[joint]
        axis, still = model.jnt_axis[joint], np.zeros(3)
        turning = [axis, np.cross(model.jnt_pos[joint], axis)]
        slides = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE
        drive = int(np.flatnonzero(model.actuator_trnid[:, 0] == joint)[0])
        gear = model.actuator_gear[drive, 0]
        gain, bias = model.actuator_gainprm[drive], model.actuator_biasprm[drive]
        limited = model.jnt_limited[joint] and not self.off & {"LIMIT", "CONSTRAINT"}
        limits = model.jnt_range[joint] if limited else [-np.inf, np.inf]
        drives = "ACTUATION" not in self.off
        ranges = [
            (model.actuator_forcerange[drive] * gear, model.actuator_forcelimited[drive]),
            (model.jnt_actfrcrange[joint], model.jnt_actfrclimited[joint]),
        ]
        ends = [abs(end) for range_, limited in ranges if limited for end in range_]
        spring = np.ravel(model.jnt_stiffness[joint])[0]
        return {
            f"{prefix}/axis": np.concatenate([still, axis] if slides else turning),
            f"{prefix}/limits": limits,
            f"{prefix}/effort_limit": one_value(ends or np.inf),
            f"{prefix}/stiffness": spring
            + drives * one_value([gain[0] * gear, -bias[1] * gear**2]),
            f"{prefix}/damping": np.ravel(model.dof_damping[dof])[0] - drives * bias[2] * gear**2,
            f"{prefix}/friction": model.dof_frictionloss[dof],
            f"{prefix}/armature": model.dof_armature[dof],
            f"{prefix}/initial_position": self.data.qpos[model.jnt_qposadr[joint]],
        }

    def _coupled(self, fingers: tuple[str, str]) -> bool:
        """Whether an active constraint holds two fingers at equal positions."""
        model, joints = self.model, {self.at.joints[name] for name in fingers}
        return any(
            {a, b} == joints
            and kind == mujoco.mjtEq.mjEQ_JOINT
            and active
            and list(data[:5]) == [0, 1, 0, 0, 0]
            for a, b, kind, active, data in zip(
                model.eq_obj1id,
                model.eq_obj2id,
                model.eq_type,
                self.active,
                model.eq_data,
                strict=True,
            )
        )


_OFF = ("GRAVITY", "CONTACT", "CONSTRAINT", "EQUALITY", "LIMIT", "ACTUATION")
"""What can be switched off as a whole, and is looked for."""

_ROUND = ("SPHERE", "CYLINDER", "CAPSULE")


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
            names.get(geom) or links[int(model.geom_bodyid[geom])]
            for geom in (int(contact.geom1), int(contact.geom2))
        )
        mujoco.mj_contactForce(model, data, k, local)  # on the second, in the contact's frame
        frame = np.reshape(contact.frame, (3, 3))  # its axes are rows
        force, torque = local[:3] @ frame, local[3:] @ frame
        yield second, first, np.concatenate([force, torque + np.cross(contact.pos, force)])


def joint_wrenches(model: Any, data: Any, at: Numbers) -> FloatArray:
    """Of the driven joints, on the links below about their origins, (n_joints, 6)."""
    mujoco.mj_rnePostConstraint(model, data)
    bodies = model.jnt_bodyid[list(at.joints.values())]
    torque, force = np.hsplit(data.cfrc_int[bodies], 2)
    centres = data.subtree_com[model.body_rootid[bodies]]  # which MuJoCo's torques are about
    return np.hstack([force, torque + np.cross(centres - data.xpos[bodies], force)])
