"""The profile `file`: MuJoCo's own model of the scene's file, told in the frames of the scene, and
what another engine's importer did not keep of a file, held against that model."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pytest_simbench.description.carried import CARRIED, named
from pytest_simbench.scene import Body, Compound, FloatArray, Pose, Scene
from pytest_simbench.scene.overlap import rotations
from pytest_simbench.scene.pose import quaternion_product
from pytest_simbench.simulator import Deviation, NotSupportedError, lazy_import

from .account import values_of
from .readback import Numbers, Part, ReadBack, contact_forces
from .reading import Reading

mujoco = lazy_import("mujoco")

EXCUSED = {
    "geom plane": "ground/* body/*/touches",
    "geom friction (sliding)": "body/*/friction",
    "geom solref": "body/*/restitution ground/restitution",
    "geom margin": "body/*/margin",
    "geom mesh (hull)": "body/*/meshes",
    "geom contype, conaffinity (of single shapes)": "body/*/touches",
    "pair": "body/*/friction ground/friction",
    "body gravcomp (of parts)": "body/*/gravity",
    "joint damping (free)": "body/*/damping",
    "option density": "body/*/damping",
    "option viscosity": "body/*/damping",
    "option wind": "body/*/damping",
    "option disableflags": "body/*/touches",
}
"""Quantities in which the file may differ from its scene, by those of the account."""

FILE_MOVES = (
    "in the profile `file` the file's own actuators move its joints; choose another profile for "
    "motions"
)

OF_JOINTS = "joint/* link/* gripper/* closure/* coupling/* body/*/touches ground/touches"
"""Quantities of joints and links, which are not read back of a file."""


def loaded(simulator: Any, own: Any, methods: str = "contact_forces numbers") -> None:
    """Have an adapter's instance tell and command what its file's world has: with these methods of
    `own` for its own ones, and facts of this world alone."""
    info = type(simulator).info
    vars(simulator)["info"] = replace(info, deviations=(*info.deviations, *own.deviations()))
    for name in ("command", "body_state", "joint_state", *methods.split()):
        vars(simulator)[name] = getattr(own, name)


class OwnFile:
    """The model of a scene's file, with the scene's bodies at their places.

    Args:
        scene: that was read from a file, its bodies perhaps moved.
        timestep: that replaces the file's [s].

    Raises:
        NotSupportedError: the scene is of no file, or has other bodies than its file.
        DescriptionError: as `Reading`.
    """

    def __init__(self, scene: Scene, timestep: float) -> None:
        if not scene.file or scene.file.lower().endswith(".urdf"):
            raise NotSupportedError(
                f"scene {scene.name!r} was read from no MJCF file, which the profile `file` loads; "
                "choose another profile"
            )
        self.reading = reading = self.read(scene.file)
        names = {body.name for body in scene.bodies}
        fixed = {body.name: body.fixed for body in scene.bodies}
        own = {body.name: body.fixed for body in reading.scene.bodies}
        joints = [s.robot.joint_names if s.robot else () for s in (scene, reading.scene)]
        if fixed != own or joints[0] != joints[1]:
            raise NotSupportedError(
                f"scene {scene.name!r} has other bodies than its file {scene.file}, which the "
                "profile `file` loads; choose another profile"
            )
        self.model, self.data = reading.model, reading.data
        self.model.opt.timestep = timestep
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        self.placed = {p.body.name: p for p in reading.placed if p.body.name in names}
        for body in scene.free_bodies:
            if isinstance(body, Compound):  # the frame of the release that read the file
                frame = body.file_frame.inverse()
                self.placed[body.name] = replace(self.placed[body.name], frame=frame)
        free = [self.placed[body.name] for body in scene.free_bodies]
        self.roots = np.array([p.root for p in free], dtype=int)
        for body, placed in zip(scene.free_bodies, free, strict=True):
            if body.wrenches:  # one of them is what the file compensates of the body's gravity
                parts = [b for b in range(self.model.nbody) if reading.root(b) == placed.root]
                self.model.body_gravcomp[parts] = 0.0
        flying = self.model.body_jntadr[self.roots]
        self._q = self.model.jnt_qposadr[flying][:, None] + np.arange(7)
        self._v = self.model.jnt_dofadr[flying][:, None] + np.arange(3)
        held = np.array([link.joint for link in reading.links], dtype=int)
        self._joint_q, self._joint_v = self.model.jnt_qposadr[held], self.model.jnt_dofadr[held]
        self._centres = np.array([p.frame.position for p in free]).reshape(-1, 3)
        self._turns = [p.frame.quaternion for p in free]
        self._drives = [(k, d) for k, d in enumerate(reading.tree.drives) if d.stiffness]
        if scene.robot is not None:  # as written, or at the end of a range that begins elsewhere
            zero = self.model.qpos0[self._joint_q]
            self.data.qpos[self._joint_q] = zero + scene.robot.column("initial_position")
        for k, (body, placed) in enumerate(zip(scene.free_bodies, free, strict=True)):
            root = body.pose.translated(z=-reading.lift) * placed.frame.inverse()
            self.data.qpos[self._q[k]] = root.as_array()
            turn, spin = root.rotation(), np.asarray(body.angular_velocity)
            away = np.cross(spin, turn @ self._centres[k])
            self.data.qvel[self._v[k]] = body.linear_velocity - away
            self.data.qvel[self._v[k] + 3] = turn.T @ spin
        mujoco.mj_forward(self.model, self.data)

    def read(self, path: str) -> Reading:
        """The file, read of the model that is stepped."""
        return Reading(path)

    def deviations(self) -> tuple[Deviation, ...]:
        """In what the file may differ from the scene, as the account has it."""
        lines = [line for line in self.reading.account if line.state != CARRIED]
        steps = self.reading.scene.file_timestep, float(self.model.opt.timestep)
        told = "the file asks for steps of {:g} s, and these are of {:g} s".format(*steps)
        other = [Deviation("", told, only="file")] if steps[0] != steps[1] else []
        if self.reading.links:
            other.append(Deviation(OF_JOINTS, "joints, links and drives are the file's own"))
        held = {k for k, _ in self._drives}
        if free := [link.told for k, link in enumerate(self.reading.links) if k not in held]:
            told = f"no command reaches joints without a position actuator: {named(free)}"
            other.append(Deviation("", told))
        return *other, *(
            Deviation(EXCUSED[line.quantity], f"as the file has it: {line.reason}", only="file")
            for line in lines
            if line.quantity in EXCUSED
        )

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        """As `Simulator.command`, by the file's own actuators."""
        for k, drive in self._drives:
            lead = (drive.damping * velocity[k] + effort[k]) / drive.stiffness
            self.data.ctrl[drive.channels] = drive.controls(position[k] + lead)

    def joint_state(self) -> FloatArray:
        """As `Simulator.joint_state`: from the posture in which the file is written."""
        positions = self.data.qpos[self._joint_q] - self.model.qpos0[self._joint_q]
        return np.stack([positions, self.data.qvel[self._joint_v]])

    def body_state(self) -> FloatArray:
        """As `Simulator.body_state`."""
        state = np.empty((len(self.roots), 13))
        root = self.data.qpos[self._q]
        turns = rotations(root[:, 3:])
        arms = np.einsum("nij,nj->ni", turns, self._centres)
        state[:, :3] = root[:, :3] + arms
        state[:, 2] += self.reading.lift
        for row, quaternion, own in zip(state, root[:, 3:], self._turns, strict=True):
            row[3:7] = quaternion_product(quaternion, own)
        spins = np.einsum("nij,nj->ni", turns, self.data.qvel[self._v + 3])
        state[:, 7:10] = self.data.qvel[self._v] + np.cross(spins, arms)
        state[:, 10:] = spins
        return state

    def numbers(self) -> Numbers:
        ground = self.reading.ground
        boxes = {name: p.geoms for name, p in self.placed.items()}
        links = {link.name: link.body for link in self.reading.links if link.whole}
        return Numbers(-1 if ground is None else ground, boxes, links, {})

    def contact_forces(self) -> Iterator[tuple[str, str, FloatArray]]:
        """As `Simulator.contact_forces`; about the scene's origin."""
        arm = np.array([0.0, 0.0, self.reading.lift])
        for first, second, wrench in contact_forces(self.model, self.data, self.numbers()):
            yield first, second, wrench + np.concatenate([np.zeros(3), np.cross(arm, wrench[:3])])


class FileReadBack(ReadBack):
    """Reads the quantities of a scene from its file's model."""

    def __init__(self, simulator: Any, own: OwnFile) -> None:
        self.own = own
        super().__init__(simulator, own.model, own.data, own.numbers())
        self.prepared = None  # joints and links are not read back
        self.grounded = own.reading.ground is not None

    def world(self) -> dict[str, Any]:
        found = super().world()
        found["ground/height"] += self.own.reading.lift
        return found

    def pose(self, part: Part) -> FloatArray:
        found = super().pose(part)
        found[2] += self.own.reading.lift
        return found

    def _body(self, body: Body) -> Part:
        placed = self.own.placed[body.name]
        root = Pose.from_array([*self.data.xpos[placed.root], *self.data.xquat[placed.root]])
        frame = root * placed.frame
        place = np.asarray(frame.position)
        return Part(placed.root, self.at.boxes[body.name], place, frame.rotation())

    def inertial(self, part: Part) -> dict[str, Any]:
        """Of the body and all that is fixed on it."""
        mass, centre, tensor = self.own.reading.inertial(part.body)
        axes = part.turn.T @ self.data.xmat[part.body].reshape(3, 3)
        away = self.data.xpos[part.body] - part.place
        return super().inertial(part) | {
            "mass": mass,
            "com": axes @ centre + part.turn.T @ away,
            "inertia": axes @ tensor @ axes.T,
        }


Told = tuple[str, str]
"""What was not kept, and the sentence about it."""

CLOSE = 2e-5
"""Share, and of places [m], by which values may differ: both engines have single precision."""


def compared(
    what: str, made: Any, asked: Any, names: Iterable[str], close: float = 0.0
) -> Iterator[Told]:
    """What is told where rows differ by more than a share, and `close` beside it."""
    made, asked = (np.atleast_2d(np.transpose(values)).T for values in (made, asked))
    rows: Any = ~np.isclose(made, asked, rtol=CLOSE, atol=close, equal_nan=True).all(axis=1)
    if rows.any():
        where = dict.fromkeys(name for name, differs in zip(names, rows, strict=True) if differs)
        values = f"{values_of(made[rows])}, in the file {values_of(asked[rows])}"
        yield what, f"{what} is {values} ({named(where)})"


def deviations(who: str, told: Iterable[Told], excused: Mapping[str, str]) -> Iterator[Deviation]:
    """A sentence each, and one for the quantities of the parity check that differ with them."""
    patterns = []
    for what, sentence in told:
        yield Deviation("", f"{who}: {sentence}")
        patterns += [excused[what]] if what in excused else []
    if patterns:
        yield Deviation(" ".join(patterns), f"as {who} has it")


def pairs(own: Reading, solid: list[int]) -> tuple[Any, list[str]]:
    """Which two of these shapes are asked about, as one of them moves; names of their bodies."""
    still = np.array([not own.root_of(geom) for geom in solid], dtype=bool)
    ask = np.triu(np.ones((len(still),) * 2, dtype=bool)) & ~np.outer(still, still)
    owners = [own.name("body", int(own.model.geom_bodyid[geom])) for geom in solid]
    return ask, [f"{owners[a]} and {owners[b]}" for a, b in np.argwhere(ask)]
