"""What an adapter says of itself and its engine without importing the engine."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from fnmatch import fnmatchcase
from importlib.util import find_spec
from pathlib import Path

from pytest_simbench.ground.errors import NotSupportedError, SimulatorError
from pytest_simbench.ground.versions import BUILD, VersionedName, release_numbers
from pytest_simbench.scene import Robot, Scene
from pytest_simbench.scene.friction import RULES
from pytest_simbench.scene.scene import WORDS


class Capability(StrEnum):
    """What a simulator may be able to do beyond stepping; `needs(...)` marks take these names."""

    WINDOW = "window"
    OFFSCREEN = "offscreen"
    SAVE_RESTORE = "save_restore"
    EXACT_RESTORE = "exact_restore"
    """A restored run equals, bit for bit, the one that was neither saved nor restored."""
    CONTACT_COUNT = "contact_count"
    CONTACT_FORCES = "contact_forces"
    COMPOUND = "compound"
    """A body may have several shapes, see `scene.Compound`."""
    LOOPS = "loops"
    """Links may close loops, see `scene.Closure`."""
    SELF_COLLIDE = "self_collide"
    """Links of a robot may collide with each other, see `scene.Robot`."""
    COUPLINGS = "couplings"
    """Joints may move together, see `scene.Coupling`."""
    APART = "apart"
    """Pairs may be kept from colliding, see `scene.Scene`."""
    JOINT_WRENCHES = "joint_wrenches"
    """It tells what each joint transmits."""
    DETERMINISTIC = "deterministic"
    GPU = "gpu"

    @classmethod
    def named(cls, names: str) -> frozenset[Capability]:
        """Those of the names, separated by blanks.

        Raises:
            ValueError: there is no such capability.
        """
        return frozenset(map(cls, names.split()))


MEASURED_ON = "panda"
"""The robot on which the sizes of declared deviations were measured."""

FOLLOWER = "FOLLOWER"
"""Stands for the name of a joint in the pattern of a deviation, see `Deviation.with_robot`."""


@dataclass(frozen=True)
class Deviation:
    """Something of the scene that an engine cannot express or cannot report.

    Attributes:
        quantity: patterns of the quantities that it excuses ("body/*/margin link/*/margin"), or ""
            when it concerns no quantity that is read back.
        reason: why, in one sentence for the user.
        within: the largest difference that it excuses, in the quantity's unit; None excuses any,
            and that the engine does not tell the quantity.
        elsewhere: the same with another robot than `MEASURED_ON`, whose links may be larger; None
            where it makes no difference.
        only: what a scene must have for it to count, one of `Scene.words` ("cylinder",
            "prescribed"); empty when it counts in every scene.
    """

    quantity: str
    reason: str
    within: float | None = None
    elsewhere: float | None = None
    only: str = ""

    def __post_init__(self) -> None:
        if self.only and self.only not in WORDS:
            told = f"a deviation counts only in scenes with {self.only!r}, which none has"
            raise SimulatorError(f"{told}; choose from {', '.join(sorted(WORDS))}")

    def concerns(self, scene: Scene) -> bool:
        """Whether it counts in this scene."""
        return not self.only or self.only in scene.words

    def with_robot(self, robot: Robot | None) -> Deviation:
        """The same in a world with this robot. `FOLLOWER` in its patterns is then each finger that
        follows the first one."""
        if robot is None or robot.name == MEASURED_ON:
            return self
        followers = robot.gripper.joints[1:] if FOLLOWER in self.quantity else ()
        patterns = [self.quantity.replace(FOLLOWER, name) for name in followers]
        within = self.within if self.elsewhere is None else self.elsewhere
        return replace(self, quantity=" ".join(patterns) or self.quantity, within=within)

    def excuses(self, quantity: str) -> bool:
        return any(fnmatchcase(quantity, pattern) for pattern in self.quantity.split())


def alternatives(modules: str) -> list[str]:
    """The modules that an entry of `SimulatorInfo.modules` names, one of which is enough."""
    return modules.split("|")


def importable(module: str) -> bool:
    """Whether a module is there. It is not imported, but the package that it lies in is."""
    try:
        return find_spec(module) is not None
    except (ImportError, ValueError):
        return False


def no_module(absent: Iterable[str]) -> str:
    """What follows the words "no module" when such entries are absent."""
    return " and no module ".join(" or ".join(alternatives(names)) for names in absent)


@dataclass(frozen=True)
class SimulatorInfo:
    """The facts that `simbench list` lists.

    Attributes:
        name: short and stable; part of test ids and records.
        title: engine and company as a user knows them.
        distribution: PyPI distribution whose version is the engine's.
        modules: modules that must be importable for the simulator to be here; of several joined by
            `|`, one of them (`engine8|engine9`: modules that carry their version).
        program: for an engine that is a program of the user's own, which no package brings: the
            environment variable that names its folder, and a file in it. Its modules may be none.
        install: what to type when it is missing.
        licence: of the engine.
        engine: physics engine inside.
        tested_version: newest version that passed the conformance kit.
        oldest_version: oldest release that the adapter was tested with, and that it runs with;
            empty where no other than the newest was tried.
        capabilities: what it can do.
        deviations: what it cannot express of a scene.
        costly_start: starting is so costly (kernels to compile) that one worker serves several
            repetitions, with a checked reset in between.
        compile_timeout: the longest that `Simulator.compile` may take with cold caches [s].
        requirements: pinned requirements of an interpreter of its own, for an engine whose
            packages clash with pytest's or with another engine's; empty when it installs here.
        companions: what an environment of another release needs beside the engine: requirements
            by the oldest release that needs just these.
        home: name of the environment; its own name where that is empty.
        system_packages: of Debian and Ubuntu, for an engine that comes with the operating system:
            its worker then runs in the system's Python. Name numpy's package too.
        caches: environment variables to be set to folders (named by the values) that are kept
            between runs, for compiled kernels.
        environment: variables to be set before a headless engine is imported, unless the user did.
        install_size_mb: what installing it adds on disk, rounded [MB].
        language: in which the engine is written.
        friction_rule: what the engine, as its adapter sets it, makes of the frictions of two
            surfaces: one of `scene.friction.RULES`, or several joined by `|`, of which it takes
            the scene's, and the first where that is another; empty: not known, which is told of
            scenes of several frictions.
        reads: endings of the files that it makes scenes of, see `Simulator.read_file`.
    """

    name: str
    title: str
    distribution: str
    modules: tuple[str, ...]
    install: str
    licence: str
    engine: str
    tested_version: str
    capabilities: frozenset[Capability]
    deviations: tuple[Deviation, ...] = ()
    costly_start: bool = False
    compile_timeout: float = 900.0
    requirements: tuple[str, ...] = ()
    companions: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    home: str = ""
    system_packages: tuple[str, ...] = ()
    caches: Mapping[str, str] = field(default_factory=dict)
    install_size_mb: int | None = None
    environment: Mapping[str, str] = field(default_factory=dict)
    language: str = "unknown"
    oldest_version: str = ""
    friction_rule: str = ""
    reads: tuple[str, ...] = ()
    program: tuple[str, str] = ("", "")

    def __post_init__(self) -> None:
        for name in ("modules", "deviations", "requirements", "system_packages", "reads"):
            value, kind = getattr(self, name), Deviation if name == "deviations" else str
            if not (isinstance(value, tuple) and all(isinstance(item, kind) for item in value)):
                told = f"a tuple of {kind.__name__}, not {value!r:.60}"
                raise SimulatorError(f"info.{name} of {self.name}: give {told}")
        if not all(isinstance(item, Capability) for item in self.capabilities):
            raise SimulatorError(f"info.capabilities of {self.name}: give Capability.named('...')")
        if self.friction_rule and not {*self.friction_rule.split("|")} <= {*RULES}:
            told = f"{self.friction_rule!r} is none; choose from {', '.join(RULES)}"
            raise SimulatorError(f"info.friction_rule of {self.name}: {told}")

    @property
    def no_program(self) -> str:
        """Why the program is not here, as a sentence; empty where it is, or where it is none."""
        variable, file = self.program
        named = os.environ.get(variable, "") if variable else ""
        if not variable or (named and Path(named, file).is_file()):
            return ""
        told = f"{variable} is {named}, which has no {file}" if named else f"{variable} is not set"
        return f"{self.name} is not here ({told}): {self.install}"

    def of_version(self, name: VersionedName) -> SimulatorInfo:
        """Of a release or a build of the engine.

        Raises:
            SimulatorError: the adapter does not run with that release, or the engine has none.
        """
        whole = f"{name.base}{name.kind}{name.which}"
        if name.kind == BUILD:  # whoever names it has installed it
            return replace(
                self, name=whole, requirements=(), system_packages=(), install=f"--sim {whole}=PATH"
            )
        if self.system_packages:
            raise SimulatorError(
                f"{whole}: {name.base} comes with packages of the system, which has no other "
                f"release of it; name an interpreter that has one: {name.base}@PATH"
            )
        if refused := self.refused(name.which):
            raise SimulatorError(f"{whole}: {refused}")
        pin = f"{self.distribution}=={name.which}"
        own = pin in self.requirements
        return replace(
            self,
            name=whole,
            home=name.base if own else "",
            requirements=self.requirements if own else (pin, *self._companions(name.which)),
            system_packages=(),
            install=f"simbench install {whole}",
        )

    def refused(self, version: str) -> str:
        """Why the adapter does not run with a version of the engine; empty if it does."""
        oldest = release_numbers(self.oldest_version)
        if not release_numbers(version) or release_numbers(version) >= oldest:
            return ""
        return (
            f"the adapter was tested with {self.distribution} {self.tested_range} and runs with "
            f"nothing older, not with {version}"
        )

    def tested(self, version: str) -> bool:
        """Whether a version is one of those that the adapter was tested with."""
        if version == self.tested_version:
            return True
        oldest, newest = map(release_numbers, (self.oldest_version, self.tested_version))
        return bool(oldest) and oldest <= release_numbers(version) <= newest

    @property
    def tested_range(self) -> str:
        """The versions that the adapter was tested with, for tables."""
        if self.oldest_version in ("", self.tested_version):
            return self.tested_version
        return f"{self.oldest_version} to {self.tested_version}"

    def _companions(self, version: str) -> tuple[str, ...]:
        """What else a release needs; numpy is for the worker itself."""
        wanted = release_numbers(version)
        known = [v for v in self.companions if release_numbers(v) <= wanted]
        newest = max(known, key=release_numbers, default=None)
        return self.companions[newest] if newest is not None else ("numpy",)

    @property
    def modes(self) -> tuple[str, ...]:
        return ("headless", "gui") if Capability.WINDOW in self.capabilities else ("headless",)


BEYOND = {
    "compound": (
        Capability.COMPOUND,
        "has bodies of one shape alone, and scene {!r} has one of more",
    ),
    "loop": (
        Capability.LOOPS,
        "closes no loops of links, and the robot of scene {!r} has one",
    ),
    "coupling": (
        Capability.COUPLINGS,
        "couples no joints but those of a gripper, and the robot of scene {!r} has such",
    ),
    "apart": (
        Capability.APART,
        "keeps no pairs from colliding, and scene {!r} has such",
    ),
    "self_collide": (
        Capability.SELF_COLLIDE,
        "has links of a robot pass through each other, and those of scene {!r} are to collide",
    ),
}
"""By word of a scene: what a simulator needs for it, and what to say of one that lacks it."""


def check_supported(info: SimulatorInfo, scene: Scene) -> None:
    """Raise `NotSupportedError` for a scene that holds what the simulator is not able to."""
    for word, (capability, problem) in BEYOND.items():
        if word in scene.words and capability not in info.capabilities:
            raise NotSupportedError(f"{info.name} {problem.format(scene.name)}")
