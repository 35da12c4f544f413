"""Gazebo (gz-sim 8 to 10), in process and in lock-step, through its own Python bindings.

Gazebo takes its physics engine as a plugin: DART (`dartsim`, its default) or Bullet's multibodies
(`bullet-featherstone`). Drives are its velocity commands of joints, see `drives`.

What was learnt stands in docs/engines/gazebo.md.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.scene import FloatArray, Scene
from pytest_simbench.simulator import FOLLOWER, Capability, Deviation, Simulator, SimulatorInfo

from .drives import Drives, Wrenches
from .readback import ReadBack
from .sdf import Physics, is_lone, robot_model, world_text
from .server import MODULES, Server, bindings, library_version, new_name
from .settings import CHOSEN_ON, PROFILES, GazeboSettings
from .window import Window

PACKAGES = ("python3-numpy", "gz-harmonic")
"""The second is of the Open Source Robotics Foundation's own package archive."""

ARCHIVE = "https://gazebosim.org/docs/harmonic/install_ubuntu"
"""Says how that archive is made known to apt."""


class Gazebo(Simulator):
    """Adapter of Gazebo."""

    info = SimulatorInfo(
        name="gazebo",
        title="Gazebo",
        distribution="gz-sim",
        modules=MODULES,
        install=f"apt-get install {' '.join(PACKAGES)} (from Gazebo's archive: {ARCHIVE})",
        system_packages=PACKAGES,
        licence="Apache-2.0",
        engine="DART, Bullet",
        language="C++",
        tested_version="8.14.0",
        capabilities=frozenset({Capability.WINDOW}),
        deviations=(
            Deviation("joint/*/armature", "Gazebo has no rotor inertia"),
            Deviation(
                "joint/*/stiffness joint/*/damping",
                "velocity commands are constraints of the engine, neither springs nor dampers: an "
                "effort beside one does nothing",
            ),
            Deviation("body/*/damping link/*/damping", "Gazebo tells no damping of links"),
            Deviation(
                "",
                "Gazebo's engines do not damp bodies: a force and a torque do it in each step",
                only="damping",
            ),
            Deviation(
                "",
                "the adapter moves no body as prescribed: such a body stands still",
                only="prescribed",
            ),
            Deviation(
                "joint/*/damping",
                "the adapter gives joints no damping of their own: SDF's was not tried",
                only="passive_damping",
            ),
            Deviation(
                "joint/*/friction",
                "the adapter gives joints no dry friction: SDF's was not tried",
                only="joint_friction",
            ),
            Deviation(
                "joint/*/stiffness joint/*/rest",
                "the adapter gives joints no springs: SDF's were not tried",
                only="spring",
            ),
            Deviation(
                "link/*/gravity",
                "the adapter gives links their whole weight: SDF's switch was not tried",
                only="link_gravity",
            ),
            Deviation(
                "joint/*/stiffness",
                "the adapter commands velocities: it holds what has a motor alone",
                only="motor",
            ),
            Deviation("body/*/margin", "Gazebo's boxes and round shapes have no margin outside"),
            Deviation(
                "link/*/margin",
                "Gazebo tells no margin; bullet-featherstone puts one of 10 mm around a mesh",
            ),
            Deviation(
                "body/*/velocity",
                "Gazebo tells no velocity before the first step, in which a force gives it",
            ),
            Deviation(
                f"joint/*finger_joint2/effort_limit joint/{FOLLOWER}/effort_limit",
                "with dartsim the second finger is led by the first, by up to both their limits",
            ),
            Deviation(
                "",
                "bullet-featherstone's friction goes by a body's own axes: where its z axis lies "
                "in the contact, it is mu^(3/4) instead of mu, but of a body alone on the ground",
            ),
            Deviation(
                "",
                "a mesh's hull is made anew from voxels, which takes seconds, with a layer of "
                "1 mm around it",
                only="convex_mesh",
            ),
            Deviation(
                "",
                "bullet-featherstone holds what turns on the ground, as SDF's torsional friction "
                "of 1 asks; `tuned` has torsional_friction=0, which lets it turn",
            ),
            Deviation(
                "",
                "shapes, friction and joints are read from the world that Gazebo's server writes; "
                "its physics engine tells nobody what it has",
            ),
            Deviation(
                "",
                "a body's pose and velocity are refreshed when it has moved by 1e-6 m: what comes "
                "to rest keeps its last velocity, up to a mm/s",
            ),
        ),
        environment={"GZ_IP": "127.0.0.1"},
        install_size_mb=1500,
    )
    profiles = PROFILES
    chosen_on = CHOSEN_ON
    settings: GazeboSettings
    _window: Window | None = None

    def load(self, scene: Scene) -> None:
        self.begin(scene)
        s = self.settings
        self._physics = Physics(s, is_lone(scene))
        name = new_name()
        self._files = tempfile.TemporaryDirectory(prefix="simbench-gazebo-")  # of bodies' meshes
        folder = Path(self._files.name)
        text = world_text(scene, self.prepared, self._physics, name, folder, self.gui)
        self.server = server = Server(text, name)
        server.reset()
        if self.gui:
            self._window = Window(library_version(), self.info.install)
        sim, ecm = bindings().sim, server.ecm
        self._free = [
            sim.Link(self._model(body.name).link_by_name(ecm, "link")) for body in scene.free_bodies
        ]
        for link in self._free:
            link.enable_velocity_checks(ecm)
        self._wrenches = Wrenches(
            ecm, scene.free_bodies, self._free, s.timestep, self._physics.turns_torques
        )
        self._drives: Drives | None = None
        if self.prepared is not None:
            self._drives = Drives(
                server,
                self._model(robot_model(scene)),
                self.prepared.robot,
                s.timestep,
                s.position_gain,
                self._physics.coupled,
            )

    def _model(self, name: str) -> Any:
        ecm = self.server.ecm
        return bindings().sim.Model(self.server.world.model_by_name(ecm, name))

    def read_back(self) -> dict[str, Any]:
        return ReadBack(self).all()

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        # A velocity command finds the effort itself, so there is nothing to feed forward.
        if self._drives is not None:
            self._drives.command(position, velocity)

    def lead(self, before: FloatArray, after: FloatArray) -> None:
        pass  # declared: prescribed bodies stand

    def push(self, wrenches: FloatArray) -> None:
        self._wrenches.push(wrenches, self.body_state())

    def step(self) -> None:
        if self._drives is not None:
            self._drives.act()
        if self._wrenches.damps:
            self._wrenches.act(self.body_state())
        self.server.step()
        self._steps += 1

    def body_state(self) -> FloatArray:
        state, ecm = np.zeros((len(self._free), 13)), self.server.ecm
        if not self._steps:  # Gazebo tells no velocity before it has made a step
            state[:, 7:] = self._wrenches.thrown
        for row, link in zip(state, self._free, strict=True):
            place = link.world_pose(ecm)
            at, turn = place.pos(), place.rot()
            row[:7] = at.x(), at.y(), at.z(), turn.w(), turn.x(), turn.y(), turn.z()
            linear = link.world_linear_velocity(ecm) if self._steps else None
            if linear is not None:  # as of a prescribed body, which stands
                angular = link.world_angular_velocity(ecm)
                row[7:10] = linear.x(), linear.y(), linear.z()
                row[10:] = angular.x(), angular.y(), angular.z()
        return state

    def joint_state(self) -> FloatArray:
        return np.empty((2, 0)) if self._drives is None else self._drives.state()

    def close(self) -> None:
        if self._window is not None:
            self._window.close()

    def versions(self) -> dict[str, str]:
        bindings()
        return {self.info.distribution: library_version()}
