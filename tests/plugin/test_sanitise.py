"""What a stranger's run may do to who runs pytest: nothing. Its texts do no harm to the terminal,
and nothing outside of its folder is read or written through it."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest

from pytest_simbench.recordings.film import Film
from pytest_simbench.records.folder import TASKS, RunFolder
from pytest_simbench.report.files import write_files
from pytest_simbench.report.model.report import Report
from tests.cli.command import simbench
from tests.hostile import assert_harmless_terminal
from tests.plugin.inner import CLAIMING, run_pytest
from tests.records.build import record

EVIL = "\x1b]0;owned\x07\x1b[2Jred\r\u202e\x9b31m"

TEST = """
    import warnings
    import pytest
    from pytest_simbench.measure.results import InconclusiveWarning
    from tests.tiny import Falling

    EVIL = {evil!r}

    class Bad(Falling):
        def perform(self, world, seed, count):
            world.process.where.phase = EVIL
            raise RuntimeError("no " + EVIL)

    def test_failing(repeat):
        repeat(Bad())

    def test_value(sim_name):
        local = EVIL
        assert sim_name == EVIL

    def test_warns(sim_name):
        warnings.warn(InconclusiveWarning("perhaps " + EVIL))

    def test_skipped(sim_name):
        pytest.skip("because " + EVIL)
"""


def plain(result: pytest.RunResult) -> str:
    text = result.stdout.str() + result.stderr.str()
    assert_harmless_terminal(text)
    return text


@pytest.mark.parametrize("style", ["long", "native"])
def test_failures_and_skips(pytester: pytest.Pytester, style: str) -> None:
    pytester.makepyfile(TEST.format(evil=EVIL))
    words = f"--sim=mujoco --reps=1 --tb={style} -l -rA --color=no"
    result = pytester.runpytest_subprocess(*words.split())  # which shows tracebacks
    result.assert_outcomes(failed=2, passed=1, skipped=1)
    text = plain(result)
    assert r"no \x1b]0;owned\x07\x1b[2Jred \u202e\x9b31m" in text
    assert r"because \x1b" in text
    assert r"perhaps \x1b" in text


def hostile_run(folder: Path, records: Path) -> None:
    """A run made elsewhere: the records of another one, and texts in them."""
    folder.mkdir()
    with (folder / "records.jsonl").open("w") as file:
        for line in records.read_text().splitlines():
            record = json.loads(line)
            if (record["simulator"], record["mode"]) != ("mujoco", "headless"):
                continue
            record |= {"task": EVIL, "profile": EVIL, "deviations": [EVIL], "test": f"t::{EVIL}"}
            record["metrics"] = {EVIL: 0.5}
            record["notes"] = {"untested": EVIL}
            file.write(json.dumps(record) + "\n")


RECORDS = Path(__file__).parents[1] / "measure" / "stacking_records.jsonl"


def test_merging_and_comparing(pytester: pytest.Pytester) -> None:
    hostile_run(pytester.path / "a", RECORDS)
    result = simbench(pytester, "merge", "a", "--output=both")
    text = plain(result)
    assert result.ret == 0
    assert r"\x1b]0;owned" in text
    pytester.makepyfile(TEST.format(evil=EVIL))
    result = run_pytest(pytester, "--sim=mujoco --reps=1 -k failing --sim-baseline=a --color=no")
    plain(result)
    result.stdout.fnmatch_lines(["*comparison with the baseline*"])


def test_a_usage_error(pytester: pytest.Pytester) -> None:
    line = {"schema": 1, EVIL: 1, "test": EVIL, "seed": EVIL}
    record = {**json.loads(RECORDS.read_text().splitlines()[0]), **line}
    folder = pytester.mkdir("\x1b[2Jrun")
    (folder / "records.jsonl").write_text(json.dumps(record) + "\n")
    result = run_pytest(
        pytester, "--color=no", "--sim-baseline", folder.name, ret=pytest.ExitCode.USAGE_ERROR
    )
    assert re.search(r"ERROR: .*\\x1b\[2Jrun", plain(result))
    assert re.search(r"merge: .*\\x1b\[2Jrun", plain(simbench(pytester, "merge", folder.name)))


KEEP = ("--sim-trace=on", "--sim-record=mcap", "--sim-pictures", "--sim-video=on")


def content(folder: Path) -> dict[str, bytes]:
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_links_in_a_run_folder_are_not_followed(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All that a run leaves lies elsewhere, behind links; it is resumed and reported."""
    pytest.importorskip("av", reason="videos need the extra 'video'")
    monkeypatch.setenv("TMPDIR", str(pytester.mkdir("spare")))
    pytester.makepyfile(CLAIMING)
    run_pytest(pytester, "--sim=mujoco --reps=1 --sim-output=o", *KEEP)
    run, elsewhere = pytester.path / "o", pytester.mkdir("elsewhere")
    for name in ("repeatability.jsonl", "thresholds.jsonl"):
        (run / name).touch()
    (run / "repeatability").mkdir()
    names = {path.name for path in run.iterdir()} - {"records.jsonl"}
    assert names >= {"tasks.jsonl", "thresholds.jsonl", "logs", "traces", "pictures", "videos"}
    for name in names:
        (run / name).rename(elsewhere / name)
        (run / name).symlink_to(elsewhere / name)
    before = content(elsewhere)
    resumed = run_pytest(pytester, "--sim=mujoco --reps=2 --sim-resume=o", *KEEP, passed=1)
    reported = simbench(pytester, "report", "o", "--record=mcap")
    assert content(elsewhere) == before
    assert len((run / "records.jsonl").read_text().splitlines()) == 2
    assert not (run / "report.html").is_symlink()
    for result in (resumed, reported):
        said = result.stdout.str() + result.stderr.str()
        assert "Traceback" not in said
        assert "INTERNALERROR" not in said
        assert "leads out of its folder or is a link" in said


def test_a_report_writes_through_no_temporary_name(tmp_path: Path) -> None:
    """Links of the names that this process once gave to its temporary files."""
    pytest.importorskip("av", reason="videos need the extra 'video'")
    run, victim = RunFolder(tmp_path / "run"), tmp_path / "victim"
    run.append(record(1))
    (tmp_path / "run" / TASKS).write_text("garbage\n")
    victim.write_text("secret")
    names = ("report.html", "report.md", "report.csv", "records.jsonl", "tasks.jsonl", "x.mp4")
    for name in names:
        for part in (f".{name}.{os.getpid()}.part", f"{name}.{os.getpid()}.part", f".{name}.part"):
            (tmp_path / "run" / part).symlink_to(victim)
    assert write_files(run.path, Report.of(run.read())).complete
    assert run.repair()
    film = Film(tmp_path / "run", "x.mp4")
    film.take(0.0, np.zeros((36, 48, 3), np.uint8))
    film.finish()
    assert film.problem == ""
    assert victim.read_text() == "secret"
