"""Omniverse PhysX (NVIDIA), the engine inside Isaac Sim, through the package ovphysx.

The world is handed over as a USD stage, see `stage`. Drives are PhysX's own: implicit
springs and dampers in reduced coordinates. Their largest force bounds the drive alone, so effort
feed-forward rides on the position target, q* + tau_ff / k, and the limit bounds the whole sum. So
does a spring s of the joint itself: k is then k + s, and s (rest - q*) is added to tau_ff.

While stepping the engine is commanded and read through its tensor bindings: 0.01 ms each, where a
session (`session`) takes 0.4 ms. They are deprecated; the version is pinned. The first
touch of a binding runs a step of its own, so before the first step only sessions are used.

It has no renderer: ovphysx is a headless library, and Isaac Sim's window is not part of it.
Contacts could be counted, but their reports cost 15 % of stepping.

The contacts' memory cannot be saved, so `restore` builds the world anew, runs the one step that
bindings need, and writes the saved state: every restore has the same future, bit for bit, though
not quite that of the uninterrupted run.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.description.links import borne, link_poses
from pytest_simbench.scene import FloatArray, Pose, Scene
from pytest_simbench.scene.pose import vector3
from pytest_simbench.simulator import (
    Capability,
    Deviation,
    NotSupportedError,
    PreparedRobot,
    Simulator,
    SimulatorInfo,
    lazy_import,
)

from . import stage as usd
from .readback import ReadBack, wrenches
from .session import Session
from .settings import CHOSEN_ON, PROFILES, OvPhysXSettings

ovphysx_types = lazy_import("ovphysx.types")

_Saved = tuple[int, dict[str, NDArray[np.float32]], tuple[FloatArray, FloatArray] | None]


class OvPhysX(Simulator):
    """Adapter of Omniverse PhysX."""

    info = SimulatorInfo(
        name="ovphysx",
        title="Omniverse PhysX",
        distribution="ovphysx",
        modules=("ovphysx", "ovstage"),
        install="simbench install ovphysx",
        licence="NVIDIA Omniverse licence (proprietary)",
        engine="PhysX 5",
        language="C++",
        tested_version="0.7.0.74035321",
        oldest_version="0.7.0.74035321",  # older ones tell no joint before the first step
        friction_rule="|".join(usd.COMBINED),
        capabilities=Capability.named(
            "deterministic save_restore contact_forces compound loops couplings apart "
            "self_collide joint_wrenches"
        ),
        deviations=(
            Deviation(
                "closure/*", "ovphysx tells nothing of joints beside an articulation", only="loop"
            ),
            Deviation("timestep", "an argument of each step, which PhysX does not report"),
            Deviation("gravity", "PhysX reports no gravity through this package"),
            Deviation(
                "ground/friction ground/restitution", "PhysX reports no material of a static plane"
            ),
            Deviation("gripper/coupled coupling/*", "PhysX reports no mimic joints"),
            Deviation(
                "",
                "contact forces are told in scenes without a robot alone: reports are slow",
            ),
            Deviation(
                "joint/*/effort_limit",
                "PhysX has one spring a joint, that of its drive with the joint's own: the drive's "
                "limit bounds both, of a drive that is free none",
                within=usd.BOUNDLESS,
                only="spring",
            ),
            Deviation(
                "link/*/gravity",
                "PhysX reports whether gravity acts: a share of it is a force of each step",
                within=1.0,
                only="link_gravity",
            ),
            Deviation("joint/*/rest", "a joint's spring and its drive are one, with one target"),
            Deviation("body/*/damping link/*/damping", "PhysX reports no damping of bodies"),
            Deviation("body/*/dynamic", "PhysX does not report which bodies are kinematic"),
            Deviation("body/*/touches link/*/touches", "PhysX does not report collision groups"),
            Deviation(
                "",
                "PhysX brakes a body before it touches and bounces what is left: with tuned "
                "settings 0.27 of the speed instead of 0.6",
                only="restitution",
            ),
            Deviation(
                "link/*/meshes",
                "a convex hull that PhysX makes of a mesh has at most 64 corners",
                within=4e-3,
            ),
            Deviation(
                "body/*/boxes",
                "where a body has several shapes: measured by sweeping a box, as other shapes",
                within=3e-4,
                only="compound",
            ),
            Deviation(
                "body/*/rounds body/*/meshes",
                "measured by sweeping a box, which PhysX rounds; the cylinders differ",
                within=3e-4,
            ),
            Deviation(
                "link/*/boxes",
                "measured by sweeping a box, which PhysX rounds",
                within=1e-4,
                elsewhere=3e-4,
            ),
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
    profiles = PROFILES
    chosen_on = CHOSEN_ON
    settings: OvPhysXSettings

    def load(self, scene: Scene) -> None:
        self.begin(scene)
        self._text = usd.Stage(scene, self.prepared, _attributes(self.settings)).text()
        self._start()
        self._free = [usd.body_path(i) for i, box in enumerate(scene.bodies) if not box.fixed]
        self._led = [usd.body_path(i) for i, box in enumerate(scene.bodies) if box.prescribed]
        self._prescribed = {k: b.velocity for k, b in enumerate(scene.free_bodies) if b.prescribed}
        self._still = {  # kinematic too, so they must be given a target with the others
            usd.body_path(i): box.pose.as_array() for i, box in enumerate(scene.bodies) if box.fixed
        }
        self._joints: list[str] = []
        self._unit = np.empty(0)
        self._placed: dict[str, Pose] = {}
        self._borne: dict[str, FloatArray] = {}
        if self.prepared is not None:
            robot = self.prepared.robot
            self._joints = [usd.joint_path(i) for i in range(len(robot.joints))]
            forces = borne(self.prepared, scene.gravity, felt=0.0)
            self._borne = {name: force for name, force in forces.items() if force.any()}
            self._springs = robot.column("spring") if "spring" in scene.words else None
            self._rests = robot.column("rest")
            self._stiffness = robot.column("stiffness") + robot.column("spring")
            self._placed = link_poses(self.prepared, dict.fromkeys(robot.joint_names, 0.0))
            kinds = {joint.name: joint.kind for joint in self.prepared.joints}
            turning = [kinds[name] == "revolute" for name in robot.joint_names]
            self._unit = np.where(turning, np.pi / 180, 1.0)  # of the sessions, which count degrees

    def _start(self) -> None:
        """Begin the world anew."""
        self.close()
        self._steps = 0
        self._targets: tuple[FloatArray, FloatArray] | None = None
        self._bindings: dict[str, tuple[Any, Any]] = {}
        self.session = Session(self._text, self.settings.threads)

    def _binding(self, kind: str) -> tuple[Any, Any]:
        """A tensor binding of the robot or the free bodies, with a buffer of its shape."""
        found = self._bindings.get(kind)
        if found is None:
            tensor = getattr(ovphysx_types.TensorType, kind)
            prims = [usd.ROOT] if kind.startswith("ARTICULATION") else self._free
            binding = self.session.physx.create_tensor_binding(
                tensor_type=tensor, prim_paths=prims, raise_if_empty=True
            )
            found = self._bindings[kind] = binding, np.zeros(binding.shape, np.float32)
        return found

    def _read(self, kind: str) -> NDArray[np.float32]:
        """What a binding tells, until it is asked again."""
        binding, buffer = self._binding(kind)
        binding.read(buffer)
        return buffer

    def _write(self, kind: str, values: FloatArray | NDArray[np.float32]) -> None:
        binding, buffer = self._binding(kind)
        buffer[:] = values
        binding.write(buffer)

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        if self._springs is not None:
            effort = effort + self._springs * (self._rests - position)
        self._targets = position + effort / self._stiffness, velocity
        if self._steps > 0:
            self._write_targets(self._targets)

    def _write_targets(self, targets: tuple[FloatArray, FloatArray]) -> None:
        for kind, values in zip(("POSITION", "VELOCITY"), targets, strict=True):
            binding, buffer = self._binding(f"ARTICULATION_DOF_{kind}_TARGET")
            buffer[0, self._columns] = values
            binding.write(buffer)

    def push(self, wrenches: FloatArray) -> None:
        rows = np.hstack([wrenches, self.body_state()[:, :3]])  # and where the force acts
        if self._steps == 0:
            self.session.write("RIGID_BODY", "wrench", dict(zip(self._free, rows, strict=True)))
        else:
            self._write("RIGID_BODY_WRENCH", rows)

    def lead(self, before: FloatArray, after: FloatArray) -> None:
        rows = self._still | dict(zip(self._led, after, strict=True))
        for name, columns in (("Position", [0, 1, 2]), ("Orientation", [4, 5, 6, 3])):
            targets = {path: row[columns] for path, row in rows.items()}
            self.session.write("RIGID_BODY", f"kinematicTarget{name}", targets)

    def _bear(self, prepared: PreparedRobot) -> None:
        """Pull at links that feel a share of gravity, in the next step."""
        joints = zip(prepared.robot.joint_names, self.joint_state()[0], strict=True)
        poses, links = link_poses(prepared, dict(joints)), list(prepared.links)
        rows = {}
        for name, force in self._borne.items():
            at = poses[name] * Pose(vector3(prepared.links[name].centre))
            rows[usd.link_path(links.index(name))] = [*force, 0.0, 0.0, 0.0, *at.position]
        self.session.write("ARTICULATION_LINK", "wrench", rows)

    def step(self) -> None:
        if self._steps == 0 and self._targets is not None:
            for kind, values in zip(("Position", "Velocity"), self._targets, strict=True):
                given = zip(self._joints, values / self._unit, strict=True)
                self.session.write("ARTICULATION_JOINT", f"joint{kind}Target", dict(given))
        if self._borne and self.prepared is not None:
            self._bear(self.prepared)
        self.session.physx.step_sync(self.settings.timestep)
        self._steps += 1
        if self._steps == 1 and self._joints:
            names = self._binding("ARTICULATION_DOF_POSITION")[0].dof_names
            self._columns = [names.index(path.rpartition("/")[2]) for path in self._joints]

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
                state[:, columns] = self._read(f"RIGID_BODY_{kind}")
        state[:, 3:7] = state[:, [6, 3, 4, 5]]
        for k, velocity in self._prescribed.items():  # PhysX has it after a step alone
            state[k, 7:] = velocity
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
            row[:] = self._read(f"ARTICULATION_DOF_{kind}")[0, self._columns]
        return state

    def joint_wrenches(self) -> FloatArray:
        if self.prepared is None or self._steps == 0:  # nothing was transmitted so far
            return np.zeros((len(self._joints), 6))
        kind = "ARTICULATION_LINK_INCOMING_JOINT_FORCE"
        told, names = self._read(kind)[0], self._binding(kind)[0].body_names
        order = [names.index(f"link_{k}") for k in range(len(self.prepared.links))]
        return wrenches(told[order].astype(float), self.prepared, self.joint_state()[0])

    def read_back(self) -> dict[str, Any]:
        return ReadBack(self).all()

    def contact_forces(self) -> Iterator[tuple[str, str, FloatArray]]:
        if not usd.reports_contacts(self.scene):
            raise NotSupportedError("ovphysx tells contact forces in scenes without a robot alone")
        names = {usd.GROUND: "ground"}
        names |= {usd.body_path(i): f"body/{body.name}" for i, body in enumerate(self.scene.bodies)}
        for (first, second), points in self.session.contacts().items():
            for impulse, place in points:
                force = np.asarray(impulse, dtype=float) / self.settings.timestep
                wrench = np.concatenate([force, np.cross(place, force)])
                yield names[first], names[second], wrench

    def save(self) -> _Saved:
        kinds = self._state_kinds() if self._steps > 0 else ()
        values = {kind: self._read(kind).copy() for kind in kinds}
        return self._steps, values, self._targets

    def restore(self, state: _Saved) -> None:
        steps, values, targets = state
        self._start()
        if steps > 0:
            self.step()
        for kind, saved in values.items():
            self._write(kind, saved)
        self._steps, self._targets = steps, targets
        if targets is not None and steps > 0:
            self._write_targets(targets)

    def _state_kinds(self) -> list[str]:
        """Bindings that hold the state; positions come first, since they reset velocities."""
        bodies = ["RIGID_BODY_POSE", "RIGID_BODY_VELOCITY"] if self._free else []
        joints = ["ARTICULATION_DOF_POSITION", "ARTICULATION_DOF_VELOCITY"] if self._joints else []
        return bodies + joints

    def close(self) -> None:
        opened = self.__dict__  # in which either is missing, when loading failed before
        for binding, _ in opened.pop("_bindings", {}).values():
            binding.destroy()
        session: Session | None = opened.pop("session", None)
        if session is not None:
            session.close()


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
