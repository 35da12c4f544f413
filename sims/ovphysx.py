"""Omniverse PhysX (NVIDIA), the engine inside Isaac Sim, through the package ovphysx.

The world is handed over as a USD stage, see `ovphysx_stage`. Drives are PhysX's own: implicit
springs and dampers in reduced coordinates, whose largest force bounds the drive alone; effort
feed-forward therefore rides on the position target, q* + tau_ff / k, so that the limit bounds
the whole sum.

The engine is asked in two ways. Its sessions (`PhysX.read`) take 0.4 ms in Python; they read what
was built, and the state before the first step. Tensor bindings take 0.01 ms (and are deprecated:
the version is pinned); they command and read while stepping. Before the first step they must not
be touched: they would run a step of their own to warm up.
"""

from __future__ import annotations

import math
import tempfile
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from pytest_simbench.sims import ovphysx_stage as usd

from pytest_simbench.scene import FloatArray, Pose, Scene
from pytest_simbench.simulator import (
    Capability,
    Deviation,
    PreparedRobot,
    Settings,
    Simulator,
    SimulatorInfo,
    lazy_import,
)

ovphysx = lazy_import("ovphysx")
ovphysx_types = lazy_import("ovphysx.types")
ovstage = lazy_import("ovstage")
schema_support = lazy_import("ovphysx.samples.python_samples.schema_support")

REACH = 5.0
"""How far outside a body the rays begin that measure it [m]."""

_FRICTIONS = ("staticFriction", "dynamicFriction")
_registered = False


@dataclass(frozen=True)
class OvPhysXSettings(Settings):
    """PhysX's options; defaults are those of its USD schemas.

    Attributes:
        timestep: [s]; 1/60 is what PhysxSceneAPI says.
        solver: temporal or projected Gauss-Seidel.
        body_iterations: position iterations of free bodies.
        arm_iterations: those of the articulation; of two bodies in contact the larger one counts.
        velocity_iterations: of both.
        linear_damping, angular_damping: of bodies and links [1/s].
        sleeping: whether bodies at rest are frozen.
        max_depenetration_velocity: with which bodies that overlap are pushed apart [m/s].
        contact_offset: distance at which contacts are made [m]; None lets PhysX choose by size.
        rest_offset: distance at which they rest [m]; None lets PhysX choose.
        friction_offset_threshold: distance below which a contact has friction [m].
        friction_correlation_distance: below which contacts share a friction anchor [m].
        contact_last: solve the articulation's contacts after everything else.
        threads: workers of PhysX; 0 computes in the calling thread.
    """

    timestep: float = 1.0 / 60.0
    solver: Literal["TGS", "PGS"] = "TGS"
    body_iterations: int = 16
    arm_iterations: int = 32
    velocity_iterations: int = 1
    linear_damping: float = 0.0
    angular_damping: float = 0.05
    sleeping: bool = True
    max_depenetration_velocity: float = 3.0
    contact_offset: float | None = None
    rest_offset: float | None = None
    friction_offset_threshold: float = 0.04
    friction_correlation_distance: float = 0.025
    contact_last: bool = False
    threads: int = 0


class OvPhysX(Simulator):
    """Adapter of Omniverse PhysX."""

    info: ClassVar[SimulatorInfo] = SimulatorInfo(
        name="ovphysx",
        title="Omniverse PhysX",
        distribution="ovphysx",
        modules=("ovphysx", "ovstage"),
        install="pytest --sim-install ovphysx",
        licence="NVIDIA Omniverse licence (proprietary); not part of this package",
        engine="PhysX 5",
        tested_version="0.7.0",
        capabilities=frozenset({Capability.DETERMINISTIC}),
        deviations=(
            Deviation("timestep", "an argument of each step, which PhysX does not report"),
            Deviation("gravity", "PhysX reports no gravity through this package"),
            Deviation("ground/friction", "PhysX reports no material of a static plane"),
            Deviation("gripper/coupled", "PhysX reports no mimic joints"),
        ),
        requirements=(
            "ovphysx==0.7.0.74035321",
            "ovstage==0.3.0.1791986420",
            "physx-usd-schemas==25.11.2.72696984",
            "warp-lang==1.19.0",
            "packaging==23.2",
            "numpy==2.4.6",
        ),
        caches={"WARP_CACHE_PATH": "warp"},
        install_size_mb=1100,
    )
    profiles: ClassVar[Mapping[str, Settings]] = {
        "default": OvPhysXSettings(),
        "tuned": OvPhysXSettings(timestep=0.004, angular_damping=0.0, sleeping=False),
    }
    settings: OvPhysXSettings

    def load(self, scene: Scene) -> None:
        self.scene, self._steps = scene, 0
        self.prepared = PreparedRobot(scene.robot) if scene.robot is not None else None
        self._commanded: tuple[FloatArray, FloatArray] | None = None
        self._bindings: dict[str, tuple[Any, Any]] = {}
        text = usd.Stage(scene, self.prepared, _attributes(self.settings)).text()
        self._attach(text)
        free = [i for i, box in enumerate(scene.bodies) if not box.fixed]
        self._free = [usd.body_path(i) for i in free]
        self._joints = []
        if self.prepared is not None:
            robot = self.prepared.robot
            self._joints = [usd.joint_path(i) for i in range(len(robot.joints))]
            self._stiffness = robot.column("stiffness")
            kinds = {joint.name: joint.kind for joint in self.prepared.joints}
            turning = [kinds[name] == "revolute" for name in robot.joint_names]
            self._unit = np.where(turning, np.pi / 180, 1.0)  # sessions count in degrees

    def _attach(self, text: str) -> None:
        """Start PhysX with a stage."""
        types = ovphysx_types
        # Deprecated bindings are used on purpose (see above), and only the processor.
        warnings.filterwarnings("ignore", category=DeprecationWarning, module="pytest_simbench")
        ovphysx.PhysX.set_cpu_mode(True)
        ovphysx.set_global_config(types.GlobalConfigKey.NUM_THREADS, self.settings.threads)
        self.physx = ovphysx.PhysX()
        _register_schemas()
        self.stage = ovstage.Stage("simbench")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "scene.usda"
            path.write_text(text, encoding="utf-8")
            domains = ovstage.PopulationDomain.PHYSICS
            ovstage.population.open_usd(self.stage, str(path), ordinal=1, domains=domains)
        self.stage.advance_write_floor(ordinal=1).wait()
        self.physx.wait_task(self.physx.attach_ovstage(self.stage, read_ordinal=1))

    def _read(self, kind: str, *attributes: str) -> dict[str, dict[str, FloatArray]]:
        """Attributes of all objects of a kind from PhysX, by attribute and prim path."""
        found: dict[str, dict[str, FloatArray]] = {}
        target = getattr(ovphysx_types.SimObjectType, kind)
        scope = ovphysx_types.ObjectScope.ALL
        with self.physx.read_sync(target, list(attributes), scope=scope) as result:
            for group in result.groups:
                name = result.dictionary.token_to_string(group.attribute)
                paths = result.dictionary.get_path_strings(group.prim_list)
                columns = [np.array(tensor.numpy(), dtype=float) for tensor in group.tensors]
                rows = columns if group.is_array else columns[0]
                found.setdefault(name, {}).update(zip(paths, rows, strict=True))
            del group
        return found

    def _binding(self, kind: str, **prims: Any) -> tuple[Any, Any]:
        """A tensor binding and its buffer; only after the first step."""
        if kind not in self._bindings:
            tensor = getattr(ovphysx_types.TensorType, kind)
            binding = self.physx.create_tensor_binding(tensor_type=tensor, **prims)
            self._bindings[kind] = binding, np.zeros(binding.shape, np.float32)
        return self._bindings[kind]

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        target = position + effort / self._stiffness
        if self._steps == 0:
            self._commanded = target, velocity
        else:
            self._write_drives(target, velocity)

    def _write_drives(self, position: FloatArray, velocity: FloatArray) -> None:
        for kind, values in (("POSITION_TARGET", position), ("VELOCITY_TARGET", velocity)):
            binding, buffer = self._binding(f"ARTICULATION_DOF_{kind}", pattern=usd.ROOT)
            buffer[0, self._order] = values
            binding.write(buffer)

    def _write_first(self, position: FloatArray, velocity: FloatArray) -> None:
        """The same before the first step, when bindings must not be touched."""
        names = {"jointPositionTarget": position, "jointVelocityTarget": velocity}
        kind = ovphysx_types.SimObjectType.ARTICULATION_JOINT
        dictionary = ovstage.PathDictionary(self.stage)
        for name, values in names.items():
            given = dict(zip(self._joints, values / self._unit, strict=True))
            with self.physx.write_sync(kind, name) as session:
                for group in session.groups:
                    paths = dictionary.get_path_strings(group.prim_list)
                    for path, tensor in zip(paths, group.tensors, strict=True):
                        tensor.numpy()[:] = given[path]
                    session.commit_sync(group)

    def step(self) -> None:
        if self._steps == 0 and self._commanded is not None:
            self._write_first(*self._commanded)
        self.physx.step_sync(self.settings.timestep)
        self._steps += 1
        if self._steps == 1 and self._joints:
            names = self._binding("ARTICULATION_DOF_POSITION", pattern=usd.ROOT)[0].dof_names
            self._order = [names.index(path.rpartition("/")[2]) for path in self._joints]

    @property
    def time(self) -> float:
        return self._steps * self.settings.timestep

    def body_state(self) -> FloatArray:
        state = np.empty((len(self._free), 13))
        if not self._free:
            return state
        if self._steps == 0:
            names = ("position", "orientation", "linearVelocity", "angularVelocity")
            values = self._read("RIGID_BODY", *names)
            for row, path in zip(state, self._free, strict=True):
                row[:] = np.concatenate([values[name][path] for name in names])
        else:
            for kind, columns in (("POSE", slice(0, 7)), ("VELOCITY", slice(7, 13))):
                binding, buffer = self._binding(f"RIGID_BODY_{kind}", prim_paths=self._free)
                binding.read(buffer)
                state[:, columns] = buffer
        state[:, 3:7] = state[:, [6, 3, 4, 5]]
        return state

    def joint_state(self) -> FloatArray:
        state = np.empty((2, len(self._joints)))
        if not self._joints:
            return state
        if self._steps == 0:
            values = self._read("ARTICULATION_JOINT", "jointPosition", "jointVelocity")
            for row, name in zip(state, ("jointPosition", "jointVelocity"), strict=True):
                row[:] = [values[name][path][0] for path in self._joints]
            return state * self._unit
        for row, kind in zip(state, ("POSITION", "VELOCITY"), strict=True):
            binding, buffer = self._binding(f"ARTICULATION_DOF_{kind}", pattern=usd.ROOT)
            binding.read(buffer)
            row[:] = buffer[0, self._order]
        return state

    def read_back(self) -> dict[str, Any]:
        reported: dict[str, Any] = {"ground/height": self._height()}
        names = ("position", "orientation", "mass", "inertia", *_FRICTIONS)
        values = self._read("RIGID_BODY", *names) if self.scene.bodies else {}
        for index, box in enumerate(self.scene.bodies):
            path, prefix = usd.body_path(index), f"body/{box.name}"
            x, y, z, w = values["orientation"][path]
            pose = Pose.from_array([*values["position"][path], w, x, y, z])
            reported[f"{prefix}/pose"] = pose.as_array()
            reported[f"{prefix}/size"] = self._size(f"{path}/shape", pose)
            reported[f"{prefix}/friction"] = _friction(values, path, 1)
            if not box.fixed:
                reported[f"{prefix}/mass"] = values["mass"][path]
                reported[f"{prefix}/inertia"] = np.diag(values["inertia"][path].reshape(3, 3))
        if self.prepared is not None:
            self._read_back_robot(self.prepared, reported)
        return reported

    def _read_back_robot(self, prepared: PreparedRobot, reported: dict[str, Any]) -> None:
        attributes = {
            "jointLimit": ("limits", self._unit),
            "jointMaxForce": ("effort_limit", 1.0),
            "jointStiffness": ("stiffness", 1 / self._unit),
            "jointDamping": ("damping", 1 / self._unit),
            "jointArmature": ("armature", 1.0),
            "jointPosition": ("initial_position", self._unit),
        }
        joints = self._read("ARTICULATION_JOINT", *attributes)
        for attribute, (quantity, unit) in attributes.items():
            units = np.broadcast_to(unit, len(self._joints))
            for name, path, u in zip(prepared.robot.joint_names, self._joints, units, strict=True):
                reported[f"joint/{name}/{quantity}"] = joints[attribute][path][0] * u
        links = self._read("ARTICULATION_LINK", "mass", "inertia", "shapeCount", *_FRICTIONS)
        names = list(prepared.links)
        for link in prepared.moving_links:
            path, prefix = usd.link_path(names.index(link.name)), f"link/{link.name}"
            reported[f"{prefix}/mass"] = links["mass"][path]
            tensor = links["inertia"][path].reshape(3, 3)
            reported[f"{prefix}/inertia"] = np.sort(np.linalg.eigvalsh(tensor))
            reported[f"{prefix}/friction"] = _friction(links, path)

    def _hits(self, path: str, start: FloatArray, direction: FloatArray) -> list[FloatArray]:
        """Where a ray of twice `REACH` meets the collider `path`."""
        mode = ovphysx_types.SceneQueryMode.ALL
        hits = self.physx.raycast(start.tolist(), direction.tolist(), 2 * REACH, mode)
        paths = self.physx.get_scene_query_paths_from_ids([hit["collision"] for hit in hits])
        return [
            np.array(hit["position"]) for hit, at in zip(hits, paths, strict=True) if at == path
        ]

    def _size(self, path: str, pose: Pose) -> FloatArray:
        """Extents of a collider along the axes of its body, measured with rays from outside."""
        centre, size = np.asarray(pose.position), np.full(3, np.nan)
        for k, axis in enumerate(pose.rotation().T):
            ends = [self._hits(path, centre + s * REACH * axis, -s * axis) for s in (1, -1)]
            if all(ends):
                size[k] = (ends[0][0] - ends[1][0]) @ axis
        return size

    def _height(self) -> float:
        hits = self._hits(usd.GROUND, np.array([0.0, 0.0, REACH]), np.array([0.0, 0.0, -1.0]))
        return float(hits[0][2]) if hits else math.nan

    def close(self) -> None:
        for binding, _ in getattr(self, "_bindings", {}).values():
            binding.destroy()
        physx, stage = getattr(self, "physx", None), getattr(self, "stage", None)
        if physx is not None:
            if stage is not None and physx.is_stage_attached(stage):
                physx.wait_task(physx.detach_ovstage())
            if stage is not None:
                stage.destroy()
            physx.destroy()
        self._bindings, self.physx, self.stage = {}, None, None


def _friction(
    values: Mapping[str, Mapping[str, FloatArray]], path: str, shapes: int | None = None
) -> FloatArray | float:
    """The one coefficient of all shapes of a prim, static and dynamic; else all of them."""
    count = int(values["shapeCount"][path]) if shapes is None else shapes
    found = np.unique([np.atleast_1d(values[name][path])[:count] for name in _FRICTIONS])
    return float(found[0]) if len(found) == 1 else found


def _attributes(s: OvPhysXSettings) -> dict[str, dict[str, Any]]:
    """The settings in the words of PhysX's schemas."""
    iterations = {"solverVelocityIterationCount": s.velocity_iterations}
    return {
        "physxScene": {
            "solverType": s.solver,
            "enableGPUDynamics": False,
            "disableSleeping": not s.sleeping,
            "frictionOffsetThreshold": s.friction_offset_threshold,
            "frictionCorrelationDistance": s.friction_correlation_distance,
            "solveArticulationContactLast": s.contact_last,
        },
        "physxRigidBody": {
            "solverPositionIterationCount": s.body_iterations,
            **iterations,
            "linearDamping": s.linear_damping,
            "angularDamping": s.angular_damping,
            "maxDepenetrationVelocity": s.max_depenetration_velocity,
        },
        "physxArticulation": {"solverPositionIterationCount": s.arm_iterations, **iterations},
        "physxCollision": {"contactOffset": s.contact_offset, "restOffset": s.rest_offset},
    }


def _register_schemas() -> None:
    """Tell the USD library of PhysX's schemas, once in a process."""
    global _registered
    if not _registered:
        paths = [str(path) for path in schema_support.physx_schema_paths()]
        ovstage.population.register_usd_schemas(paths)
        _registered = True
