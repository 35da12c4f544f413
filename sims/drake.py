"""Drake (Toyota Research Institute), through pydrake.

Drives are Drake's own: actuators with `PdControllerGains`, which the contact solver SAP treats
implicitly, with effort feed-forward; the effort limit bounds their whole sum. The robot is built
from the reduced description, link by link: Drake's parser wants a file, reads no STL, and makes
no actuators with gains.

What was learnt (1.51, tuned settings but for the one named, seed 100):
- point contact gives one point for a pair of shapes, at the deepest place. A plain box rests on
  one point that jumps from corner to corner: with the engine's defaults the cubes of the grid
  never come to rest (up to 0.12 m/s or rad/s), and a held one turns in the hand. `tuned` gives
  each free box eight spheres in its corners, and each finger four behind its gripping face, that
  reach the true faces, while the box itself is 0.1 mm smaller a face: four points a face
- spheres may not touch spheres: stacked cubes then stand sphere on sphere and creep (0.3 mm
  between release and the end of the task, 5 micrometres without)
- SAP's `relaxation_time` decides how far a grip sinks in: contacts get at most the
  stiffness that the step resolves, and then sink (relaxation time + step) / step times deeper. At
  4 ms and Drake's 0.1 s a squeeze of 25 N sinks 1.4 mm into a cube (5 mm with plain boxes), with
  0.01 s 0.2 mm
- nothing but the step changes where the throw lands (stiffness 1e5 to 1e7, relaxation 0 to 0.1,
  `lagged`: equal within 0.3 mm). Contact velocities are made equal at the
  start of a step and kept for its length, so a cube leaves a turning hand by v^2 / r dt / 2 a
  second: 4 ms lands at 1.399, 2 ms at 1.377, 1 ms at 1.366, where a perfect follower's does at
  1.352. `tuned` takes 2 ms: half of 1 ms's cost
- quaternions are not kept at length 1; `body_state` normalises, as Drake does where it reads them
"""

from __future__ import annotations

import gc
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pytest_simbench.sims.drake_shapes import (
    corner_centres,
    fitting_radius,
    pad_centres,
    stl_points,
)

from pytest_simbench.scene import Box, FloatArray, Pose, Robot, Scene
from pytest_simbench.simulator import (
    Capability,
    Deviation,
    PreparedRobot,
    Settings,
    Simulator,
    SimulatorInfo,
    lazy_import,
)

analysis = lazy_import("pydrake.systems.analysis")
eigen = lazy_import("pydrake.common.eigen_geometry")
framework = lazy_import("pydrake.systems.framework")
geometry = lazy_import("pydrake.geometry")
math = lazy_import("pydrake.math")
plants = lazy_import("pydrake.multibody.plant")
sensors = lazy_import("pydrake.systems.sensors")
trees = lazy_import("pydrake.multibody.tree")

GREY = (0.5, 0.5, 0.5, 1.0)
LIGHT = (0.85, 0.85, 0.85, 1.0)


@dataclass(frozen=True)
class DrakeSettings(Settings):
    """Drake's options; defaults are those of its MultibodyPlantConfig and SceneGraphConfig.

    Attributes:
        timestep: of the discrete update [s].
        contact_model: points, or hydroelastic surfaces where both shapes have a compliance.
        approximation: of the discrete contact problem, each solved by SAP.
        near_rigid_threshold: SAP softens contacts stiffer than this allows, for conditioning.
        stiction_tolerance: slip below which `lagged` and `similar` regularise friction [m/s].
        compliance: of every surface; `undefined` leaves the pair to point contact.
        hydroelastic_modulus: [Pa].
        point_stiffness: of a contact point [N/m].
        hunt_crossley_dissipation: of `lagged` and `similar` [s/m].
        relaxation_time: of `sap`'s linear dissipation [s].
        corner_radius: of the spheres in the corners of free boxes [m]; 0: none, plain boxes.
        pad_radius: of the spheres behind the fingers' gripping faces [m]; 0: none.
        shrink: what a free box with corner spheres loses on each face [m].
    """

    timestep: float = 0.001
    contact_model: Literal["point", "hydroelastic", "hydroelastic_with_fallback"] = (
        "hydroelastic_with_fallback"
    )
    approximation: Literal["sap", "similar", "lagged"] = "lagged"
    near_rigid_threshold: float = 1.0
    stiction_tolerance: float = 1e-4
    compliance: Literal["undefined", "rigid", "compliant"] = "undefined"
    hydroelastic_modulus: float = 1e7
    point_stiffness: float = 1e6
    hunt_crossley_dissipation: float = 50.0
    relaxation_time: float = 0.1
    corner_radius: float = 0.0
    pad_radius: float = 0.0
    shrink: float = 0.0


class Drake(Simulator):
    """Adapter of Drake."""

    info: ClassVar[SimulatorInfo] = SimulatorInfo(
        name="drake",
        title="Drake",
        distribution="drake",
        modules=("pydrake",),
        install="pip install 'pytest-simbench[drake]'",
        licence="BSD-3-Clause",
        engine="Drake SAP",
        language="C++",
        tested_version="1.51.1",
        capabilities=frozenset(
            {
                Capability.WINDOW,
                Capability.OFFSCREEN,
                Capability.SAVE_RESTORE,
                Capability.CONTACT_COUNT,
                Capability.CONTACT_FORCES,
                Capability.DETERMINISTIC,
            }
        ),
        deviations=(
            Deviation(
                "",
                "tuned: free boxes are 0.1 mm a face smaller, with spheres in their corners that "
                "reach the true faces, and finger pads have spheres too: Drake's point contact "
                "gives one point a pair of shapes, on which plain boxes rock and slide",
            ),
            Deviation(
                "",
                "the window is Meshcat, a page that a browser shows: http://localhost:7000, or "
                "the next free port, which the worker's log names",
            ),
        ),
        install_size_mb=310,
    )
    profiles: ClassVar[Mapping[str, Settings]] = {
        "default": DrakeSettings(),
        "tuned": DrakeSettings(
            timestep=0.002,
            contact_model="point",
            approximation="sap",
            relaxation_time=0.01,
            corner_radius=0.004,
            pad_radius=0.003,
            shrink=1e-4,
        ),
    }
    settings: DrakeSettings

    def load(self, scene: Scene) -> None:
        self.close()
        self.scene = scene
        self.prepared = None if scene.robot is None else PreparedRobot(scene.robot)
        builder = framework.DiagramBuilder()
        self.plant, self.scene_graph = plants.AddMultibodyPlant(self._options(), builder)
        self.scene_graph.set_config(self._surfaces())
        self.plant.mutable_gravity_field().set_gravity_vector(scene.gravity)
        self._spheres: list[Any] = []
        self._shapes: dict[str, list[Any]] = {}
        world = self.plant.world_body()
        self._add_shape(
            world, "ground", "plane", geometry.HalfSpace(), Pose(), scene.ground_friction
        )
        slab = geometry.Box(10.0, 10.0, 0.02)
        self._add_picture(world, "ground", slab, Pose((0.0, 0.0, -0.01)), GREY)
        self._bodies = {box.name: self._add_box(box) for box in scene.bodies}
        if self.prepared is not None:
            self._add_robot(self.prepared)
        self.plant.Finalize()
        self._filter_collisions()
        self._meshcat = self._open_window(builder) if self.gui else None
        diagram = builder.Build()
        self.simulator = analysis.Simulator(diagram)
        self.root = self.simulator.get_mutable_context()
        self.context = self.plant.GetMyMutableContextFromRoot(self.root)
        free = [self._bodies[box.name] for box in scene.free_bodies]
        for box, body in zip(scene.free_bodies, free, strict=True):
            self.plant.SetFreeBodyPose(self.context, body, _transform(box.pose))
        self._joints_at = np.empty((2, 0), dtype=int)
        if self.prepared is not None:
            self._start_drives(self.prepared.robot)
        nq = self.plant.num_positions()
        q = np.array([body.floating_positions_start() for body in free], int).reshape(-1, 1)
        v = np.array([body.floating_velocities_start_in_v() for body in free], int).reshape(-1, 1)
        # Drake has rotation before translation; the contract has it after.
        self._bodies_at = np.hstack(
            [q + np.array([4, 5, 6, 0, 1, 2, 3]), nq + v + np.array([3, 4, 5, 0, 1, 2])]
        )
        self._steps = 0
        self._has_camera = False
        self.simulator.Initialize()

    def _options(self) -> Any:
        s = self.settings
        return plants.MultibodyPlantConfig(
            time_step=s.timestep,
            use_sampled_output_ports=False,  # they would add state, and only cost time here
            contact_model=s.contact_model,
            discrete_contact_approximation=s.approximation,
            sap_near_rigid_threshold=s.near_rigid_threshold,
            stiction_tolerance=s.stiction_tolerance,
        )

    def _surfaces(self) -> Any:
        s, config = self.settings, geometry.SceneGraphConfig()
        surface = config.default_proximity_properties
        surface.compliance_type = s.compliance
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
            body, _transform(pose), shape, f"{owner}/{part}", surface
        )
        self._shapes.setdefault(owner, []).append(made)
        return made

    def _add_picture(self, body: Any, name: str, shape: Any, pose: Pose, colour: Any) -> None:
        self.plant.RegisterVisualGeometry(body, _transform(pose), shape, name, np.array(colour))

    def _add_spheres(
        self, body: Any, name: str, centres: FloatArray, radius: float, friction: float
    ) -> None:
        for k, (x, y, z) in enumerate(centres):
            pose = Pose((float(x), float(y), float(z)))
            sphere = geometry.Sphere(radius)
            made = self._add_shape(body, name, f"sphere{k}", sphere, pose, friction)
            self._spheres.append(made)

    def _add_box(self, box: Box) -> Any:
        s = self.settings
        if box.fixed:
            body, pose, gone = self.plant.world_body(), box.pose, 0.0
        else:
            inertia = trees.SpatialInertia.SolidBoxWithMass(box.mass, *box.size)
            body, pose = self.plant.AddRigidBody(box.name, inertia), Pose()
            gone = s.shrink if s.corner_radius else 0.0
            if s.corner_radius:
                radius = fitting_radius(box.size, s.corner_radius)
                centres = corner_centres(box.size, radius)
                self._add_spheres(body, box.name, centres, radius, box.friction)
        core = geometry.Box(*(np.asarray(box.size) - 2 * gone))
        self._add_shape(body, box.name, "box", core, pose, box.friction)
        self._add_picture(body, box.name, geometry.Box(*box.size), pose, box.colour)
        return body

    def _add_robot(self, prepared: PreparedRobot) -> None:
        plant, robot, s = self.plant, prepared.robot, self.settings
        self._model = plant.AddModelInstance(robot.name)
        self._links = {}
        for link in prepared.links.values():
            body = plant.AddRigidBody(link.name, self._model, _inertia(link))
            self._links[link.name] = body
            for k, shape in enumerate(link.shapes):
                made = _robot_shape(shape, f"{link.name}_{k}")
                self._add_shape(body, link.name, str(k), made, shape.pose, robot.friction)
                self._add_picture(body, f"{link.name}/{k}", made, shape.pose, LIGHT)
        plant.WeldFrames(plant.world_frame(), self._links[prepared.root].body_frame())
        self._joints = {}
        for joint in prepared.joints:
            kind = trees.RevoluteJoint if joint.kind == "revolute" else trees.PrismaticJoint
            parent, child = self._links[joint.parent], self._links[joint.child]
            offset = trees.FixedOffsetFrame(
                f"{joint.name}/origin", parent.body_frame(), _transform(joint.origin)
            )
            ends = plant.AddFrame(offset), child.body_frame()
            limits = prepared.limits[joint.name]
            made = plant.AddJoint(kind(joint.name, *ends, joint.axis, *limits))
            self._joints[joint.name] = made
            if s.pad_radius and joint.name in robot.gripper.joints:
                centres = pad_centres(prepared, joint, s.pad_radius)
                self._add_spheres(child, joint.child, centres, s.pad_radius, robot.friction)
        self._drives = {}
        for drive in robot.joints:
            made = plant.AddJointActuator(drive.name, self._joints[drive.name], drive.effort_limit)
            made.set_default_rotor_inertia(drive.armature)
            made.set_controller_gains(trees.PdControllerGains(p=drive.stiffness, d=drive.damping))
            self._drives[drive.name] = made
        first, second = (self._joints[name] for name in robot.gripper.joints)
        self._coupling = plant.AddCouplerConstraint(first, second, 1.0)

    def _filter_collisions(self) -> None:
        manager = self.scene_graph.collision_filter_manager()
        apart = []
        if self.prepared is not None:
            frames = [self.plant.GetBodyFrameIdOrThrow(b.index()) for b in self._links.values()]
            apart.append(geometry.GeometrySet(frames))
        if self._spheres:  # they carry flat faces; one on top of another would roll off
            apart.append(geometry.GeometrySet(self._spheres))
        for group in apart:
            manager.Apply(geometry.CollisionFilterDeclaration().ExcludeWithin(group))

    def _start_drives(self, robot: Robot) -> None:
        joints = [self._joints[name] for name in robot.joint_names]
        initial, rest = robot.column("initial_position"), np.zeros(len(joints))
        nq = self.plant.num_positions()
        self._joints_at = np.array(
            [[j.position_start() for j in joints], [nq + j.velocity_start() for j in joints]]
        )
        state = self.plant.GetPositionsAndVelocities(self.context).copy()
        state[self._joints_at[0]] = initial
        self.plant.SetPositionsAndVelocities(self.context, state)
        targets = self.plant.get_desired_state_input_port(self._model)
        efforts = self.plant.get_actuation_input_port(self._model)
        self._targets = targets.FixValue(self.context, np.concatenate([initial, rest]))
        self._efforts = efforts.FixValue(self.context, rest)
        self._commanded = (initial, rest, rest)

    def read_back(self) -> dict[str, Any]:
        context, inspector = self.context, self._query().inspector()
        ground = self._shapes["ground"][0]
        reported: dict[str, Any] = {
            "gravity": self.plant.gravity_field().gravity_vector(),
            "timestep": self.plant.time_step(),
            "ground/height": inspector.GetPoseInFrame(ground).translation()[2],
            "ground/friction": self._friction("ground"),
        }
        for name, body in self._bodies.items():
            pose, size = self._place(name, body)
            reported[f"body/{name}/size"] = size
            reported[f"body/{name}/pose"] = pose
            reported[f"body/{name}/friction"] = self._friction(name)
            if body.is_floating_base_body():
                inertia = body.CalcSpatialInertiaInBodyFrame(context)
                reported[f"body/{name}/mass"] = inertia.get_mass()
                moments = inertia.CalcRotationalInertia().get_moments()
                reported[f"body/{name}/inertia"] = moments
        if self.prepared is not None:
            self._read_back_robot(self.prepared, reported)
        return reported

    def _place(self, name: str, body: Any) -> tuple[FloatArray, FloatArray]:
        """Pose (7,) of a box, and its extents along its axes (3,), spheres included [m]."""
        inspector = self._query().inspector()
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        pose = self.plant.EvalBodyPoseInWorld(self.context, body)
        for made in self._shapes[name]:
            shape, place = inspector.GetShape(made), inspector.GetPoseInFrame(made)
            if body.index() == self.plant.world_body().index():
                pose, place = pose @ place, math.RigidTransform()
            sphere = isinstance(shape, geometry.Sphere)
            half = np.full(3, shape.radius()) if sphere else shape.size() / 2
            low = np.minimum(low, place.translation() - half)
            high = np.maximum(high, place.translation() + half)
        turn = pose.rotation().ToQuaternion().wxyz()
        return np.concatenate([pose.translation(), turn]), high - low

    def _friction(self, name: str) -> Any:
        """The one friction coefficient of all shapes of a body; all of them if they differ."""
        inspector = self._query().inspector()
        values = set()
        for made in self._shapes[name]:
            surface = inspector.GetProximityProperties(made)
            friction = surface.GetProperty("material", "coulomb_friction")
            values |= {friction.static_friction(), friction.dynamic_friction()}
        return values.pop() if len(values) == 1 else sorted(values)

    def _read_back_robot(self, prepared: PreparedRobot, reported: dict[str, Any]) -> None:
        context = self.context
        coupled = self.plant.GetConstraintActiveStatus(context, self._coupling)
        reported["gripper/coupled"] = float(coupled)
        for name in prepared.robot.joint_names:
            joint, drive = self._joints[name], self._drives[name]
            limits = [joint.position_lower_limits()[0], joint.position_upper_limits()[0]]
            reported[f"joint/{name}/limits"] = limits
            reported[f"joint/{name}/effort_limit"] = drive.effort_limit()
            reported[f"joint/{name}/stiffness"] = drive.get_controller_gains().p
            reported[f"joint/{name}/damping"] = drive.get_controller_gains().d
            reported[f"joint/{name}/armature"] = drive.calc_reflected_inertia(context)
            reported[f"joint/{name}/initial_position"] = joint.GetOnePosition(context)
        for link in prepared.moving_links:
            inertia = self._links[link.name].CalcSpatialInertiaInBodyFrame(context)
            central = inertia.Shift(inertia.get_com()).CalcRotationalInertia()
            reported[f"link/{link.name}/mass"] = inertia.get_mass()
            reported[f"link/{link.name}/inertia"] = np.sort(central.CalcPrincipalMomentsOfInertia())
            if link.shapes:
                reported[f"link/{link.name}/friction"] = self._friction(link.name)

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        self._commanded = (position, velocity, effort)
        self._targets.GetMutableData().get_mutable_value().SetFromVector(
            np.concatenate([position, velocity])
        )
        self._efforts.GetMutableData().get_mutable_value().SetFromVector(effort)

    def step(self) -> None:
        self._steps += 1
        self.simulator.AdvanceTo(self._steps * self.settings.timestep)

    @property
    def time(self) -> float:
        return float(self.root.get_time())

    def body_state(self) -> FloatArray:
        state = np.asarray(self.plant.GetPositionsAndVelocities(self.context)[self._bodies_at])
        # Drake integrates quaternions without normalising them; it does so where it reads them.
        state[:, 3:7] /= np.linalg.norm(state[:, 3:7], axis=1, keepdims=True)
        return state

    def joint_state(self) -> FloatArray:
        return np.asarray(self.plant.GetPositionsAndVelocities(self.context)[self._joints_at])

    def save(self) -> tuple[int, FloatArray, Any]:
        state = self.plant.GetPositionsAndVelocities(self.context).copy()
        return self._steps, state, getattr(self, "_commanded", None)

    def restore(self, state: tuple[int, FloatArray, Any]) -> None:
        self._steps, values, commanded = state
        self.root.SetTime(self._steps * self.settings.timestep)
        self.plant.SetPositionsAndVelocities(self.context, values)
        if commanded is not None:
            self.command(*commanded)
        self.simulator.Initialize()

    def contact_count(self) -> int:
        results = self.plant.get_contact_results_output_port().Eval(self.context)
        return int(results.num_point_pair_contacts() + results.num_hydroelastic_contacts())

    def _query(self) -> Any:
        return self.plant.get_geometry_query_input_port().Eval(self.context)

    def render(self, width: int, height: int) -> NDArray[np.uint8]:
        if not self._has_camera:
            context = self.scene_graph.GetMyMutableContextFromRoot(self.root)
            light = geometry.LightParameter(
                type="directional", frame="world", direction=[0.5, 0.4, -1.0], intensity=0.8
            )
            fill = geometry.LightParameter(type="directional", frame="camera", intensity=0.6)
            look = geometry.RenderEngineVtkParams(lights=[light, fill])
            engine = geometry.MakeRenderEngineVtk(look)
            self.scene_graph.AddRenderer(context, "vtk", engine)
            self._has_camera = True
        lens = sensors.CameraInfo(width, height, np.pi / 4)
        core = geometry.RenderCameraCore(
            "vtk", lens, geometry.ClippingRange(0.05, 20.0), math.RigidTransform()
        )
        image = self._query().RenderColorImage(
            geometry.ColorRenderCamera(core), self.scene_graph.world_frame_id(), _camera()
        )
        return np.array(image.data[:, :, :3])

    def _open_window(self, builder: Any) -> Any:
        """A Meshcat server, fed when `refresh_window` says so."""
        server = geometry.MeshcatParams(host="localhost", show_stats_plot=False)
        meshcat = geometry.Meshcat(server)
        never = geometry.MeshcatVisualizerParams(publish_period=1e6)  # but when told to
        self._visualizer = geometry.MeshcatVisualizer.AddToBuilder(
            builder, self.scene_graph, meshcat, never
        )
        meshcat.SetCameraPose(EYE, LOOK_AT)
        return meshcat

    def refresh_window(self) -> None:
        if self._meshcat is not None:
            self._visualizer.ForcedPublish(self._visualizer.GetMyContextFromRoot(self.root))

    def close(self) -> None:
        for name in list(vars(self)):
            if name not in ("settings", "gui"):
                delattr(self, name)
        gc.collect()  # pydrake's parts keep each other alive; Meshcat would keep its port


EYE, LOOK_AT = (2.0, -1.4, 1.3), (0.5, 0.0, 0.35)
"""Of the camera, in the world [m]."""


def _transform(pose: Pose) -> Any:
    q = np.asarray(pose.quaternion)
    return math.RigidTransform(eigen.Quaternion(q / np.linalg.norm(q)), pose.position)


def _inertia(link: Any) -> Any:
    if link.mass == 0:
        return trees.SpatialInertia.Zero()
    i = link.inertia
    central = trees.RotationalInertia(i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2])
    return trees.SpatialInertia.MakeFromCentralInertia(link.mass, link.centre, central)


def _robot_shape(shape: Any, label: str) -> Any:
    """A box, or the convex hull of a mesh; Drake reads no STL files."""
    if shape.size is not None:
        return geometry.Box(*shape.size)
    if Path(shape.mesh).suffix.lower() == ".stl":
        return geometry.Convex(points=stl_points(shape.mesh).T, label=label)
    return geometry.Convex(shape.mesh)


def _camera() -> Any:
    """Pose of the camera, whose z looks ahead and whose y looks down."""
    ahead = np.subtract(LOOK_AT, EYE)
    ahead = ahead / np.linalg.norm(ahead)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    turn = np.column_stack([right, np.cross(ahead, right), ahead])
    return math.RigidTransform(math.RotationMatrix(turn), EYE)
