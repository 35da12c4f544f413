"""The conformance kit: checks that an adapter's author runs on their own adapter.

    from pytest_simbench.testing import conformance_checks

    @conformance_checks("mysim")
    def test_conformance(check):
        check()

Every check runs the real adapter in a real worker process, and says in its docstring which law
it holds the engine to, how closely, and why.
"""

from __future__ import annotations

from pytest_simbench.testing import (  # noqa: F401  they register their checks
    acting,
    asking,
    contract,
    drives,
    dynamics,
    interaction,
    joints,
    parity,
    physics,
    state,
)
from pytest_simbench.testing.kit import (
    CHECKS,
    Check,
    ConformanceTest,
    ConformanceWarning,
    conformance_checks,
)
from pytest_simbench.testing.subject import ConformanceFailure, Subject, close_workers

__all__ = [
    "CHECKS",
    "Check",
    "ConformanceFailure",
    "ConformanceTest",
    "ConformanceWarning",
    "Subject",
    "close_workers",
    "conformance_checks",
]
