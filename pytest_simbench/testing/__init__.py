"""The conformance kit: checks that an adapter's author runs on their own adapter.

    from pytest_simbench.testing import conformance_checks

    @conformance_checks("mysim")
    def test_conformance(check):
        check()

Every check runs the real adapter in a real worker process, and says in its docstring which law
it holds the engine to, how closely, and why.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.client.environments import missing
from pytest_simbench.simulator import Simulator
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.testing import (
    acting,
    contract,
    drives,
    dynamics,
    interaction,
    parity,
    physics,
    state,
)
from pytest_simbench.testing.checks import CHECKS, Check
from pytest_simbench.testing.expected import (
    ConformanceWarning,
    read_expected_failures,
    reason_for,
    unmatched,
)
from pytest_simbench.testing.subject import ConformanceFailure, Subject, close_workers

__all__ = [
    "CHECKS",
    "Check",
    "ConformanceFailure",
    "ConformanceTest",
    "ConformanceWarning",
    "Subject",
    "acting",
    "close_workers",
    "conformance_checks",
    "contract",
    "drives",
    "dynamics",
    "interaction",
    "parity",
    "physics",
    "state",
]


@dataclass(frozen=True)
class ConformanceTest:
    """One check of one adapter, ready to be called in a test.

    Attributes:
        subject: adapter and profile.
        check: the law.
        expected_failures: reasons by check, see `read_expected_failures`.
    """

    subject: Subject
    check: Check
    expected_failures: Mapping[str, str] = field(default_factory=dict)

    @property
    def id(self) -> str:
        return f"{self.subject.name}-{self.subject.profile}-{self.check.name}"

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
        reason = reason_for(self.id, self.expected_failures)
        try:
            self.check.law(self.subject)
        except pytest.skip.Exception:
            raise
        except Exception as error:
            if reason is None:
                raise
            pytest.xfail(f"{reason} ({error})")
        if reason is not None:
            warnings.warn(
                f"{self.id} is listed as an expected failure ({reason}) but passes; remove it",
                ConformanceWarning,
                stacklevel=2,
            )


def conformance_checks(
    *simulators: str | type[Simulator],
    profiles: Iterable[str] = ("tuned",),
    expected_failures: str | Path | Mapping[str, str] | None = None,
    python: Mapping[str, str] | None = None,
    only: Iterable[str] | None = None,
) -> Callable[..., Any]:
    """Decorator that parametrises a test with every check, as its argument `check`.

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
    names = list(CHECKS if only is None else only)
    unknown = [name for name in names if name not in CHECKS]
    if unknown:
        raise ValueError(f"no checks named {unknown}; choose from {', '.join(CHECKS)}")
    reasons = {} if expected_failures is None else read_expected_failures(expected_failures)
    tests = []
    for simulator in simulators:
        cls = adapter(simulator) if isinstance(simulator, str) else simulator
        for profile in profiles:
            subject = Subject(cls, profile, (python or {}).get(cls.info.name))
            tests += [ConformanceTest(subject, CHECKS[name], reasons) for name in names]
    for pattern in unmatched(reasons, [test.id for test in tests]) if only is None else ():
        warnings.warn(
            f"expected failure {pattern!r} matches no check; there are {', '.join(CHECKS)}",
            ConformanceWarning,
            stacklevel=2,
        )
    return pytest.mark.parametrize("check", [pytest.param(test, id=test.id) for test in tests])
