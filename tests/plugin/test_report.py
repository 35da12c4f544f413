"""The report of a run as users meet it: the page, the short result, the badge."""

from __future__ import annotations

import fnmatch
import json
import re
import signal

import pytest

from pytest_simbench.plugin.benchmark import shown
from pytest_simbench.records.baseline import KEY
from tests.cli.command import simbench
from tests.plugin.inner import CLAIMING, FALLING, run_pytest


def run(pytester: pytest.Pytester, *more: str, **outcomes: int) -> pytest.RunResult:
    return run_pytest(pytester, "--sim=mujoco --reps=5 --sim-output=o", *more, **outcomes)


@pytest.fixture(autouse=True)
def test_file(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_it=FALLING)


def test_an_interrupted_report_is_one_sentence(pytester: pytest.Pytester) -> None:
    pytester.makeconftest(
        """
        import signal
        from pytest_simbench.plugin import run
        run.write_files = lambda *given: signal.raise_signal(signal.SIGINT)
        """
    )
    result = run(pytester)
    assert result.ret == pytest.ExitCode.INTERRUPTED
    lines = [*result.stdout.lines, *result.stderr.lines]
    message = "interrupted while the report was made; the records are kept in */o, and simbench "
    assert fnmatch.filter(lines, f"Exit: {message}report */o makes the report")
    assert len((pytester.path / "o" / "records.jsonl").read_text().splitlines()) == 5


def test_an_interrupt_between_two_repetitions_is_no_look(pytester: pytest.Pytester) -> None:
    """Of a test that had no verdict yet; of one that had, repetitions that are added are one."""
    pytester.makeconftest(
        """
        import signal
        from pytest_simbench.records.folder import RunFolder

        append = RunFolder.append
        def appended(self, record):
            append(self, record)
            if "test_it" in record.test and record.repetition == 2:
                signal.raise_signal(signal.SIGINT)
        RunFolder.append = appended
        """
    )
    pytester.makepyfile(test_a=FALLING)
    run(pytester, ret=pytest.ExitCode.INTERRUPTED)
    path = pytester.path / "o" / "outcome.json"
    run_pytest(pytester, "--sim=mujoco --reps=5 --sim-resume=o -k test_a", passed=1)
    run_pytest(pytester, "--sim=mujoco --reps=5 --sim-resume=o", passed=2)
    assert json.loads(path.read_text())["looks"] == 1
    run_pytest(pytester, "--sim=mujoco --reps=6 --sim-resume=o", passed=2)
    assert json.loads(path.read_text())["looks"] == 2


def test_a_run_that_was_killed_has_not_passed(pytester: pytest.Pytester) -> None:
    killed = CLAIMING + "    __import__('signal').raise_signal(9)\n"
    pytester.makepyfile(test_it=killed, test_a=CLAIMING)
    assert run(pytester).ret == -signal.SIGKILL
    simbench(pytester, "report", "o")
    report = pytester.path / "o" / "report.md"
    told = "1 of 1 claims hold; the run did not end: resume it; 0 of 10 repetitions crashed"
    assert report.read_text().startswith(f"**UNDECIDED {told}")
    pytester.makepyfile(test_it=CLAIMING)
    run_pytest(pytester, "--sim=mujoco --reps=5 --sim-resume=o", passed=2)
    assert report.read_text().startswith("**PASS 2 of 2 claims hold; 0 of 10 repetitions")


@pytest.mark.usefixtures("drawn")
def test_a_run_ends_with_its_page_and_the_answer(pytester: pytest.Pytester) -> None:
    """The answer first, where the page is last, and no table of pytest-benchmark between."""
    result = run(pytester, "--sim-badge=site/badge.json", passed=1)
    lines = result.stdout.lines
    start = next(k for k, line in enumerate(lines) if "simulator comparison" in line)
    end = next(k for k, line in enumerate(lines) if line.startswith("report: "))
    assert lines[start + 1] == "no claim was judged; 0 of 5 repetitions crashed"
    assert "mujoco did falling: 5 repetitions, none crashed." in lines
    assert lines[end] == "report: o/report.html"
    assert re.match(r"=+ .*1 passed", lines[end + 1])
    assert end - start < 40
    assert "benchmark: 1 tests" not in result.stdout.str()
    assert "declared deviations" not in result.stdout.str()
    page = (pytester.path / "o" / "report.html").read_text(encoding="utf-8")
    assert page.startswith("<!DOCTYPE html>")
    assert "mujoco did falling: 5 repetitions, none crashed." in page
    assert json.loads((pytester.path / "site" / "badge.json").read_text()) == {
        "schemaVersion": 1,
        "label": "simulators",
        "message": "mujoco: 5 repetitions passed",
        "color": "brightgreen",
    }


def test_everything_is_told_with_v_and_a_badge_that_cannot_be_written(
    pytester: pytest.Pytester,
) -> None:
    pytester.mkdir("badge.json")
    result = run(pytester, "-v", "--sim-badge=badge.json", passed=1)
    result.stdout.fnmatch_lines(["no badge: *badge.json could not be written (*"])
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    output = result.stdout.str()
    assert "where the time went" in output
    assert "declared deviations from the scene" in output
    assert output.index("did falling: 5") < output.index("where the time went")
    assert output.index("declared deviations") < output.index("\nreport: ")


@pytest.mark.parametrize("where", ["command line", "ini", "environment", ""])
def test_the_table_of_pytest_benchmark_comes_with_one_of_its_options(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, where: str
) -> None:
    option = "--benchmark-columns=min,max"
    if where == "ini":
        pytester.makeini(f"[pytest]\naddopts = {option}")
    if where == "environment":
        monkeypatch.setenv("PYTEST_ADDOPTS", option)
    config = pytester.parseconfig(*[option] * (where == "command line"))
    groups = [("test_falling", [{"extra_info": {KEY: {}}}]), ("sum", [{"extra_info": {}}])]
    assert shown(config, groups) == (groups if where else groups[1:])


@pytest.mark.usefixtures("drawn")
def test_the_comparison_with_a_baseline_stands_on_the_page_which_is_made_again(
    pytester: pytest.Pytester,
) -> None:
    """From the folder alone: the comparison with a baseline that is gone, and the badge."""
    run_pytest(pytester, "--sim=mujoco --reps=5 --sim-output=base")
    run(pytester, "--sim-baseline=base")
    (pytester.path / "base").rename(pytester.path / "elsewhere")
    kept = (pytester.path / "o" / "report.html").read_bytes()
    assert b'<section id="baseline">' in kept
    assert f"Compared with {pytester.path / 'base'}".encode() in kept
    (pytester.path / "o" / "report.html").unlink()
    result = simbench(pytester, "report", "o", "--badge=badge.json")
    assert result.ret == 0
    assert (pytester.path / "o" / "report.html").read_bytes() == kept
    result.stdout.fnmatch_lines([f"baseline: {pytester.path / 'base'}", "*landed*", "report: o/*"])
    assert json.loads((pytester.path / "badge.json").read_text())["color"] == "brightgreen"


def test_the_badge_of_merged_runs_is_that_of_all(pytester: pytest.Pytester) -> None:
    run(pytester)
    pytester.makepyfile(test_it=FALLING.rstrip() + ".assert_at_least('landed', 0.5)\n    assert 0")
    run_pytest(
        pytester,
        "--sim=mujoco --reps=5 --sim-output=second --sim-seed=3000 --sim-badge=badge.json",
        failed=1,
    )
    badge = pytester.path / "badge.json"
    assert json.loads(badge.read_text())["color"] == "red"
    for command in (["merge", "o", "second", "--output=whole"], ["report", "whole"]):
        result = simbench(pytester, *command, "--badge=badge.json")
        assert result.ret == 0
        assert json.loads(badge.read_text())["color"] == "red"
        badge.unlink()
    (pytester.path / "o" / "outcome.json").unlink()
    simbench(pytester, "report", "o", "--badge=badge.json")
    assert json.loads(badge.read_text())["message"] == "mujoco: 5 repetitions, not judged"


def test_a_run_of_repeatability_alone_has_its_page(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        test_it="""
        from pytest_simbench.records.repeatability import Line, append

        def test_it(output_path):
            found = {"sentence": "5 mm in x change it"}
            append(output_path, Line("search", "t", "mujoco", "headless", "tuned", "falling", 1,
                                     {}, {}, found))
        """
    )
    result = run_pytest(pytester, "--sim-output=o", passed=1)
    result.stdout.fnmatch_lines(["*= repeatability =*", "*5 mm in x change it*", "report: o/*"])
    assert "5 mm in x change it" in (pytester.path / "o" / "report.html").read_text("utf-8")
    assert not (pytester.path / "o" / "report.md").exists()
