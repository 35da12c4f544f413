"""`--sim-threshold`: its names and values are held against what the tests that ran measure."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.plugin.inner import CLAIMING, run_pytest

TEST = """
    import pytest
    from tests.tiny import Falling

    @pytest.mark.parametrize("name", ["landed"])
    def test_falling(repeat, threshold, name):
        repeat(Falling(duration=0.2)).assert_at_least(name, threshold(name, 0.1))

    def test_other(threshold):
        assert threshold("own_metric", 1.0) == 2.0
"""


def test_what_a_task_measures_and_what_a_test_asks_for_are_known(
    pytester: pytest.Pytester,
) -> None:
    pytester.makepyfile(TEST)
    result = run_pytest(
        pytester,
        "--sim=mujoco --reps=5 --sim-threshold=landed=0.9,own_metric=2 -n2",
        passed=2,
        ret=0,
    )
    result.stdout.fnmatch_lines(["UNDECIDED *landed >= 90 %*"])


@pytest.mark.parametrize("arguments", [[], ["-n2"]], ids=["plain", "xdist"])
def test_a_name_that_no_test_knows_is_told_at_the_end(
    pytester: pytest.Pytester, arguments: list[str]
) -> None:
    pytester.makepyfile(TEST.replace("== 2.0", "== 1.0"))
    arguments = ["--sim=mujoco", "--reps=1", "--sim-threshold=landet=1", *arguments]
    result = run_pytest(pytester, "", *arguments, passed=2, ret=pytest.ExitCode.USAGE_ERROR)
    result.stdout.fnmatch_lines(
        [
            "report: *",
            "ERROR: --sim-threshold=landet=1: no metric is named 'landet'; did you mean 'landed'? "
            "valid names: *crashed, *landed, *own_metric*",
        ]
    )
    assert result.stdout.str().count("no metric is named") == 1


def test_a_claim_with_a_number_of_its_own_has_no_threshold_to_change(
    pytester: pytest.Pytester,
) -> None:
    pytester.makepyfile(CLAIMING)
    words = "--sim=mujoco --reps=5 --sim-threshold=landed=0.9"
    result = run_pytest(pytester, words, passed=1, ret=pytest.ExitCode.USAGE_ERROR)
    result.stdout.fnmatch_lines(["ERROR: --sim-threshold=landed=0.9: no test that ran asks for*"])


def test_a_run_that_x_stops_has_its_result_and_knows_no_names(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        from tests.tiny import Falling

        def test_falling(repeat):
            repeat(Falling(duration=0.2)).assert_at_most("landed", -1)

        def test_other(threshold):
            assert threshold("own_metric", 1.0) == 2.0
        """
    )
    result = run_pytest(pytester, "--sim=mujoco --reps=1 -x --sim-threshold=own_metric=2", failed=1)
    result.stdout.fnmatch_lines(["*simulator comparison*"])
    assert "no metric is named" not in result.stdout.str()


def test_a_value_that_can_never_fail_is_told_before_a_repetition_runs(
    pytester: pytest.Pytester,
) -> None:
    """Which values can not: `--sim-threshold` in test_input."""
    pytester.makepyfile(TEST)
    result = run_pytest(
        pytester,
        "--sim=mujoco --sim-output=o --sim-threshold=landed=0 -k falling",
        failed=1,
        deselected=1,
    )
    message = "landed is always at least 0, so that this threshold can never fail"
    result.stdout.fnmatch_lines([f"--sim-threshold=landed=0: {message}"])
    assert not Path(pytester.path, "o", "records.jsonl").exists()
