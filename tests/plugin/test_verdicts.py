"""How often a task is repeated, and what fails a test: crashes, claims that are not decided."""

from __future__ import annotations

import json
import re
from xml.etree import ElementTree

import pytest

from tests.plugin.inner import CLAIMING, FALLING, NOTHING_LANDS, records, run_pytest

DYING = """
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
    pytester.makepyfile(DYING.format(last=FIRST + crashed, marked=marked))
    result = run_pytest(pytester, f"--sim=mujoco --reps=2 --sim-seed={FIRST} -rfx", *options)
    known = int("--sim-crashes=0.5" not in options)
    result.assert_outcomes(
        failed=len(failed), passed=3 - len(failed), xfailed=known, xpassed=1 - known,
        warnings=result.parseoutcomes().get("warnings", 0),
    )  # fmt: skip
    result.stdout.fnmatch_lines([told])
    result.stdout.fnmatch_lines(
        ["* known to fail; *", "test_known: crashed <= 0 % *XFAIL*"] * known
    )
    for name in failed:
        result.stdout.fnmatch_lines([f"FAILED *::test_{name}[[]mujoco-headless]*"])
    assert "check_crashes" not in result.stdout.str()  # a line of ours


def test_the_ini_file_may_allow_crashes_and_a_mark_is_nearer(pytester: pytest.Pytester) -> None:
    pytester.makeini("[pytest]\nsim_crashes = 1\n")
    pytester.makepyfile(DYING.format(last=FIRST + 2, marked=0.9))
    result = run_pytest(
        pytester,
        f"--sim=mujoco --reps=2 --sim-seed={FIRST}",
        "-k silent or marked",
        passed=1,
        failed=1,
        deselected=2,
    )
    result.stdout.fnmatch_lines(["FAILED *::test_marked*"])


PARTS = """
    import pytest
    from tests.tiny import Falling

    def claim(repeat):
        repeat(Falling()).assert_at_least("landed", 0.9)

    def test_in_parts(repeat, subtests):
        with subtests.test("a"):
            pytest.xfail("known")
        with subtests.test("b"):
            claim(repeat)

    def test_catches_it_and_fails(repeat):
        with pytest.raises(AssertionError):
            claim(repeat)
        raise ValueError
"""


@pytest.mark.skipif(pytest.version_tuple < (9, 0), reason="pytest 9 has subtests")
def test_a_claim_in_a_test_that_failed_is_not_known_to_fail(pytester: pytest.Pytester) -> None:
    """One subtest expected to fail, and so the claim of another was XFAIL."""
    pytester.makeconftest(NOTHING_LANDS)
    pytester.makepyfile(PARTS)
    result = run_pytest(pytester, "--sim=mujoco --reps=8", ret=1)
    result.stdout.fnmatch_lines(["FAIL   2 of 2 claims fail; *"])


RERUN = """
from _pytest.runner import runtestprotocol

def pytest_runtest_protocol(item, nextitem):
    for attempt in (1, 2):
        item._initrequest()
        for report in runtestprotocol(item, nextitem=nextitem, log=False):
            if attempt == 1 and report.failed:
                report.outcome = "rerun"
            item.ihook.pytest_runtest_logreport(report=report)
    return True
"""

AGAIN = """
    from tests.tiny import Falling

    attempts = []

    def test_claims_it_once(repeat):
        result = repeat(Falling())
        attempts.append(1)
        if len(attempts) == 1:
            result.assert_at_least("landed", 0.9)

    def test_other(repeat):
        repeat(Falling()).assert_at_most("landed", 0.9)
        attempts.append(2)
        assert attempts.count(2) == 2
"""


def test_what_the_last_attempt_says_counts(pytester: pytest.Pytester) -> None:
    """As pytest-rerunfailures does: pytest passed, and the report told the first attempt's FAIL."""
    pytester.makeconftest(NOTHING_LANDS + RERUN)
    pytester.makepyfile(AGAIN)
    for words in ("--sim-output=o", "--sim-resume=o -k other"):
        result = run_pytest(pytester, f"--sim=mujoco --reps=8 --junitxml=j.xml {words}", ret=0)
        result.stdout.fnmatch_lines(["PASS   1 of 1 claims hold; *"])
    *_, last = ElementTree.parse(pytester.path / "j.xml").iter("testcase")
    names = [str(item.get("name")) for item in last.iter("property")]
    assert len({*names}) == len(names)


STRICT = """
    from tests.tiny import Falling

    def test_falling(repeat, threshold):
        repeat(Falling({duration})).assert_at_least("landed", threshold("landed", 0.9))
"""
TOO_FEW = "*not judged whether at least 90 %, a claim needs 5 repetitions or more*"
UNDECIDED = "UNDECIDED test_falling: landed >= 90 %: mujoco *"


@pytest.mark.parametrize(
    ("duration", "arguments", "outcome", "message"),
    [
        # A single repetition failed any claim with one lost cube.
        (0.05, ["--reps=1"], "passed", f"{UNDECIDED}(a claim needs*"),
        (0.6, ["--reps=1", "--sim-strict"], "failed", TOO_FEW),
        (0.6, ["--reps=5"], "passed", f"{UNDECIDED}100 * (about * more"),
        (0.6, ["--reps=5", "--sim-strict"], "failed", "*inconclusive whether at least 90 %*"),
        (0.6, ["--reps=5", "--sim-strict", "--sim-threshold=landed=0.3"], "passed", "*PASS*"),
    ],
)
def test_undecided(
    pytester: pytest.Pytester, duration: float, arguments: list[str], outcome: str, message: str
) -> None:
    pytester.makepyfile(STRICT.format(duration=duration))
    result = run_pytest(
        pytester, "--sim=mujoco", *arguments, **{outcome: 1}, ret=(outcome == "failed")
    )
    result.stdout.fnmatch_lines([message])


AUTO = """
    from tests.tiny import Falling

    def test_decided(repeat):
        repeat(Falling()).assert_at_least("landed", 0.5)

    def test_undecided(repeat):
        repeat(Falling()).assert_at_least("landed", 0.9)

    def test_without_a_claim(repeat):
        repeat(Falling())
"""


def test_it_repeats_until_the_claims_are_decided(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(AUTO)
    result = run_pytest(
        pytester,
        "--sim=mujoco --reps=auto:12 --sim-output=out --sim-jobs=4 --junitxml=junit.xml",
        "--benchmark-json=b.json",
        passed=3,
    )
    kept = records(pytester.path / "out")
    tests = [record["test"].split("::")[1].split("[")[0] for record in kept]
    wanted = {"test_decided": 10, "test_undecided": 12, "test_without_a_claim": 10}
    assert {name: tests.count(name) for name in wanted} == wanted
    result.stdout.fnmatch_lines(["UNDECIDED test_undecided: *>= 90 %: mujoco *"])
    told = re.findall(r"repetition (\d+) of (\d+)", result.stdout.str())
    assert told
    assert [pair for pair in told if int(pair[0]) > int(pair[1])] == []
    # What pytest-benchmark and JUnit are told is known when the test has ended only.
    saved = json.loads((pytester.path / "b.json").read_text())["benchmarks"]
    assert [b["stats"]["rounds"] for b in saved] == [10, 12, 10]
    found = ElementTree.parse(pytester.path / "junit.xml").iterfind(
        ".//property[@name='repetitions']"
    )
    assert [item.get("value") for item in found] == ["10", "12", "10"]


def test_a_jitter_that_makes_starts_overlap_is_one_sentence(pytester: pytest.Pytester) -> None:
    task = "from pytest_simbench.tasks import Throwing as Falling"
    pytester.makepyfile(FALLING.replace("from tests.tiny import Falling", task))
    result = run_pytest(pytester, "--sim=mujoco --reps=4 --jitter=10 --sim-output=o", failed=1)
    result.stdout.fnmatch_lines(["the jitter 10 is too large for the task 'throwing': seed 10001*"])
    assert not (pytester.path / "o" / "records.jsonl").exists()


ALIKE = """
    from tests.tiny import Falling

    def test_falling(repeat):
        for least in (0.9, 0.1):
            repeat(Falling(0.5 + least / 10)).assert_at_least("landed", least)
"""


def test_each_of_several_claims_that_are_alike_is_told(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(ALIKE)
    for more in (["--sim-output=a"], ["--sim-resume=a"]):
        result = run_pytest(pytester, "--sim=mujoco --reps=5", *more, passed=1)
        result.stdout.fnmatch_lines(
            ["UNDECIDED   1 of 2 claims hold, 1 undecided; 0 of 10 repetitions crashed",
             "test_falling: landed >= 90 %  UNDECIDED 100 *",
             "test_falling: landed >= 10 %  PASS 100 *"]
        )  # fmt: skip


def test_what_a_resumed_test_claims_no_more_is_not_told(pytester: pytest.Pytester) -> None:
    """A verdict on fewer repetitions stood beside those that contradicted it."""
    for folder, test, told in (
        ("--sim-output=a", CLAIMING, "PASS   1 of 1 claims*"),
        ("--sim-resume=a", FALLING, "no claim was judged*"),
    ):
        pytester.makepyfile(test)
        run_pytest(pytester, "--sim=mujoco --reps=5", folder).stdout.fnmatch_lines([told])
