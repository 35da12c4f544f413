"""DART (the physics engine inside Gazebo), through its Python bindings dartpy."""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from pytest_simbench.scene import Box, FloatArray, Scene
from pytest_simbench.simulator import (
    Capability,
    Deviation,
    PreparedRobot,
    Settings,
    Simulator,
    SimulatorInfo,
    lazy_import,
)

dartpy = lazy_import("dartpy")

COUPLING_FORCE = 1000.0


@dataclass(frozen=True)
class DARTSettings(Settings):
    timestep: float = 0.001
    detector: Literal["fcl", "ode", "bullet", "dart"] = "fcl"
    solver: Literal["dantzig", "pgs", "nsgs", "fbf"] = "dantzig"
    sleeping: bool = True
    split_impulse: bool = False
    position_gain: float = 0.1
    sweeps: int = 100
    tolerance: float = 1e-5


class DART(Simulator):
    """Adapter of DART."""

    info: ClassVar[SimulatorInfo] = SimulatorInfo(
        name="dart",
        title="DART",
        distribution="dartpy",
        modules=("dartpy",),
        install="pip install 'pytest-simbench[dart]'",
        licence="BSD-2-Clause",
        engine="DART",
        tested_version="6.20.0",
        capabilities=frozenset(
            {
                Capability.WINDOW,
                Capability.SAVE_RESTORE,
                Capability.CONTACT_COUNT,
                Capability.CONTACT_FORCES,
                Capability.DETERMINISTIC,
            }
        ),
        deviations=(
            Deviation("joint/*/armature", "DART has no rotor inertia"),
            Deviation("joint/*/stiffness", "servo motors are velocity constraints, no springs"),
            Deviation("joint/*/damping", "servo motors are velocity constraints, no dampers"),
            Deviation("joint/*finger_joint2/effort_limit", "x"),
        ),
        install_size_mb=80,
    )
    profiles: ClassVar[Mapping[str, Settings]] = {
        "default": DARTSettings(),
        "tuned": DARTSettings(detector="ode", sleeping=False, position_gain=0.5),
    }
    settings: DARTSettings

    def load(self, scene: Scene) -> None:
        s = self.settings
        self.scene = scene
        self.world = world = dartpy.simulation.World()
        world.setTimeStep(s.timestep)
        world.setGravity(np.array(scene.gravity))
        kinds = dartpy.simulation.CollisionDetectorType
        world.setCollisionDetector(getattr(kinds, s.detector.upper()))
        sleep = world.getDeactivationOptions()
        sleep.mEnabled = s.sleeping
        world.setDeactivationOptions(sleep)
        solver = world.getConstraintSolver()
        solver.setSplitImpulseEnabled(s.split_impulse)
        c = dartpy.constraint
        if s.solver == "pgs":
            solver.setBoxedLcpSolver(c.PgsBoxedLcpSolver())
        elif s.solver == "nsgs":
            o = c.NsgsFrictionSolver.Options()
            o.maxSweeps = s.sweeps
            o.tolerance = s.tolerance
            solver.setBoxedLcpSolver(c.NsgsFrictionSolver(o))
        elif s.solver == "fbf":
            o = c.FbfFrictionSolver.Options()
            o.tolerance = s.tolerance
            solver.setBoxedLcpSolver(c.FbfFrictionSolver(o))
        self._ground = self._add_ground(scene.ground_friction)
        self._bodies = {box.name: self._add_box(box) for box in scene.bodies}
        self._free = [self._bodies[box.name] for box in scene.free_bodies]
        self._robot = None
        self.prepared = None
        if scene.robot is not None:
            self.prepared = PreparedRobot(scene.robot)
            self._load_robot(self.prepared)

    def _add_ground(self, friction: float) -> Any:
        skeleton = dartpy.dynamics.Skeleton("ground")
        _, body = skeleton.createWeldJointAndBodyNodePair()
        shape = body.createShapeNode(dartpy.dynamics.PlaneShape([0.0, 0.0, 1.0], 0.0))
        self._set_surface(shape, friction)
        skeleton.setMobile(False)
        self.world.addSkeleton(skeleton)
        return body

    def _add_box(self, box: Box) -> Any:
        dynamics = dartpy.dynamics
        skeleton = dynamics.Skeleton(box.name)
        place = dartpy.math.Isometry3()
        place.set_translation(np.array(box.pose.position))
        place.set_rotation(box.pose.rotation())
        if box.fixed:
            joint, body = skeleton.createWeldJointAndBodyNodePair()
            joint.setTransformFromParentBodyNode(place)
            skeleton.setMobile(False)
        else:
            joint, body = skeleton.createFreeJointAndBodyNodePair()
            inertia = dynamics.Inertia()
            inertia.setMass(box.mass)
            inertia.setMoment(np.diag(box.inertia()))
            body.setInertia(inertia)
            joint.setPositions(dynamics.FreeJoint.convertToPositions(place))
        shape = body.createShapeNode(dynamics.BoxShape(np.array(box.size)))
        shape.createVisualAspect().setColor(list(box.colour))
        self._set_surface(shape, box.friction)
        self.world.addSkeleton(skeleton)
        return body

    def _set_surface(self, shape: Any, friction: float) -> None:
        if not shape.hasCollisionAspect():
            shape.createCollisionAspect()
        if not shape.hasDynamicsAspect():
            shape.createDynamicsAspect()
        shape.getDynamicsAspect().setFrictionCoeff(friction)

    def _load_robot(self, prepared: PreparedRobot) -> None:
        robot = prepared.robot
        loader = dartpy.utils.DartLoader()
        options = dartpy.utils.DartLoaderOptions()
        options.mDefaultRootJointType = dartpy.utils.DartLoaderRootJointType.FIXED
        loader.setOptions(options)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "robot.urdf"
            path.write_text(_with_mimic(prepared), encoding="utf-8")
            self._robot = skeleton = loader.parseSkeleton(str(path))
        for body in skeleton.getBodyNodes():
            for shape in body.getShapeNodes():
                if shape.hasCollisionAspect():
                    self._set_surface(shape, robot.friction)
        dynamics = dartpy.dynamics
        follower = robot.gripper.joints[1]
        for joint in robot.joints:
            drive = skeleton.getJoint(joint.name)
            drive.setLimitEnforcement(True)
            limit = joint.effort_limit
            if joint.name == follower:
                limit = COUPLING_FORCE
            else:
                drive.setActuatorType(dynamics.ActuatorType.SERVO)
            drive.setForceUpperLimit(0, limit)
            drive.setForceLowerLimit(0, -limit)
        index = {skeleton.getDof(i).getName(): i for i in range(skeleton.getNumDofs())}
        self._dofs = [index[name] for name in robot.joint_names]
        initial = robot.column("initial_position")
        skeleton.setPositions(self._dofs, initial)
        self._index = np.array(self._dofs)
        self._driven = np.array([name != follower for name in robot.joint_names])
        self._gain = np.zeros(len(self._dofs))
        self._gain[self._index] = self._driven * self.settings.position_gain / self.settings.timestep
        self.world.addSkeleton(skeleton)
        self.command(initial, 0 * initial, 0 * initial)

    def read_back(self) -> dict[str, Any]:
        world = self.world
        ground = self._ground.getShapeNode(0)
        reported: dict[str, Any] = {
            "gravity": world.getGravity(),
            "timestep": world.getTimeStep(),
            "ground/friction": ground.getDynamicsAspect().getFrictionCoeff(),
            "ground/height": ground.getShape().getOffset() + ground.getWorldTransform().translation()[2],
        }
        for name, body in self._bodies.items():
            shape = body.getShapeNode(0)
            reported[f"body/{name}/size"] = shape.getShape().getSize()
            reported[f"body/{name}/friction"] = shape.getDynamicsAspect().getFrictionCoeff()
            place = shape.getWorldTransform()
            reported[f"body/{name}/pose"] = [*place.translation(), *place.quaternion().wxyz()]
            if body.getSkeleton().isMobile():
                reported[f"body/{name}/mass"] = body.getMass()
                reported[f"body/{name}/inertia"] = np.diag(body.getInertia().getMoment())
        if self.prepared is not None:
            self._read_back_robot(self.prepared, reported)
        return reported

    def _read_back_robot(self, prepared: PreparedRobot, reported: dict[str, Any]) -> None:
        robot = self._robot
        dynamics = dartpy.dynamics
        reported["gripper/coupled"] = float(
            robot.getJoint(prepared.robot.gripper.joints[1]).getActuatorType()
            == dynamics.ActuatorType.MIMIC
        )
        for name in prepared.robot.joint_names:
            joint = robot.getJoint(name)
            reported[f"joint/{name}/limits"] = [
                joint.getPositionLowerLimit(0),
                joint.getPositionUpperLimit(0),
            ]
            reported[f"joint/{name}/effort_limit"] = joint.getForceUpperLimit(0)
            reported[f"joint/{name}/initial_position"] = joint.getPosition(0)
        for link in prepared.moving_links:
            body = robot.getBodyNode(link.name)
            reported[f"link/{link.name}/mass"] = body.getMass()
            reported[f"link/{link.name}/inertia"] = np.sort(
                np.linalg.eigvalsh(body.getInertia().getMoment())
            )
            frictions = {
                shape.getDynamicsAspect().getFrictionCoeff()
                for shape in body.getShapeNodes()
                if shape.hasDynamicsAspect()
            }
            reported[f"link/{link.name}/friction"] = np.array(sorted(frictions)).squeeze()

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        s = self.settings
        # gain (q* - dt v* - q) / dt + v*
        gain = s.position_gain / s.timestep
        base = np.zeros(len(position))
        base[self._index] = (gain * position + (1 - s.position_gain) * velocity) * self._driven
        self._base = base

    def step(self) -> None:
        if self._robot is not None:
            q = self._robot.getPositions()
            self._robot.setCommands(self._base - self._gain * q)
        self.world.step(False)

    @property
    def time(self) -> float:
        return float(self.world.getTime())

    def body_state(self) -> FloatArray:
        state = np.empty((len(self._free), 13))
        for row, body in zip(state, self._free, strict=True):
            place = body.getWorldTransform()
            row[:3] = place.translation()
            row[3:7] = place.quaternion().wxyz()
            row[7:10], row[10:] = body.getCOMLinearVelocity(), body.getAngularVelocity()
        return state

    def joint_state(self) -> FloatArray:
        if self._robot is None:
            return np.empty((2, 0))
        q, v = self._robot.getPositions(), self._robot.getVelocities()
        return np.stack([q[self._index], v[self._index]])

    def contact_count(self) -> int:
        return int(self.world.getLastCollisionResult().getNumContacts())


def _with_mimic(prepared: PreparedRobot) -> str:
    first, second = prepared.robot.gripper.joints
    root = ET.fromstring(prepared.to_urdf())
    for joint in root.findall("joint"):
        if joint.attrib["name"] == second:
            ET.SubElement(joint, "mimic", joint=first, multiplier="1", offset="0")
    return ET.tostring(root, encoding="unicode")
