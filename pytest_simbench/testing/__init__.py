"""The conformance kit: checks that an adapter's author runs on their own adapter.

    from pytest_simbench.testing import conformance_checks

    @conformance_checks("mysim")
    def test_conformance(check):
        check()

Every check runs the real adapter in a real worker process, and says in its docstring which law
it holds the engine to, how closely, and why.
"""

from __future__ import annotations

from pytest_simbench.testing import (
    acting,
    contract,
    drives,
    dynamics,
    interaction,
    letting_go,
    parity,
    physics,
    self_collision,
    state,
)
from pytest_simbench.testing.checks import CHECKS, Check
from pytest_simbench.testing.expected import ConformanceWarning
from pytest_simbench.testing.kit import ConformanceTest, conformance_checks
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
    "letting_go",
    "parity",
    "physics",
    "self_collision",
    "state",
]
