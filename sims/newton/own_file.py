"""The profile `file`: what Newton's importer makes of the scene's file, in the frames of the scene.

SolverMuJoCo makes a model of MuJoCo's of it. So MuJoCo's `OwnFile` tells its state, and what the
importer did not keep is found by holding that model against MuJoCo's own of the file.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np

from pytest_simbench.scene import FloatArray, Scene
from pytest_simbench.simulator import Deviation, NotSupportedError, lazy_import

from ..mujoco.account import switched_off
from ..mujoco.constraints import collide
from ..mujoco.own_file import CLOSE, FILE_MOVES, OwnFile, Told, compared, deviations, pairs
from ..mujoco.reading import Reading

newton = lazy_import("newton")
mujoco = lazy_import("mujoco")

FIELDS = {
    "body": "mass inertia gravcomp xpos xmat xipos",
    "geom": "friction solref solimp condim priority solmix margin fluid surfacevel adhesion xpos "
    "xmat",
    "jnt": "range solref solimp margin stiffness actfrcrange xanchor xaxis",
    "dof": "damping armature frictionloss solref solimp",
    "actuator": "gainprm biasprm dynprm gear forcerange ctrlrange",
    "pair": "friction solref solimp margin gap dim",
    "eq": "type solref solimp",
}
"""What is compared of the compiled models and, at their zero posture, of their states."""

CALLED = {"jnt": "joint", "dof": "joint", "eq": "equality"}
"""Kinds whose elements are named otherwise."""

LIMITED = {
    "range": "limited",
    "actfrcrange": "actfrclimited",
    "forcerange": "forcelimited",
    "ctrlrange": "ctrllimited",
}
"""Fields that count where another one says so."""

UNLIMITED = np.array([-1e6, 1e6])
"""What Newton has where a force is not limited [N, N m]."""

FAR = 1e3
"""Farther than two shapes of a scene are apart [m]."""

EXCUSED = {
    "option gravity": "gravity",
    "body mass": "body/*/mass",
    "body inertia": "body/*/inertia",
    "body gravcomp": "body/*/gravity",
    "body xpos": "body/*/pose",
    "body xmat": "body/*/pose",
    "body xipos": "body/*/com",
    "geom friction": "body/*/friction ground/friction",
    "geom solref": "body/*/restitution ground/restitution",
    "geom margin": "body/*/margin",
    "dof damping": "body/*/damping",
    "dof frictionloss": "body/*/damping",
    "geom contype, conaffinity": "body/*/touches ground/touches",
}
"""Quantities of the parity check that a difference excuses."""


class NewtonFile(OwnFile):
    """The imported file, and its solver.

    Attributes:
        states: both of Newton's states, at the start.
        free: Newton's numbers of the free bodies.

    Raises:
        NotSupportedError: as `OwnFile`, or the importer refuses the file or leaves out a part.
    """

    def __init__(self, scene: Scene, timestep: float) -> None:
        super().__init__(scene, timestep)
        self.states = [self.imported.state(), self.imported.state()]
        for state in self.states:
            self.solver._update_newton_state(self.imported, state, self.data, state)
        self.free = self.solver.mjc_body_to_newton.numpy()[0][self.roots].tolist()

    def read(self, path: str) -> Reading:
        own = Reading(path)
        builder = newton.ModelBuilder()
        try:
            builder.add_mjcf(path, ctrl_direct=True)  # else gears and biases of actuators are lost
            self.imported = model = builder.finalize(device="cpu")
            self.solver = solver = newton.solvers.SolverMuJoCo(
                model, use_mujoco_cpu=True, skip_visual_only_geoms=False
            )
        except (ValueError, RuntimeError, TypeError, LookupError, NotImplementedError) as error:
            raise NotSupportedError(f"Newton's importer refuses {path}: {error}") from None
        found = copy(own)
        found.model, found.data = solver.mj_model, solver.mj_data
        found.data.qpos[:] = found.model.qpos0
        mujoco.mj_kinematics(found.model, found.data)
        numbers = solver.mjc_body_to_newton.numpy()[0].tolist()
        labels = ["world" if n < 0 else model.body_label[n].rpartition("/")[2] for n in numbers]
        bodies, geoms, joints = counterparts(own, found, labels)
        found.ground = None if own.ground is None else geoms[own.ground]
        found.placed = [
            replace(p, root=bodies[p.root], geoms=[geoms[g] for g in p.geoms]) for p in own.placed
        ]
        found.links = [replace(k, body=bodies[k.body], joint=joints[k.joint]) for k in own.links]
        self._told = tuple(differences(own, found, bodies, geoms, joints))
        return found

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        """Raises `NotSupportedError`: the file's own actuators move its joints."""
        raise NotSupportedError(FILE_MOVES)

    def deviations(self) -> tuple[Deviation, ...]:
        """As `OwnFile`, and what the importer did not keep."""
        told = deviations("Newton's importer", self._told, EXCUSED)
        return *told, *super().deviations()


def counterparts(own: Reading, found: Reading, labels: list[str]) -> tuple[list[int], ...]:
    """The numbers in the imported model of a file's bodies, shapes and joints.

    Bodies by name, those without one in their order on the body above; joints in their order on
    a body; shapes by kind and the nearest place.
    """
    model, other = own.model, found.model
    for kind, count in {"bodies": "nbody", "shapes": "ngeom", "joints": "njnt"}.items():
        made, asked = getattr(other, count), getattr(model, count)
        if made != asked:
            reason = f"Newton's importer makes {made} of {asked} {kind} of {own.path}"
            raise NotSupportedError(reason)
    names = [model.body(body).name for body in range(model.nbody)]
    bodies = [labels.index(name) if name in labels else -1 for name in names]
    for body, above in enumerate(model.body_parentid):
        if bodies[body] < 0:
            below = np.flatnonzero(other.body_parentid == bodies[above]).tolist()
            bodies[body] = next(number for number in below if number not in bodies)
    first = other.body_jntadr[bodies] - model.body_jntadr
    joints = [joint + int(first[body]) for joint, body in enumerate(model.jnt_bodyid)]
    geoms: list[int] = []
    for geom, body in enumerate(model.geom_bodyid):
        away = np.linalg.norm(found.data.geom_xpos - own.data.geom_xpos[geom], axis=1)
        away[other.geom_type != model.geom_type[geom]] += FAR
        away[other.geom_bodyid != bodies[body]] += FAR**2
        away[geoms] = np.inf
        geoms.append(int(np.argmin(away)))
    return bodies, geoms, joints


def differences(
    own: Reading, found: Reading, bodies: list[int], geoms: list[int], joints: list[int]
) -> Iterator[Told]:
    """What the importer did not keep of a file, and the sentence about it."""
    model, other = own.model, found.model
    made = _options(other)
    for name, asked in _options(model).items():
        if made[name] != asked:
            yield f"option {name}", f"option {name} is {made[name]}, in the file {asked}"
    solid = own.solid if own.ground is None else [*own.solid, own.ground]
    rows: dict[str, tuple[Any, Any]] = {
        "body": (range(model.nbody), bodies),
        "geom": (solid, [geoms[geom] for geom in solid]),
        "jnt": (range(model.njnt), joints),
        "dof": (model.jnt_dofadr, other.jnt_dofadr[joints]),
    }
    for kind, count in {
        "actuator": "nu",
        "pair": "npair",
        "eq": "neq",
        "tendon": "ntendon",
    }.items():
        many, there = getattr(model, count), getattr(other, count)
        rows[kind] = (range(min(many, there)),) * 2
        if there < many:
            yield kind, f"{there} of {many} {CALLED.get(kind, kind)} elements are there"
    for kind, fields in FIELDS.items():
        first, second = (np.array(numbers, dtype=int) for numbers in rows[kind])
        called = rows["jnt" if kind == "dof" else kind][0]
        names = [own.name(CALLED.get(kind, kind), number) for number in called]
        for field in fields.split():
            values = _values(found, kind, field)[second], _values(own, kind, field)[first]
            close = CLOSE * field.startswith("x")  # places and axes
            yield from compared(f"{kind} {field}", *values, names, close)
    meet = collide(found, rows["geom"][1]), collide(own, solid)
    ask, names = pairs(own, solid)
    yield from compared("geom contype, conaffinity", meet[0][ask], meet[1][ask], names)


def _options(model: Any) -> dict[str, str]:
    """That act, in words."""
    option, off = model.opt, mujoco.mjtDisableBit
    found = {
        name: " ".join(f"{value + 0.0:.6g}" for value in np.ravel(getattr(option, name)))
        for name in dir(option)
        if not name.startswith(("_", "o_", "timestep")) and not callable(getattr(option, name))
    }
    if option.disableflags & off.mjDSBL_GRAVITY:
        found["gravity"] = "0 0 0"
    flags = option.disableflags & ~(off.mjDSBL_GRAVITY | off.mjDSBL_AUTORESET)
    found["disableflags"] = switched_off(flags)
    found["integrator"] = mujoco.mjtIntegrator(option.integrator).name
    return found


def _values(reading: Reading, kind: str, field: str) -> FloatArray:
    """A field of all elements of a kind; without a limit where there is none."""
    model, name = reading.model, f"{kind}_{field}"
    holder = model if hasattr(model, name) else reading.data
    values = np.array(getattr(holder, name if hasattr(holder, name) else field), dtype=float)
    if field in LIMITED:
        return np.where(getattr(model, f"{kind}_{LIMITED[field]}")[:, None], values, UNLIMITED)
    if holder is not model and kind == "geom":  # frames of meshes are those of their inertia
        values[model.geom_type == mujoco.mjtGeom.mjGEOM_MESH] = np.nan
    return np.sort(values, axis=1) if field == "inertia" else values
