"""With `--sim-jobs` tests of one repetition each run side by side, where they say what they will
repeat."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from textwrap import dedent

import pytest

from tests.plugin.inner import records, run_pytest

TEST = """
    import os
    import threading
    import time
    from pathlib import Path

    import pytest
    from tests.tiny import Falling

    class Timed(Falling):
        shares_worker = True

        def perform(self, world, seed, count):
            began = time.monotonic()
            if seed == int(os.environ.get("STOP_AT", "0")):
                raise KeyboardInterrupt
            while os.environ["ALONE"] != "yes" and len(list(Path().glob("here *"))) < 2:
                Path(f"here {threading.get_ident()}").touch()
                if time.monotonic() > began + 30:
                    raise AssertionError("nobody came")
            outcome = super().perform(world, seed, count)
            with Path("spans").open("a") as file:
                print(began, time.monotonic(), file=file)
            return outcome

    @pytest.mark.reps(1)
    @pytest.mark.repeats("task")
    @pytest.mark.parametrize("task", [Timed(), Timed(0.7)], ids=["short", "long"])
    def test_it(repeat, task):
        repeat(task).assert_at_least("landed", 0.1)
"""
SIMS = "--sim-profile=default,tuned"


@pytest.fixture
def folder(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ALONE", "no")
    (pytester.path / "test_it.py").write_text(dedent(TEST))
    return pytester.path


def run(pytester: pytest.Pytester, *more: str, **outcomes: int) -> pytest.RunResult:
    return run_pytest(pytester, "--sim=mujoco --sim-output=out", SIMS, *more, **outcomes)


def kept(folder: Path) -> list[tuple[str, str]]:
    return [(record["test"], record["status"]) for record in records(folder / "out")]


def test_two_tests_run_at_once_and_each_record_is_there_once(
    pytester: pytest.Pytester, folder: Path
) -> None:
    """The first one waits until another one has begun."""
    run(pytester, "--sim-jobs=2", passed=4)
    assert len({test for test, _ in kept(folder)}) == len(kept(folder)) == 4


@pytest.mark.parametrize(("jobs", "own"), [(1, "repeats"), (2, "sim_settings")])
def test_one_job_and_tests_with_settings_run_one_after_the_other(
    pytester: pytest.Pytester, folder: Path, monkeypatch: pytest.MonkeyPatch, jobs: int, own: str
) -> None:
    monkeypatch.setenv("ALONE", "yes")
    with (folder / "test_it.py").open("a") as file:
        file.write(f"\n{own} = pytest.fixture(lambda: {{'timestep': 0.01}})\n")
    run(pytester, f"--sim-jobs={jobs}", passed=4)
    spans = [tuple(map(float, line.split())) for line in (folder / "spans").open()]
    assert all(one[1] <= other[0] for one, other in pairwise(sorted(spans)))


def test_a_mark_that_names_no_task_is_an_error(pytester: pytest.Pytester, folder: Path) -> None:
    (folder / "test_it.py").write_text(dedent(TEST).replace('repeats("task")', 'repeats("law")'))
    result = run(pytester, "--sim-jobs=2", failed=4)
    result.stdout.fnmatch_lines(["*repeats needs the name of a parameter*choose from task*"])


def test_ctrl_c_ends_both(
    pytester: pytest.Pytester, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The test's own is recorded as interrupted; what no test has come to, is not recorded."""
    monkeypatch.setenv("STOP_AT", "10001")
    assert run(pytester, "--sim-jobs=2").ret == pytest.ExitCode.INTERRUPTED
    assert [status for _, status in kept(folder)] == ["interrupted"]
