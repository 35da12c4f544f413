"""What an adapter says of itself and its engine without importing the engine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from fnmatch import fnmatchcase

from pytest_simbench.scene import Robot


class Capability(StrEnum):
    """What a simulator may be able to do beyond stepping; `needs(...)` marks take these names."""

    WINDOW = "window"
    OFFSCREEN = "offscreen"
    SAVE_RESTORE = "save_restore"
    EXACT_RESTORE = "exact_restore"
    """A restored run equals, bit for bit, the one that was neither saved nor restored."""
    CONTACT_COUNT = "contact_count"
    DETERMINISTIC = "deterministic"
    GPU = "gpu"


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
    """

    quantity: str
    reason: str
    within: float | None = None
    elsewhere: float | None = None

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


@dataclass(frozen=True)
class SimulatorInfo:
    """The facts that `--sims` lists.

    Attributes:
        name: short and stable; part of test ids and records.
        title: engine and company as a user knows them.
        distribution: PyPI distribution whose version is the engine's.
        modules: modules that must be importable for the simulator to be here.
        install: what to type when it is missing.
        licence: of the engine.
        engine: physics engine inside.
        tested_version: newest version that passed the conformance kit.
        capabilities: what it can do.
        deviations: what it cannot express of a scene.
        costly_start: starting is so costly (kernels to compile) that one worker serves several
            repetitions, with a checked reset in between.
        compile_timeout: the longest that `Simulator.compile` may take with cold caches [s].
        requirements: pinned requirements of an interpreter of its own, for an engine whose
            packages clash with pytest's or with another engine's; empty when it installs here.
        system_packages: of Debian and Ubuntu, for an engine that comes with the operating system:
            its worker then runs in the system's Python. Name numpy's package too.
        caches: environment variables to be set to folders (named by the values) that are kept
            between runs, for compiled kernels.
        environment: variables to be set before a headless engine is imported, unless the user did.
        install_size_mb: what installing it adds on disk, rounded [MB].
        language: in which the engine is written.
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
    system_packages: tuple[str, ...] = ()
    caches: Mapping[str, str] = field(default_factory=dict)
    install_size_mb: int | None = None
    environment: Mapping[str, str] = field(default_factory=dict)
    language: str = "unknown"

    @property
    def modes(self) -> tuple[str, ...]:
        return ("headless", "gui") if Capability.WINDOW in self.capabilities else ("headless",)
