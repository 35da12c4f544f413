"""Options that do their work and exit: `--sims`, `--robots`; and where the others are."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from importlib.metadata import version

import pytest

from pytest_simbench.client.environments import interpreter, outside
from pytest_simbench.ground.text import for_terminal
from pytest_simbench.plugin import options, recording, spellings
from pytest_simbench.plugin.bisect import bisect
from pytest_simbench.plugin.data import download
from pytest_simbench.plugin.environments import install, list_environments, uninstall
from pytest_simbench.plugin.merge import merge_runs, report_runs
from pytest_simbench.plugin.selection import Selection
from pytest_simbench.plugin.session import session_of
from pytest_simbench.scene import Robot
from pytest_simbench.simulator.info import SimulatorInfo
from pytest_simbench.simulator.registry import adapter, known, problem, registered, registry


def run_command(config: pytest.Config) -> int:
    """Do what the first such option on the command line asks for; the exit code.

    Raises:
        pytest.UsageError: what is wrong with the input; one sentence.
    """
    options.values(config)
    recording.check(config)
    actions = (
        install, uninstall, list_environments, download, bisect, merge_runs, report_runs, _list,
        _robots,
    )  # fmt: skip
    commands = dict(zip(options.COMMANDS, actions, strict=True))
    name = next(name for name in commands if options.given(config, name))
    try:
        return commands[name](config)
    except KeyboardInterrupt:
        print(f"\n{options.option(name).flag}: interrupted; nothing that it read was changed")
        return int(pytest.ExitCode.INTERRUPTED)


def _list(config: pytest.Config) -> int:
    """`--sims`: the known simulators, what is here, what each can do and where it deviates."""
    for line in [*_simulators(session_of(config).selection), *spellings.foreign(config)]:
        print(for_terminal(line))
    return 0


def _robots(config: pytest.Config) -> int:
    """`--robots`: the known robots, and the one that `--robot` names; 1 when one is broken."""
    from pytest_simbench.robot.errors import RobotError
    from pytest_simbench.robot.registry import known, known_robot

    chosen = session_of(config).selection.robots.values()
    broken = False
    for name in known():
        try:
            print(for_terminal(_robot_line(known_robot(name))))
        except RobotError as error:
            broken = True
            print(for_terminal(f"{name}: BROKEN: {error}"))
    for robot in chosen:
        if robot is not None and robot.name not in known():
            print(for_terminal(_robot_line(robot)))
    return int(broken)


def _robot_line(robot: Robot) -> str:
    """Name, size and hand of a robot, and what it cannot do."""
    from pytest_simbench.robot.model import RobotModel
    from pytest_simbench.tasks import Pushing, Stacking, Throwing

    arm, fingers = len(robot.arm_joints), len(robot.gripper.joints)
    many = "one jaw that opens" if fingers == 1 else f"{fingers} fingers that open"
    hand = f"{many} to {robot.gripper.opened:g} {RobotModel(robot).finger_unit}"
    x, y, z = robot.base.position
    line = (
        f"{robot.name}: {arm} arm joints, {hand if fingers else 'a hand that only touches'}, "
        f"base at ({x:g}, {y:g}, {z:g})"
    )
    tasks = (task(robot=robot) for task in (Stacking, Throwing, Pushing))
    return "".join([line, *(f"\n    no {t.name}: {p}" for t in tasks if (p := t.problem()))])


def _here(selection: Selection, name: str) -> str:
    """Where a simulator is and which version."""
    info = adapter(name).info
    if name in selection.pythons or name in selection.specs:
        return f"in {selection.pythons.get(name) or selection.specs[name]}"
    other = outside(info) if interpreter(info) else None
    try:
        found = other.version() if other else version(info.distribution)
    except Exception:  # not there, or metadata that nobody can read
        found = None
    place = other.place if other else "installed"
    if not found:  # no Python package tells it: the engine does, when it runs
        return f"version not known before it runs, {place}"
    return f"version {found}{'' if info.tested(found) else ', UNTESTED'}, {place}"


def _size(info: SimulatorInfo) -> str:
    size = "" if info.install_size_mb is None else f"{info.install_size_mb} MB on disk; "
    start = "compiles at first use" if info.costly_start else "nothing to compile"
    return size + start


def _simulators(selection: Selection) -> Iterator[str]:
    """Lines: the table of capabilities, then a paragraph for each registered simulator, also for
    those whose adapter is broken."""
    from pytest_simbench.report.terminal.parts import capability_table

    width = shutil.get_terminal_size((160, 24)).columns
    yield capability_table([adapter(name).info for name in registered()], width)
    yield ""
    for name in known():
        broken = problem(name)
        if broken:
            yield f"{name}: BROKEN: {broken}"
            yield ""
            continue
        cls = adapter(name)
        info = cls.info
        missing = selection.missing(name)
        yield f"{name}: {info.title} ({info.licence}), engine {info.engine}"
        yield f"    {'NOT HERE: ' + missing if missing else _here(selection, name)}"
        yield f"    tested with version {info.tested_range}; {_size(info)}"
        yield f"    modes: {', '.join(info.modes)}; profiles: {', '.join(cls.profiles)}"
        yield f"    can: {', '.join(sorted(info.capabilities))}"
        for deviation in info.deviations:
            what = f"{deviation.quantity}: " if deviation.quantity else ""
            yield f"    deviates: {what}{deviation.reason}"
        yield ""
    for sentence in registry().unreadable:
        yield f"BROKEN: {sentence}"
