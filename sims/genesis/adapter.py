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
import math
from collections.abc import Hashable, Iterator
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.description.links import borne
from pytest_simbench.scene import FloatArray, Scene, rotation_matrix
from pytest_simbench.simulator import (
    Capability,
    Deviation,
    Simulator,
    SimulatorInfo,
    heavy,
    lazy_import,
)
from pytest_simbench.simulator.base import named_parts

from ..mujoco.bounces import BOUNCES, direct
from ..mujoco.own_file import loaded
from .engine import (
    OLDEST,
    array_of,
    centre_of_mass,
    contact_parameters,
    forget_worlds,
    keep_apart,
    numbers,
    of_collider,
    start_engine,
    tensors_in,
)
from .own_file import FileReadBack, GenesisFile
from .readback import ReadBack
from .settings import CHOSEN_ON, PROFILES, GenesisFileSettings, GenesisSettings
from .world import LEAST_FRICTION, add_body, add_camera, add_robot, material, new_world, weld

genesis = lazy_import("genesis")

MOST_BOUNCE = 0.9999
"""The largest restitution: Genesis divides by the damping ratio."""


class Genesis(Simulator):
    """Adapter of Genesis."""

    info = SimulatorInfo(
        name="genesis",
        title="Genesis",
        distribution="genesis-world",
        modules=("genesis",),
        install="simbench install genesis",
        licence="Apache-2.0",
        engine="Genesis",
        tested_version="1.2.3",
        oldest_version=OLDEST,
        friction_rule="maximum",
        capabilities=Capability.named(
            "window offscreen save_restore exact_restore contact_count contact_forces compound "
            "loops couplings apart self_collide deterministic"
        ),
        deviations=(
            Deviation("link/*/damping", "Genesis has no damping of links"),
            Deviation("body/*/margin link/*/margin", "Genesis' shapes have no margin"),
            Deviation("", BOUNCES, only="restitution"),
            Deviation("", f"no contact has a friction coefficient below {LEAST_FRICTION}"),
        ),
        costly_start=True,
        compile_timeout=1800.0,
        requirements=("torch==2.13.0", "genesis-world==1.2.3"),
        companions={"1.0": ("torch==2.13.0", "numpy")},
        caches={"QD_OFFLINE_CACHE_FILE_PATH": "quadrants", "GS_CACHE_FILE_PATH": "genesis"},
        install_size_mb=3700,
        language="Python (Quadrants)",
    )
    profiles = PROFILES
    chosen_on = CHOSEN_ON
    settings: GenesisSettings
    world: Any = None
    _own_file: GenesisFile | None = None
    _robot: Any = None
    compiled: ClassVar[set[tuple[Any, ...]]] = set()
    """What this process has kernels for, see `compile`."""

    def compile(self, scene: Scene) -> None:
        """Build and step such a world once.

        The engine writes new machine code to disk when it is shut down, which is why that is done
        here: the worker's end leaves it no time. Nothing less will do: writing it out meanwhile
        (`dump_cache_data_to_disk`) makes kernels of later worlds crash.
        """
        kind = self.kind(scene)
        if kind in self.compiled:
            return
        self.load(scene)
        if "wrench" in scene.words:
            self.push(np.zeros((len(self._free), 6)))
        self.step()
        self.body_state()
        self.read_back()
        list(self.contact_forces())
        self.restore(self.save())
        self.close()
        genesis.destroy()
        self.compiled.add(kind)

    def kind(self, scene: Scene) -> tuple[Hashable, ...]:
        """What decides which kernels a world needs: options, and kinds of bodies, not how many."""
        options = dataclasses.replace(  # what is data, not code
            self.settings, timestep=1.0, substeps=1, constraint_timeconst=1.0, impedance=(0.9, 0.95)
        )
        robot = None if scene.robot is None else scene.robot.self_collide
        forces = scene.words & {"wrench", "link_gravity"}  # whose kernels are others
        shapes = frozenset(type(part) for body in scene.bodies for part in body.parts)
        grouped = any(len(body.parts) > 1 for body in scene.bodies)
        several = len(scene.free_bodies) + (scene.robot is not None) > 1  # solved by islands
        return options, robot, forces, shapes, grouped, several, bool(scene.free_bodies)

    def load(self, scene: Scene) -> None:
        self.begin(scene)
        self._camera: Any = None
        start_engine(self.settings.precision)
        self.world = new_world(scene, self.settings, window=self.gui)
        self._dofs: list[int] = []
        self._borne: tuple[list[int], list[FloatArray]] = [], []
        if isinstance(self.settings, GenesisFileSettings):
            self._load_file(scene)
        else:
            self._build(scene)

    def _load_file(self, scene: Scene) -> None:
        self._own_file = own = GenesisFile(scene, self.settings.timestep, self.world)
        self.solver, self._ground = own.solver, own.entity
        self._boxes = dict[str, Any]()
        self._free = [part.idx for part in own.free]
        self._touching = own.names(), "geom", own.own.lift
        loaded(self, own, "")

    def _build(self, scene: Scene) -> None:
        world = self.world
        self._ground = world.add_entity(
            genesis.morphs.Plane(), material=material(scene.ground_friction)
        )
        self._boxes = {box.name: add_body(world, box, heavy(scene)) for box in scene.bodies}
        self._robot = None if self.prepared is None else add_robot(world, self.prepared)
        world.build()
        self.solver = world.rigid_solver
        if self.prepared is not None and self.prepared.robot.closures:
            weld(self.solver, self.prepared)
        self._set_contacts(scene)
        links = self._links()
        self._touching = {link.idx: name for name, link in links.items()}, "link", 0.0
        keep_apart(self.solver.collider, links, scene.apart)
        self._free = [self._boxes[box.name].links[0].idx for box in scene.free_bodies]
        self._led = [self._boxes[box.name].links[0] for box in scene.prescribed_bodies]
        self._start_bodies(scene)
        if self.prepared is not None:
            self._set_drives(self.prepared.robot)
            forces = borne(self.prepared, scene.gravity)
            self._borne = [self._robot.get_link(name).idx for name in forces], [*forces.values()]
            self._bear()

    def _set_contacts(self, scene: Scene) -> None:
        """Impedance of contacts, and frictions that a material refuses."""
        solver, geoms = self.solver, self.solver.geoms
        parameters = np.array([contact_parameters(geom) for geom in geoms])
        if (parameters[:, 2:4] != self.settings.impedance).any():
            parameters[:, 2:4] = self.settings.impedance
            for geom, values in zip(geoms, parameters, strict=True):
                geom.set_sol_params(values)
        surfaces = [(self._boxes[b.name], b.friction, b.restitution) for b in scene.bodies]
        surfaces.append((self._ground, scene.ground_friction, scene.ground_restitution))
        if scene.robot is not None:
            surfaces.append((self._robot, scene.robot.friction, 0.0))
        substep = self.settings.timestep / self.settings.substeps
        for entity, friction, restitution in surfaces:
            if restitution:
                stiffness, damping = direct(min(restitution, MOST_BOUNCE), substep)
                ratio = -damping / (2 * math.sqrt(-stiffness))
                for geom in entity.geoms:
                    values = contact_parameters(geom)
                    values[:2] = -2 / damping, ratio  # time constant, damping ratio
                    geom.set_sol_params(values)
            if friction < LEAST_FRICTION:
                for geom in entity.geoms:
                    solver.set_geom_friction(friction, geom.idx)

    def _links(self) -> dict[str, Any]:
        """What the engine has for "ground", each `body/NAME` and `link/NAME`."""
        bodies = {name: body.links[0] for name, body in self._boxes.items()}
        names = () if self.prepared is None else self.prepared.links
        links = {name: self._robot.get_link(name) for name in names}
        return named_parts(self._ground.links[0], bodies, links)

    def _start_bodies(self, scene: Scene) -> None:
        """Velocities and damping of free bodies: linear in the world's axes, angular in the
        body's."""
        for box in scene.free_bodies:
            link = self._boxes[box.name].links[0]
            dofs = list(range(link.dof_start, link.dof_end))
            if box.damping.any():
                spins = box.angular_damping * box.inertia()
                damping = [*[box.linear_damping * box.mass] * 3, *spins]
                self.solver.set_dofs_damping(damping, dofs)
            if box.velocity.any():
                spin = box.pose.rotation().T @ box.angular_velocity
                self.solver.set_dofs_velocity([*box.linear_velocity, *spin], dofs)

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
        solver.set_dofs_damping(robot.column("passive_damping"), dofs)
        solver.set_dofs_frictionloss(robot.column("friction"), dofs)
        # The engine's springs are at rest at 0; a constant effort beyond the limits moves them.
        spring = robot.column("spring")
        moved = np.float32(spring * robot.column("rest"))
        solver.set_dofs_force_range(moved - limit, moved + limit, dofs)
        if spring.any():
            solver.set_dofs_stiffness(spring, dofs)
            solver.set_dofs_act_bias(moved, -self._stiffness, -robot.column("damping"), dofs)
        initial = robot.column("initial_position")
        solver.set_dofs_position(initial, dofs)
        self.command(initial, np.zeros(len(dofs)), np.zeros(len(dofs)))

    def read_back(self) -> dict[str, Any]:
        if self._own_file is not None:
            return FileReadBack(self, self._own_file).all()
        return ReadBack(self).all()

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        self.solver.control_dofs_position_velocity(
            position + effort / self._stiffness, velocity, self._dofs
        )

    def push(self, wrenches: FloatArray) -> None:
        force, torque = np.hsplit(wrenches, 2)
        solver = self.solver
        solver.apply_links_external_force(force, self._free, ref=centre_of_mass())
        solver.apply_links_external_torque(torque, self._free, ref=centre_of_mass())

    def _bear(self) -> None:
        """Pull at links that feel a share of gravity, in the next step."""
        links, forces = self._borne
        if links:
            self.solver.apply_links_external_force(forces, links, ref=centre_of_mass())

    def lead(self, before: FloatArray, after: FloatArray) -> None:
        for link, row in zip(self._led, before, strict=True):
            spin = rotation_matrix(row[3:7]).T @ row[10:]
            dofs = list(range(link.dof_start, link.dof_end))
            self.solver.set_dofs_velocity([*row[7:10], *spin], dofs)

    def step(self) -> None:
        self.world.step(update_visualizer=False)
        self._bear()
        self._steps += 1

    def body_state(self) -> FloatArray:
        state = np.empty((len(self._free), 13))
        if self._free:
            state[:, :7] = self._poses(self._free)
            state[:, 7:10] = numbers(self.solver.get_links_vel(self._free, ref=centre_of_mass()))
            state[:, 10:] = numbers(self.solver.get_links_ang(self._free))
        return state

    def _poses(self, links: list[int]) -> FloatArray:
        """Positions and quaternions of links, (n, 7)."""
        if not links:
            return np.empty((0, 7))
        position = numbers(self.solver.get_links_pos(links))
        quaternion = numbers(self.solver.get_links_quat(links))
        return np.hstack([position, quaternion / np.linalg.norm(quaternion, axis=1)[:, None]])

    def joint_state(self) -> FloatArray:
        if not self._dofs:
            return np.empty((2, 0))
        return np.stack(
            [
                numbers(self.solver.get_dofs_position(self._dofs)),
                numbers(self.solver.get_dofs_velocity(self._dofs)),
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
            of_collider(solver.collider, "collider_state"),
            solver.constraint_solver.constraint_state,
        ):
            yield from tensors_in(part)

    def contact_count(self) -> int:
        return int(array_of(of_collider(self.solver.collider, "collider_state").n_contacts)[0])

    def contact_forces(self) -> Iterator[tuple[str, str, FloatArray]]:
        names, kind, lift = self._touching
        up = np.array([0.0, 0.0, lift])
        found = self.solver.collider.get_contacts(as_tensor=True, to_torch=False)
        pairs = zip(found[f"{kind}_a"], found[f"{kind}_b"], strict=True)
        for (a, b), place, force in zip(pairs, found["position"], found["force"], strict=True):
            wrench = np.concatenate([force, np.cross(place + up, force)]).astype(float)
            yield names[int(b)], names[int(a)], wrench  # the force is on b

    def render(self, width: int, height: int) -> NDArray[np.uint8]:
        if self._camera is None or self._camera.res != (width, height):
            self._camera = add_camera(self.world, width, height)
        picture = self._camera.render(rgb=True, force_render=True)[0]
        return np.array(numbers(picture)[..., :3], dtype=np.uint8)

    def refresh_window(self) -> None:
        if self.gui and self.world.viewer.is_alive():  # else the user has closed it
            self.world.visualizer.update(force=True)

    def close(self) -> None:
        self._camera = self._robot = self._ground = self.solver = None
        self._boxes = {}
        if self.world is not None:
            self.world.destroy()
            self.world = None
            forget_worlds()
            gc.collect()  # scene, solver and entities refer to each other
