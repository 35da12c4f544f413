"""The abstract simulator: what an adapter implements, and all that the rest knows of an engine."""

from __future__ import annotations

import importlib
import math
import signal
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import ModuleType
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.description.carried import Carried
from pytest_simbench.description.links import check_apart
from pytest_simbench.description.urdf import PreparedRobot
from pytest_simbench.ground.errors import NotSupportedError
from pytest_simbench.records.tuned_on import Seen
from pytest_simbench.scene import FloatArray, Scene, Vector3
from pytest_simbench.simulator.info import SimulatorInfo
from pytest_simbench.simulator.settings import Settings

Part = TypeVar("Part")

TIMES = 1e4
"""What strikes a heavy body moves it by this part of its own change of velocity, for one step. With
more, solvers lose digits: in one engine a cube of 0.2 kg jitters at 20 mm/s on a belt of 1e7 kg."""


def heavy(scene: Scene) -> float:
    """Mass [kg] and moments of inertia [kg m^2] of what stands for a body that moves as prescribed,
    where an engine knows none: many times those of any other body.

    Such an engine gets a free body that nothing moves: so heavy that what touches it hardly changes
    its velocity, alike about all axes so that it turns steadily, and without weight.
    `Simulator.lead` gives it its state before each step.
    """
    return TIMES * max([1.0, *(body.mass for body in scene.bodies)])


EYE: Vector3 = (2.0, -2.1, 1.35)
"""Of the camera, in the world [m]: the same for every engine, so that pictures can be compared. The
robot stands on the left, what it throws comes nearer on the right."""

LOOK_AT: Vector3 = (0.6, 0.0, 0.5)
"""The middle of the picture, in the world [m]; z is up."""

FIELD_OF_VIEW = math.radians(40.0)
"""Vertical [rad]."""


def view_axes() -> FloatArray:
    """The picture's right and down, and ahead of the camera: columns, in the world, (3, 3)."""
    ahead = np.subtract(LOOK_AT, EYE) / np.linalg.norm(np.subtract(LOOK_AT, EYE))
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return np.column_stack([right, np.cross(ahead, right), ahead])


def named_parts(
    ground: Part, bodies: Mapping[str, Part], links: Mapping[str, Part]
) -> dict[str, Part]:
    """What an engine has for ground, bodies and links, by their names in contacts and in pairs that
    are kept apart: "ground", `body/NAME` and `link/NAME`."""
    found = {f"body/{name}": part for name, part in bodies.items()}
    return {"ground": ground, **found, **{f"link/{name}": part for name, part in links.items()}}


def chosen_on(*tuned: Seen, real: tuple[Seen, ...] = ()) -> Mapping[str, tuple[Seen, ...]]:
    """What the settings of an adapter were chosen on, by profile: `tuned` on seeds, `real` on these
    and on each third toss of those that are not held out, and on what else is named."""
    return {"tuned": tuned, "real": (*tuned, Seen.motions("cube_tosses", 0, 564, 6), *real)}


class _LazyModule(ModuleType):
    def __getattr__(self, attribute: str) -> Any:
        if attribute.startswith("__"):
            raise AttributeError(attribute)
        found = getattr(importlib.import_module(self.__name__), attribute)
        if callable(found):  # no state; to import again took 2 % of a fast engine's step
            setattr(self, attribute, found)
        return found


def lazy_import(name: str) -> Any:
    """Stand-in for the module `name`, which is imported when its first attribute is read.

    An adapter's facts and settings can so be read where its engine is not installed. Missing
    submodules are imported by naming them: `lazy_import("engine.viewer")`.
    """
    return _LazyModule(name)


@contextmanager
def signals_kept(*numbers: signal.Signals) -> Iterator[None]:
    """Meanwhile an engine may replace Python's handlers of these signals; they are put back."""
    kept = {number: signal.getsignal(number) for number in numbers}
    try:
        yield
    finally:
        for number, handler in kept.items():
            signal.signal(number, handler)


class Simulator(ABC):
    """One engine holding one world, in a process of its own.

    Subclass it in `sims/` (or in a package of your own, registered in the entry-point group
    `pytest_simbench.simulators`), fill in `info` and `profiles`, and implement the abstract
    methods. The module must import without the engine: import that lazily (`lazy_import`).

    The life of a simulator: constructed with its settings, `load` once, then `command` and `step`
    again and again with state read in between, and `close` at the end. A command holds until the
    next one; what acts on bodies from outside is told before each step (`push`, `lead`). Free
    bodies are always given in the order of `scene.free_bodies`, joints in the order of
    `scene.robot.joints`. Joint drives obey the law in `scene.Joint`; where the engine has a native
    drive, it is used. Links of the robot collide with each other only where
    the robot has `self_collide` (`description.links`), everything else does.

    Attributes:
        info: facts about the engine, its capabilities and its deviations.
        profiles: settings by profile name; `default` and `tuned` at least.
        chosen_on: by profile, the seeds or measured motions by whose results its settings were
            chosen, or others rejected; a report on the same says so.
        settings: those of this instance.
        scene, prepared: what `begin` was given, and its reduced robot, None in one without.
        gui: whether a window is to be opened in `load`.
    """

    info: ClassVar[SimulatorInfo]
    profiles: ClassVar[Mapping[str, Settings]]
    chosen_on: ClassVar[Mapping[str, tuple[Seen, ...]]] = {}

    scene: Scene
    prepared: PreparedRobot | None
    _steps: int = 0

    def __init__(self, settings: Settings, *, gui: bool = False) -> None:
        self.settings = settings
        self.gui = gui

    def begin(self, scene: Scene) -> None:
        """Have `scene` and `prepared`, and no steps so far; for `load` to call first."""
        self.scene, self._steps = scene, 0
        self.prepared = None if scene.robot is None else PreparedRobot(scene.robot)
        check_apart(scene, self.prepared)

    def read_file(self, path: str) -> tuple[Scene, tuple[Carried, ...]]:
        """A file of the engine's own format as a scene, and what was carried of it.

        Only called for files with an ending in `info.reads`; nothing is loaded.

        Raises:
            DescriptionError: something in the file that cannot be, or that no scene can hold.
        """
        raise self._missing("reader of files")

    def compile(self, scene: Scene) -> None:  # noqa: B027 - most engines have nothing to compile
        """Have ready what `load` of this scene needs compiled; called just before it.

        Its time is a phase of its own in the record, never counted in the task. Only called where
        `info.costly_start`; what it compiles may be kept in the process for the next instance.
        """

    @abstractmethod
    def load(self, scene: Scene) -> None:
        """Build the world of `scene`; its joints at rest at their initial positions."""

    @abstractmethod
    def read_back(self) -> dict[str, Any]:
        """What the engine says that it built, by the names in `parity.quantities`.

        Values must come from the engine, never from the scene. What the engine cannot tell is
        left out and declared in `info.deviations`.
        """

    @abstractmethod
    def command(self, position: FloatArray, velocity: FloatArray, effort: FloatArray) -> None:
        """Set points of all joints, each (n_joints,): position, velocity, feed-forward effort."""

    def push(self, wrenches: FloatArray) -> None:
        """Force and torque on each free body in the next step, and in no other, (n_free, 6).

        At the centre of mass, in the world frame [N, N m]. Only called in scenes with forces, and
        again before each step in which one acts; zeros end what acted before.
        """
        raise self._missing("forces on bodies")

    def lead(self, before: FloatArray, after: FloatArray) -> None:
        """Have the prescribed bodies move in the next step from one state to another.

        Only called in scenes with such bodies, before each step. Rows are as in `body_state`, in
        the order of `scene.prescribed_bodies`, (n_prescribed, 13) each: of the step's begin and
        of its end. Velocities are those of the whole step.
        """
        raise self._missing("bodies that move as prescribed")

    @abstractmethod
    def step(self) -> None:
        """Advance the world by one time step."""

    @property
    def time(self) -> float:
        """Simulated time since `load` [s]; that of the steps that the adapter counts in `_steps`,
        unless it tells another one."""
        return self._steps * self.settings.timestep

    @abstractmethod
    def body_state(self) -> FloatArray:
        """State of the free bodies, (n_free, 13).

        Columns: position [m], quaternion w, x, y, z, linear velocity of the centre of mass [m/s],
        angular velocity [rad/s]; all in the world frame.
        """

    @abstractmethod
    def joint_state(self) -> FloatArray:
        """Positions and velocities of the driven joints, (2, n_joints)."""

    def sample(self) -> Any:
        """The present state in a form of the engine's own, for logs of each step, where that costs
        less than the two above. Who derives from an adapter and tells other states is not asked."""
        raise self._missing("samples")

    def sampled(self, samples: Sequence[Any]) -> tuple[FloatArray, FloatArray]:
        """What `joint_state` (n, 2, n_joints) and `body_state` (n, n_free, 13) would have told when
        these samples were taken."""
        raise self._missing("samples")

    def save(self) -> Any:
        """The whole state of the world, to be given to `restore` in this process."""
        raise self._missing("save and restore")

    def restore(self, state: Any) -> None:
        """Go back to a state from `save`; stepping from it repeats the same future."""
        raise self._missing("save and restore")

    def contact_count(self) -> int:
        """Number of contact points at present."""
        raise self._missing("contact count")

    def contact_forces(self) -> Iterable[tuple[str, str, FloatArray]]:
        """What touches what, and how strongly, in the last step.

        Two of "ground", `body/NAME` and `link/NAME`, and the wrench of the second on the first,
        (6,): force [N], and torque about the world's origin [N m], in the world frame. A pair may
        come several times, as one point of contact each, and in either order: they are added up.
        """
        raise self._missing("contact forces")

    def joint_wrenches(self) -> FloatArray:
        """What each joint transmitted in the last step, (n_joints, 6).

        The wrench of the link above on the link below, of constraint and drive together: force [N],
        and torque about the origin of the link below [N m], which is where the joint is; both in
        the world frame. So of a rod of mass m that hangs at rest, it is m g upward.
        """
        raise self._missing("joint wrenches")

    def render(self, width: int, height: int) -> NDArray[np.uint8]:
        """A picture of the world without a window, (height, width, 3), RGB, from `EYE`."""
        raise self._missing("offscreen picture")

    def refresh_window(self) -> None:  # noqa: B027 - a window may draw itself
        """Show the present state in the window; called about 30 times a second in GUI mode."""

    def close(self) -> None:  # noqa: B027 - there may be nothing to release
        """Release the engine's resources, also when `load` failed or was never called.

        The process ends right after, or constructs the next simulator.
        """

    def versions(self) -> dict[str, str]:
        """Versions of the packages that the results depend on."""
        from importlib.metadata import PackageNotFoundError, version

        try:
            return {self.info.distribution: version(self.info.distribution)}
        except PackageNotFoundError:
            return {}

    def untested(self) -> str:
        """A sentence when the engine is of another version than the adapter was tested with."""
        info = self.info
        found = self.versions().get(info.distribution, "of an unknown version")
        if info.tested(found):
            return ""
        return (
            f"UNTESTED VERSION: {info.distribution} {found} is here, the adapter was tested with "
            f"{info.tested_range}; for the newest of them: {info.install}"
        )

    def _missing(self, what: str) -> NotSupportedError:
        return NotSupportedError(f"{self.info.name} has no {what}")
