"""Omniverse PhysX (NVIDIA), the engine inside Isaac Sim, through the package ovphysx.

The world is handed over as a USD stage, see `ovphysx_stage`. Drives are PhysX's own: implicit
springs and dampers in reduced coordinates. Their largest force bounds the drive alone, so effort
feed-forward rides on the position target, q* + tau_ff / k, and the limit bounds the whole sum.

While stepping the engine is commanded and read through its tensor bindings: 0.01 ms each, where a
session (`ovphysx_session`) takes 0.4 ms. They are deprecated; the version is pinned. The first
touch of a binding runs a step of its own, so before the first step only sessions are used.

It has no renderer: ovphysx is a headless library, and Isaac Sim's window is not part of it.
Contacts could be counted, but their reports cost 15 % of stepping. States can be written, yet not
the contacts' memory, so restoring is not claimed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from pytest_simbench.sims import ovphysx_stage as usd
from pytest_simbench.sims.ovphysx_session import Session

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

ovphysx_types = lazy_import("ovphysx.types")

_FRICTIONS = ("staticFriction", "dynamicFriction")


@dataclass(frozen=True)
class OvPhysXSettings(Settings):
    """PhysX's options; defaults are those of its USD schemas.

    `tuned` takes a short step with few iterations, which lets an impact through: with many, a
    pyramid takes it as one block. What that costs the drives is told in docs/engines/ovphysx.md.

    Attributes:
        timestep: [s]; 1/60 is what PhysxSceneAPI says.
        solver: temporal or projected Gauss-Seidel.
        body_iterations: position iterations of free bodies.
        arm_iterations: those of the articulation. The largest number of all counts for the whole
            scene: with 4 for the arm, 1, 2 and 4 for the bodies give the same bits.
        velocity_iterations: of both.
        linear_damping, angular_damping: of bodies and links [1/s].
        sleeping: whether bodies at rest are frozen.
        max_depenetration_velocity: with which bodies that overlap are pushed apart [m/s].
        contact_offset: distance at which contacts are made [m]; None lets PhysX choose by size.
        rest_offset: distance at which they rest [m]; None lets PhysX choose.
        friction_offset_threshold: distance below which a contact has friction [m].
        friction_correlation_distance: below which contacts share a friction anchor [m].
        forces_every_iteration: apply gravity in each position iteration instead of once a step.
        contact_last: solve the articulation's contacts after everything else.
        threads: workers of PhysX; 0 computes in the calling thread. Its own default is 8, which
            computes the same bits, five times as slowly in a scene this small.
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
    forces_every_iteration: bool = True
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
        licence="NVIDIA Omniverse licence (proprietary)",
        engine="PhysX 5",
        language="C++",
        tested_version="0.7.0.74035321",
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
        "tuned": OvPhysXSettings(
            timestep=0.002,
            body_iterations=4,
            arm_iterations=4,
            angular_damping=0.0,
            sleeping=False,
        ),
    }
    settings: OvPhysXSettings

    def load(self, scene: Scene) -> None:
        self.scene, self._steps = scene, 0
        self.prepared = PreparedRobot(scene.robot) if scene.robot is not None else None
        self._waiting: tuple[FloatArray, FloatArray] | None = None
        self._bindings: dict[str, tuple[Any, Any]] = {}
        text = usd.Stage(scene, self.prepared, _attributes(self.settings)).text()
        self.session = Session(text, self.settings.threads)
        self._free = [usd.body_path(i) for i, box in enumerate(scene.bodies) if not box.fixed]
        self._joints: list[str] = []
        if self.prepared is not None:
            robot = self.prepared.robot
            self._joints = [usd.joint_path(i) for i in range(len(robot.joints))]
            self._stiffness = robot.column("stiffness")
            kinds = {joint.name: joint.kind for joint in self.prepared.joints}
            turning = [kinds[name] == "revolute" for name in robot.joint_names]
            self._unit = np.where(turning, np.pi / 180, 1.0)  # of the sessions, which count degrees

    def _binding(self, kind: str) -> tuple[Any, Any]:
        """A tensor binding of the robot or the free bodies, with a buffer of its shape."""
        if kind not in self._bindings:
            tensor = getattr(ovphysx_types.TensorType, kind)
            prims = [usd.ROOT] if kind.startswith("ARTICULATION") else self._free
            binding = self.session.physx.create_tensor_binding(
                tensor_type=tensor, prim_paths=prims, raise_if_empty=True
            )
            self._bindings[kind] = binding, np.zeros(binding.shape, np.float32)
        return self._bindings[kind]

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        targets = position + effort / self._stiffness, velocity
        if self._steps == 0:
            self._waiting = targets
            return
        for kind, values in zip(("POSITION", "VELOCITY"), targets, strict=True):
            binding, buffer = self._binding(f"ARTICULATION_DOF_{kind}_TARGET")
            buffer[0, self._columns] = values
            binding.write(buffer)

    def step(self) -> None:
        if self._waiting is not None:
            for kind, values in zip(("Position", "Velocity"), self._waiting, strict=True):
                given = zip(self._joints, values / self._unit, strict=True)
                self.session.write_joints(f"joint{kind}Target", dict(given))
            self._waiting = None
        self.session.physx.step_sync(self.settings.timestep)
        self._steps += 1
        if self._steps == 1 and self._joints:
            names = self._binding("ARTICULATION_DOF_POSITION")[0].dof_names
            self._columns = [names.index(path.rpartition("/")[2]) for path in self._joints]

    @property
    def time(self) -> float:
        return self._steps * self.settings.timestep

    def body_state(self) -> FloatArray:
        state = np.empty((len(self._free), 13))
        if not self._free:
            return state
        if self._steps == 0:
            names = ("position", "orientation", "linearVelocity", "angularVelocity")
            values = self.session.read("RIGID_BODY", *names)
            for row, path in zip(state, self._free, strict=True):
                row[:] = np.concatenate([values[name][path] for name in names])
        else:
            for kind, columns in (("POSE", slice(0, 7)), ("VELOCITY", slice(7, 13))):
                binding, buffer = self._binding(f"RIGID_BODY_{kind}")
                binding.read(buffer)
                state[:, columns] = buffer
        state[:, 3:7] = state[:, [6, 3, 4, 5]]
        return state

    def joint_state(self) -> FloatArray:
        state = np.empty((2, len(self._joints)))
        if not self._joints:
            return state
        if self._steps == 0:
            values = self.session.read("ARTICULATION_JOINT", "jointPosition", "jointVelocity")
            for row, name in zip(state, ("jointPosition", "jointVelocity"), strict=True):
                row[:] = [values[name][path][0] for path in self._joints] * self._unit
            return state
        for row, kind in zip(state, ("POSITION", "VELOCITY"), strict=True):
            binding, buffer = self._binding(f"ARTICULATION_DOF_{kind}")
            binding.read(buffer)
            row[:] = buffer[0, self._columns]
        return state

    def read_back(self) -> dict[str, Any]:
        reported: dict[str, Any] = {"ground/height": self.session.height(usd.GROUND)}
        names = ("position", "orientation", "mass", "inertia", "shapeCount", *_FRICTIONS)
        values = self.session.read("RIGID_BODY", *names)
        for index, box in enumerate(self.scene.bodies):
            path, prefix = usd.body_path(index), f"body/{box.name}"
            x, y, z, w = values["orientation"][path]
            pose = Pose.from_array([*values["position"][path], w, x, y, z])
            reported[f"{prefix}/pose"] = pose.as_array()
            reported[f"{prefix}/size"] = self.session.size(f"{path}/shape", pose)
            reported[f"{prefix}/friction"] = _friction(values, path)
            if not box.fixed:
                reported[f"{prefix}/mass"] = values["mass"][path]
                reported[f"{prefix}/inertia"] = np.diag(values["inertia"][path].reshape(3, 3))
        if self.prepared is not None:
            self._read_back_robot(self.prepared, reported)
        return reported

    def _read_back_robot(self, prepared: PreparedRobot, reported: dict[str, Any]) -> None:
        ones = np.ones_like(self._unit)
        attributes = {
            "jointLimit": ("limits", self._unit),
            "jointMaxForce": ("effort_limit", ones),
            "jointStiffness": ("stiffness", 1 / self._unit),
            "jointDamping": ("damping", 1 / self._unit),
            "jointArmature": ("armature", ones),
            "jointPosition": ("initial_position", self._unit),
        }
        joints = self.session.read("ARTICULATION_JOINT", *attributes)
        for attribute, (quantity, units) in attributes.items():
            named = zip(prepared.robot.joint_names, self._joints, units, strict=True)
            for name, path, unit in named:
                reported[f"joint/{name}/{quantity}"] = joints[attribute][path][0] * unit
        links = self.session.read("ARTICULATION_LINK", "mass", "inertia", "shapeCount", *_FRICTIONS)
        names = list(prepared.links)
        for link in prepared.moving_links:
            path, prefix = usd.link_path(names.index(link.name)), f"link/{link.name}"
            reported[f"{prefix}/mass"] = links["mass"][path]
            tensor = links["inertia"][path].reshape(3, 3)
            reported[f"{prefix}/inertia"] = np.sort(np.linalg.eigvalsh(tensor))
            reported[f"{prefix}/friction"] = _friction(links, path)

    def close(self) -> None:
        for binding, _ in getattr(self, "_bindings", {}).values():
            binding.destroy()
        self._bindings = {}
        session, self.session = getattr(self, "session", None), None
        if session is not None:  # not so when loading failed before
            session.close()


def _friction(values: Mapping[str, Mapping[str, FloatArray]], path: str) -> Any:
    """The one coefficient of all shapes of a prim, static and dynamic; else all of them."""
    count = int(values["shapeCount"][path])
    found = np.unique([np.atleast_1d(values[name][path])[:count] for name in _FRICTIONS])
    return found[0] if len(found) == 1 else found


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
            "enableExternalForcesEveryIteration": s.forces_every_iteration,
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
