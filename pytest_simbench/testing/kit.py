"""The list of checks (name, law, the capability each needs, which robots it can be asked of), and
their tests: one of each check, adapter, profile and robot; some are expected to fail."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.client.environments import missing
from pytest_simbench.client.errors import SceneRefused
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.registry import known
from pytest_simbench.scene import Robot
from pytest_simbench.simulator import Capability, Simulator
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.testing.subject import ConformanceFailure, Subject

Law = Callable[[Subject], None]

Unfit = Callable[[Robot], str | None]
"""Why a law cannot be asked of a robot, in one sentence, or None."""


CUBE, SPACE = 0.05, 0.01
"""Edge of the cube that a hand grasps, and space beside it on either side, open [m]."""


@dataclass(frozen=True)
class Check:
    """One law of the kit.

    Attributes:
        name: its function's name, part of the test's id.
        law: raises `ConformanceFailure` when the adapter breaks it.
        needs: the capability without which it is skipped.
        robot: for which robots it is skipped, and why; None of a law about no robot, or about a
            robot of its own.
    """

    name: str
    law: Law
    needs: Capability | None
    robot: Unfit | None

    @property
    def doc(self) -> str:
        return (self.law.__doc__ or "").strip()


CHECKS: dict[str, Check] = {}
"""All checks by name, in the order in which they were defined."""


def check(needs: Capability | None = None, robot: Unfit | None = None) -> Callable[[Law], Law]:
    """Add a function to `CHECKS` under its own name."""

    def add(law: Law) -> Law:
        name = getattr(law, "__name__", "")
        CHECKS[name] = Check(name, law, needs, robot)
        return law

    return add


def any_robot(robot: Robot) -> str | None:
    """Nothing is asked of the robot."""
    return None


def coupled(robot: Robot) -> str | None:
    """It must have two fingers that move together."""
    count = len(robot.gripper.joints)
    return None if count > 1 else f"{robot.name} has {count} finger joints: none is coupled"


def grasping(robot: Robot) -> str | None:
    """It must have two parallel fingers, which open wide enough for a cube."""
    if not RobotModel(robot).has_parallel_fingers:
        return f"{robot.name} has no hand with two parallel fingers"
    needed, opened = CUBE / 2 + SPACE, robot.gripper.opened
    if opened < needed:
        return f"{robot.name} opens its fingers to {opened:g} m; the law takes {needed:g} m"
    return None


def throwing(robot: Robot) -> str | None:
    """It must grasp, and know how to swing its arm for a throw."""
    return grasping(robot) or (
        None if robot.swing else f"robot {robot.name!r} has no swing for the throw"
    )


class ConformanceWarning(UserWarning):
    """An expected failure that is none: its check passes, or there is no such check."""


def read_expected_failures(source: str | Path | Mapping[str, str]) -> dict[str, str]:
    """Reasons by check, from a mapping or a file with lines `check: reason`.

    A check is named by its name (`free_fall`) or a test id (`mysim-tuned-free_fall`), with
    wildcards as in a shell. Empty lines and lines that begin with # are passed over.

    Raises:
        ValueError: a line without a reason; names file and line.
    """
    if isinstance(source, Mapping):
        return dict(source)
    path, reasons = Path(source), {}
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        pattern, colon, reason = line.partition(":")
        if not colon or not reason.strip():
            raise ValueError(f"{path}, line {number}: write `check: reason`, not {line!r}")
        reasons[pattern.strip()] = reason.strip()
    return reasons


def reason_for(identifier: str, reasons: Mapping[str, str]) -> str | None:
    """Why the test of that id is expected to fail, None when it is not."""
    for pattern, reason in reasons.items():
        if _matches(identifier, pattern):
            return reason
    return None


def unmatched(reasons: Mapping[str, str], identifiers: Iterable[str]) -> list[str]:
    """Patterns that name no test; their robot may be any: files hold others than those known."""
    known = list(identifiers)
    return [p for p in reasons if not any(_matches(i, p) or _but_robot(i, p) for i in known)]


def _matches(identifier: str, pattern: str) -> bool:
    return fnmatchcase(identifier, pattern) or fnmatchcase(identifier.rpartition("-")[2], pattern)


def _but_robot(identifier: str, pattern: str) -> bool:
    parts = pattern.split("-")
    return fnmatchcase(identifier, "-".join([*parts[:-2], parts[-1]]))


@dataclass(frozen=True)
class ConformanceTest:
    """One check of one adapter, ready to be called in a test.

    Attributes:
        subject: adapter, profile and robot.
        check: the law.
        expected_failures: reasons by check, see `read_expected_failures`.
    """

    subject: Subject
    check: Check
    expected_failures: Mapping[str, str] = field(default_factory=dict)

    @property
    def id(self) -> str:
        """`mysim-tuned-free_fall`, and `mysim-tuned-ur5-static_hold` of another robot than the
        Panda."""
        robot = self.subject.robot
        return _identifier(self.subject, "" if robot is None else robot.name, self.check.name)

    def __call__(self) -> None:
        """Run the check.

        Raises:
            ConformanceFailure: the adapter breaks the law, and nobody expected it.
        """
        info, needs = self.subject.cls.info, self.check.needs
        if needs is not None and not self.subject.can(needs):
            pytest.skip(f"{info.name} does not claim {needs}")
        absent = None if self.subject.python else missing(info)
        if absent:
            pytest.skip(absent)
        unfit = None if self.check.robot is None else self.check.robot(self.subject.arm)
        if unfit:
            pytest.skip(unfit)
        reason = reason_for(self.id, self.expected_failures)
        try:
            self.check.law(self.subject)
        except pytest.skip.Exception:
            raise
        except Exception as error:
            if reason is None and isinstance(error, SceneRefused):  # what it claims to hold
                raise ConformanceFailure(error.what) from None
            if reason is None:
                raise
            pytest.xfail(f"{reason} ({error})")
        panda = _identifier(self.subject, "", self.check.name)
        of_panda = self.id != panda and reason_for(panda, self.expected_failures)
        if reason is not None and not of_panda:
            warnings.warn(
                f"{self.id} is listed as an expected failure ({reason}) but passes; remove it",
                ConformanceWarning,
                stacklevel=2,
            )


@dataclass(frozen=True)
class Kit:
    """Laws for adapters; the plugin makes tests of them when the robot is known.

    Attributes:
        subjects: adapters with their profiles, with the Panda.
    """

    subjects: tuple[Subject, ...]
    names: tuple[str, ...]
    expected_failures: Mapping[str, str]

    def tests(self, robots: Iterable[Robot | None]) -> Iterator[ConformanceTest]:
        """Each law with each robot (None: the Panda); what is about no robot once."""
        chosen = tuple(robots)
        for subject in self.subjects:
            for name in self.names:
                check = CHECKS[name]
                for robot in chosen if check.robot else (None,):
                    yield ConformanceTest(
                        replace(subject, robot=robot), check, self.expected_failures
                    )

    def identifiers(self) -> Iterator[str]:
        """Ids of the tests with every known robot, the Panda's first."""
        for robot in ("", *known()):
            for subject in self.subjects:
                for name in self.names:
                    yield _identifier(subject, robot, name)


def _identifier(subject: Subject, robot: str, check: str) -> str:
    return "-".join(part for part in (subject.name, subject.profile, robot, check) if part)


def conformance_checks(
    *simulators: str | type[Simulator],
    profiles: Iterable[str] = ("tuned",),
    expected_failures: str | Path | Mapping[str, str] | None = None,
    python: Mapping[str, str] | None = None,
    only: Iterable[str] | None = None,
) -> Callable[..., Any]:
    """Decorator that parametrises a test with every check, as its argument `check`.

    The robot is that of `--robot`, the Panda by default; laws without a robot run once.

    Args:
        simulators: registered names, or adapter classes.
        profiles: settings profiles to check.
        expected_failures: file or mapping of laws known to be broken: they become xfail. A line
            that matches no check, or whose check passes, gives a `ConformanceWarning`.
        python: interpreter by simulator name, for engines that are neither here nor in an
            environment of their own.
        only: names of the checks wanted, default all.

    Raises:
        UnknownSimulatorError: a name that nobody registered.
        ValueError: an unknown name in `only`, or a malformed line of expected failures.
    """
    names = tuple(CHECKS if only is None else only)
    unknown = [name for name in names if name not in CHECKS]
    if unknown:
        raise ValueError(f"no checks named {unknown}; choose from {', '.join(CHECKS)}")
    reasons = {} if expected_failures is None else read_expected_failures(expected_failures)
    subjects = []
    for simulator in simulators:
        cls = adapter(simulator) if isinstance(simulator, str) else simulator
        own = (python or {}).get(cls.info.name)
        subjects += [Subject(cls, profile, own) for profile in profiles]
    kit = Kit(tuple(subjects), names, reasons)
    for pattern in unmatched(reasons, kit.identifiers()) if only is None else ():
        warnings.warn(
            f"expected failure {pattern!r} matches no check; there are {', '.join(CHECKS)}",
            ConformanceWarning,
            stacklevel=2,
        )
    return pytest.mark.sim_conformance(kit)
