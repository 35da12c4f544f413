"""Drake (Toyota Research Institute), through pydrake.

Drives are Drake's own: actuators with `PdControllerGains`, which the contact solver SAP treats
implicitly, with effort feed-forward; the effort limit bounds their whole sum. The robot is built
from the reduced description, link by link: Drake's parser wants a file, reads no STL, and makes
no actuators with gains.

What was learnt stands in docs/engines/drake.md.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.scene import FloatArray, Robot, Scene
from pytest_simbench.simulator import Capability, Deviation, Simulator, SimulatorInfo, lazy_import
from pytest_simbench.simulator.base import EYE, FIELD_OF_VIEW, LOOK_AT, view_axes

from .readback import ReadBack
from .settings import CHOSEN_ON, OLDEST, PROFILES, DrakeSettings
from .world import World, transform

analysis = lazy_import("pydrake.systems.analysis")
framework = lazy_import("pydrake.systems.framework")
geometry = lazy_import("pydrake.geometry")
math = lazy_import("pydrake.math")
sensors = lazy_import("pydrake.systems.sensors")


class Drake(Simulator):
    """Adapter of Drake."""

    info = SimulatorInfo(
        name="drake",
        title="Drake",
        distribution="drake",
        modules=("pydrake",),
        install="pip install 'pytest-simbench[drake]'",
        licence="BSD-3-Clause",
        engine="Drake SAP",
        language="C++",
        tested_version="1.51.1",
        oldest_version=OLDEST,
        friction_rule="harmonic",
        capabilities=Capability.named(
            "window offscreen save_restore exact_restore contact_count contact_forces compound "
            "loops couplings apart self_collide joint_wrenches deterministic"
        ),
        deviations=(
            Deviation(
                "*/restitution",
                "Drake has no restitution; its contacts dissipate",
            ),
            Deviation(
                "",
                "a body's angular damping is one torque for all its axes: right about that of its "
                "largest moment of inertia, too strong about the others",
                only="damping",
            ),
            Deviation("link/*/damping", "Drake has no damping of links"),
            Deviation("closure/*", "pydrake tells nothing of a ball constraint", only="loop"),
            Deviation("coupling/*", "pydrake tells nothing of a coupler", only="coupling"),
            Deviation(
                "body/*/boxes",
                "tuned: corners of free boxes are cut by 0.1 mm a face and rounded by a sphere",
                within=2e-4,
            ),
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
    profiles = PROFILES
    chosen_on = CHOSEN_ON
    settings: DrakeSettings

    def load(self, scene: Scene) -> None:
        self.close()
        self.begin(scene)
        builder = framework.DiagramBuilder()
        self.world = World(scene, self.prepared, self.settings, builder)
        self.plant, self.scene_graph = self.world.plant, self.world.scene_graph
        self._meshcat = self._open_window(builder) if self.gui else None
        self.simulator = analysis.Simulator(builder.Build())
        self.root = self.simulator.get_mutable_context()
        self.context = self.plant.GetMyMutableContextFromRoot(self.root)
        free = [self.world.bodies[box.name] for box in scene.free_bodies]
        for box, body in zip(scene.free_bodies, free, strict=True):
            self.plant.SetFreeBodyPose(self.context, body, transform(box.pose))
        self._joints_at = np.empty((2, 0), dtype=int)
        if self.prepared is not None:
            self._start_drives(self.prepared.robot)
            self.world.bear(self.prepared, self.context)
        nq = self.plant.num_positions()
        joints = [self.world.floating_joint(body) for body in free]
        q = np.array([joint.position_start() for joint in joints], int).reshape(-1, 1)
        v = np.array([joint.velocity_start() for joint in joints], int).reshape(-1, 1)
        # Drake has rotation before translation; the contract has it after.
        self._bodies_at = np.hstack(
            [q + np.array([4, 5, 6, 0, 1, 2, 3]), nq + v + np.array([3, 4, 5, 0, 1, 2])]
        )
        state = self.plant.GetPositionsAndVelocities(self.context).copy()
        for at, box in zip(self._bodies_at, scene.free_bodies, strict=True):
            state[at[7:]] = box.velocity
        self.plant.SetPositionsAndVelocities(self.context, state)
        self._led = [body.prescribed for body in scene.free_bodies]
        self._has_camera = False
        self._began = state
        self.simulator.Initialize()

    def _start_drives(self, robot: Robot) -> None:
        joints = [self.world.joints[name] for name in robot.joint_names]
        initial, rest = robot.column("initial_position"), np.zeros(len(joints))
        nq = self.plant.num_positions()
        self._joints_at = np.array(
            [[j.position_start() for j in joints], [nq + j.velocity_start() for j in joints]]
        )
        state = self.plant.GetPositionsAndVelocities(self.context).copy()
        state[self._joints_at[0]] = initial
        self.plant.SetPositionsAndVelocities(self.context, state)
        targets = self.plant.get_desired_state_input_port(self.world.model)
        efforts = self.plant.get_actuation_input_port(self.world.model)
        idle = np.zeros(len(self.world.brakes))
        self._targets = targets.FixValue(self.context, np.concatenate([idle, initial, idle, rest]))
        self._efforts = efforts.FixValue(self.context, np.concatenate([idle, rest]))
        self._commanded = (initial, rest, rest)

    def read_back(self) -> dict[str, Any]:
        return ReadBack(self).all()

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        self._commanded = (position, velocity, effort)
        driven = -len(position)  # after the brakes of joints with friction
        targets = _values(self._targets).reshape(2, -1)
        targets[0, driven:], targets[1, driven:] = position, velocity
        _values(self._efforts)[driven:] = effort

    def push(self, wrenches: FloatArray) -> None:
        forces = np.zeros(self.plant.num_velocities())
        forces[self._bodies_at[:, 7:] - self.plant.num_positions()] = wrenches
        self.plant.get_applied_generalized_force_input_port().FixValue(self.context, forces)

    def lead(self, before: FloatArray, after: FloatArray) -> None:
        state = self.plant.GetPositionsAndVelocities(self.context).copy()
        state[self._bodies_at[self._led]] = before
        self.plant.SetPositionsAndVelocities(self.context, state)

    def step(self) -> None:
        self._steps += 1
        self._began = self._state()
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
        return self._steps, self._state(), getattr(self, "_commanded", None)

    def restore(self, state: tuple[int, FloatArray, Any]) -> None:
        self._steps, values, commanded = state
        self.root.SetTime(self._steps * self.settings.timestep)
        self.plant.SetPositionsAndVelocities(self.context, values)
        self._began = values
        if commanded is not None:
            self.command(*commanded)
        self.simulator.Initialize()

    def _state(self) -> FloatArray:
        return np.array(self.plant.GetPositionsAndVelocities(self.context))

    @contextmanager
    def _as_it_began(self) -> Iterator[None]:
        """In the state from which the last step went out: Drake tells the forces of the step that
        would follow the present one, for which no set point is known yet."""
        now = self._state()
        self.plant.SetPositionsAndVelocities(self.context, self._began)
        yield
        self.plant.SetPositionsAndVelocities(self.context, now)

    def contact_forces(self) -> list[tuple[str, str, FloatArray]]:
        with self._as_it_began():
            return list(self._contact_forces())

    def _contact_forces(self) -> Iterator[tuple[str, str, FloatArray]]:
        results = self.plant.get_contact_results_output_port().Eval(self.context)
        names = {made: name for name, group in self._named_shapes() for made in group}
        for k in range(results.num_point_pair_contacts()):
            info = results.point_pair_contact_info(k)
            pair, force = info.point_pair(), np.asarray(info.contact_force())  # on the second
            wrench = np.concatenate([force, np.cross(info.contact_point(), force)])
            yield names[pair.id_B], names[pair.id_A], wrench
        for k in range(results.num_hydroelastic_contacts()):
            info = results.hydroelastic_contact_info(k)
            surface = info.contact_surface()
            spatial = info.F_Ac_W()  # on the first, at the centroid
            force = np.asarray(spatial.translational())
            torque = spatial.rotational() + np.cross(surface.centroid(), force)
            yield names[surface.id_M()], names[surface.id_N()], np.concatenate([force, torque])

    def _named_shapes(self) -> Iterator[tuple[str, list[Any]]]:
        """Drake's shapes of the ground, each body and each link."""
        for name, made in self.world.shapes.items():
            kind = "body/" if name in self.world.bodies else "link/"
            yield name if name == "ground" else kind + name, made

    def joint_wrenches(self) -> FloatArray:
        with self._as_it_began():
            return self._joint_wrenches()

    def _joint_wrenches(self) -> FloatArray:
        told = self.plant.get_reaction_forces_output_port().Eval(self.context)
        order = list(self.plant.GetJointIndices())
        rows = []
        for drive in self.world.drives.values():
            joint = drive.joint()
            at_child = told[order.index(joint.index())]  # in the axes of the child's frame
            turn = joint.frame_on_child().CalcRotationMatrixInWorld(self.context).matrix()
            rows.append([turn @ at_child.translational(), turn @ at_child.rotational()])
        return np.array(rows).reshape(-1, 6)

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
        lens = sensors.CameraInfo(width, height, FIELD_OF_VIEW)
        core = geometry.RenderCameraCore(
            "vtk", lens, geometry.ClippingRange(0.05, 20.0), math.RigidTransform()
        )
        eye = math.RigidTransform(math.RotationMatrix(view_axes()), EYE)
        image = self._query().RenderColorImage(
            geometry.ColorRenderCamera(core), self.scene_graph.world_frame_id(), eye
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


def _values(fixed: Any) -> FloatArray:
    """What a fixed port holds, to be changed in place."""
    values: FloatArray = fixed.GetMutableData().get_mutable_value().get_mutable_value()
    return values
