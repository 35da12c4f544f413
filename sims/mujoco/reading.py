"""A file of MuJoCo's own format as a scene, and the account of what was carried of it.

MuJoCo compiles the file; all is read from the compiled model, so defaults, classes, frames and
includes mean what MuJoCo means.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.description.carried import APPROXIMATED, CARRIED, NOT_CARRIED, Carried, named
from pytest_simbench.description.urdf import ROOT
from pytest_simbench.scene import Body, Compound, FloatArray, Pose, Scene, SceneError, Start, Wrench
from pytest_simbench.scene.checks import FORBIDDEN, RESERVED
from pytest_simbench.scene.pose import principal_axes, quaternion_of, vector3
from pytest_simbench.scene.scene import ROOM
from pytest_simbench.simulator import DescriptionError, lazy_import

from .account import tell_the_rest, values_of
from .articulated import MOUNT, OnJoint, Tree, on_joints
from .constraints import apart
from .shapes import shape_of

mujoco = lazy_import("mujoco")

CLOSE = 1e-6
"""Share by which a body's centre and moments may be off those of its one shape."""

MOST_SHAPES = 5000
"""Of a scene that collide: each is held against each, which takes half a minute and 1 GB."""


@dataclass(frozen=True)
class Placed:
    """Where a body of the scene is in the model.

    Attributes:
        body: of the scene.
        root: number of the model's body that moves it; 0: the world.
        frame: the scene's frame of the body in that of `root`.
    """

    body: Body
    root: int
    geoms: list[int]
    frame: Pose


class Reading:
    """A file that was read.

    Args:
        spec: what the file says; None: it is read.

    Attributes:
        solid, seen: numbers of the shapes that collide, but for planes; of those that cannot.
        ground: number of the plane that is the ground; None: the file has none.
        falls: whether gravity acts.
        soft: numbers of the bodies that are points of what is soft, and nothing else.
        lift: height by which the scene is moved up [m].

    Raises:
        DescriptionError: one sentence.
    """

    def __init__(self, path: str, spec: Any = None) -> None:
        self.path = path
        self._told: dict[tuple[str, str, str], list[str]] = {}
        try:
            self.model = model = (spec or mujoco.MjSpec.from_file(path)).compile()
        except (ValueError, RuntimeError, OSError) as error:
            raise DescriptionError(f"{path}: {' '.join(str(error).split())}") from None
        self.data = data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        self._names: dict[str, int] = {ROOT: 0, MOUNT: 0}
        off = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
        self.falls = bool(model.opt.gravity.any() and not off)
        masks = model.geom_contype | model.geom_conaffinity
        masks[[*model.pair_geom1, *model.pair_geom2]] = 1  # whatever their masks, pairs collide
        self.solid, self.seen = (np.flatnonzero(found).tolist() for found in (masks, masks == 0))
        if len(self.solid) > MOST_SHAPES:
            told = f"{len(self.solid)} shapes collide, and {MOST_SHAPES} can; leave out some"
            raise self.refuse(told)
        of_flex = {
            int(body) for of in ("vert", "node") for body in getattr(model, f"flex_{of}bodyid", ())
        }
        parents = set(model.body_parentid.tolist())
        self.soft = {b for b in of_flex - parents if b > 0 and not model.body_geomnum[b]}
        self.ground = self._find_ground()
        self.links = on_joints(self)
        try:
            placed = [self._placed(*group) for group in self._groups()]
            self._place(placed)
        except SceneError as error:
            raise DescriptionError(f"{path}: {error}") from None
        tell_the_rest(self)

    def tell(self, quantity: str, state: str, reason: str, where: Iterable[str] = ()) -> None:
        """What became of a quantity; what is told of several elements in the same words is one."""
        self._told.setdefault((quantity, state, reason), []).extend(where)

    @property
    def account(self) -> list[Carried]:
        """What was carried."""
        return [Carried(*line, named(where)) for line, where in self._told.items()]

    def refuse(self, why: str) -> DescriptionError:
        return DescriptionError(f"{self.path}: {why}")

    def name(self, kind: str, number: int) -> str:
        which = getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}")
        return mujoco.mj_id2name(self.model, which, number) or f"{kind} {number}"

    # What there is

    def root_of(self, geom: int) -> int:
        """The moving body that a shape is a part of; 0: none."""
        return self.root(int(self.model.geom_bodyid[geom]))

    def root(self, body: int) -> int:
        """The moving body that a body is a part of; 0: none, it is fixed."""
        root = int(self.model.body_weldid[body])
        return root if self.model.body_dofnum[root] else 0

    def geoms_of(self, link: OnJoint) -> list[int]:
        """The shapes of a link that collide."""
        return [geom for geom in self.solid if self.root_of(geom) == link.body]

    def _find_ground(self) -> int | None:
        planes = [g for g in self.solid if self.model.geom_type[g] == mujoco.mjtGeom.mjGEOM_PLANE]
        for plane in planes:
            if self.data.geom_xmat[plane].reshape(3, 3)[2, 2] < 1 - CLOSE**2:
                raise self.refuse(
                    f"the plane {self.name('geom', plane)} is not level, and a scene has one level "
                    "ground; make it a box"
                )
        planes.sort(key=lambda plane: self.data.geom_xpos[plane, 2])
        self.solid = [geom for geom in self.solid if geom not in planes]
        if len(planes) > 1:
            lower = (self.name("geom", plane) for plane in planes[:-1])
            self.tell("geom plane", NOT_CARRIED, "only the highest is the ground", lower)
        return planes[-1] if planes else None

    def _groups(self) -> list[tuple[str, int, list[int]]]:
        """Name, root and shapes of each body; of the world's own shapes each is a body."""
        model = self.model
        found: dict[tuple[int, int], list[int]] = {}
        on_joints = {link.body for link in self.links}
        for geom in self.solid:
            body = int(model.geom_bodyid[geom])
            root = self.root(body)
            if root in on_joints:
                continue
            key = (root, root or body) if body else (0, -1 - geom)
            found.setdefault(key, []).append(geom)
        roots = {b for b in range(1, model.nbody) if self.root(b) == b} - on_joints - self.soft
        empty = sorted(b for b in roots if (b, b) not in found)
        if empty:
            names = named(self.name("body", body) for body in empty)
            raise self.refuse(f"free bodies have no shape that collides: {names}")
        return [
            (self.own_name("body", key) if key > 0 else self.own_name("geom", -1 - key), root, g)
            for (root, key), g in found.items()
        ]

    def own_name(self, kind: str, number: int, taken: dict[str, int] | None = None) -> str:
        """Its name in the file, without what a scene's names must not have, and none of those that
        are taken; None: by bodies and links."""
        taken = self._names if taken is None else taken
        told = self.name(kind, number)
        name = "".join("_" if c in FORBIDDEN or not c.isprintable() else c for c in told)
        name = name.strip(" .")[:90] or kind
        if name.lower() in RESERVED or name in taken:
            name = f"{name} {kind} {number}"
        taken[name] = number
        if name != told:
            self.tell(f"{kind} name", APPROXIMATED, f"it is {name!r} in the scene", [told])
        return name

    # Bodies

    def pose(self, body: int, data: Any = None) -> Pose:
        """Of a body in the file's world; by other data, where the joints stand elsewhere."""
        data = data or self.data
        return _pose(data.xpos[body], data.xquat[body])

    def geom_pose(self, geom: int) -> Pose:
        """Of a shape in the file's world."""
        return _pose(self.data.geom_xpos[geom], _quaternion(self.data.geom_xmat[geom]))

    def site_pose(self, site: int, data: Any) -> Pose:
        """The same of a site."""
        return _pose(data.site_xpos[site], _quaternion(data.site_xmat[site]))

    def _placed(self, name: str, root: int, geoms: list[int]) -> Placed:
        model = self.model
        base = self.pose(root)
        friction = float(model.geom_friction[geoms, 0].max())
        if model.geom_friction[geoms, 0].min() < friction:
            self.tell(
                "geom friction (sliding)",
                APPROXIMATED,
                "a body has one friction: the largest of "
                f"{values_of(model.geom_friction[geoms, 0])}",
                [name],
            )
        shapes = []
        for k, geom in enumerate(geoms):
            place = base.inverse() * self.geom_pose(geom)
            shape, own = shape_of(self, geom, str(k), friction)
            shapes.append(shape.moved_to(place * own))
        if not root:
            if len(shapes) == 1:
                return Placed(shapes[0].changed(name=name), 0, geoms, shapes[0].pose)
            whole = Compound(name, tuple(shapes), Pose(), friction=friction)
            return Placed(whole, 0, geoms, Pose())
        mass, centre, tensor = self.inertial(root)
        if len(shapes) == 1:
            axes = shapes[0].pose.rotation()
            turned = axes.T @ tensor @ axes
            off = np.linalg.norm(centre - shapes[0].pose.position)
            aside = np.abs(turned - np.diag(np.diag(turned))).max()
            even = off < CLOSE * max(shapes[0].extents) and aside < CLOSE * np.trace(turned)
            if even and np.allclose(shapes[0].pose.as_array(), Pose().as_array(), atol=CLOSE):
                body = shapes[0].changed(name=name, mass=mass)
                if not np.allclose(np.diag(turned), body.even_inertia(), rtol=CLOSE, atol=0):
                    body = body.changed(moments=vector3(np.diag(turned)))
                body = self._borne(self._damped(body, root, centre), root)
                return Placed(body, root, geoms, shapes[0].pose)
        moments, axes = principal_axes(tensor)
        frame = _pose(centre, quaternion_of(axes))
        inverse = frame.inverse()
        body = Compound(
            name,
            tuple(shape.moved_to(inverse * shape.pose) for shape in shapes),
            Pose(),
            mass=mass,
            friction=friction,
            moments=vector3(moments),
            file_frame=inverse,
        )
        body = self._borne(self._damped(body, root, centre), root)
        return Placed(body, root, geoms, frame)

    def inertial(self, root: int) -> tuple[float, FloatArray, FloatArray]:
        """Mass [kg], centre of mass [m] and tensor of inertia about it [kg m^2] of a body and all
        that is fixed on it, in its frame."""
        model, data = self.model, self.data
        own = [b for b in range(1, model.nbody) if self.root(b) == root]
        masses, turn = model.body_mass[own], data.xmat[root].reshape(3, 3)
        centres = (data.xipos[own] - data.xpos[root]) @ turn
        mass = float(masses.sum())
        centre = masses @ centres / mass
        tensor = np.zeros((3, 3))
        for body, m, away in zip(own, masses, centres - centre, strict=True):
            axes = turn.T @ data.ximat[body].reshape(3, 3)
            tensor += axes @ np.diag(model.body_inertia[body]) @ axes.T
            tensor += m * (away @ away * np.eye(3) - np.outer(away, away))
        return mass, centre, tensor

    def _borne(self, body: Body, root: int) -> Body:
        """With the force that compensates its gravity."""
        share = self.compensated(root)
        if not share:
            return body
        reason = f"a force of {share:.4g} of its weight bears it"
        self.tell("body gravcomp", CARRIED, reason, [body.name])
        force = vector3(-share * body.mass * self.model.opt.gravity)
        return body.changed(wrenches=(Wrench(force=force),))

    def compensated(self, root: int) -> float:
        """Share of its gravity that is compensated, of a body and all that is fixed on it."""
        model = self.model
        own = [b for b in range(1, model.nbody) if self.root(b) == root and model.body_mass[b] > 0]
        shares, masses = model.body_gravcomp[own], model.body_mass[own]
        share = float(shares @ masses / masses.sum())
        if np.ptp(shares) > CLOSE:
            reason = f"its parts have different shares, here all {share:.4g}, the mean"
            self.tell("body gravcomp (of parts)", APPROXIMATED, reason, [self.name("body", root)])
        return share if self.falls else 0.0

    def _damped(self, body: Body, root: int, centre: FloatArray) -> Body:
        """With the damping of its free joint."""
        first = int(self.model.body_dofadr[root])
        damping = float(self.model.dof_damping[first])
        if not damping:
            return body
        moments = body.inertia()
        mean = float(moments.mean())
        off = float(np.abs(mean / moments - 1).max())
        away = 1000 * float(np.linalg.norm(centre))
        reason = (
            f"{damping:g} is {damping / body.mass:.4g} /s of linear and {damping / mean:.4g} /s of "
            f"angular velocity (of single axes up to {off:.0%} off: the mean moment is taken); in "
            f"the file it acts {away:.2g} mm from the centre of mass"
        )
        self.tell("joint damping (free)", APPROXIMATED, reason, [body.name])
        return body.changed(linear_damping=damping / body.mass, angular_damping=damping / mean)

    def _place(self, placed: list[Placed]) -> None:
        """Put the bodies where they are, above the ground, into a scene."""
        model, data = self.model, self.data
        moved = [replace(p, body=p.body.moved_to(self.pose(p.root) * p.frame)) for p in placed]
        down = np.array([[0.0, 0.0, -1.0]])
        if self.ground is not None:
            self.lift = -float(data.geom_xpos[self.ground, 2])
            friction = float(model.geom_friction[self.ground, 0])
        else:
            lowest = [-float(p.body.reach_placed(down)[0]) for p in moved]
            of_links = [geom for link in self.links for geom in self.geoms_of(link)]
            lowest += (data.geom_xpos[of_links, 2] - model.geom_rbound[of_links]).tolist()
            self.lift = max(0.0, -min(lowest, default=0.0))
            friction = max((p.body.friction for p in placed), default=1.0)
            reason = "the file has none; a level ground at z = 0 is there, which free bodies touch"
            self.tell("geom plane", APPROXIMATED, reason)
        if self.lift:
            reason = f"all is moved up by {self.lift:g} m, so that the ground is at z = 0"
            self.tell("height", APPROXIMATED, reason)
        self.placed = [
            replace(p, body=p.body.moved_to(p.body.pose.translated(z=self.lift))) for p in moved
        ]
        pairs, together = apart(self)
        self.tree = tree = Tree(self, self.links)
        free = [p.body.pose.position for p in self.placed if p.root]
        room = np.maximum(ROOM, 2 * np.abs(free).max(axis=0, initial=0.0) if free else 0.0)
        self.scene = Scene(
            Path(self.path).stem.strip(" .") or "scene",
            tuple(p.body for p in self.placed),
            tree.robot(self.lift, together),
            gravity=vector3(model.opt.gravity) if self.falls else (0.0, 0.0, 0.0),
            ground_friction=friction,
            room=vector3(room),
            apart=pairs,
            file=self.path,
            starts=tuple(map(self._start, range(model.nkey))),
            file_timestep=float(model.opt.timestep),
            file_lift=self.lift,
        )

    def _start(self, key: int) -> Start:
        """A keyframe: the free bodies' poses in the frames of the file, the joints' positions, and
        what the controls tell their drives."""
        model, qpos = self.model, self.model.key_qpos[key]
        names, poses = [], []
        for p in self.placed:
            if p.root:
                k = int(model.jnt_qposadr[model.body_jntadr[p.root]])
                names.append(p.body.name)
                poses.append(_pose(qpos[k : k + 3], qpos[k + 3 : k + 7]).translated(z=self.lift))
        at = model.jnt_qposadr[[link.joint for link in self.links]].astype(int)
        limits = np.reshape(self.tree.limits, (-1, 2))
        positions = np.clip(qpos[at] - model.qpos0[at], *limits.T).tolist()
        began = model.qpos0[at] + positions
        for row in np.flatnonzero(np.abs(qpos[at] - began) > CLOSE):
            own = f"{self.links[row].told} is at {qpos[at][row]:.4g} rad or m, outside of its range"
            where = [self.name("key", key)]
            self.tell("key (range)", APPROXIMATED, f"{own}; here at {began[row]:.4g}", where)
        drives, controls = self.tree.drives, model.key_ctrl[key]
        held = [drive.target(controls) for drive in drives]
        targets = [q if t is None else t for q, t in zip(positions, held, strict=True)]
        speeds = [drive.speed(controls) for drive in drives]
        efforts = [drive.effort(controls) for drive in drives]
        beside = (values if any(values) else () for values in (speeds, efforts))
        told = (positions, targets, *beside)
        return Start(tuple(names), tuple(poses), *map(tuple, told))


def _pose(place: Any, quaternion: Any) -> Pose:
    return Pose.from_array([*place, *np.divide(quaternion, np.linalg.norm(quaternion))])


def _quaternion(matrix: FloatArray) -> FloatArray:
    found = np.empty(4)
    mujoco.mju_mat2Quat(found, np.ravel(matrix))
    return found
