"""DART (the physics engine inside Gazebo), through its Python bindings dartpy.

Drives are DART's own servo motors: velocity constraints with the effort limit as largest force,
solved together with the contacts. Each step h they are told the velocity at which the scene's
drive law (`scene.Joint`) asks for no effort at its end, (k (q* - q) + d v*) / (h k + d): they are
that law, infinitely stiff at the same k / d. What is told a higher velocity, as by a share of the
error in each step (0.5 of it: 500/s against k / d = 10/s), brakes too late once its effort
saturates, and swings: the Panda's joint 5 at 40 rad/s.

DART's other drive, spring and damper with a rest position, is implicit too but knows no effort
limit, and contact impulses do not feel its damping: at rest against a contact only m / (m + h d)
of the spring's force arrives, a quarter for a finger. So it is no drive, and only what joints have
of their own. A joint that has a motor alone (`scene.Joint`) is of DART's kind `FORCE`.

What was learnt stands in docs/engines/dart.md.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from typing import Any

import numpy as np

from pytest_simbench.description.links import borne, ends, reduced
from pytest_simbench.scene import FloatArray, Scene, rotation_matrix
from pytest_simbench.simulator import (
    FOLLOWER,
    Capability,
    Deviation,
    NotSupportedError,
    PreparedRobot,
    Simulator,
    SimulatorInfo,
    lazy_import,
)

from .bodies import ONE_CONTACT_ON_A_PLANE, Couplings, add_body, add_ground, set_surface
from .readback import ReadBack
from .settings import CHOSEN_ON, PROFILES, DARTSettings

dartpy = lazy_import("dartpy")

WEAKEST = 1e-9
"""Least resistance h k + d of a drive [N m s/rad or N s/m]: a joint may have neither."""

State = tuple[float, list[tuple[FloatArray, FloatArray, FloatArray]], FloatArray]
"""Time, positions, velocities and accelerations of each skeleton, the command."""


class DART(Simulator):
    """Adapter of DART."""

    info = SimulatorInfo(
        name="dart",
        title="DART",
        distribution="dartpy",
        modules=("dartpy",),
        install="pip install 'pytest-simbench[dart]'",
        licence="BSD-2-Clause",
        engine="DART",
        language="C++",
        tested_version="6.20.0",
        oldest_version="6.20.0",  # older ones have neither the detector nor the solver of `tuned`
        friction_rule="minimum",
        capabilities=Capability.named(
            "window save_restore contact_count contact_forces compound loops couplings apart "
            "self_collide joint_wrenches deterministic"
        ),
        deviations=(
            Deviation("joint/*/armature", "DART has no rotor inertia"),
            Deviation(
                "joint/*/stiffness joint/*/damping",
                "servo motors are velocity constraints, neither springs nor dampers: an effort "
                "beside one does nothing",
            ),
            Deviation("link/*/damping", "DART has no damping of links"),
            Deviation("closure/*", "DART keeps the points of a ball joint to itself", only="loop"),
            Deviation("", "what sleeps has contacts without force"),
            Deviation(
                "",
                "meshes are surfaces of triangles: one put upon another slips off",
                only="convex_mesh",
            ),
            Deviation("body/*/margin link/*/margin", "DART's shapes have no margin"),
            Deviation(
                "link/*/meshes",
                "DART's reader of meshes moves corners of some, by up to 0.02 mm in a Mico2",
                within=1e-5,
                elsewhere=5e-5,
            ),
            Deviation(
                "joint/*finger_joint2/effort_limit",
                "the second finger has no drive: it follows the first, by up to both their limits",
            ),
            Deviation(
                f"joint/{FOLLOWER}/effort_limit",
                "a finger that follows has no drive: the first one moves it, by up to both limits",
            ),
            Deviation(
                "", "the coupling is one-way: the first finger does not feel the second's load"
            ),
            Deviation(
                "",
                "contacts and drives feel m / (m + dt d + dt^2 k) of a joint's own damping d and "
                "spring k",
                only="passive_damping",
            ),
            Deviation(
                "coupling/*",
                "the adapter couples joints by impulses before a step; DART knows nothing of it",
                only="coupling",
            ),
        ),
        install_size_mb=80,
    )
    profiles = PROFILES
    chosen_on = CHOSEN_ON
    settings: DARTSettings

    def load(self, scene: Scene) -> None:
        self.begin(scene)
        self.world = world = dartpy.simulation.World()
        self._set_options(world, scene)
        slab = self.settings.detector in ONE_CONTACT_ON_A_PLANE
        self._ground = add_ground(world, scene.ground_friction, scene.ground_restitution, slab)
        self._bodies = {box.name: add_body(world, box) for box in scene.bodies}
        self._free = [self._bodies[box.name] for box in scene.free_bodies]
        self._led = [self._bodies[box.name] for box in scene.prescribed_bodies]
        self._robot: Any = None
        self._couplings: Couplings | None = None
        self._borne: list[tuple[Any, FloatArray]] = []
        self._base = np.empty(0)
        if self.prepared is not None:
            self._load_robot(self.prepared)
        kept = self.world.getConstraintSolver().getCollisionOption().collisionFilter
        for pair in scene.apart:
            kept.addBodyNodePairToBlackList(*map(self._body_node, pair))
        self._viewer = self._open_window() if self.gui else None

    def _set_options(self, world: Any, scene: Scene) -> None:
        s, constraint = self.settings, dartpy.constraint
        world.setTimeStep(s.timestep)
        world.setGravity(np.array(scene.gravity))
        kinds = dartpy.simulation.CollisionDetectorType
        world.setCollisionDetector(getattr(kinds, s.detector.upper()))
        sleep = world.getDeactivationOptions()
        sleep.mEnabled = s.sleeping
        world.setDeactivationOptions(sleep)
        solver = world.getConstraintSolver()
        solver.setSplitImpulseEnabled(s.split_impulse)
        if s.solver == "pgs":  # dartpy makes none, but DART keeps one to fall back on
            pgs = solver.getSecondaryBoxedLcpSolver()
            options = constraint.PgsBoxedLcpSolverOption()
            options.mMaxIteration = s.sweeps
            options.mDeltaXThreshold = options.mRelativeDeltaXTolerance = s.tolerance
            pgs.setOption(options)
            solver.setSecondaryBoxedLcpSolver(None)
            solver.setBoxedLcpSolver(pgs)
        elif s.solver == "nsgs":
            options = constraint.NsgsFrictionSolver.Options()
            options.maxSweeps, options.tolerance = s.sweeps, s.tolerance
            solver.setBoxedLcpSolver(constraint.NsgsFrictionSolver(options))

    def _load_robot(self, prepared: PreparedRobot) -> None:
        robot, dynamics, utils = prepared.robot, dartpy.dynamics, dartpy.utils
        loader = utils.DartLoader()
        options = utils.DartLoaderOptions()
        options.mDefaultRootJointType = utils.DartLoaderRootJointType.FIXED
        loader.setOptions(options)
        with tempfile.TemporaryDirectory() as folder:
            path = prepared.write_urdf(folder, mimic=True)  # which dartpy cannot set itself
            self._robot = skeleton = loader.parseSkeleton(str(path))
        skeleton.setSelfCollisionCheck(robot.self_collide)  # but for links that a joint joins
        for body in skeleton.getBodyNodes():
            for shape in body.getShapeNodes():
                if shape.hasCollisionAspect():
                    set_surface(shape, robot.friction)
        followers = robot.gripper.joints[1:]
        for drive in robot.joints:
            joint = skeleton.getJoint(drive.name)
            joint.setLimitEnforcement(True)
            limit = drive.effort_limit
            if drive.name in followers:
                limit *= 2
            else:
                kinds = dynamics.ActuatorType
                joint.setActuatorType(kinds.FORCE if drive.motor else kinds.SERVO)
            joint.setDampingCoefficient(0, drive.passive_damping)
            joint.setCoulombFriction(0, drive.friction)
            joint.setSpringStiffness(0, drive.spring)
            joint.setRestPosition(0, drive.rest)
            joint.setForceUpperLimit(0, limit)
            joint.setForceLowerLimit(0, -limit)
            # a servo keeps its velocity limit; the scene's drive law has none, no other engine does
            joint.setVelocityUpperLimit(0, np.inf)
            joint.setVelocityLowerLimit(0, -np.inf)
        names = [skeleton.getDof(i).getName() for i in range(skeleton.getNumDofs())]
        self._index = np.array([names.index(name) for name in robot.joint_names])
        self._motors = np.array([joint.motor for joint in robot.joints])
        driven = np.array([name not in followers for name in robot.joint_names]) & ~self._motors
        k, d, step = robot.column("stiffness"), robot.column("damping"), self.settings.timestep
        resistance = np.maximum(step * k + d, WEAKEST)
        self._gain, self._share = driven * k / resistance, driven * d / resistance
        if robot.couplings:
            self._couplings = Couplings(skeleton, names, robot.couplings)
        initial = robot.column("initial_position")
        skeleton.setPositions(list(self._index), initial)
        self.world.addSkeleton(skeleton)
        for closure in reduced(prepared):
            bodies = (skeleton.getBodyNode(link) for link in (closure.first, closure.second))
            if closure.rigid:  # as they are now
                held = dartpy.constraint.WeldJointConstraint(*bodies)
            else:
                place, _ = ends(prepared, closure)
                held = dartpy.constraint.BallJointConstraint(*bodies, place)
            self.world.getConstraintSolver().addConstraint(held)
        for name, force in borne(prepared, self.scene.gravity, felt=0.0).items():
            skeleton.getBodyNode(name).setGravityMode(False)
            self._borne.append((skeleton.getBodyNode(name), force))
        self._bear()
        self._error_gain = np.zeros(len(names))
        self._error_gain[self._index] = self._gain
        self.command(initial, 0 * initial, 0 * initial)

    def read_back(self) -> dict[str, Any]:
        return ReadBack(self).all()

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        # Servo motors find the effort themselves. DART clips what it is told of the kind `FORCE`.
        base = np.zeros(len(self._index))
        base[self._index] = self._gain * position + self._share * velocity + self._motors * effort
        self._base = base

    def push(self, wrenches: FloatArray) -> None:
        for body, row in zip(self._free, wrenches, strict=True):
            body.clearExternalForces()  # they last
            body.addExtForce(row[:3], np.zeros(3), False, True)
            body.addExtTorque(row[3:], False)

    def lead(self, before: FloatArray, after: FloatArray) -> None:
        for body, row in zip(self._led, before, strict=True):
            joint, place = body.getParentJoint(), dartpy.math.Isometry3()
            place.set_translation(row[:3])
            place.set_rotation(rotation_matrix(row[3:7]))
            joint.setPositions(dartpy.dynamics.FreeJoint.convertToPositions(place))
            joint.setLinearVelocity(row[7:10])
            joint.setAngularVelocity(row[10:])
            joint.setCommands(joint.getVelocities())

    def step(self) -> None:
        if self._robot is not None:
            if self._couplings is not None:
                self._couplings.push()
            self._robot.setCommands(self._base - self._error_gain * self._robot.getPositions())
        self.world.step(False)
        self._bear()

    def _bear(self) -> None:
        """Pull at links that feel a share of gravity. A force lasts, and turns with its link."""
        for body, force in self._borne:
            body.setExtForce(force, body.getLocalCOM(), False, True)

    @property
    def time(self) -> float:
        return float(self.world.getTime())

    def body_state(self) -> FloatArray:
        state = np.empty((len(self._free), 13))
        for row, body in zip(state, self._free, strict=True):
            place = body.getWorldTransform()
            row[:3], row[3:7] = place.translation(), place.quaternion().wxyz()
            row[7:10], row[10:] = body.getCOMLinearVelocity(), body.getAngularVelocity()
        return state

    def joint_state(self) -> FloatArray:
        if self._robot is None:
            return np.empty((2, 0))
        q, v = self._robot.getPositions(), self._robot.getVelocities()
        return np.stack([q[self._index], v[self._index]])

    def save(self) -> State:
        # DART's solver starts from the last contacts; both futures must start without them.
        self.world.getConstraintSolver().clearLastCollisionResult()
        states = [(s.getPositions(), s.getVelocities(), s.getAccelerations()) for s in self._all()]
        return self.time, states, self._base

    def restore(self, state: State) -> None:
        time, states, self._base = state
        self.world.setTime(time)
        for skeleton, (q, v, a) in zip(self._all(), states, strict=True):
            skeleton.setPositions(q)
            skeleton.setVelocities(v)
            skeleton.setAccelerations(a)
        self._bear()
        self.world.getConstraintSolver().clearLastCollisionResult()

    def _all(self) -> list[Any]:
        return [self.world.getSkeleton(i) for i in range(self.world.getNumSkeletons())]

    def contact_forces(self) -> Iterator[tuple[str, str, FloatArray]]:
        for contact in self.world.getLastCollisionResult().getContacts():
            first, second = (
                self._name_of(end.getShapeFrame().asShapeNode().getBodyNodePtr())
                for end in (contact.collisionObject1, contact.collisionObject2)
            )
            force = np.asarray(contact.force)
            yield first, second, np.concatenate([force, np.cross(contact.point, force)])

    def _body_node(self, name: str) -> Any:
        """Of "ground", `body/NAME` or `link/NAME`."""
        kind, _, rest = name.partition("/")
        if kind == "link":
            return self._robot.getBodyNode(rest)
        return self._bodies[rest] if rest else self._ground

    def _name_of(self, body: Any) -> str:
        owner = body.getSkeleton().getName()
        if self._robot is not None and owner == self._robot.getName():
            return f"link/{body.getName()}"
        return owner if owner == "ground" else f"body/{owner}"

    def joint_wrenches(self) -> FloatArray:
        if self._couplings is not None:
            raise NotSupportedError("dart tells no wrenches of joints that are coupled")
        rows = []
        for joint in self._joints():
            body = joint.getChildBodyNode()
            turn = body.getWorldTransform().rotation()
            torque, force = np.reshape(body.getBodyForce(), (2, 3))  # in the body's frame
            rows.append([turn @ force, turn @ torque])
        return np.array(rows).reshape(-1, 6)

    def _joints(self) -> list[Any]:
        """Of the robot, in the scene's order."""
        if self.scene.robot is None:
            return []
        return [self._robot.getJoint(name) for name in self.scene.robot.joint_names]

    def contact_count(self) -> int:
        return int(self.world.getLastCollisionResult().getNumContacts())

    def _open_window(self) -> Any:
        osg = dartpy.gui.osg
        viewer = osg.Viewer()
        self._node = osg.WorldNode(self.world)  # the viewer does not keep it alive
        viewer.addWorldNode(self._node, False)  # not active: it must not step the world
        viewer.setUpViewInWindow(0, 0, 1024, 768)
        viewer.setCameraHomePosition([2.6, -2.2, 1.6], [0.6, 0.0, 0.3], [0.0, 0.0, 1.0])
        return viewer

    def refresh_window(self) -> None:
        if self._viewer is not None:
            self._viewer.frame()

    def close(self) -> None:
        self._viewer = self._node = None
