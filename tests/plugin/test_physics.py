"""The suite of laws as users run it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.command import simbench
from tests.plugin.inner import records

SUITE = Path(__file__).resolve().parents[2] / "suites" / "test_physics.py"


def test_a_broken_law_is_a_finding_and_no_failure_unless_asked_for(
    pytester: pytest.Pytester,
) -> None:
    """PyBullet's motors are no springs: a rod on one does not sag."""
    pytester.makepyfile(test_physics=SUITE.read_text("utf-8"))
    asked = ("--sim=mujoco,pybullet", "-k", "free_fall or sag", "--sim-output=out")
    result = pytester.runpytest_subprocess(*asked, "--sim-threshold=ratio=2")
    result.assert_outcomes(passed=3, failed=1)
    result.stdout.fnmatch_lines(
        [
            "*off by * tolerances*",
            "for free motion: no clear best*",
            "for joints: mujoco, which keeps 1 of 1 laws.",
            "pybullet *1/1 *x *0/1 *x *",
        ]
    )
    kept = records(pytester.path / "out")
    assert [(r["simulator"], r["task"], r["repetition"], r["status"]) for r in kept] == [
        (simulator, law, 1, "ok") for simulator in ("mujoco", "pybullet")
        for law in ("free_fall", "sag")
    ]  # fmt: skip
    assert [r["reused_worker"] for r in kept] == [False, True, False, True]
    law = kept[-1]["notes"]["reading"]
    assert law["exact"] == pytest.approx(0.1925, abs=1e-4)
    assert kept[-1]["metrics"]["ratio"] == pytest.approx(law["exact"] / law["tolerance"], 0.01)
    again = simbench(pytester, "report", "out")
    assert again.ret == 0
    again.stdout.fnmatch_lines(["for joints: mujoco, which keeps 1 of 1 laws."])
