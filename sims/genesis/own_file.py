"""The profile `file`: what Genesis' importer makes of the scene's file, in the frames of the scene.

The importer has MuJoCo compile the file, and makes one entity of it: a link of each body, the
world's own too. It reads no options.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from pytest_simbench.description.urdf import Link
from pytest_simbench.scene import FloatArray, Pose, Scene
from pytest_simbench.simulator import Deviation, NotSupportedError, lazy_import

from ..mujoco.constraints import collide
from ..mujoco.own_file import FILE_MOVES, OwnFile, Told, compared, deviations, pairs
from .engine import array_of, contact_parameters, numbers, of_collider
from .readback import ReadBack

genesis = lazy_import("genesis")
mujoco = lazy_import("mujoco")

NOT_READ = (
    "Genesis' importer reads no options, so all are Genesis' own; of contacts no condim, priority, "
    "margin, pairs and no friction of spinning and rolling; no compensated gravity"
)

EXCUSED = {
    "body mass": "body/*/mass body/*/com body/*/inertia",
    "geom friction": "body/*/friction ground/friction",
    "geom solref, solimp": "body/*/restitution ground/restitution",
    "joint damping": "body/*/damping",
    "joint frictionloss": "body/*/damping",
    "collision": "body/*/touches ground/touches",
}
"""Quantities of the parity check that a difference excuses."""


@dataclass(frozen=True)
class Part:
    """A body of the scene: its link, its shapes, and the scene's frame of it in the link's."""

    link: Any
    geoms: list[int]
    frame: Pose

    def __getattr__(self, name: str) -> Any:
        return getattr(self.link, name)


class GenesisFile:
    """The imported file.

    Args:
        scene: as `OwnFile`.
        timestep: [s].

    Raises:
        NotSupportedError: as `OwnFile`, or the importer refuses the file or leaves out a part.
    """

    def __init__(self, scene: Scene, timestep: float, world: Any) -> None:
        self.scene, self.file = scene, OwnFile(scene, timestep)
        self.own = own = self.file.reading
        try:
            self.entity = world.add_entity(genesis.morphs.MJCF(file=scene.file))
            world.build()
        except (genesis.GenesisException, ValueError, RuntimeError) as error:
            reason = f"Genesis' importer refuses {scene.file}: {error}"
            raise NotSupportedError(reason) from None
        self.solver = world.rigid_solver
        self.links, geoms = list(self.entity.links), list(self.entity.geoms)
        bodies = [own.model.body(body).name for body in range(own.model.nbody)]
        self.solid = sorted(own.solid if own.ground is None else [*own.solid, own.ground])
        if [link.name for link in self.links] != bodies or len(geoms) != len(self.solid):
            raise NotSupportedError(
                f"Genesis' importer makes {len(self.links)} of {len(bodies)} bodies and "
                f"{len(geoms)} of {len(self.solid)} shapes of {scene.file}, or another order"
            )
        self.geoms = dict(zip(self.solid, (geom.idx for geom in geoms), strict=True))
        self.start = mujoco.MjData(own.model)
        mujoco.mj_kinematics(own.model, self.start)
        self.parts = {}
        for name, placed in self.file.placed.items():
            place = [*self.start.xpos[placed.root], *self.start.xquat[placed.root]]
            frame = self.pose(placed.root).inverse() * Pose.from_array(place) * placed.frame
            shapes = [self.geoms[geom] for geom in placed.geoms]
            self.parts[name] = Part(self.links[placed.root], shapes, frame)
        ground = [] if own.ground is None else [self.geoms[own.ground]]
        self.ground = Part(self.links[0], ground, Pose())
        self.free = [self.parts[body.name] for body in scene.free_bodies]
        held = [link.joint for link in own.links]
        self.held = own.model.jnt_dofadr[held], own.model.jnt_qposadr[held]
        self._told = tuple(self._differences())
        self._begin()

    def pose(self, link: int) -> Pose:
        place = numbers(self.solver.get_links_pos([link]))[0]
        turn = numbers(self.solver.get_links_quat([link]))[0]
        return Pose.from_array([*place, *turn / np.linalg.norm(turn)])

    def _begin(self) -> None:
        """Put bodies and joints where the scene has them."""
        q = numbers(self.solver.get_qpos())
        at = self.held[1]
        q[at] = self.file.data.qpos[at]
        speeds = np.zeros(self.solver.n_dofs)
        for body, part in zip(self.scene.free_bodies, self.free, strict=True):
            link = body.pose.translated(z=-self.own.lift) * part.frame.inverse()
            q[part.q_start : part.q_start + 7] = link.as_array()
            turn, spin = link.rotation(), np.asarray(body.angular_velocity)
            away = np.cross(spin, turn @ part.frame.position)
            speeds[part.dof_start : part.dof_end] = [*(body.linear_velocity - away), *turn.T @ spin]
        self.solver.set_qpos(q)
        self.solver.set_dofs_velocity(speeds)
        driven = np.flatnonzero(array_of(self.solver.dyn_info.dofs.act_bias)[:, 1]).tolist()
        if driven:  # which pull to nothing before they are told a target: 0, as in MuJoCo
            self.solver.control_dofs_position(np.zeros(len(driven)), driven)

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        """Raises `NotSupportedError`: the file's own actuators move its joints."""
        raise NotSupportedError(FILE_MOVES)

    def body_state(self) -> FloatArray:
        """As `Simulator.body_state`."""
        state = np.empty((len(self.free), 13))
        for row, part in zip(state, self.free, strict=True):
            link = self.pose(part.idx)
            row[:7] = (link * part.frame).translated(z=self.own.lift).as_array()
            row[10:] = numbers(self.solver.get_links_ang([part.idx]))[0]
            arm = link.rotation() @ part.frame.position
            row[7:10] = numbers(self.solver.get_links_vel([part.idx]))[0] + np.cross(row[10:], arm)
        return state

    def joint_state(self) -> FloatArray:
        """As `Simulator.joint_state`: from the posture in which the file is written."""
        dofs, at = self.held
        positions = numbers(self.solver.get_qpos())[at] - self.own.model.qpos0[at]
        return np.stack([positions, numbers(self.solver.get_dofs_velocity())[dofs]])

    def names(self) -> dict[int, str]:
        """What contacts tell, by the numbers of the shapes."""
        owners = {link.body: f"link/{link.name}" for link in self.own.links if link.whole}
        found = {self.geoms[g]: owners.get(self.own.root_of(g), "ground") for g in self.solid}
        for name, part in self.parts.items():
            found |= dict.fromkeys(part.geoms, f"body/{name}")
        return found

    def deviations(self) -> tuple[Deviation, ...]:
        """As `OwnFile`, and what the importer did not keep."""
        told = deviations("Genesis' importer", self._told, EXCUSED)
        return Deviation("", NOT_READ), *told, *self.file.deviations()

    def _differences(self) -> Iterator[Told]:
        """What the importer did not keep of a file, and the sentence about it."""
        own, model, solver, solid = self.own, self.own.model, self.solver, self.solid
        roots = [body for body in range(1, model.nbody) if model.body_dofnum[body]]
        bodies = [own.name("body", root) for root in roots]  # each with what is fixed on it
        of_root = np.array([model.body_weldid == root for root in roots]).reshape(-1, model.nbody)
        shapes = [own.name("geom", geom) for geom in solid]
        joints = [own.name("joint", int(joint)) for joint in model.dof_jntid]
        geoms, masses = self.entity.geoms, [float(link.get_mass()) for link in self.links]
        soft = np.hstack([model.geom_solref, model.geom_solimp])[solid]
        springs = np.reshape(model.jnt_stiffness, (model.njnt, -1))[:, 0]
        ask, both = pairs(own, solid)
        meet = collide(own, solid)[ask]
        for what, made, asked, names in (
            ("body mass", of_root @ masses, of_root @ model.body_mass, bodies),
            ("geom friction", [g.friction for g in geoms], model.geom_friction[solid, 0], shapes),
            ("geom solref, solimp", [contact_parameters(g) for g in geoms], soft, shapes),
            ("joint armature", solver.get_dofs_armature(), model.dof_armature, joints),
            ("joint damping", solver.get_dofs_damping(), model.dof_damping, joints),
            ("joint frictionloss", solver.get_dofs_frictionloss(), model.dof_frictionloss, joints),
            ("joint stiffness", solver.get_dofs_stiffness(), springs[model.dof_jntid], joints),
            ("collision", self._meet()[ask], meet, both),
        ):
            yield from compared(what, numbers(made), asked, names)

    def _meet(self) -> FloatArray:
        """1 for each two shapes that Genesis lets collide, else 0."""
        at = [self.geoms[geom] for geom in self.solid]
        table = array_of(of_collider(self.solver.collider, "collider_info").collision_pair_idx)
        return np.asarray(np.maximum(table, table.T)[np.ix_(at, at)] >= 0, dtype=float)


class FileReadBack(ReadBack):
    """Reads the quantities of a scene from its imported file; joints and links are not read."""

    def __init__(self, simulator: Any, imported: GenesisFile) -> None:
        super().__init__(simulator)
        self.imported, self.prepared = imported, None
        self.bodies, self.ground = imported.parts, imported.ground
        self.grounded = bool(self.ground.geoms)

    def height(self) -> float:
        return super().height() + self.imported.own.lift if self.grounded else np.nan

    def pose(self, part: Any) -> FloatArray:
        found = self.imported.pose(part.idx) * part.frame
        return found.translated(z=self.imported.own.lift).as_array()

    def shape_pose(self, part: Any, shape: int) -> Pose:
        place = numbers(self.solver.get_geoms_pos([shape]))[0]
        turn = numbers(self.solver.get_geoms_quat([shape]))[0]
        body = self.imported.pose(part.idx) * part.frame
        return body.inverse() * Pose.from_array([*place, *turn / np.linalg.norm(turn)])

    def inertial(self, part: Any) -> dict[str, Any]:
        """Of the link and all that is fixed on it."""
        own, body = self.imported.own, self.imported.pose(part.idx) * part.frame
        whole = Link("")
        for link in (k for k in range(own.model.nbody) if own.root(k) == part.idx):
            of = super().inertial(self.imported.links[link])
            single = Link("", float(of["mass"]), of["com"], of["inertia"])
            whole.absorb(single, body.inverse() * self.imported.pose(link))
        found = {"mass": whole.mass, "com": whole.centre, "inertia": whole.inertia}
        return super().inertial(part) | found

    def _velocity(self, link: Any) -> FloatArray:
        row = next(k for k, part in enumerate(self.imported.free) if part.idx == link.idx)
        return np.asarray(self.imported.body_state()[row, 7:])

    def _shapes(self, part: Any) -> list[int]:
        return list(part.geoms)
