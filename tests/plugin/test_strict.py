"""Claims that too few repetitions do not decide: a warning, and with `--sim-strict` a failure."""

from __future__ import annotations

import pytest

TEST = """
    from tests.tiny import Falling

    def test_falling(repeat, threshold):
        repeat(Falling()).assert_at_least("landed", threshold("landed", 0.9))
"""
TOO_FEW = "*not judged whether at least 90 %, a claim needs 5 repetitions or more*"


@pytest.mark.parametrize(
    ("arguments", "outcome", "message"),
    [
        (["--reps=1"], "passed", "UNDECIDED test_falling: landed >= 90 %: mujoco *(a claim needs*"),
        (["--reps=1", "--sim-strict"], "failed", TOO_FEW),
        (
            ["--reps=5"],
            "passed",
            "UNDECIDED test_falling: landed >= 90 %: mujoco 100 * (about * more",
        ),
        (["--reps=5", "--sim-strict"], "failed", "*inconclusive whether at least 90 %*"),
        (["--reps=5", "--sim-strict", "--sim-threshold=landed=0.3"], "passed", ""),
    ],
)
def test_undecided(
    pytester: pytest.Pytester, arguments: list[str], outcome: str, message: str
) -> None:
    pytester.makepyfile(TEST)
    result = pytester.runpytest_subprocess("--sim=mujoco", *arguments)
    result.assert_outcomes(**{outcome: 1})
    assert result.ret == (outcome == "failed")
    if message:
        result.stdout.fnmatch_lines([message])
    assert "Traceback" not in result.stdout.str()


def test_one_missed_landing_fails_nothing(pytester: pytest.Pytester) -> None:
    """A single repetition passed any claim above 0 and failed it with one lost cube."""
    pytester.makepyfile(TEST.replace("Falling()", "Falling(duration=0.05)"))
    result = pytester.runpytest_subprocess("--sim=mujoco", "--reps=1")
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["UNDECIDED test_falling: landed >= 90 %: mujoco *(a claim needs*"])


def test_the_ini_file_may_ask_for_it(pytester: pytest.Pytester) -> None:
    pytester.makeini("[pytest]\nsim_strict = true\n")
    pytester.makepyfile(TEST)
    result = pytester.runpytest_subprocess("--sim=mujoco", "--reps=1")
    result.assert_outcomes(failed=1)
