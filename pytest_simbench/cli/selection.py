"""Which simulators, modes, settings and robots a run covers, and what of it cannot be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pytest_simbench.cli.values import BadInput, refusing, shown
from pytest_simbench.client import environments
from pytest_simbench.cluster.offers import Node, unmet
from pytest_simbench.experiment.variants import Variant, problem, variants
from pytest_simbench.ground.errors import SettingsError
from pytest_simbench.ground.versions import base_name
from pytest_simbench.scene import Robot
from pytest_simbench.simulator import registry
from pytest_simbench.simulator.profile_file import ENDING, ProfileFile, read_profile
from pytest_simbench.simulator.settings import UNDECORATED, Settings

if TYPE_CHECKING:
    from pytest_simbench.experiment.case import Case
    from pytest_simbench.tasks.base import Task

MODES = ("headless", "gui")

EVERY = "all"
"""Every registered simulator, or every built-in robot."""


@dataclass(frozen=True)
class Selection:
    """What the user asked for, checked.

    Attributes:
        simulators: names, in order.
        modes: `headless`, `gui`.
        profiles: settings profiles, those of files by their labels.
        changes: simulator name to changed settings; those of a bare name hold for all
            of its versions.
        pythons, specs: simulator name to interpreter or execnet specification.
        robots: that do the tasks, by name; "" for the tasks' own, the Panda.
        nodes: of the cluster that carries repetitions out; none for this machine.
        sweep: time steps to make each test for [s]; True for those around each profile's own, None
            for these alone.
        named: the simulators that were asked for by name.
        files: the profiles of files, by their labels.
    """

    simulators: tuple[str, ...]
    modes: tuple[str, ...]
    profiles: tuple[str, ...]
    changes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    pythons: dict[str, str] = field(default_factory=dict)
    specs: dict[str, str] = field(default_factory=dict)
    robots: Mapping[str, Robot | None] = field(default_factory=lambda: {"": None})
    nodes: tuple[Node, ...] = ()
    sweep: bool | tuple[float, ...] | None = None
    named: tuple[str, ...] = ()
    files: Mapping[str, ProfileFile] = field(default_factory=dict)

    @property
    def every_robot(self) -> bool:
        """Whether what a robot cannot do is no error: nobody asked for it by name."""
        return len(self.robots) > 1

    def variants(self, name: str, mode: str) -> list[Variant]:
        """What a test is made for, of one simulator and mode."""
        found = self._of_one_robot(name, mode)
        return [variant._replace(robot=robot) for robot in self.robots for variant in found]

    def _of_one_robot(self, name: str, mode: str) -> list[Variant]:
        found = []
        for profile in self.profiles:
            unknown = registry.problem(name) or self.settings_problem(name, profile)
            if self.sweep is None or unknown:
                found.append(Variant(name, mode, profile))
            else:
                own = self.settings(name, profile).timestep
                found += variants(name, mode, profile, own, self.sweep)
        return found

    def changes_of(self, name: str) -> dict[str, Any]:
        """Changed settings of a simulator."""
        return {**self.changes.get(base_name(name), {}), **self.changes.get(name, {})}

    def missing(self, name: str, profile: str) -> str | None:
        """Why a simulator cannot run in a profile here, or on the cluster, with what mends it; None
        when it can."""
        found = registry.problem(name) or self.settings_problem(name, profile)
        if found:
            return found
        if self.nodes:
            modes = [mode for mode in self.modes if mode in registry.adapter(name).info.modes]
            return unmet(self.nodes, name, modes)
        if name in self.pythons or name in self.specs:
            return None
        return environments.missing(registry.adapter(name).info)

    def unusable(self, name: str, to_install: bool = False) -> str | None:
        """Why a simulator cannot run in any of the profiles; None when it can. Tests in those that
        one lacks are skipped, with the reason. A missing environment is no fault where it is
        `to_install`."""
        why = self.settings_problem if to_install else self.missing
        reasons = [why(name, profile) for profile in self.profiles]
        return reasons[0] if all(reasons) else None

    def ready(self) -> Selection:
        """Without what cannot run here and was not named."""
        here = (n for n in self.simulators if n in self.named or not self.unusable(n))
        return replace(self, simulators=tuple(here))

    def case(self, of: Variant, changes: Mapping[str, Any] | None = None, **more: Any) -> Case:
        """How a variant is run (`Case`); what the user changed goes on top of `changes`."""
        from pytest_simbench.experiment.case import Case

        return Case.of(
            of.simulator,
            python=self.pythons.get(of.simulator),
            spec=self.specs.get(of.simulator),
            mode=of.mode,
            profile=self.files.get(of.profile, of.profile),
            own_timestep=of.own_timestep,
            changes={**(changes or {}), **self.changes_of(of.simulator), **of.changes},
            robot=self.robots[of.robot],
            **more,
        )

    def settings(
        self, name: str, profile: str, changes: Mapping[str, Any] | None = None
    ) -> Settings:
        """Of a simulator, in a profile, with changes; what the user changed goes on top.

        Raises:
            SettingsError: it has no such profile, or cannot take a change.
        """
        changes = {**(changes or {}), **self.changes_of(name)}
        if file := self.files.get(profile):
            return file.settings(name, changes)
        return registry.settings_of(name, profile, changes)

    def settings_problem(self, name: str, profile: str) -> str | None:
        """Why a simulator has no such profile, or cannot take a change; None when it can."""
        try:
            self.settings(name, profile)
        except SettingsError as error:
            return str(error)
        return None


def check(selection: Selection, makes: bool) -> None:
    """Complain of what cannot run.

    Args:
        selection: what the options say.
        makes: missing environments are no fault, since they are made afterwards.

    Raises:
        BadInput: one sentence.
        SimulatorError: an unknown or broken simulator.
    """
    valid = dict.fromkeys(
        profile for name in registry.registered() for profile in registry.adapter(name).profiles
    )
    for profile in selection.profiles:
        if profile not in valid and profile not in selection.files:
            raise BadInput(
                f"no simulator has a settings profile {profile!r}; choose from "
                f"{', '.join(valid)}, or give a file that ends in .toml"
            )
    if isinstance(selection.sweep, tuple) and (wrong := problem(selection.sweep)):
        raise BadInput(wrong)
    named = [*selection.named, *selection.changes, *selection.pythons, *selection.specs]
    registry.check_names(named)
    for name in named:
        registry.adapter(name)  # complains of a broken one
    for name in selection.pythons.keys() & selection.specs.keys():
        raise BadInput(
            f"{name} has both --sim-python and --sim-spec; a specification names its own "
            "interpreter (python=...), so give one of them"
        )
    for name in selection.changes:
        for profile in selection.profiles:
            if refused := selection.settings_problem(name, profile):
                raise BadInput(refused)
    for name in selection.named:
        if reason := selection.unusable(name, to_install=makes):
            raise BadInput(reason)


def profiles_of(asked: Sequence[str]) -> tuple[tuple[str, ...], dict[str, ProfileFile]]:
    """Profiles as they are asked for, with those of files by label.

    Raises:
        SettingsError: a file that holds none.
    """
    found = [read_profile(name) if name.endswith(ENDING) else name for name in asked]
    files = {one.label: one for one in found if isinstance(one, ProfileFile)}
    labels = (one if isinstance(one, str) else one.label for one in found)
    return tuple(dict.fromkeys(labels)), files  # two files may say the same


def robots_of(text: str | Path | None, where: str = "--robot") -> Mapping[str, Robot | None]:
    """The robots of that name or file; "" for the one that the tasks have anyway.

    Raises:
        BadInput: there is no such robot.
    """
    if text is None:
        return {"": None}
    from pytest_simbench.motion.errors import RobotError
    from pytest_simbench.motion.registry import BUILT_IN, DEFAULT, find

    names = BUILT_IN if text == EVERY else [str(text)]
    with refusing(RobotError, f"{where}={shown(text)}"):
        found = [None if name == DEFAULT else find(name) for name in names]
    return {"" if robot is None else robot.name: robot for robot in found}


def checked_task(value: Any, where: str) -> Task:
    """`value` if it is a task; else it is refused as an argument of `where`."""
    from pytest_simbench.tasks.base import Task

    if isinstance(value, Task):
        kind = type(value)
        deaf = "__dataclass_params__" not in vars(kind)
        if not is_dataclass(kind) or (deaf and vars(kind).keys() & {f.name for f in fields(kind)}):
            name = kind.__name__
            raise BadInput(f"{where}({name}()): {UNDECORATED.format(name)}")
        return value
    if isinstance(value, type) and issubclass(value, Task):
        name = value.__name__
        raise BadInput(f"{where}({name}) got a class instead of a task: write {where}({name}())")
    raise BadInput(f"{where}({shown(repr(value))}) takes a task, for instance {where}(Throwing())")
