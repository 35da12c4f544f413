"""CoppeliaSim (4.10), in process and in lock-step, by the C interface of its headless library.

The program brings the physics engines, of which a setting chooses one. Its dynamics are stepped
without its simulation loop: so no script of its own runs. Drives are its control of joints, see
`drives`.
"""

from __future__ import annotations

from collections.abc import Iterator
from ctypes import byref, c_int
from typing import Any

import numpy as np

from pytest_simbench.scene import FloatArray, Pose, Scene
from pytest_simbench.simulator import (
    FOLLOWER,
    Capability,
    Deviation,
    Simulator,
    SimulatorError,
    SimulatorInfo,
    UnavailableError,
)
from pytest_simbench.simulator.base import named_parts

from . import library as program
from . import world as build
from .drives import Drives
from .readback import ReadBack
from .settings import CHOSEN_ON, PROFILES, CoppeliaSimSettings
from .world import Part, Surface

FORGOTTEN = 500
"""Steps after which what the program would tell its clients is thrown away: some MB."""


class CoppeliaSim(Simulator):
    """Adapter of CoppeliaSim."""

    info = SimulatorInfo(
        name="coppeliasim",
        title="CoppeliaSim",
        distribution="coppeliasim",
        modules=(),
        program=(program.ROOT, program.LIBRARY),
        install=f"set {program.ROOT} to the folder of an installed CoppeliaSim 4.10",
        licence="GPL-3.0-or-later, engines GPL-2.0-or-later",
        engine="Bullet, ODE, Newton Dynamics, MuJoCo",
        language="C++",
        tested_version="4.10.0",
        oldest_version="4.10.0",
        capabilities=Capability.named(
            "contact_count contact_forces deterministic compound couplings"
        ),
        deviations=(
            Deviation("body/*/margin link/*/margin", "the program tells no margin of shapes"),
            Deviation("*/restitution", "neither ODE nor MuJoCo, as the program has them, bounce"),
            Deviation(
                "body/*/damping link/*/damping", "MuJoCo, as the program has it, damps no bodies"
            ),
            Deviation(
                f"joint/*finger_joint2/effort_limit joint/{FOLLOWER}/effort_limit",
                "but with MuJoCo the second finger is led by the first, by up to both their limits",
            ),
            Deviation(
                "",
                "in a process that had worlds before, Bullet 2.78, ODE and Newton may be given "
                "bodies in another order, and their results differ in the last digits",
            ),
            Deviation("", "Bullet 2.78 has no gyroscopic torque: what spins never tumbles"),
            Deviation(
                "",
                "with MuJoCo the program tells where bodies were before the last step; joints are "
                "told as they are after it",
            ),
        ),
        environment={"QT_QPA_PLATFORM": "offscreen"},
    )
    profiles = PROFILES
    chosen_on = CHOSEN_ON
    settings: CoppeliaSimSettings
    _started = False

    def load(self, scene: Scene) -> None:
        self.begin(scene)
        s = self.settings
        self._start()
        build.set_engine(s, scene.gravity)
        self._surface = surface = Surface(s)
        shapes = build.Shapes(s.engine)
        self._ground = build.add_ground(
            shapes, surface, scene.ground_friction, scene.ground_restitution
        )
        self._bodies = {body.name: build.add_body(shapes, surface, body) for body in scene.bodies}
        self._free = [self._bodies[body.name] for body in scene.free_bodies]
        self._led = [self._bodies[body.name] for body in scene.prescribed_bodies]
        self._links: dict[str, Part] = {}
        self._joints: dict[str, int] = {}
        self._drives: Drives | None = None
        if self.prepared is not None:
            self._links, self._joints = build.add_links(shapes, surface, self.prepared)
            self._drives = Drives(self.prepared, self._links, self._joints, s)
        shapes.close()
        self._goals = np.empty((0, 13))
        self._step = program.stepper(s.timestep)

    def _start(self) -> None:
        """Start the program, once."""
        if self._started:
            return
        if self.info.no_program:
            raise UnavailableError(self.info.no_program)
        program.check_engine(self.settings.engine)
        program.start()
        self._started = True

    def read_back(self) -> dict[str, Any]:
        return ReadBack(self).all()

    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        if self._drives is not None:
            self._drives.command(position, velocity, effort)

    def push(self, wrenches: FloatArray) -> None:
        for part, row in zip(self._free, wrenches, strict=True):
            if row.any():
                force, torque = program.doubles(row[:3]), program.doubles(row[3:])
                program.call("simAddForceAndTorque_D", part.handle, force, torque)

    def lead(self, before: FloatArray, after: FloatArray) -> None:
        self._goals = after

    def step(self) -> None:
        if self._drives is not None:
            self._drives.act()
        for part, row in zip(self._led, self._goals, strict=False):
            part.put(Pose.from_array(row[:7]))  # the program moves it there in the step
        if not self._step():
            raise SimulatorError(
                f"CoppeliaSim made no step with engine={self.settings.engine}: "
                f"{program.last_error()}"
            )
        self._steps += 1
        if self._steps % FORGOTTEN == 0:
            program.forget_events()

    def body_state(self) -> FloatArray:
        state = np.empty((len(self._free), 13))
        for row, part in zip(state, self._free, strict=True):
            row[:7] = part.pose().as_array()
            row[7:10], row[10:] = part.velocity() if self._steps else self._surface.thrown(part)
        return state

    def joint_state(self) -> FloatArray:
        return np.empty((2, 0)) if self._drives is None else self._drives.state()

    def contact_count(self) -> int:
        return sum(1 for _ in self._contacts())

    def contact_forces(self) -> Iterator[tuple[str, str, FloatArray]]:
        parts = named_parts(self._ground, self._bodies, self._links)
        names = {part.handle: name for name, part in parts.items()}
        for (first, second), row in self._contacts():
            wrench = np.concatenate([row[3:], np.cross(row[:3], row[3:])])
            yield names[first], names[second], wrench

    def _contacts(self) -> Iterator[tuple[tuple[int, int], FloatArray]]:
        """Of the last step: two shapes' handles; point [m] and force [N] of each contact, (6,)."""
        handles, values = (c_int * 2)(), program.doubles([0.0] * 6)
        k = 0
        while self._steps and program.call(
            "simGetContactInfo_D", program.ALL, program.ALL, k, byref(handles), values
        ):
            yield (handles[0], handles[1]), np.array(values)
            k += 1

    def close(self) -> None:
        if self._started:
            self._started = False
            program.end()

    def versions(self) -> dict[str, str]:
        self._start()  # none but the running program tells
        return {self.info.distribution: program.version()}
