"""`--protocol` chooses the version of the task that is run, counted and recorded."""

from __future__ import annotations

import pytest

from pytest_simbench.records.folder import RunFolder

SUITE = """
from dataclasses import dataclass, replace
from tests.tiny import Falling

@dataclass(frozen=True)
class Versions(Falling):
    def smoke(self):
        return replace(self, duration=0.2)
    def study(self):
        return replace(self, duration=0.4)

def test_versions(repeat):
    repeat(Versions())
"""


@pytest.mark.parametrize(("protocol", "duration"), [("fast", 0.6), ("smoke", 0.2), ("paper", 0.4)])
def test_the_protocols_version_is_run(
    pytester: pytest.Pytester, protocol: str, duration: float
) -> None:
    pytester.makepyfile(SUITE)
    result = pytester.runpytest_subprocess(
        "--sim=mujoco", "--reps=1", f"--protocol={protocol}", "--sim-output=out"
    )
    result.assert_outcomes(passed=1)
    (record,) = RunFolder(pytester.path / "out").read().records
    assert record.settings["task.duration"] == duration
    assert record.stepping["simulated"] == pytest.approx(duration)
