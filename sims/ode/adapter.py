"""ODE (the engine inside Gazebo classic and, as a fork, Webots), through pyode.

Drives are motors of ODE's joints, see `drives`. ODE finds pairs that may touch; contacts become
joints here, in Python (`contacts`). pyode has no window and draws no pictures.

What was learnt stands in docs/engines/ode.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pytest_simbench.description.links import borne, joined, reduced
from pytest_simbench.scene import FloatArray, Scene
from pytest_simbench.scene.friction import RULES
from pytest_simbench.simulator import (
    Capability,
    Deviation,
    NotSupportedError,
    PreparedRobot,
    Simulator,
    SimulatorInfo,
    lazy_import,
)
from pytest_simbench.simulator.base import named_parts

from . import world as build
from .axes import Axis
from .contacts import Contacts, Part
from .drives import Drives
from .library import GAVE_UP, body_id, library, library_path, messages, turn, turned
from .readback import ReadBack
from .settings import CHOSEN_ON, PROFILES, ODESettings

ode = lazy_import("ode")

PACKAGES = ("python3-numpy", "python3-pyode")

SEED = 0
"""Of ODE's own random numbers, by which quickStep shuffles its rows; 0 is where they begin."""

STUCK = 0.2
"""So long the solver may give up in every step [s]; meshes that touch made it do so for 3."""


State = tuple[int, list[Any], list[tuple[bytes, bytes]], list[bool], list[Any], Any, int]
"""What a run goes on from: steps since loading; of each body position and velocities, rotation, and
whether it is awake; turns of each joint, see `Axis`; the drives' set points; seed of ODE's random
numbers."""


class ODE(Simulator):
    """Adapter of ODE."""

    info = SimulatorInfo(
        name="ode",
        title="Open Dynamics Engine",
        distribution="Py3ODE",
        modules=("ode",),
        install=f"apt-get install {' '.join(PACKAGES)}",
        system_packages=PACKAGES,
        licence="BSD-3-Clause or LGPL-2.1",
        engine="ODE",
        language="C++",
        tested_version="1.2.0.dev15",
        friction_rule="|".join(RULES),
        capabilities=Capability.named(
            "save_restore contact_count contact_forces compound loops couplings apart "
            "self_collide joint_wrenches deterministic"
        ),
        deviations=(
            Deviation(
                "coupling/*",
                "ODE has no couplings: contacts of each step are one, of which it tells whose",
                only="coupling",
            ),
            Deviation(
                "joint/*/rest", "a spring is a motor, told before each step how fast to move"
            ),
            Deviation("body/*/margin link/*/margin", "ODE's shapes have no margin"),
            Deviation("", "what sleeps has no contacts, and so no forces"),
            Deviation(
                "",
                "with drive=velocity (profile default) the drives are Webots' controllers of "
                "velocity: far stiffer than the scene's, and blind to set points of velocity",
            ),
        ),
        install_size_mb=40,
    )
    profiles = PROFILES
    chosen_on = CHOSEN_ON
    settings: ODESettings

    def load(self, scene: Scene) -> None:
        self.begin(scene)
        if self.prepared is not None:
            _check_couplings(self.prepared)
        s = self.settings
        library().dRandSetSeed(SEED)
        self.world = world = ode.World()
        world.setGravity(scene.gravity)
        world.setERP(s.erp)
        world.setCFM(s.cfm)
        world.setQuickStepNumIterations(s.iterations)
        world.setAutoDisableFlag(s.sleeping)
        world.setAutoDisableTime(1.0)
        self.contacts = Contacts(
            world,
            s.contact_erp,
            s.contact_cfm,
            s.contacts,
            s.friction == "slip",
            RULES[scene.friction_rule],
        )
        space = self.contacts.space
        self._advance = world.step if s.solver == "step" else world.quickStep
        self._ground = build.add_ground(space, scene.ground_friction, scene.ground_restitution)
        self._bodies = {
            box.name: build.add_body(world, space, box, s.timestep) for box in scene.bodies
        }
        self._free = [self._bodies[box.name].body for box in scene.free_bodies]
        self._led = [self._bodies[box.name].body for box in scene.prescribed_bodies]
        self._links: dict[str, Part] = {}
        self._axes: dict[str, Axis] = {}
        self._closures: list[Any] = []
        self._borne: list[tuple[Any, FloatArray]] = []
        self._drives: Drives | None = None
        if self.prepared is not None:
            self._load_robot(self.prepared)
        self._parts = named_parts(self._ground, self._bodies, self._links)
        for pair in scene.apart:
            self.contacts.apart.add(frozenset(id(self._parts[name].surface) for name in pair))
        links = [part.body for part in self._links.values() if part.body is not None]
        self._moving, self._stuck = [*self._free, *links], 0
        if self._drives is not None:
            self._moving += [pinion.body for pinion in self._drives.pinions.values()]
        self._names = [body_id(body) for body in self._moving]

    def _load_robot(self, prepared: PreparedRobot) -> None:
        robot, s = prepared.robot, self.settings
        self.world.setAutoDisableFlag(False)  # of bodies made from here on: a motor wakes nobody
        self._links = build.add_links(self.world, self.contacts.space, prepared)
        for pair in joined(prepared) if robot.self_collide else ():
            self.contacts.apart.add(frozenset(id(self._links[name].surface) for name in pair))
        self._axes = build.add_joints(self.world, prepared, self._links, s.timestep)
        build.put_links(prepared, self._links, {j.name: j.initial_position for j in robot.joints})
        for joint in robot.joints:
            self._axes[joint.name].stands(joint.initial_position)
        self._closures = [
            build.close_loop(self.world, prepared, self._links, closure)
            for closure in reduced(prepared)
        ]
        for name, force in borne(prepared, self.scene.gravity, felt=0.0).items():
            self._links[name].body.setGravityMode(False)
            self._borne.append((self._links[name].body, force))
        self._bear()
        self._drives = Drives(self.world, robot, self._axes, s.timestep, s.drive, s.position_gain)

    def _bear(self) -> None:
        """Pull at links that feel a share of gravity, in the next step."""
        for body, force in self._borne:
            body.addForce(force)

    def read_back(self) -> dict[str, Any]:
        return ReadBack(self).all()

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        if self._drives is not None:
            self._drives.command(position, velocity, effort)

    def push(self, wrenches: FloatArray) -> None:
        for body, row in zip(self._free, wrenches, strict=True):
            if row.any():
                body.enable()  # a force wakes nobody
                body.addForce(row[:3])
                body.addTorque(row[3:])

    def lead(self, before: FloatArray, after: FloatArray) -> None:
        for body, row in zip(self._led, before, strict=True):
            body.setPosition(row[:3])
            body.setQuaternion(row[3:7])
            body.setLinearVel(row[7:10])
            body.setAngularVel(row[10:])

    def step(self) -> None:
        if self._drives is not None:
            self._drives.act()
        for axis in self._axes.values():
            if axis.wide:
                axis.tell_stops()
        self.contacts.make()
        messages.clear()
        self._advance(self.settings.timestep)
        if self._drives is not None:
            self._drives.rest()
        self._bear()
        self._steps += 1
        self._stuck = self._stuck + 1 if GAVE_UP in messages else 0
        if self._stuck * self.settings.timestep >= STUCK:
            raise RuntimeError(
                f"ODE's solver has given up in every step for {STUCK:g} s, at t = {self.time:.3f} "
                "s, and drives and contacts had no force; try --sim-set ode.solver=quickstep"
            )

    def body_state(self) -> FloatArray:
        state = np.empty((len(self._free), 13))
        for row, body in zip(state, self._free, strict=True):
            row[:3], row[3:7] = body.getPosition(), body.getQuaternion()
            row[7:10], row[10:] = body.getLinearVel(), body.getAngularVel()
        return state

    def joint_state(self) -> FloatArray:
        return np.empty((2, 0)) if self._drives is None else self._drives.state()

    def save(self) -> State:
        bodies = [(b.getPosition(), b.getLinearVel(), b.getAngularVel()) for b in self._moving]
        rotations = [turned(name) for name in self._names]
        commanded = None if self._drives is None else self._drives.commanded
        awake = [bool(body.isEnabled()) for body in self._moving]
        turns = [tuple(axis.turn) for axis in self._axes.values()]
        seed = library().dRandGetSeed()
        return self._steps, bodies, rotations, awake, turns, commanded, seed

    def restore(self, state: State) -> None:
        self._steps, bodies, rotations, awake, turns, commanded, seed = state
        self.contacts.clear()
        self.contacts.settle()  # else the order of contacts is that of what went before
        for name, rotation in zip(self._names, rotations, strict=True):
            turn(name, *rotation)
        for body, values, woken in zip(self._moving, bodies, awake, strict=True):
            position, linear, angular = values
            body.setPosition(position)
            body.setLinearVel(linear)
            body.setAngularVel(angular)
            body.enable() if woken else body.disable()
        for axis, turn_ in zip(self._axes.values(), turns, strict=True):
            axis.turn[:] = turn_
        if self._drives is not None and commanded is not None:
            self._drives.command(*commanded)
        library().dRandSetSeed(seed)

    def joint_wrenches(self) -> FloatArray:
        if self.prepared is None:
            return np.empty((0, 6))
        if self.prepared.robot.couplings:  # whose contacts are no part of the joints
            raise NotSupportedError("ode tells no wrenches of joints that are coupled")
        frames = {joint.name: self._links[joint.child].frame for joint in self.prepared.joints}
        names = self.prepared.robot.joint_names
        return np.array([self._axes[name].wrench(frames[name]) for name in names])

    def contact_count(self) -> int:
        return len(self.contacts.made)

    def contact_forces(self) -> Iterator[tuple[str, str, FloatArray]]:
        names = {id(part.surface): name for name, part in self._parts.items()}
        for first, second, wrench in self.contacts.forces():
            yield names[id(first)], names[id(second)], wrench

    def versions(self) -> dict[str, str]:
        number = library_path().partition(".so.")[2]
        return {**super().versions(), **({"libode": number} if number else {})}


def _check_couplings(prepared: PreparedRobot) -> None:
    """Refuse what `Pinion` cannot couple before anything is built: what ODE frees half built
    crashes."""
    ends = {joint.name: {joint.parent, joint.child} for joint in prepared.joints}
    robot = prepared.robot
    for pair in (*robot.gripper.couplings, *robot.couplings):
        if not ends[pair.leader] & ends[pair.follower]:
            raise NotSupportedError(
                f"ode couples joints of one link, and {pair.follower} and {pair.leader} have none "
                "in common"
            )
