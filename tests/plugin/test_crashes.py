"""How many repetitions may crash: none, unless a mark, an option or the test itself says so."""

from __future__ import annotations

import pytest

TEST = """
    import os
    import signal

    import pytest
    from tests.tiny import Falling


    class Dying(Falling):
        def perform(self, world, seed, count):
            if seed < {last}:
                os.kill(world.process.pid, signal.SIGKILL)
            return super().perform(world, seed, count)


    def test_silent(repeat):
        repeat(Dying(duration=0.05))


    @pytest.mark.sim_crashes({marked})
    def test_marked(repeat):
        repeat(Dying(duration=0.05))


    def test_claims(repeat):
        repeat(Dying(duration=0.05)).assert_crashed_at_most(0.9)


    @pytest.mark.xfail_sim("mujoco", reason="it is known to crash")
    def test_known(repeat):
        repeat(Dying(duration=0.05))
"""
FIRST = 500


@pytest.mark.parametrize(
    ("crashed", "options", "failed", "told"),
    [
        (1, [], ["silent"], "*1 of 2 repetitions crashed: 1 x WorkerExited in *seed 500: *"),
        (1, ["--sim-crashes=0"], ["silent", "marked"], "*None may crash (--sim-crashes)"),
        (1, ["--sim-crashes=0.5"], [], "test_silent: crashed <= 50 %*UNDECIDED 1 of 2*"),
        (2, [], ["silent", "marked", "claims"], "*2 of 2 repetitions crashed*No repetition fin*"),
    ],
)
def test_a_test_fails_when_more_repetitions_crashed_than_may(
    pytester: pytest.Pytester, crashed: int, options: list[str], failed: list[str], told: str
) -> None:
    marked = 0.6  # of 1 in 2
    pytester.makepyfile(TEST.format(last=FIRST + crashed, marked=marked))
    result = pytester.runpytest_subprocess(
        "--sim=mujoco", "--reps=2", f"--sim-seed={FIRST}", "-rfx", *options
    )
    known = int("--sim-crashes=0.5" not in options)
    result.assert_outcomes(
        failed=len(failed), passed=3 - len(failed), xfailed=known, xpassed=1 - known,
        warnings=result.parseoutcomes().get("warnings", 0),
    )  # fmt: skip
    result.stdout.fnmatch_lines([told])
    for name in failed:
        result.stdout.fnmatch_lines([f"FAILED *::test_{name}[[]mujoco-headless]*"])
    assert "Traceback" not in result.stdout.str()
    assert "check_crashes" not in result.stdout.str()  # a line of ours


def test_the_ini_file_may_allow_crashes_and_a_mark_is_nearer(pytester: pytest.Pytester) -> None:
    pytester.makeini("[pytest]\nsim_crashes = 1\n")
    pytester.makepyfile(TEST.format(last=FIRST + 2, marked=0.9))
    result = pytester.runpytest_subprocess(
        "--sim=mujoco", "--reps=2", f"--sim-seed={FIRST}", "-k", "silent or marked"
    )
    result.assert_outcomes(passed=1, failed=1, deselected=2)
    result.stdout.fnmatch_lines(["FAILED *::test_marked*"])
