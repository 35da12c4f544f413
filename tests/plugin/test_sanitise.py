"""What a stranger's text may do to the terminal of who runs pytest: nothing."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from tests.cli.command import simbench
from tests.hostile import assert_harmless_terminal
from tests.plugin.inner import run_pytest

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
