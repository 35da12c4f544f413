"""Claims that too few repetitions do not decide: a warning, and with `--sim-strict` a failure."""

from __future__ import annotations

import pytest

from tests.plugin.inner import no_traceback

TEST = """
    from tests.tiny import Falling

    def test_falling(repeat, threshold):
        repeat(Falling({duration})).assert_at_least("landed", threshold("landed", 0.9))
"""
TOO_FEW = "*not judged whether at least 90 %, a claim needs 5 repetitions or more*"
UNDECIDED = "UNDECIDED test_falling: landed >= 90 %: mujoco *"


@pytest.mark.parametrize(
    ("duration", "arguments", "outcome", "message"),
    [
        (0.6, ["--reps=1"], "passed", f"{UNDECIDED}(a claim needs*"),
        # A single repetition failed any claim with one lost cube.
        (0.05, ["--reps=1"], "passed", f"{UNDECIDED}(a claim needs*"),
        (0.6, ["--reps=1", "--sim-strict"], "failed", TOO_FEW),
        (0.6, ["--reps=1", "-o", "sim_strict=true"], "failed", TOO_FEW),
        (0.6, ["--reps=5"], "passed", f"{UNDECIDED}100 * (about * more"),
        (0.6, ["--reps=5", "--sim-strict"], "failed", "*inconclusive whether at least 90 %*"),
        (0.6, ["--reps=5", "--sim-strict", "--sim-threshold=landed=0.3"], "passed", "*PASS*"),
    ],
)
def test_undecided(
    pytester: pytest.Pytester, duration: float, arguments: list[str], outcome: str, message: str
) -> None:
    pytester.makepyfile(TEST.format(duration=duration))
    result = pytester.runpytest_subprocess("--sim=mujoco", *arguments)
    result.assert_outcomes(**{outcome: 1})
    assert result.ret == (outcome == "failed")
    result.stdout.fnmatch_lines([message])
    no_traceback(result)
