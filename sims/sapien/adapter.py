"""SAPIEN (PhysX 5), through its Python bindings; the engine under ManiSkill.

Drives are PhysX's own implicit springs in the joints of a reduced-coordinate articulation, force
limited. A joint force set beside the drive would not count towards that limit, so the effort
feed-forward rides on the position target: q* + tau_ff / k; the limit then clips the whole sum.
Velocity targets are native. Joints are coupled by SAPIEN's tendons, fingers with the stiffness that
its URDF loader gives a mimic joint, others with less. See docs/engines/sapien.md.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.description.links import borne, frames, reduced
from pytest_simbench.scene import Closure, FloatArray, Scene
from pytest_simbench.simulator import (
    Capability,
    Deviation,
    NotSupportedError,
    PreparedRobot,
    Simulator,
    SimulatorInfo,
    lazy_import,
)

from .bodies import (
    ROBOT,
    WORLD,
    Groups,
    add_body,
    add_ground,
    add_own,
    couple,
    groups_apart,
    soften,
)
from .drawing import Drawing
from .readback import ReadBack
from .settings import CHOSEN_ON, PROFILES, SAPIENSettings

sapien = lazy_import("sapien")
physx = lazy_import("sapien.physx")

PACKED = [4, 5, 6, 0, 1, 2, 3, *range(7, 13)]
"""Columns of `body_state` in the rows that SAPIEN packs: quaternion first. These rows, one for each
free body, are the first of what `PhysxCpuSystem.pack` gives, in single precision."""


HARD = (1e6, 1e4)
"""Stiffness [N m/rad] and damping [N m s/rad] that hold welded links; 1e5 and 1e8 hold alike."""


class SAPIEN(Simulator):
    """Adapter of SAPIEN."""

    info = SimulatorInfo(
        name="sapien",
        title="SAPIEN",
        distribution="sapien",
        modules=("sapien",),
        install="pip install 'pytest-simbench[sapien]'",
        licence="Apache-2.0, PhysX: BSD-3-Clause",
        engine="PhysX 5",
        language="C++",
        tested_version="3.0.3",
        oldest_version="3.0.0",
        companions={"3.0.0": ("numpy", "setuptools<81")},  # pkg_resources
        friction_rule="mean",
        capabilities=Capability.named(
            "window offscreen save_restore contact_count contact_forces compound loops couplings "
            "apart self_collide joint_wrenches deterministic"
        ),
        deviations=(
            Deviation("gripper/coupled coupling/*", "SAPIEN does not report its tendons"),
            Deviation(
                "link/*/meshes",
                "PhysX's convex hull of a mesh leaves out corners",
                within=5e-4,
                elsewhere=1e-3,
            ),
            Deviation(
                "link/*/gravity",
                "SAPIEN tells whether gravity acts: a share of it is a force of each step",
                within=1.0,
                only="link_gravity",
            ),
            Deviation(
                "",
                "a hinge's spring pulls the wrong way beyond half a turn",
                only="spring",
            ),
            Deviation("", "a cylinder is a prism, which loses speed as it rolls", only="cylinder"),
            Deviation(
                "",
                "impacts slower than bounce_threshold (2 m/s) do not bounce",
                only="restitution",
            ),
            Deviation("", "contact forces are those along the normals, without friction"),
            Deviation("", "window and pictures take a Vulkan device"),
            Deviation("", "a restored world has the saved poses and velocities, but new contacts"),
        ),
        install_size_mb=340,
    )
    profiles = PROFILES
    chosen_on = CHOSEN_ON
    settings: SAPIENSettings

    def load(self, scene: Scene) -> None:
        self.begin(scene)
        self._drawing: Drawing | None = None
        self._build(scene)
        if self.gui:
            self.refresh_window()

    def _build(self, scene: Scene) -> None:
        self._configure(scene)
        self._system = physx.PhysxCpuSystem()
        self._system.timestep = self.settings.timestep
        self._world = sapien.Scene([self._system])
        groups = groups_apart(scene)
        self._ground = add_ground(self._world, scene, groups)
        damped = self.settings.angular_damping
        self._bodies = {b.name: add_body(self._world, b, damped, groups) for b in scene.bodies}
        self._free = [self._bodies[box.name] for box in scene.free_bodies]
        self._led = [self._bodies[box.name] for box in scene.prescribed_bodies]
        self._prescribed = {k: b.velocity for k, b in enumerate(scene.free_bodies) if b.prescribed}
        packed = self._system.rigid_dynamic_components
        self._rows = [packed.index(body) for body in self._free]
        self._robot: Any = None
        self._joints: list[Any] = []
        self._own: list[list[Any]] = []
        self._links: dict[str, Any] = {}
        self._closures: list[Any] = []
        self._borne: list[tuple[Any, FloatArray]] = []
        if self.prepared is not None:
            self._load_robot(self.prepared, groups)

    def _configure(self, scene: Scene) -> None:
        """Set what PhysX reads when a scene, a shape and a body are made: global, so all of it."""
        s = self.settings
        physx.set_scene_config(
            gravity=scene.gravity,
            bounce_threshold=s.bounce_threshold,
            enable_pcm=s.pcm,
            enable_tgs=s.tgs,
            enable_ccd=False,
            enable_enhanced_determinism=s.enhanced_determinism,
            enable_friction_every_iteration=s.friction_every_iteration,
            cpu_workers=0,
        )
        physx.set_body_config(s.position_iterations, s.velocity_iterations, s.sleep_threshold)
        physx.set_shape_config(s.contact_offset, 0.0)

    def _load_robot(self, prepared: PreparedRobot, groups: Groups) -> None:
        robot, step = prepared.robot, self.settings.timestep
        loader = self._world.create_urdf_loader()
        loader.set_material(robot.friction, robot.friction, 0.0)
        with tempfile.TemporaryDirectory() as folder:
            # even to note a visual shape down needs a Vulkan device
            path = prepared.write_urdf(folder, visuals=False)
            builder = loader.load_file_as_articulation_builder(str(path))
        touches = WORLD | ROBOT if robot.self_collide else WORLD  # never two that a joint joins
        for link in builder.link_builders:
            link.collision_groups = groups.get(f"link/{link.name}", [ROBOT, touches, 0, 0])
        self._robot = builder.build(fix_root_link=True)
        self._links = {link.name: link for link in self._robot.links}
        for link in self._robot.links:
            link.linear_damping = link.angular_damping = self.settings.link_damping
        for link in prepared.links.values():
            built = len(self._links[link.name].collision_shapes)
            if built != len(link.shapes):  # SAPIEN passes over a shape that it cannot build
                raise RuntimeError(
                    f"SAPIEN built {built} of the {len(link.shapes)} shapes of {link.name}"
                )
        active = {joint.name: joint for joint in self._robot.active_joints}
        order = [joint.name for joint in self._robot.active_joints]
        self._order = np.array([order.index(name) for name in robot.joint_names])
        self._joints = [active[name] for name in robot.joint_names]
        for joint, drive in zip(self._joints, robot.joints, strict=True):
            joint.set_drive_properties(drive.stiffness, drive.damping, drive.effort_limit, "force")
            joint.set_armature([drive.armature])
            joint.set_friction(0.0 if drive.friction else self.settings.joint_friction)
            self._own.append(add_own(joint, drive, step))
        stiffest = self.settings.coupling_stiffness
        for pair in robot.gripper.couplings:
            couple(self._robot, pair, stiffest)
        for pair in robot.couplings:
            couple(self._robot, pair, min(stiffest, soften(self._robot, pair, step)))
        self._closures = [self._close(prepared, closure) for closure in reduced(prepared)]
        for name, force in borne(prepared, self.scene.gravity, felt=0.0).items():
            self._links[name].disable_gravity = True
            if force.any():
                self._borne.append((self._links[name], force))
        initial = np.empty(len(order))
        initial[self._order] = robot.column("initial_position")
        self._robot.set_qpos(initial)
        self._robot.set_qvel(np.zeros(len(order)))
        # TGS lets what such a drive holds creep by 3/8 of a step's fall a step
        self._most = np.array([j.effort_limit if j.motor else 0.0 for j in robot.joints])
        self._motors = bool(self._most.any())
        self._compliance = 1.0 / robot.column("stiffness")
        self._targets = [joint.set_drive_target for joint in self._joints]
        self._speeds = [joint.set_drive_velocity_target for joint in self._joints]
        zero = np.zeros(len(order))
        self.command(robot.column("initial_position"), zero, zero)

    def _close(self, prepared: PreparedRobot, closure: Closure) -> Any:
        """Hold two links together by a joint that lets them turn alone, or not at all."""
        first, second = self._links[closure.first], self._links[closure.second]
        made = physx.PhysxDriveComponent(second)
        made.parent = first
        made.pose_in_parent = sapien.Pose(closure.first_point)
        made.pose_in_child = sapien.Pose(closure.second_point)
        for lock in (made.set_limit_x, made.set_limit_y, made.set_limit_z):
            lock(0.0, 0.0)
        if closure.rigid:
            turn = frames(prepared, closure)[1].quaternion
            made.pose_in_child = sapien.Pose(closure.second_point, turn)
            # locked twist and cone give way, by 1 rad in 0.3 s; with this 1.7 mrad
            made.set_drive_property_slerp(*HARD)
        second.entity.add_component(made)
        return made

    def read_back(self) -> dict[str, Any]:
        return ReadBack(self).all()

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        if self._motors:
            pushed = np.clip(effort, -self._most, self._most)
            of_joints = np.zeros_like(pushed)
            of_joints[self._order] = pushed
            self._robot.set_qf(of_joints)
            effort = effort * (self._most == 0)
        for set_target, target in zip(
            self._targets, (position + effort * self._compliance).tolist(), strict=True
        ):
            set_target(target)
        for set_speed, speed in zip(self._speeds, velocity.tolist(), strict=True):
            set_speed(speed)

    def push(self, wrenches: FloatArray) -> None:
        for body, row in zip(self._free, wrenches, strict=True):
            if row.any():  # which wakes it
                body.add_force_torque(row[:3].astype(np.float32), row[3:].astype(np.float32))

    def lead(self, before: FloatArray, after: FloatArray) -> None:
        for body, row in zip(self._led, after, strict=True):
            body.kinematic_target = sapien.Pose(row[:3], row[3:7])

    def step(self) -> None:
        for link, force in self._borne:
            link.add_force_torque(force.astype(np.float32), np.zeros(3, np.float32))
        self._system.step()
        self._steps += 1

    def body_state(self) -> FloatArray:
        # All in one call; body by body it takes ten times as long, a third of the stepping.
        packed = np.frombuffer(self._system.pack(), np.float32, count=13 * len(self._rows))
        state = packed.reshape(-1, 13)[self._rows][:, PACKED].astype(float)
        for k, velocity in self._prescribed.items():  # PhysX has it after a step alone
            state[k, 7:] = velocity
        return state

    def joint_state(self) -> FloatArray:
        if self._robot is None:
            return np.empty((2, 0))
        return np.stack([self._robot.qpos, self._robot.qvel])[:, self._order].astype(float)

    def save(self) -> tuple[Any, ...]:
        return self._system.pack(), self._steps, None if self._robot is None else self._robot.qf

    def restore(self, state: tuple[Any, ...]) -> None:
        # The state that SAPIEN packs holds no contacts. A world that lives on keeps its own, their
        # friction and their order, and the future would depend on what was before the restore.
        self._build(self.scene)
        self._system.unpack(state[0])
        self._steps = state[1]
        if self._robot is not None:  # what pushes beside the drives is not packed
            self._robot.set_qf(state[2])

    def contact_forces(self) -> Iterator[tuple[str, str, FloatArray]]:
        for contact in self._system.get_contacts():
            first, second = map(self._name_of, contact.bodies)
            for point in contact.points:
                force = np.asarray(point.impulse, dtype=float) / self.settings.timestep
                yield first, second, np.concatenate([force, np.cross(point.position, force)])

    def _name_of(self, component: Any) -> str:
        if component == self._ground:
            return "ground"
        kind = "body" if component in self._bodies.values() else "link"
        return f"{kind}/{component.entity.name if kind == 'body' else component.name}"

    def joint_wrenches(self) -> FloatArray:
        if self._robot is None:
            return np.empty((0, 6))
        if any(self._own) or self._closures:  # PhysX does not tell what such constraints carry
            raise NotSupportedError(
                "sapien tells no wrenches of joints with springs, damping or friction, or of loops"
            )
        told = np.asarray(self._robot.get_link_incoming_joint_forces(), dtype=float)
        links, rows = list(self._robot.links), []
        for joint in self._joints:
            link = joint.child_link
            frame = link.pose * joint.pose_in_child  # in whose axes PhysX tells it
            turn = frame.to_transformation_matrix()[:3, :3]
            rows.append((told[links.index(link)].reshape(2, 3) @ turn.T).ravel())
        return np.array(rows)

    def contact_count(self) -> int:
        return sum(len(contact.points) for contact in self._system.get_contacts())

    def render(self, width: int, height: int) -> NDArray[np.uint8]:
        return self._drawn().picture(width, height)

    def refresh_window(self) -> None:
        if self.gui:
            self._drawn().show()

    def _drawn(self) -> Drawing:
        """The drawing, up to date; made when it is first asked for."""
        if self._drawing is None:
            self._drawing = Drawing(self.scene, self.prepared)
        poses = {name: body.entity.pose for name, body in self._bodies.items()}
        if self.prepared is not None:
            poses |= {name: self._links[name].entity.pose for name in self.prepared.links}
        self._drawing.follow(poses)
        return self._drawing

    def close(self) -> None:
        drawing = getattr(self, "_drawing", None)
        if drawing is not None:
            drawing.close()
        # Everything that holds on to the scene must go, else PhysX keeps it.
        for name in list(vars(self)):
            if name.startswith("_"):
                delattr(self, name)
