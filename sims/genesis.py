"""Genesis (Genesis AI), rigid-body solver on the CPU.

Drives are Genesis' own position-velocity controllers: force = k (q* - q) + d (v* - v), cut at the
effort limit. The feed-forward effort rides on the position: q* + tau_ff / k. The limit is symmetric
and bounds the whole sum.

The engine compiles its kernels (Quadrants, a fork of Taichi) when they are first called, for each
combination of options; the machine code is kept on disk. See docs/engines/genesis.md for times.
"""

from __future__ import annotations

import dataclasses
import gc
import importlib
import inspect
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.scene import Box, FloatArray, Scene
from pytest_simbench.simulator import (
    Capability,
    Deviation,
    PreparedRobot,
    Settings,
    Simulator,
    SimulatorInfo,
    lazy_import,
    one_value,
)

genesis = lazy_import("genesis")

LEAST_FRICTION = 0.01
"""A material must have at least this coefficient, and so has every contact (`func_add_contact`)."""


@dataclass(frozen=True)
class GenesisSettings(Settings):
    """Genesis' options; defaults are the engine's own, `RigidOptions` and `SimOptions`.

    Attributes:
        timestep: [s].
        substeps: steps of the solver in one time step.
        precision: of all floating-point numbers, in bits.
        integrator: `approximate_implicitfast` adds the drives' damping to the mass matrix for good,
            `implicitfast` only while integrating velocities.
        friction_cone: shape of the friction cone.
        impratio: ratio of friction to normal constraint impedance; 0 leaves it to the engine, which
            takes 100 with the elliptic cone and 1 with the pyramid.
        constraint_timeconst: of contacts [s], at least two steps of the solver.
        impedance: of contacts: smallest, largest.
        iterations: largest number, of the constraint solver.
        tolerance: at which it stops; 0 leaves it to the engine (1e-5, in 64 bits 1e-8).
        noslip_iterations: of the friction post-processing, for the pyramid only.
        box_box_detection: two boxes are collided by an algorithm of their own.
        gjk: collide other convex shapes by GJK instead of MPR.
    """

    timestep: float = 0.01
    substeps: int = 1
    precision: Literal["32", "64"] = "32"
    integrator: Literal["approximate_implicitfast", "implicitfast", "Euler"] = (
        "approximate_implicitfast"
    )
    friction_cone: Literal["pyramidal", "elliptic"] = "pyramidal"
    impratio: float = 0.0
    constraint_timeconst: float = 0.01
    impedance: tuple[float, float] = (0.9, 0.95)
    iterations: int = 50
    tolerance: float = 0.0
    noslip_iterations: int = 0
    box_box_detection: bool = False
    gjk: bool = False


class Genesis(Simulator):
    """Adapter of Genesis."""

    info: ClassVar[SimulatorInfo] = SimulatorInfo(
        name="genesis",
        title="Genesis",
        distribution="genesis-world",
        modules=("genesis",),
        install="pytest --sim-install genesis",
        licence="Apache-2.0",
        engine="Genesis",
        tested_version="1.2.3",
        capabilities=frozenset(
            {
                Capability.OFFSCREEN,
                Capability.SAVE_RESTORE,
                Capability.EXACT_RESTORE,
                Capability.CONTACT_COUNT,
                Capability.CONTACT_FORCES,
                Capability.DETERMINISTIC,
            }
        ),
        deviations=(
            Deviation("", f"no contact has a friction coefficient below {LEAST_FRICTION}"),
        ),
        costly_start=True,
        compile_timeout=1800.0,
        requirements=("torch==2.13.0", "genesis-world==1.2.3"),
        caches={"QD_OFFLINE_CACHE_FILE_PATH": "quadrants", "GS_CACHE_FILE_PATH": "genesis"},
        install_size_mb=3700,
        language="Python (Quadrants)",
    )
    profiles: ClassVar[Mapping[str, Settings]] = {
        "default": GenesisSettings(),
        "tuned": GenesisSettings(
            timestep=0.002,
            constraint_timeconst=0.004,
            friction_cone="elliptic",
            box_box_detection=True,
        ),
    }
    settings: GenesisSettings
    world: Any = None
    compiled: ClassVar[set[tuple[Any, ...]]] = set()
    """What this process has kernels for, see `compile`."""

    def compile(self, scene: Scene) -> None:
        """Build and step such a world once; kernels depend on options and on the kinds of bodies.

        The engine writes new machine code to disk when it is shut down, which is why that is done
        here: the worker's end leaves it no time. Nothing less will do: writing it out meanwhile
        (`dump_cache_data_to_disk`) makes kernels of later worlds crash.
        """
        several = len(scene.free_bodies) + (scene.robot is not None) > 1  # solved by islands
        options = dataclasses.replace(  # what is data, not code
            self.settings, timestep=1.0, substeps=1, constraint_timeconst=1.0, impedance=(0.9, 0.95)
        )
        kind = (options, several, scene.robot is not None, bool(scene.free_bodies))
        if kind in self.compiled:
            return
        self.load(scene)
        self.step()
        self.body_state()
        self.read_back()
        self.restore(self.save())
        self.close()
        genesis.destroy()
        self.compiled.add(kind)

    def load(self, scene: Scene) -> None:
        self.scene, self._steps, self._camera = scene, 0, None
        self.prepared = None if scene.robot is None else PreparedRobot(scene.robot)
        _start_engine(self.settings.precision)
        self.world = world = self._new_world(scene)
        self._ground = world.add_entity(
            genesis.morphs.Plane(), material=_material(scene.ground_friction)
        )
        self._boxes = {box.name: _add_box(world, box) for box in scene.bodies}
        self._robot = None if self.prepared is None else _add_robot(world, self.prepared)
        world.build()
        self.solver = world.rigid_solver
        self._set_contacts(scene)
        self._free = [self._boxes[box.name].links[0].idx for box in scene.free_bodies]
        self._dofs: list[int] = []
        if scene.robot is not None:
            self._set_drives(scene.robot)

    def _new_world(self, scene: Scene) -> Any:
        s, options = self.settings, genesis.options
        return genesis.Scene(
            sim_options=options.SimOptions(
                dt=s.timestep, substeps=s.substeps, gravity=scene.gravity
            ),
            rigid_options=options.RigidOptions(
                enable_self_collision=False,  # of a robot; boxes are entities of their own
                integrator=getattr(genesis.integrator, s.integrator),
                friction_cone=getattr(genesis.friction_cone, s.friction_cone),
                impratio=s.impratio or None,
                constraint_timeconst=s.constraint_timeconst,
                iterations=s.iterations,
                tolerance=s.tolerance or None,
                noslip_iterations=s.noslip_iterations,
                box_box_detection=s.box_box_detection,
                use_gjk_collision=s.gjk,
            ),
            vis_options=options.VisOptions(show_world_frame=False),
            viewer_options=options.ViewerOptions(
                res=(1024, 768), camera_pos=_EYE, camera_lookat=_LOOK_AT, camera_fov=_FOV
            ),
            profiling_options=options.ProfilingOptions(show_FPS=False),
            show_viewer=self.gui,
        )

    def _set_contacts(self, scene: Scene) -> None:
        """Impedance of contacts, and frictions that a material refuses."""
        solver, geoms = self.solver, self.solver.geoms
        parameters = np.array([geom.sol_params.cpu().numpy() for geom in geoms])
        if (parameters[:, 2:4] != self.settings.impedance).any():
            parameters[:, 2:4] = self.settings.impedance
            for geom, values in zip(geoms, parameters, strict=True):
                geom.set_sol_params(values)
        frictions = {self._boxes[box.name]: box.friction for box in scene.bodies}
        frictions[self._ground] = scene.ground_friction
        for entity, friction in frictions.items():
            if friction < LEAST_FRICTION:
                for geom in entity.geoms:
                    solver.set_geom_friction(friction, geom.idx)

    def _set_drives(self, robot: Any) -> None:
        entity = self._robot
        joints = [entity.get_joint(name) for name in robot.joint_names]
        self._dofs = dofs = [joint.dof_start for joint in joints]
        solver = self.solver
        self._stiffness = robot.column("stiffness")
        limit = robot.column("effort_limit")
        solver.set_dofs_armature(robot.column("armature"), dofs)
        solver.set_dofs_kp(self._stiffness, dofs)
        solver.set_dofs_kv(robot.column("damping"), dofs)
        solver.set_dofs_damping(np.zeros(len(dofs)), dofs)
        solver.set_dofs_frictionloss(np.zeros(len(dofs)), dofs)
        solver.set_dofs_force_range(-limit, limit, dofs)
        initial = robot.column("initial_position")
        solver.set_dofs_position(initial, dofs)
        self.command(initial, np.zeros(len(dofs)), np.zeros(len(dofs)))

    def read_back(self) -> dict[str, Any]:
        info, rigid = self.solver.dyn_info, self.solver.rigid_info
        ground = self._ground.geoms[0].idx
        frictions = array_of(info.geoms.friction)
        poses = self._poses([entity.links[0].idx for entity in self._boxes.values()])
        reported: dict[str, Any] = {
            "gravity": array_of(rigid.gravity).reshape(3),
            "timestep": array_of(rigid.substep_dt).item() * self.settings.substeps,
            "ground/height": _numbers(self.solver.get_geoms_pos([ground]))[0, 2],
            "ground/friction": frictions[ground],
        }
        masses = array_of(info.links.inertial_mass)
        inertias = array_of(info.links.inertial_i)
        for (name, entity), pose in zip(self._boxes.items(), poses, strict=True):
            geom, link = entity.geoms[0].idx, entity.links[0].idx
            reported[f"body/{name}/size"] = array_of(info.geoms.data)[geom, :3]
            reported[f"body/{name}/friction"] = frictions[geom]
            reported[f"body/{name}/pose"] = pose
            if entity.n_dofs:
                reported[f"body/{name}/mass"] = masses[link]
                reported[f"body/{name}/inertia"] = np.diag(inertias[link])
        if self.prepared is not None:
            self._read_back_robot(self.prepared, reported)
            for link in self.prepared.moving_links:
                part = self._robot.get_link(link.name)
                reported[f"link/{link.name}/mass"] = masses[part.idx]
                moments = np.linalg.eigvalsh(inertias[part.idx].astype(float))
                reported[f"link/{link.name}/inertia"] = moments
                shapes = [geom.idx for geom in part.geoms]
                reported[f"link/{link.name}/friction"] = one_value(frictions[shapes])
        return reported

    def _read_back_robot(self, prepared: PreparedRobot, reported: dict[str, Any]) -> None:
        dofs, equalities = self.solver.dyn_info.dofs, self.solver.dyn_info.equalities
        fingers = {self._robot.get_joint(name).idx for name in prepared.robot.gripper.joints}
        pairs = zip(
            array_of(equalities.eq_obj1id)[:, 0],
            array_of(equalities.eq_obj2id)[:, 0],
            array_of(equalities.eq_type)[:, 0],
            strict=True,
        )
        reported["gripper/coupled"] = any(
            {a, b} == fingers and kind == genesis.EQUALITY_TYPE.JOINT for a, b, kind in pairs
        )
        limits, forces = array_of(dofs.limit), array_of(dofs.force_range)
        gains, biases = array_of(dofs.act_gain), array_of(dofs.act_bias)
        damping, armature = array_of(dofs.damping), array_of(dofs.armature)
        positions = self.joint_state()[0]
        for name, dof, position in zip(
            prepared.robot.joint_names, self._dofs, positions, strict=True
        ):
            reported[f"joint/{name}/limits"] = limits[dof]
            reported[f"joint/{name}/effort_limit"] = one_value(forces[dof] * [-1, 1])
            reported[f"joint/{name}/stiffness"] = gains[dof]
            reported[f"joint/{name}/damping"] = damping[dof] - biases[dof, 2]
            reported[f"joint/{name}/armature"] = armature[dof]
            reported[f"joint/{name}/initial_position"] = position

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        self.solver.control_dofs_position_velocity(
            position + effort / self._stiffness, velocity, self._dofs
        )

    def step(self) -> None:
        self.world.step(update_visualizer=False)
        self._steps += 1

    @property
    def time(self) -> float:
        return self._steps * self.settings.timestep

    def body_state(self) -> FloatArray:
        state = np.empty((len(self._free), 13))
        if self._free:
            state[:, :7] = self._poses(self._free)
            state[:, 7:10] = _numbers(self.solver.get_links_vel(self._free, ref="link_com"))
            state[:, 10:] = _numbers(self.solver.get_links_ang(self._free))
        return state

    def _poses(self, links: list[int]) -> FloatArray:
        """Positions and quaternions of links, (n, 7)."""
        if not links:
            return np.empty((0, 7))
        position = _numbers(self.solver.get_links_pos(links))
        quaternion = _numbers(self.solver.get_links_quat(links))
        return np.hstack([position, quaternion / np.linalg.norm(quaternion, axis=1)[:, None]])

    def joint_state(self) -> FloatArray:
        if not self._dofs:
            return np.empty((2, 0))
        return np.stack(
            [
                _numbers(self.solver.get_dofs_position(self._dofs)),
                _numbers(self.solver.get_dofs_velocity(self._dofs)),
            ]
        )

    def save(self) -> tuple[int, list[NDArray[Any]]]:
        return self._steps, [array_of(tensor) for tensor in self._tensors()]

    def restore(self, state: tuple[int, list[NDArray[Any]]]) -> None:
        self._steps = state[0]
        for tensor, values in zip(self._tensors(), state[1], strict=True):
            array_of(tensor, copy=False)[...] = values

    def _tensors(self) -> Iterator[Any]:
        """All that a step reads and writes: motion, targets, warm starts, cached contact normals.

        The engine's own saved state has neither targets nor warm starts, nor the last contacts.
        """
        solver = self.solver
        for part in (
            solver.dyn_state,
            solver.rigid_info,
            solver.collider._collider_state,
            solver.constraint_solver.constraint_state,
        ):
            yield from _tensors_in(part)

    def contact_count(self) -> int:
        return int(array_of(self.solver.collider._collider_state.n_contacts)[0])

    def render(self, width: int, height: int) -> NDArray[np.uint8]:
        if self._camera is None or self._camera.res != (width, height):
            # `Scene.add_camera` refuses once a scene is built; the visualiser does not.
            self._camera = self.world.visualizer.add_camera(
                res=(width, height),
                pos=_EYE,
                lookat=_LOOK_AT,
                up=(0.0, 0.0, 1.0),
                model="pinhole",
                fov=_FOV,
                aperture=2.0,
                focus_dist=None,
                GUI=False,
                spp=1,
                denoise=False,
                near=0.1,
                far=20.0,
                env_idx=None,
                debug=False,
            )
            self._camera.build()
        picture = self._camera.render(rgb=True, force_render=True)[0]
        return np.array(_numbers(picture)[..., :3], dtype=np.uint8)

    def refresh_window(self) -> None:
        if self.gui:
            self.world.visualizer.update(force=True)

    def close(self) -> None:
        self._camera = self._robot = self._ground = self.solver = None
        self._boxes = {}
        if self.world is not None:
            self.world.destroy()
            self.world = None
            gc.collect()  # scene, solver and entities refer to each other


_EYE, _LOOK_AT, _FOV = (2.0, 1.6, 1.3), (0.5, 0.0, 0.35), 40.0
"""Of camera and window [m], [degrees]."""


def _start_engine(precision: str) -> None:
    """Initialise Genesis, which a process does once for each precision."""
    if genesis._initialized:
        if genesis.np_float == np.dtype(f"float{precision}"):
            return
        genesis.destroy()
    genesis.init(backend=genesis.cpu, precision=precision, logging_level="warning", seed=0)
    with quick_inspection():
        importlib.import_module("genesis.engine.simulator")


@contextmanager
def quick_inspection() -> Iterator[None]:
    """Spare the import of Genesis' solvers most of its time.

    Every function with Quadrants' decorators asks `inspect` about the frame that imports it. Those
    of Python's own import system have no source file, and `inspect.getmodule` looks through all
    3000 modules before it answers None, 2000 times. Measured on 2 cores: 6.9 s of CPU, 0.8 s when
    the answer is given at once.
    """
    original = inspect.getmodule

    def getmodule(object: Any, _filename: Any = None) -> Any:
        code = object.f_code if inspect.isframe(object) else object
        if inspect.iscode(code) and code.co_filename.startswith("<frozen "):
            return None
        return original(object, _filename)

    inspect.getmodule = getmodule
    try:
        yield
    finally:
        inspect.getmodule = original


def _material(friction: float, density: float | None = None) -> Any:
    return genesis.materials.Rigid(rho=density, friction=max(friction, LEAST_FRICTION))


def _add_box(world: Any, box: Box) -> Any:
    morph = genesis.morphs.Box(
        size=box.size, pos=box.pose.position, quat=box.pose.quaternion, fixed=box.fixed
    )
    density = None if box.fixed else box.mass / float(np.prod(box.size))
    surface = genesis.surfaces.Default(color=box.colour)
    return world.add_entity(morph, material=_material(box.friction, density), surface=surface)


def _add_robot(world: Any, prepared: PreparedRobot) -> Any:
    xml = ET.fromstring(prepared.to_urdf())
    first, second = prepared.robot.gripper.joints
    for joint in xml.findall("joint"):
        if joint.attrib["name"] == second:  # becomes an equality constraint
            ET.SubElement(joint, "mimic", joint=first, multiplier="1", offset="0")
    morph = genesis.morphs.URDF(
        file=ET.tostring(xml, encoding="unicode"),
        fixed=True,
        merge_fixed_links=False,
        default_armature=None,
        requires_jac_and_IK=False,
    )
    return world.add_entity(morph, material=_material(prepared.robot.friction))


def _numbers(tensor: Any) -> FloatArray:
    """A PyTorch tensor or an array, in double precision."""
    return np.asarray(tensor.cpu() if hasattr(tensor, "cpu") else tensor, dtype=float)


def array_of(tensor: Any, *, copy: bool = True) -> NDArray[Any]:
    """Values of one of the engine's tensors, or its own memory.

    The tensors' `to_numpy` and `from_numpy` would compile and launch kernels.
    """
    values: NDArray[Any] = genesis.utils.misc.qd_to_numpy(tensor, copy=copy)
    return values


def _tensors_in(struct: Any) -> Iterator[Any]:
    """Every tensor of nested dataclasses, in their order."""
    if dataclasses.is_dataclass(struct):
        for field in dataclasses.fields(struct):
            yield from _tensors_in(getattr(struct, field.name))
    elif hasattr(struct, "to_numpy"):
        yield struct
