"""The suite of laws as users run it, over time steps too (`--sim-sweep`)."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.command import simbench
from tests.plugin.inner import records, run_pytest

SUITE = Path(__file__).resolve().parents[2] / "suites" / "test_physics.py"


def test_a_broken_law_is_a_finding_and_no_failure_unless_asked_for(
    pytester: pytest.Pytester,
) -> None:
    """PyBullet's motors are no springs: a rod on one does not sag. Each law is asked once."""
    pytester.makepyfile(test_physics=SUITE.read_text("utf-8"))
    asked = ("--sim=mujoco,pybullet", "-k", "free_fall or sag", "--sim-output=out", "--reps=3")
    result = run_pytest(pytester, "--sim-threshold=ratio=2", *asked, passed=3, failed=1)
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


def test_a_law_that_is_asked_once_can_be_claimed_and_gated(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        from pytest_simbench.laws import LAWS

        def test_it(repeat):
            repeat(LAWS[0]).assert_at_most("ratio", 0.5)
        """
    )
    asked = ("--sim=mujoco", "--reps=20", "--sim-strict")
    run_pytest(pytester, "--sim-output=first", *asked, passed=1)
    slower = (*asked, "--sim-set=mujoco.timestep=0.004", "--sim-baseline=first")
    run_pytest(pytester, "--sim-compare-fail=ratio:100000%", *slower, passed=1, ret=0)
    worse = run_pytest(pytester, "--sim-compare-fail=error:50%", *slower, ret=1)
    worse.stdout.fnmatch_lines(["*: error rose from *", "*every repetition is the same)"])


def ids(folder: Path) -> list[str]:
    return [record["test"].partition("::")[2] for record in records(folder)]


def test_a_sweep_of_two_profiles_is_one_run_that_is_resumed_and_reported(
    pytester: pytest.Pytester,
) -> None:
    """What cannot be done at a longer step is a finding, and no failed test."""
    pytester.makepyfile(
        test_physics=SUITE.read_text("utf-8"),
        test_else="""
        from pytest_simbench.laws import LAWS

        class Refused(type(LAWS[0])):
            name = "refused"

            def measure(self, world):
                found = super().measure(world)
                if found.tolerance > 0.1:
                    raise ValueError("no such step for me")
                return found

        def test_refused(repeat, sim_swept):
            result = repeat(Refused())
            assert len(result.failures) == (sim_swept and result.records[0].metrics == {})
        """,
    )
    asked = ["--sim=mujoco", "-k", "free_fall or refused", "--reps=1", "--sim-output=out"]
    asked.append("--sim-profile=default,tuned")
    run_pytest(pytester, "", *asked, passed=4)
    out = pytester.path / "out"
    assert set(ids(out)) == {
        "test_law[mujoco-headless-default-free_fall]", "test_law[mujoco-headless-free_fall]",
        "test_refused[mujoco-headless-default]", "test_refused[mujoco-headless]",
    }  # fmt: skip

    asked += ["--sim-resume=out", "--sim-sweep=0.016,0.002,1e-3"]
    result = run_pytest(pytester, "", *asked, passed=2 * 2 * 3)
    result.stdout.fnmatch_lines(
        [
            "mujoco (default) *2/2 *",
            "mujoco (tuned) *2/2 *",
            "*the same laws over time steps*",
            "mujoco (default) *2/2 [12]*ms *",  # whichever cost less this time
            "mujoco (tuned) *2/2 [12]*ms *",
            "mujoco (*) fails refused at 16ms: *no such step for me*",
        ]
    )
    assert len(ids(out)) == len(set(ids(out))) == 2 * 2 * 3
    assert "test_law[mujoco-headless-default-dt=1ms-free_fall]" in ids(out)
    text = (out / "report.md").read_text()
    assert "free\\_fall | 1.00 [" in text
    assert "no such step for me" in text
    again = simbench(pytester, "report", "out")
    again.stdout.fnmatch_lines(["the same laws over time steps", "mujoco (tuned) *2/2 [12]*ms *"])
