"""MJCF files as scenes, read by MuJoCo's own parser: includes, classes, defaults, frames and
keyframes mean what they mean to MuJoCo.

Shapes, places, masses and inertias are those of the compiled model. For the account each element is
held against a new one of its kind: an attribute that differs from MuJoCo's default is carried,
approximated, or told. So an attribute that a later MuJoCo adds is told too.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.description.carried import Carried
from pytest_simbench.ground.errors import DescriptionError
from pytest_simbench.scene import (
    Body,
    Box,
    Capsule,
    Compound,
    ConvexMesh,
    Cylinder,
    Pose,
    Scene,
    SceneError,
    Sphere,
    principal,
)
from pytest_simbench.scene.polytope import MOST
from pytest_simbench.scene.scene import ROOM
from pytest_simbench.simulator import lazy_import

mujoco = lazy_import("mujoco")

MOST_BODIES, MOST_GEOMS = 2_000, 20_000


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


COMPILED: Mapping[str, frozenset[str]] = {
    "geom": _words(
        "type size pos quat alt fromto density mass typeinertia meshname fitscale frame contype "
        "conaffinity friction"
    ),
    "body": _words(
        "pos quat alt frame mass ipos iquat ialt inertia fullinertia explicitinertial geoms joints"
    ),
    "joint": _words("type pos frame damping"),
    "option": _words("gravity"),
}
"""Attributes that the scene has from the compiled model, or that have rows of their own."""

NO_PHYSICS: Mapping[str, frozenset[str]] = {
    "geom": _words(
        "name classname id info material rgba group userdata parent compiler signature castshadow "
        "fluid_coefs"
    ),
    "body": _words(
        "name classname childclass id info userdata parent compiler signature simple sleep bodies "
        "cameras frames lights sites"
    ),
    "joint": _words(
        "name classname id info group userdata parent compiler signature axis align range limited "
        "ref solref_limit solimp_limit actfrclimited actfrcrange actgravcomp springref margin"
    ),
    "option": _words("sleep_tolerance"),
}
"""What moves no body: names, looks, and what a free joint does not have."""

ENGINE = "a matter of the engine's settings: the profile has them, for each engine its own"
SOFT = (
    "how soft a contact is is an engine's own matter: its profile has it. Compare the profile "
    "`file`, and finer steps"
)
REASONS: Mapping[str, str] = {
    "geom solref": SOFT,
    "geom solimp": SOFT,
    "geom solmix": SOFT,
    "geom condim": "contacts slide with friction here; rolling and spinning are the profile's",
    "geom priority": "the larger friction of two counts, whatever has priority",
    "geom margin": "contacts begin where shapes touch",
    "geom gap": "contacts begin where shapes touch",
    "body gravcomp": "every body feels the whole gravity",
    "body mocap": "it stays where it is; nobody moves it",
    "joint armature": "a free body has its own inertia alone",
    "joint frictionloss": "a free body has no friction of its joint",
    "joint stiffness": "a free body has no spring",
    "option density": "no air: drag and buoyancy are left out",
    "option viscosity": "no air: drag and buoyancy are left out",
    "option wind": "no air",
}
LISTS: Mapping[str, str] = {
    "equalities": "what they hold together moves apart here",
    "tendons": "there are none here",
    "actuators": "nothing drives a free body here",
    "pairs": "contacts of these pairs are like all others here",
    "excludes": "these pairs touch here",
    "flexes": "soft bodies are left out",
    "skins": "looks alone",
    "plugins": "no plug-in runs here",
    "keys": "the scene starts as the bodies are placed in the file; take a file of starts instead",
    "sensors": "nothing is measured by them",
}
LOOKS = frozenset({"skins", "sensors"})


def read(path: str) -> tuple[Scene, tuple[Carried, ...], float]:
    """The scene of an MJCF file, the account of it, and the time step that it asks for [s].

    Raises:
        DescriptionError: no such file, not to be parsed, or a body that no scene can have.
    """
    try:
        spec = mujoco.MjSpec.from_file(path)
    except ValueError as error:
        raise DescriptionError(f"{path}: {_one_line(error)}") from None
    return of_spec(spec, path)


def of_spec(spec: Any, path: str) -> tuple[Scene, tuple[Carried, ...], float]:
    """The same of a parsed file."""
    account = _told(spec)
    for body in spec.bodies:
        moving = [_name(j, "joint") for j in body.joints if j.type != mujoco.mjtJoint.mjJNT_FREE]
        if moving:
            raise DescriptionError(
                f"{path}: body {body.name!r} moves by the joint {moving[0]!r}, and only bodies "
                "with a free joint or none are read so far"
            )
    try:
        model = spec.compile()
    except ValueError as error:
        raise DescriptionError(f"{path}: {_one_line(error)}") from None
    if model.nbody > MOST_BODIES or model.ngeom > MOST_GEOMS:
        raise DescriptionError(
            f"{path} has {model.nbody} bodies and {model.ngeom} shapes; at most {MOST_BODIES} and "
            f"{MOST_GEOMS} are read"
        )
    reader = _Reader(model, path)
    try:
        scene = reader.scene(Path(path).stem)
    except SceneError as error:
        raise DescriptionError(f"{path}: {error}") from None
    return scene, (*account, *reader.account), float(model.opt.timestep)


class _Reader:
    """Makes a scene of a compiled model."""

    def __init__(self, model: Any, path: str) -> None:
        self.model, self.path = model, path
        self.data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, self.data)
        self.account: list[Carried] = []
        self.colliding = (model.geom_contype != 0) | (model.geom_conaffinity != 0)

    def scene(self, name: str) -> Scene:
        model, kinds = self.model, self.model.geom_type
        planes = np.flatnonzero(self.colliding & (kinds == mujoco.mjtGeom.mjGEOM_PLANE))
        height, friction = self._ground(planes.tolist())
        bodies: list[Body] = []
        for body in range(model.nbody):
            own = np.flatnonzero(self.colliding & (model.geom_bodyid == body)).tolist()
            geoms = [geom for geom in own if geom not in planes]
            if body == 0:
                bodies += [self._body(self._geom_name(g), 0, [g]) for g in geoms]
            elif geoms or model.body_dofnum[body]:
                bodies.append(self._body(self._body_name(body), body, geoms))
        self._tell(geoms=int((~self.colliding).sum()), bodies=bodies)
        placed = [body.moved_to(body.pose.translated(z=-height)) for body in bodies]
        far = np.max([np.abs(body.pose.position) for body in placed], axis=0, initial=0.0)
        room = tuple(max(wall, 2 * float(at)) for wall, at in zip(ROOM, far, strict=True))
        return Scene(
            name,
            tuple(placed),
            gravity=tuple(model.opt.gravity.tolist()),
            ground_friction=friction,
            room=(room[0], room[1], room[2]),
        )

    def _ground(self, planes: list[int]) -> tuple[float, float]:
        """Height [m] and friction of the ground."""
        if not planes:
            self._add(
                "ground", "approximated", "the file has none, and every scene has one at z = 0"
            )
            return 0.0, 1.0
        heights = {round(float(self.data.geom_xpos[k][2]), 9) for k in planes}
        level = all(abs(self.data.geom_xmat[k][8] - 1) < 1e-6 for k in planes)
        if len(heights) > 1 or not level:
            raise DescriptionError(
                f"{self.path} has planes that are not level or at several heights; a scene has one "
                "level ground: make the others boxes"
            )
        (height,) = heights
        reason = "the plane, endless" if not height else f"the scene is moved down by {height:g} m"
        self._add("ground", "carried", reason)
        return height, float(max(self.model.geom_friction[k][0] for k in planes))

    def _body(self, name: str, body: int, geoms: list[int]) -> Body:
        """A body: where its inertia has its frame if it is free, else where the file has it."""
        model, data = self.model, self.data
        free, own = bool(model.body_dofnum[body]), Pose()
        if body:
            at = Pose.from_array([*data.xpos[body], *data.xquat[body]])
        else:
            at = _pose(data.geom_xpos[geoms[0]], data.geom_xmat[geoms[0]])
        if free:
            own = Pose.from_array([*model.body_ipos[body], *model.body_iquat[body]])
        surface: dict[str, Any] = {"friction": self._friction(name, geoms)}
        shapes = []
        for k, geom in enumerate(geoms):
            place = Pose.from_array([*model.geom_pos[geom], *model.geom_quat[geom]])
            local = own.inverse() * place if body else Pose()
            shapes.append(self._shape(str(k), geom, local, surface))
        if not shapes:
            raise DescriptionError(
                f"{self.path}: body {name!r} has no shape that can touch anything"
            )
        mass = float(model.body_mass[body]) if free else 0.0
        moments = tuple(model.body_inertia[body].tolist()) if free else None
        alone = shapes[0]
        given: dict[str, Any] = {"mass": mass, "moments": moments, **self._damping(body, free)}
        if len(shapes) == 1 and alone.pose == Pose():
            return alone.changed(name=name, pose=at * own, **given)
        return Compound(
            name, tuple(shapes), at * own, colour=alone.colour, file_frame=own.inverse(),
            **surface, **given,
        )  # fmt: skip

    def _shape(self, name: str, geom: int, pose: Pose, surface: Mapping[str, float]) -> Body:
        model = self.model
        x, y, z = model.geom_size[geom].tolist()
        r, g, b, a = (min(max(c, 0.0), 1.0) for c in model.geom_rgba[geom].tolist())
        given: dict[str, Any] = {"colour": (r, g, b, a), **surface}
        match mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_"):
            case "BOX":
                return Box(name, (2 * x, 2 * y, 2 * z), pose, **given)
            case "SPHERE":
                return Sphere(name, x, pose, **given)
            case "CYLINDER":
                return Cylinder(name, x, 2 * y, pose, **given)
            case "CAPSULE":
                return Capsule(name, x, 2 * y, pose, **given)
            case "MESH":
                return self._mesh(name, geom, pose, given)
            case other:
                own = self._geom_name(geom)
                raise DescriptionError(f"{self.path}: {own!r} is a {other.lower()}: not read yet")

    def _mesh(self, name: str, geom: int, pose: Pose, given: dict[str, Any]) -> Body:
        """The convex hull, as MuJoCo collides it."""
        model, mesh = self.model, int(self.model.geom_dataid[geom])
        first = model.mesh_vertadr[mesh]
        points = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
        graph = int(model.mesh_graphadr[mesh])
        if graph >= 0:  # numbers of the hull's corners, see MuJoCo's `mesh_graph`
            count = int(model.mesh_graph[graph])
            points = points[model.mesh_graph[graph + 2 + count : graph + 2 + 2 * count]]
        if len(points) > MOST:
            raise DescriptionError(
                f"{self.path}: the hull of {self._geom_name(geom)!r} has {len(points)} corners; at "
                f"most {MOST} are read: simplify it, or split it into convex parts (coacd)"
            )
        vertices, frame = principal(points.astype(float))
        return ConvexMesh(name, vertices, pose * frame, **given)

    def _friction(self, name: str, geoms: list[int]) -> float:
        """The sliding friction of a body."""
        model = self.model
        own = model.geom_friction[geoms, 0]
        if len(np.unique(own)) > 1:
            reason = "a body has one: the largest of its shapes is taken"
            self._add("geom friction (several on one body)", "approximated", reason, name)
        rest = model.geom_friction[geoms, 1:]
        usual = np.array([0.005, 0.0001])
        if len(rest) and not np.allclose(rest, usual):
            reason = "spinning and rolling friction are the profile's"
            self._add("geom friction (spinning, rolling)", "not carried", reason, name)
        return float(own.max(initial=0.0)) if len(own) else 1.0

    def _damping(self, body: int, free: bool) -> dict[str, float]:
        """Of a free joint: force and torque per velocity, as rates of the body."""
        model = self.model
        if not free:
            return {}
        dof = model.body_dofadr[body] + np.arange(6)
        damping = float(np.ravel(model.dof_damping[dof])[0])
        if not damping:
            return {}
        moments = model.body_inertia[body]
        reason = "exact along, and about the axes one rate, that of their mean moment, for all"
        self._add("joint damping", "approximated", reason, self._body_name(body))
        return {
            "linear_damping": damping / float(model.body_mass[body]),
            "angular_damping": damping / float(moments.mean()),
        }

    def _tell(self, geoms: int, bodies: list[Body]) -> None:
        self._add("bodies", "carried", f"{len(bodies)} with shapes, masses, inertias and places")
        self._add("geom friction (sliding)", "carried", "of two surfaces the larger one, as here")
        if geoms:
            self._add(
                "geom without contact", "not carried", f"{geoms} that nothing can touch: looks"
            )
        own = np.unique(
            np.column_stack([self.model.geom_contype, self.model.geom_conaffinity])[self.colliding],
            axis=0,
        )
        if not all((a[0] & b[1]) or (b[0] & a[1]) for a in own for b in own):
            reason = "all bodies touch each other and the ground here"
            self._add("geom contype, conaffinity", "not carried", reason)

    def _add(self, quantity: str, state: Any, reason: str, where: str = "") -> None:
        names = (where,) if where else ()
        for k, row in enumerate(self.account):
            if (row.quantity, row.reason) == (quantity, reason):
                self.account[k] = Carried(quantity, state, reason, (*row.where, *names))
                return
        self.account.append(Carried(quantity, state, reason, names))

    def _body_name(self, body: int) -> str:
        return self.model.body(body).name or f"body{body}"

    def _geom_name(self, geom: int) -> str:
        return self.model.geom(geom).name or f"geom{geom}"


def _told(spec: Any) -> list[Carried]:
    """Rows for what elements have beside MuJoCo's defaults, and for lists of other elements."""
    fresh = mujoco.MjSpec()
    body = fresh.worldbody.add_body()
    rows: dict[str, list[str]] = {}
    for kind, elements, usual in (
        ("geom", spec.geoms, body.add_geom()),
        ("body", [b for b in spec.bodies if b.name != "world"], body),
        ("joint", spec.joints, body.add_freejoint()),
        ("option", [spec.option], fresh.option),
    ):
        known = COMPILED[kind] | NO_PHYSICS[kind]
        names = [n for n in dir(usual) if not n.startswith("_") and n not in known]
        for element in elements:
            for name in names:
                own, default = getattr(element, name), getattr(usual, name)
                if not callable(own) and not _same(own, default):
                    rows.setdefault(f"{kind} {name}", []).append(_name(element, kind))
    told = [
        Carried(
            what,
            "not carried",
            REASONS.get(what, ENGINE),
            tuple(dict.fromkeys(filter(None, where))),
        )
        for what, where in rows.items()
    ]
    for name, reason in LISTS.items():
        found = list(getattr(spec, name, ()))
        if found and name not in LOOKS:
            where = tuple(_name(item, name) for item in found)
            told.append(Carried(name, "not carried", reason, where))
    return told


def _name(element: Any, kind: str) -> str:
    """Its own, or whose it is."""
    if kind == "option":
        return ""
    parent = getattr(getattr(element, "parent", None), "name", "")
    return element.name or (f"a {kind} of {parent}" if parent else f"a {kind}")


def _same(a: Any, b: Any) -> bool:
    """Whether two attributes of elements are equal."""
    if isinstance(a, float | np.ndarray):
        return bool(np.array_equal(a, b, equal_nan=True))
    if hasattr(a, "active"):  # a plug-in
        return bool(a.active == b.active)
    return bool(a == b)


def _pose(position: Any, matrix: Any) -> Pose:
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ravel(matrix))
    return Pose.from_array([*position, *quaternion])


def _one_line(error: ValueError) -> str:
    return " ".join(str(error).split())
