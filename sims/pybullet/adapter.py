"""PyBullet (Bullet 2.x), through its Python bindings.

Drives are Bullet's own position motors (joints.py). They are not springs: there is no stiffness in
N m/rad, and no effort feed-forward, which they do not need. The fingers' effort limit is the grip's
squeeze. What joints do beside, and those that have a motor alone (`scene.Joint`), is there too.

What was learnt stands in docs/engines/pybullet.md.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.description.links import borne, frames, joined, motion_subspace, reduced
from pytest_simbench.scene import FloatArray, Scene
from pytest_simbench.simulator import (
    Capability,
    Deviation,
    NotSupportedError,
    PreparedRobot,
    Simulator,
    SimulatorInfo,
    heavy,
    lazy_import,
)
from pytest_simbench.simulator.base import EYE, FIELD_OF_VIEW, LOOK_AT, named_parts

from .anchors import Anchors
from .joints import Drives, Pushed, couple, rub
from .readback import ReadBack, wrench
from .settings import CHOSEN_ON, PROFILES, PyBulletSettings
from .world import ROBOT, WORLD, add_body, close_loop, set_surface

pybullet = lazy_import("pybullet")


class PyBullet(Simulator):
    """Adapter of PyBullet."""

    info = SimulatorInfo(
        name="pybullet",
        title="PyBullet",
        distribution="pybullet",
        modules=("pybullet",),
        install="pip install 'pytest-simbench[pybullet]'",
        licence="Zlib",
        engine="Bullet",
        language="C++",
        tested_version="3.2.7",
        oldest_version="3.2.2",  # before 3.2.6 there are no wheels for Python 3.11
        companions={"3.2.2": ("numpy<2",), "3.2.7": ("numpy",)},  # what it was compiled for
        friction_rule="geometric",
        capabilities=Capability.named(
            "window offscreen save_restore exact_restore contact_count contact_forces compound "
            "loops couplings apart self_collide joint_wrenches deterministic"
        ),
        deviations=(
            Deviation("joint/*/armature", "Bullet has no rotor inertia"),
            Deviation(
                "joint/*/stiffness joint/*/damping",
                "position motors are velocity constraints, neither springs nor dampers: an effort "
                "beside one does nothing",
            ),
            Deviation("joint/*/rest", "the adapter pushes springs of joints; Bullet has none"),
            Deviation(
                "",
                "damping and springs of joints are pushed by the adapter, once a step",
                only="passive_damping",
            ),
            Deviation("joint/*/effort_limit", "Bullet keeps its motors' largest force to itself"),
            Deviation("body/*/damping link/*/damping", "Bullet keeps its damping to itself"),
            Deviation(
                "",
                "Bullet's damping c brakes by c v (1 + v) instead of c v",
                only="damping",
            ),
            Deviation(
                "",
                "an impact gives back its depth as speed too: restitution is 0.03 too large",
                only="restitution",
            ),
            Deviation("body/*/gravity link/*/gravity", "Bullet has one gravity for all"),
            Deviation("body/*/touches link/*/touches", "Bullet keeps its filters to itself"),
            Deviation(
                "link/*/meshes",
                "Bullet leaves out corners of a mesh's convex hull",
                within=5e-5,
                elsewhere=1e-4,
            ),
            Deviation(
                "body/*/meshes", "Bullet moves a mesh's corners by 1/4000 of its size", within=5e-4
            ),
            Deviation(
                "body/*/margin link/*/margin",
                "Bullet's collision margin; a box has it within its faces, a mesh outside",
                within=0.001,
            ),
        ),
        install_size_mb=100,
    )
    profiles = PROFILES
    chosen_on = CHOSEN_ON
    settings: PyBulletSettings

    def load(self, scene: Scene) -> None:
        self.begin(scene)
        self._commanded: tuple[FloatArray, ...] | None = None
        s = self.settings
        options = "--width=1024 --height=768" if self.gui else ""
        self.client = c = pybullet.connect(
            pybullet.GUI if self.gui else pybullet.DIRECT, options=options
        )
        if c < 0:
            raise RuntimeError("PyBullet could not open its window")
        if self.gui:
            pybullet.configureDebugVisualizer(pybullet.COV_ENABLE_GUI, 0, physicsClientId=c)
            pybullet.resetDebugVisualizerCamera(1.6, 50.0, -30.0, [0.5, 0, 0.3], physicsClientId=c)
        pybullet.setGravity(*scene.gravity, physicsClientId=c)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=s.timestep,
            numSolverIterations=s.solver_iterations,
            solverResidualThreshold=s.solver_residual,
            contactERP=s.contact_erp,
            frictionERP=s.friction_erp,
            enableConeFriction=int(s.cone_friction),
            deterministicOverlappingPairs=int(s.ordered_pairs),
            physicsClientId=c,
        )
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=c)
        self._ground = pybullet.createMultiBody(0, plane, physicsClientId=c)
        set_surface(c, self._ground, s, scene.ground_friction, scene.ground_restitution)
        self._bodies = {body.name: add_body(c, body, s, heavy(scene)) for body in scene.bodies}
        self._free = [self._bodies[box.name] for box in scene.free_bodies]
        self._led = [self._bodies[body.name] for body in scene.prescribed_bodies]
        self._leading: list[tuple[int, FloatArray]] = []
        self._falls = s.timestep * np.asarray(scene.gravity)
        self._part_from_still(scene)
        self._robot = -1
        self._anchors: Anchors | None = None
        self._pushed: Pushed | None = None
        self._borne: dict[int, FloatArray] = {}
        self._couplings: list[int] = []
        self._closures: list[int] = []
        self._joints: list[int] = []
        self._links: dict[str, int] = {}
        if self.prepared is not None:
            self._load_robot(self.prepared)
        self._parts = named_parts(  # Bullet's numbers of body and link
            (self._ground, -1),
            {name: (body, -1) for name, body in self._bodies.items()},
            {name: (self._robot, link) for name, link in self._links.items()},
        )
        for pair in scene.apart:
            (first, a), (second, b) = (self._parts[name] for name in pair)
            pybullet.setCollisionFilterPair(first, second, a, b, 0, c)

    def _part_from_still(self, scene: Scene) -> None:
        """Prescribed bodies do not touch what nothing can move."""
        fixed = [self._bodies[body.name] for body in scene.fixed_bodies]
        for body in self._led:
            for other in (self._ground, *fixed, *self._led):
                if other != body:
                    pybullet.setCollisionFilterPair(body, other, -1, -1, 0, self.client)

    def _load_robot(self, prepared: PreparedRobot) -> None:
        c, robot = self.client, prepared.robot
        with tempfile.TemporaryDirectory() as folder:
            self._robot = pybullet.loadURDF(
                str(prepared.write_urdf(folder)),
                useFixedBase=True,
                flags=pybullet.URDF_USE_INERTIA_FROM_FILE
                | (pybullet.URDF_USE_SELF_COLLISION if robot.self_collide else 0),
                physicsClientId=c,
            )
        infos = [
            pybullet.getJointInfo(self._robot, i, physicsClientId=c)
            for i in range(pybullet.getNumJoints(self._robot, physicsClientId=c))
        ]
        index = {info[1].decode(): i for i, info in enumerate(infos)}
        self._links = {info[12].decode(): i for i, info in enumerate(infos)}
        self._links[prepared.root] = -1
        self._joints = [index[name] for name in robot.joint_names]
        for link in range(-1, len(infos)):
            set_surface(
                c,
                self._robot,
                self.settings,
                robot.friction,
                link=link,
                group=ROBOT,
                touches=WORLD | ROBOT if robot.self_collide else WORLD,
            )
        if self.settings.friction_anchor:
            self._anchors = Anchors(c, self._robot, self.settings.timestep)
        if robot.self_collide:
            for pair in joined(prepared):
                numbers = (self._links[name] for name in pair)
                pybullet.setCollisionFilterPair(self._robot, self._robot, *numbers, 0, c)
        for joint, drive in zip(self._joints, robot.joints, strict=True):
            pybullet.resetJointState(self._robot, joint, drive.initial_position, physicsClientId=c)
        for joint in self._joints:
            pybullet.enableJointForceTorqueSensor(self._robot, joint, True, physicsClientId=c)
        self._couplings = [
            couple(c, self._robot, index[pair.leader], index[pair.follower], pair)
            for pair in (*robot.gripper.couplings, *robot.couplings)
        ]
        self._couplings += [
            rub(c, self._robot, index[joint.name], joint.friction)
            for joint in robot.joints
            if joint.friction
        ]
        forces = borne(prepared, self.scene.gravity)
        self._borne = {self._links[name]: force for name, force in forces.items()}
        if any(joint.spring or joint.passive_damping or joint.motor for joint in robot.joints):
            step = self.settings.timestep
            self._pushed = Pushed(c, self._robot, self._joints, robot, step)
        self._closures = [
            close_loop(c, self._robot, self._links, closure, frames(prepared, closure))
            for closure in reduced(prepared)
        ]
        self._drives = Drives(c, self._robot, self._joints, robot, self.settings)
        self.command(robot.column("initial_position"), *np.zeros((2, len(robot.joints))))

    def read_back(self) -> dict[str, Any]:
        return ReadBack(self).all()

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        self._commanded = (position, velocity, effort)
        if self._pushed is not None:
            self._pushed.command(effort)
        self._drives.command(position, velocity)

    def push(self, wrenches: FloatArray) -> None:
        c = self.client
        for body, row in zip(self._free, wrenches, strict=True):
            place, _ = pybullet.getBasePositionAndOrientation(body, c)
            force, torque = row[:3], row[3:]
            pybullet.applyExternalForce(body, -1, force, place, pybullet.WORLD_FRAME, c)
            pybullet.applyExternalTorque(body, -1, torque, pybullet.WORLD_FRAME, c)

    def lead(self, before: FloatArray, after: FloatArray) -> None:
        self._leading = list(zip(self._led, before, strict=True))

    def step(self) -> None:
        for body, row in self._leading:
            w, x, y, z = row[3:7]
            pybullet.resetBasePositionAndOrientation(body, row[:3], [x, y, z, w], self.client)
            # Bullet has one gravity for all, which acts before contacts do
            pybullet.resetBaseVelocity(body, row[7:10] - self._falls, row[10:], self.client)
        if self._pushed is not None:
            self._pushed.push()
        for link, force in self._borne.items():
            at = self._robot, link
            place = pybullet.getLinkState(*at, physicsClientId=self.client)[0]
            pybullet.applyExternalForce(*at, force, place, pybullet.WORLD_FRAME, self.client)
        if self._anchors is None:
            pybullet.stepSimulation(self.client)
        else:
            self._anchors.step(self._steps)
        self._steps += 1

    def body_state(self) -> FloatArray:
        c = self.client
        numbers: list[float] = []  # one array in the end: rows of arrays take twice as long
        pose, velocity = pybullet.getBasePositionAndOrientation, pybullet.getBaseVelocity
        for body in self._free:
            position, (x, y, z, w) = pose(body, c)
            linear, angular = velocity(body, c)
            numbers += (*position, w, x, y, z, *linear, *angular)
        return np.array(numbers, dtype=np.float64).reshape(-1, 13)

    def joint_state(self) -> FloatArray:
        if not self._joints:
            return np.empty((2, 0))
        states = pybullet.getJointStates(self._robot, self._joints, physicsClientId=self.client)
        return np.array([[state[0] for state in states], [state[1] for state in states]])

    def save(self) -> tuple[Any, ...]:
        anchors = self._anchors.save() if self._anchors else None
        made = pybullet.saveState(physicsClientId=self.client)
        pushed = self._pushed.last if self._pushed else None
        return made, self._steps, self._commanded, anchors, pushed

    def restore(self, state: tuple[Any, ...]) -> None:
        made, self._steps, commanded, anchors, pushed = state
        pybullet.restoreState(stateId=made, physicsClientId=self.client)
        if self._anchors is not None and anchors is not None:
            self._anchors.restore(anchors)
        if self._pushed is not None:
            self._pushed.last = pushed
        if commanded is not None:  # motor targets are not part of Bullet's state
            self.command(*commanded)

    def contact_forces(self) -> Iterator[tuple[str, str, FloatArray]]:
        names = {part: name for name, part in self._parts.items()}
        for point in pybullet.getContactPoints(physicsClientId=self.client) or ():
            first, second = names[point[1], point[3]], names[point[2], point[4]]
            force = np.array([point[9], point[10], point[12]]) @ [point[7], point[11], point[13]]
            yield first, second, np.concatenate([force, np.cross(point[5], force)])

    def joint_wrenches(self) -> FloatArray:
        if self.prepared is None:
            return np.empty((0, 6))
        robot = self.prepared.robot
        if robot.couplings or robot.column("friction").any():
            raise NotSupportedError("pybullet tells no wrenches of joints that rub or are coupled")
        subspaces = {joint.name: motion_subspace(joint) for joint in self.prepared.joints}
        rows = [
            wrench(self.client, self._robot, joint, subspaces[name])
            for name, joint in zip(robot.joint_names, self._joints, strict=True)
        ]
        return np.array(rows)

    def contact_count(self) -> int:
        return len(pybullet.getContactPoints(physicsClientId=self.client) or ())

    def render(self, width: int, height: int) -> NDArray[np.uint8]:
        view = pybullet.computeViewMatrix(EYE, LOOK_AT, [0.0, 0.0, 1.0])
        angle = math.degrees(FIELD_OF_VIEW)
        lens = pybullet.computeProjectionMatrixFOV(angle, width / height, 0.05, 10.0)
        picture = pybullet.getCameraImage(
            width,
            height,
            view,
            lens,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self.client,
        )
        pixels = np.asarray(picture[2], dtype=np.uint8).reshape(height, width, 4)
        return pixels[:, :, :3].copy()

    def close(self) -> None:
        client = getattr(self, "client", None)  # none, when loading failed before
        if client is not None and pybullet.isConnected(client):
            pybullet.disconnect(client)
