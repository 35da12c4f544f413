"""Drake's settings, and the world that its adapter builds: plant, shapes, robot, drives."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from pytest_simbench.description.links import OPEN, borne, ends, frames, joined, reduced
from pytest_simbench.description.shapes import mesh_points
from pytest_simbench.description.urdf import MovingJoint, Shape
from pytest_simbench.scene import (
    Body,
    Box,
    Capsule,
    Closure,
    Compound,
    ConvexMesh,
    Cylinder,
    FloatArray,
    Joint,
    Pose,
    Scene,
    Sphere,
)
from pytest_simbench.scene.robot import FREE
from pytest_simbench.simulator import NotSupportedError, PreparedRobot, heavy, lazy_import

from .settings import DrakeSettings, without_sampled_ports

eigen = lazy_import("pydrake.common.eigen_geometry")
geometry = lazy_import("pydrake.geometry")
math = lazy_import("pydrake.math")
plants = lazy_import("pydrake.multibody.plant")
spatial = lazy_import("pydrake.multibody.math")
trees = lazy_import("pydrake.multibody.tree")

GREY = (0.5, 0.5, 0.5, 1.0)
LIGHT = (0.85, 0.85, 0.85, 1.0)

LAYER = 0.05
"""How deep the ground gives way where surfaces are compliant [m]; Drake has no default."""

CREEP = 1e-4
"""Speed at which a joint slips under its whole friction [rad/s, m/s]: Drake's own for contacts."""

VERTEX_RADIUS = 1e-6
"""Of the spheres at the vertices of free meshes [m]: they stick out by no more than that."""


class World:
    """A scene in a plant that is added to `builder` and finalised.

    Attributes:
        plant, scene_graph: Drake's bodies and joints, and their shapes.
        prepared: the reduced robot, or None.
        bodies, links, joints, drives: Drake's objects by the scene's names; a fixed box is part of
            the world body.
        shapes: geometry ids by name of the box or link that they belong to, or "ground".
        springs, brakes: what gives joints a spring and friction of their own, by their names.
        couplings: ids of the constraints between joints.
    """

    def __init__(
        self, scene: Scene, prepared: PreparedRobot | None, settings: DrakeSettings, builder: Any
    ) -> None:
        self.settings, self.scene, self.prepared = settings, scene, prepared
        self.plant, self.scene_graph = plants.AddMultibodyPlant(self._options(), builder)
        self.scene_graph.set_config(self._surfaces())
        self.plant.mutable_gravity_field().set_gravity_vector(scene.gravity)
        self.shapes: dict[str, list[Any]] = {}
        self.spheres: list[Any] = []
        world, plane = self.plant.world_body(), geometry.HalfSpace()
        self._add_shape(world, "ground", "plane", plane, Pose(), scene.ground_friction)
        slab = geometry.Box(10.0, 10.0, 0.02)
        self._add_picture(world, "ground", slab, Pose((0.0, 0.0, -0.01)), GREY)
        self.bodies = {box.name: self._add_body(box) for box in scene.bodies}
        self.links: dict[str, Any] = {}
        self.joints: dict[str, Any] = {}
        self.drives: dict[str, Any] = {}
        self.springs: dict[str, Any] = {}
        self.brakes: dict[str, Any] = {}
        if self.prepared is not None:
            self._add_links(self.prepared)
            self._add_joints(self.prepared)
        self.plant.Finalize()
        self._filter_collisions()

    def floating_joint(self, body: Any) -> Any:
        """The joint of a free body to the world."""
        plant = self.plant
        return next(
            plant.get_joint(index)
            for index in plant.GetJointIndices()
            if plant.get_joint(index).child_body().index() == body.index()
        )

    def bear(self, prepared: PreparedRobot, context: Any) -> None:
        """Pull at links that feel a share of gravity, from now on."""
        pulls = []
        for name, force in borne(prepared, self.scene.gravity).items():
            pull, link = plants.ExternallyAppliedSpatialForce(), self.links[name]
            pull.body_index, pull.p_BoBq_B = link.index(), link.default_com()
            pull.F_Bq_W = spatial.SpatialForce(tau=np.zeros(3), f=force)
            pulls.append(pull)
        self.plant.get_applied_spatial_force_input_port().FixValue(context, pulls)

    def _options(self) -> Any:
        s = self.settings
        return plants.MultibodyPlantConfig(
            **without_sampled_ports(plants.MultibodyPlantConfig),
            time_step=s.timestep,
            contact_model=s.contact_model,
            discrete_contact_approximation=s.approximation,
            sap_near_rigid_threshold=s.near_rigid_threshold,
            stiction_tolerance=s.stiction_tolerance,
        )

    def _surfaces(self) -> Any:
        s, config = self.settings, geometry.SceneGraphConfig()
        surface = config.default_proximity_properties
        surface.compliance_type = s.compliance
        surface.slab_thickness = LAYER
        surface.hydroelastic_modulus = s.hydroelastic_modulus
        surface.point_stiffness = s.point_stiffness
        surface.hunt_crossley_dissipation = s.hunt_crossley_dissipation
        surface.relaxation_time = s.relaxation_time
        return config

    def _add_shape(
        self, body: Any, owner: str, part: str, shape: Any, pose: Pose, friction: float
    ) -> Any:
        """A collision shape. Of two surfaces' friction Drake takes the harmonic mean."""
        surface = geometry.ProximityProperties()
        geometry.AddContactMaterial(
            properties=surface, friction=plants.CoulombFriction(friction, friction)
        )
        made = self.plant.RegisterCollisionGeometry(
            body, transform(pose), shape, f"{owner}/{part}", surface
        )
        self.shapes.setdefault(owner, []).append(made)
        return made

    def _add_picture(self, body: Any, name: str, shape: Any, pose: Pose, colour: Any) -> None:
        self.plant.RegisterVisualGeometry(body, transform(pose), shape, name, np.array(colour))

    def _add_spheres(
        self, body: Any, name: str, centres: FloatArray, radius: float, friction: float
    ) -> None:
        for k, (x, y, z) in enumerate(centres):
            pose = Pose((float(x), float(y), float(z)))
            sphere = geometry.Sphere(radius)
            made = self._add_shape(body, name, f"sphere{k}", sphere, pose, friction)
            self.spheres.append(made)

    def _add_body(self, part: Body) -> Any:
        solid, weighted, arguments = _solid(part.parts[0])
        if part.fixed:
            body, pose = self.plant.world_body(), part.pose
        elif part.prescribed:
            body, pose = self._add_heavy(part), Pose()
        else:
            if part.moments is None and weighted:
                inertia = getattr(trees.SpatialInertia, weighted)(part.mass, *arguments)
            else:
                inertia = _inertia(part.mass, np.zeros(3), np.diag(part.inertia()))
            own = trees.default_model_instance()
            body, pose = self.plant.AddRigidBody(part.name, own, inertia), Pose()
            if part.damping.any():
                self._damp(body, part)
        if isinstance(part, Compound):  # without spheres in corners: its walls may be thin
            for k, shape in enumerate(part.parts):
                made, at = _solid(shape)[0], pose * shape.pose
                self._add_shape(body, part.name, f"part{k}", made, at, part.friction)
                self._add_picture(body, f"{part.name}/{k}", made, at, part.colour)
            return body
        core = solid
        if isinstance(part, Box) and part.mass and self.settings.corner_radius:
            core = self._add_corners(body, part)
        if isinstance(part, ConvexMesh) and part.mass and self.settings.corner_radius:
            self._add_spheres(
                body, part.name, np.array(part.vertices), VERTEX_RADIUS, part.friction
            )
        self._add_shape(body, part.name, "box", core, pose, part.friction)
        self._add_picture(body, part.name, solid, pose, part.colour)
        return body

    def _add_heavy(self, part: Body) -> Any:
        """A body that nothing moves, without weight; Drake has none that move as prescribed."""
        plant, mass = self.plant, heavy(self.scene)
        alone = plant.AddModelInstance(f"{part.name}/prescribed")
        plant.mutable_gravity_field().set_enabled(alone, False)
        return plant.AddRigidBody(part.name, alone, _inertia(mass, np.zeros(3), mass * np.eye(3)))

    def _damp(self, body: Any, part: Body) -> None:
        """The damping of a floating joint, whose torque is the same about all axes."""
        world = self.plant.world_frame()
        turning = part.angular_damping * float(part.inertia().max())
        self.plant.AddJoint(
            trees.QuaternionFloatingJoint(
                f"{part.name}/free",
                world,
                body.body_frame(),
                turning,
                part.linear_damping * part.mass,
            )
        )

    def _add_corners(self, body: Any, box: Box) -> Any:
        """Spheres in the corners of a box; the box that is left within them."""
        radius = fitting_radius(box.size, self.settings.corner_radius)
        centres = corner_centres(box.size, radius)
        self._add_spheres(body, box.name, centres, radius, box.friction)
        return geometry.Box(*(np.asarray(box.size) - 2 * self.settings.shrink))

    def _add_links(self, prepared: PreparedRobot) -> None:
        plant, robot = self.plant, prepared.robot
        self.model = plant.AddModelInstance(robot.name)
        for link in prepared.links.values():
            weight = _inertia(link.mass, link.centre, link.inertia)
            body = plant.AddRigidBody(link.name, self.model, weight)
            self.links[link.name] = body
            for k, shape in enumerate(link.shapes):
                made = _robot_shape(shape, f"{link.name}_{k}")
                self._add_shape(body, link.name, str(k), made, shape.pose, robot.friction)
                self._add_picture(body, f"{link.name}/{k}", made, shape.pose, LIGHT)
        plant.WeldFrames(plant.world_frame(), self.links[prepared.root].body_frame())

    def _add_joints(self, prepared: PreparedRobot) -> None:
        plant, robot, s = self.plant, prepared.robot, self.settings
        for joint in prepared.joints:
            kind = trees.RevoluteJoint if joint.kind == "revolute" else trees.PrismaticJoint
            parent, child = self.links[joint.parent], self.links[joint.child]
            offset = trees.FixedOffsetFrame(
                f"{joint.name}/origin", parent.body_frame(), transform(joint.origin)
            )
            ends = plant.AddFrame(offset), child.body_frame()
            limits = prepared.limits[joint.name]
            made = plant.AddJoint(kind(joint.name, *ends, joint.axis, *limits))
            self.joints[joint.name] = made
            if s.pad_radius and joint.name in robot.gripper.joints:
                centres = pad_centres(prepared, joint, s.pad_radius)
                self._add_spheres(child, joint.child, centres, s.pad_radius, robot.friction)
        for own in robot.joints:  # before the drives: Drake takes the last actuator's rotor inertia
            self._add_own(own)
        for drive in robot.joints:
            made = plant.AddJointActuator(drive.name, self.joints[drive.name], drive.effort_limit)
            made.set_default_rotor_inertia(drive.armature)
            made.set_controller_gains(trees.PdControllerGains(p=drive.stiffness, d=drive.damping))
            self.drives[drive.name] = made
        self.couplings = [
            plant.AddCouplerConstraint(
                self.joints[pair.follower], self.joints[pair.leader], pair.ratio, pair.offset
            )
            for pair in (*robot.gripper.couplings, *robot.couplings)
        ]
        for closure in reduced(prepared):
            first, second = self.links[closure.first], self.links[closure.second]
            if closure.rigid:
                a, b = map(transform, frames(prepared, closure))
                plant.AddWeldConstraint(first, a, second, b)
            elif _parts(prepared, closure):
                plant.AddBallConstraint(first, closure.first_point, second, closure.second_point)

    def _add_own(self, own: Joint) -> None:
        """What a joint does by itself. Drake has no friction of it: a second actuator brakes."""
        joint = self.joints[own.name]
        joint.set_default_damping(own.passive_damping)
        if own.spring:
            hinge = isinstance(joint, trees.RevoluteJoint)
            kind = trees.RevoluteSpring if hinge else trees.PrismaticSpring
            spring = kind(joint, own.rest, own.spring)
            self.springs[own.name] = self.plant.AddForceElement(spring)
        if own.friction:
            brake = self.plant.AddJointActuator(f"{own.name}/friction", joint, own.friction)
            brake.set_controller_gains(trees.PdControllerGains(p=FREE, d=own.friction / CREEP))
            self.brakes[own.name] = brake

    def _filter_collisions(self) -> None:
        manager = self.scene_graph.collision_filter_manager()
        apart = []
        if self.prepared is not None:
            groups = [frozenset(self.links)]  # names of links that do not collide
            if self.prepared.robot.self_collide:
                groups = list(joined(self.prepared))
            for group in groups:
                bodies = [self.links[name].index() for name in group]
                frames = [self.plant.GetBodyFrameIdOrThrow(index) for index in bodies]
                apart.append(geometry.GeometrySet(frames))
        if self.spheres:  # they carry flat faces; one on top of another would roll off
            apart.append(geometry.GeometrySet(self.spheres))
        led = [made for body in self.scene.prescribed_bodies for made in self.shapes[body.name]]
        if led:  # they touch what they can move
            still = [body.name for body in self.scene.bodies if not body.mass]
            fixed = [made for name in ("ground", *still) for made in self.shapes[name]]
            pair = geometry.GeometrySet(led), geometry.GeometrySet(fixed)
            manager.Apply(geometry.CollisionFilterDeclaration().ExcludeBetween(*pair))
        for group in apart:
            manager.Apply(geometry.CollisionFilterDeclaration().ExcludeWithin(group))
        for names in self.scene.apart:
            shapes = [self.shapes.get(name.rpartition("/")[2], []) for name in names]
            first, second = map(geometry.GeometrySet, shapes)
            manager.Apply(geometry.CollisionFilterDeclaration().ExcludeBetween(first, second))


def _solid(body: Body) -> tuple[Any, str, tuple[Any, ...]]:
    """Drake's shape of a body, and what makes its inertia of a mass, if anything, and which
    arguments."""
    upright = np.array([0.0, 0.0, 1.0])
    match body:
        case Box():
            return geometry.Box(*body.size), "SolidBoxWithMass", body.size
        case Sphere():
            return geometry.Sphere(body.radius), "SolidSphereWithMass", (body.radius,)
        case Cylinder():
            size = body.radius, body.length
            return geometry.Cylinder(*size), "SolidCylinderWithMass", (*size, upright)
        case Capsule():
            size = body.radius, body.length
            return geometry.Capsule(*size), "SolidCapsuleWithMass", (*size, upright)
        case ConvexMesh():
            return geometry.Convex(points=np.array(body.vertices).T, label=body.name), "", ()
    raise NotSupportedError(f"drake has no {type(body).__name__}")


def _parts(prepared: PreparedRobot, closure: Closure) -> bool:
    """Whether joints can part a closure's points. Drake makes NaN of a ball where none can."""
    moved = prepared.robot.column("initial_position") + np.arange(1, len(prepared.joints) + 1) / 3
    first, second = ends(prepared, closure, moved)
    return float(np.linalg.norm(first - second)) > OPEN


def transform(pose: Pose) -> Any:
    """Drake's rigid transform of a pose."""
    q = np.asarray(pose.quaternion)
    return math.RigidTransform(eigen.Quaternion(q / np.linalg.norm(q)), pose.position)


def _inertia(mass: float, centre: FloatArray, i: FloatArray) -> Any:
    """Of a mass [kg] with its centre (3,) [m] and the inertia about it (3, 3) [kg m^2]."""
    if mass == 0:
        return trees.SpatialInertia.Zero()
    central = trees.RotationalInertia(i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2])
    return trees.SpatialInertia.MakeFromCentralInertia(mass, centre, central)


def _robot_shape(shape: Shape, label: str) -> Any:
    """A box, or the convex hull of a mesh; Drake itself reads no STL files."""
    if shape.size is not None:
        return geometry.Box(*shape.size)
    return geometry.Convex(points=mesh_points(shape.mesh or "").T, label=label)


def corner_centres(size: Sequence[float], radius: float) -> FloatArray:
    """Centres (8, 3) [m] of spheres that touch three faces each of a box of `size`, from within."""
    return np.array(list(product((-1.0, 1.0), repeat=3))) * (np.asarray(size) / 2 - radius)


def fitting_radius(size: Sequence[float], radius: float) -> float:
    """`radius`, or what fits twice along the box's shortest edge [m]."""
    return min(radius, min(size) / 4)


def pad_centres(prepared: PreparedRobot, finger: MovingJoint, radius: float) -> FloatArray:
    """Centres (n, 3) [m] of spheres behind the corners of a finger's gripping face.

    The finger's joint opens along its axis, so its gripping face is that of its boxes which lies
    farthest against the axis. The centres are in the link's frame.
    """
    boxes = [s for s in prepared.links[finger.child].shapes if s.size is not None]
    if not boxes:
        return np.empty((0, 3))
    centres = np.vstack(
        [
            corner_centres(box.size or (), radius) @ box.pose.rotation().T + box.pose.position
            for box in boxes
        ]
    )
    depth = centres @ np.asarray(finger.axis)
    return np.asarray(centres[depth < depth.min() + 1e-5])
