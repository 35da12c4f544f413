"""However a run is cut up, its records are the same, byte for byte but for times and resources."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from textwrap import dedent

import pytest

from tests.cli.command import simbench
from tests.plugin.inner import run_before, run_pytest

TEST = """
    import os
    import time
    from pathlib import Path
    from tests.tiny import Falling

    class Stopped(Falling):
        def perform(self, world, seed, count):
            began = time.monotonic()
            outcome = super().perform(world, seed, count)
            if "SPANS" in os.environ:
                with Path(os.environ["SPANS"]).open("a") as file:
                    print(began, time.monotonic(), file=file)
            outcome.details["bodies"] = world.bodies  # every bit of the state at the end
            if str(seed) == os.environ.get("STOP_AT"):
                raise KeyboardInterrupt
            return outcome

    def test_one(repeat):
        repeat(Stopped()).assert_at_least("landed", 0.1)

    def test_two(repeat):
        repeat(Stopped(duration=0.3)).assert_at_least("landed", 0.1)
"""
TIMES = ("seconds", "stepping", "timeline", "resources")
"""Differ from run to run."""


def kept(folder: Path, *, jobs: bool = False) -> list[str]:
    """The records of a run as JSON lines, sorted, without times and resources."""
    lines = {}
    for line in (folder / "records.jsonl").read_text().splitlines():
        record = json.loads(line)
        for name in TIMES:
            del record[name]
        if jobs:
            assert record["contended"] is True  # this is about times: they are not comparable
            record["contended"] = False
        if record["status"] != "interrupted":
            key = (record["test"], record["repetition"])
            assert key not in lines, f"{key} was run twice"
            lines[key] = json.dumps(record)
    return [lines[key] for key in sorted(lines)]


@pytest.fixture(scope="module")
def straight(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The records of one straight run."""
    words = "--sim=mujoco --reps=4 --sim-output=out"
    with run_before(request, tmp_path_factory, TEST, words) as folder:
        found = kept(folder / "out")
    assert len(found) == 8
    assert all('"bodies": [[' in line for line in found)
    return found


@pytest.fixture
def folder(pytester: pytest.Pytester) -> Path:
    (pytester.path / "test_it.py").write_text(dedent(TEST))
    return pytester.path


def run(pytester: pytest.Pytester, *more: str, **outcomes: int) -> pytest.RunResult:
    return run_pytest(pytester, "--sim=mujoco", *more, **outcomes)


@pytest.mark.parametrize("arguments", [["-n2"], ["--sim-jobs=2"]], ids=["xdist", "jobs"])
def test_side_by_side(
    pytester: pytest.Pytester, folder: Path, straight: list[str], arguments: list[str]
) -> None:
    result = run(pytester, "--reps=4", "--sim-output=out", *arguments, passed=2)
    assert result.stdout.str().count("simulator comparison") == 1
    assert kept(folder / "out", jobs="--sim-jobs=2" in arguments) == straight


def test_tests_share_the_jobs_of_the_run(
    pytester: pytest.Pytester,
    folder: Path,
    straight: list[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two tests at once, and one repetition: its times are as if it had the machine to itself."""
    monkeypatch.setenv("SPANS", str(pytester.path / "spans"))
    run(pytester, "--reps=4", "--sim-output=out", "-n2", "--sim-jobs=1", passed=2)
    assert kept(folder / "out") == straight
    spans = [line.split() for line in (pytester.path / "spans").read_text().splitlines()]
    in_order = sorted((float(began), float(ended)) for began, ended in spans)
    assert len(in_order) == 8
    assert all(one[1] <= other[0] for one, other in pairwise(in_order))


@pytest.mark.parametrize("arguments", [[], ["-n2"]], ids=["plain", "xdist"])
def test_interrupted_and_resumed(
    pytester: pytest.Pytester,
    folder: Path,
    straight: list[str],
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
) -> None:
    monkeypatch.setenv("STOP_AT", "10003")
    stopped = run(pytester, "--reps=4", "--sim-output=out")
    assert stopped.ret == pytest.ExitCode.INTERRUPTED
    assert kept(folder / "out") == straight[:2]
    assert stopped.stdout.str().count("1 cut short") == 2  # the claims, the answer
    monkeypatch.delenv("STOP_AT")
    result = run(pytester, "--reps=4", "--sim-resume=out", *arguments, passed=2)
    assert kept(folder / "out") == straight
    assert " cut" not in result.stdout.str()
    assert "0 of 4" in result.stdout.str()
    result.stdout.fnmatch_lines(["falling: 4 repetitions*"])


def test_sharded_and_merged_then_judged_without_running(
    pytester: pytest.Pytester, folder: Path, straight: list[str]
) -> None:
    run(pytester, "--reps=3", "--sim-output=a", passed=2)
    run(pytester, "--reps=1", "--sim-seed=10004", "--sim-output=b", passed=2)
    merged = simbench(pytester, "merge", "b", "a", "--output=whole")
    assert merged.ret == pytest.ExitCode.OK
    merged.stdout.fnmatch_lines(["falling: 4 repetitions*"])
    assert kept(folder / "whole") == straight
    names = [json.loads(line)["notes"]["log"] for line in straight]
    assert [name[:9] for name in names] == ["logs/test"] * 8
    assert {path.name for path in (folder / "whole/logs").iterdir()} == {n[5:] for n in names}
    run(pytester, "--reps=4", "--sim-resume=whole", passed=2)
    assert kept(folder / "whole") == straight


def test_another_version_is_not_resumed(pytester: pytest.Pytester, folder: Path) -> None:
    """Another test of the same simulator may have other settings, but not another version; nor may
    a test of which nothing is missing."""
    run(pytester, "--reps=1", "--sim-output=out", "-k", "one", passed=1)
    path = folder / "out" / "records.jsonl"
    path.write_text(path.read_text().replace('"mujoco": "', '"mujoco": "0.'))
    result = run(pytester, "--reps=1", "--sim-resume=out", failed=2)
    result.stdout.fnmatch_lines(['test_one*would not be comparable: versions.mujoco was "0.*'])
    result.stdout.fnmatch_lines(['test_two*would not be comparable: versions.mujoco was "0.*'])
    assert len(path.read_text().splitlines()) == 1
