"""Which robots are known: the built-in ones, those of other packages, and files.

A package registers a robot in the entry-point group `pytest_simbench.robots`, its name and a
function that returns it: `my_arm = "my_package.robots:my_arm"`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, partial
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

from pytest_simbench.motion.errors import RobotError
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import Robot

GROUP = "pytest_simbench.robots"

DEFAULT = "panda"
"""The robot of the reference study: tasks use it where none is chosen."""

ARMS = Path(__file__).with_name("arms")


def _from_file(path: str | Path) -> Robot:
    """The robot of a file. What reads it loads Pinocchio, Coal and SciPy; names need none."""
    from pytest_simbench.motion.files import read_robot

    return read_robot(path)


BUILT_IN: Mapping[str, Callable[[], Robot]] = {
    DEFAULT: panda,
    **{path.stem: partial(_from_file, path) for path in sorted(ARMS.glob("*.toml"))},
}
"""Robots that come with the package, by name."""

FILE = ".toml"


def find(text: str) -> Robot:
    """The robot that is meant by a name, or by the path of a file that ends in `.toml`.

    Raises:
        RobotError: there is none, or it cannot be used; one sentence.
    """
    if not text.endswith(FILE):
        return known_robot(text)
    robot = _from_file(text)
    if robot.name in known():
        raise RobotError(
            f"{text}: the name {robot.name!r} is that of a known robot; give it another one"
        )
    return robot


def known() -> list[str]:
    """All names, the built-in ones first."""
    return [*BUILT_IN, *(name for name in sorted(_registered()) if name not in BUILT_IN)]


@cache
def known_robot(name: str) -> Robot:
    """The robot of that name.

    Raises:
        RobotError: it is not known, or the package that registers it is broken.
    """
    if name in BUILT_IN:
        return BUILT_IN[name]()
    if name not in _registered():
        raise RobotError(
            f"unknown robot {name!r}; choose from {', '.join(known())}, or give the path of a "
            f"robot file that ends in {FILE}"
        )
    entry = _registered()[name]
    whose = f"the robot {name!r} ({entry.value})"
    try:
        robot = entry.load()()
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # sys.exit in a module, for instance
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise RobotError(f"{whose} cannot be made: {reason[:300]}") from error
    if not isinstance(robot, Robot):
        raise RobotError(f"{whose} is {type(robot).__name__}, no pytest_simbench.scene.Robot")
    if robot.name != name:
        raise RobotError(f"{whose} calls itself {robot.name!r}; one of the names is wrong")
    return robot


@cache
def _registered() -> dict[str, EntryPoint]:
    return {entry.name: entry for entry in entry_points(group=GROUP)}
