"""The runs of a bisection: what pytest is called with, and what is read of its answer."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from pytest_simbench.cli.search import Search
from pytest_simbench.cli.values import BadInput
from pytest_simbench.records.description import TaskDescription
from pytest_simbench.records.folder import RunFolder
from tests.records.build import METRICS, record

CASES = """<testsuites><testsuite>
<testcase classname="tests.test_a" name="test_one[sim==1.8-headless]"><properties>
<property name="crashed" value="0"/><property name="placing 1: repetitions" value="1"/>
</properties></testcase>
<testcase classname="tests.test_a" name="test_two[sim==1.8-headless]"><failure message="Failed: no
 more">x</failure></testcase>
<testcase classname="tests.test_a" name="test_three[sim==1.9-headless]"/>
</testsuite></testsuites>"""


class Pytest:
    """Ends with a code and some lines, and tells JUnit what it is given."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.junit, self.code, self.lines = CASES, 1, ""
        self.asked: list[list[str]] = []
        monkeypatch.setattr(subprocess, "run", self)

    def __call__(self, command: list[str], **how: Any) -> Any:
        *words, junit, prefix = command
        flag, _, path = junit.partition("=")
        assert (flag, prefix) == ("--junitxml", "--junitprefix=")
        if self.junit:
            Path(path).write_text(self.junit)
        self.asked.append(words)
        return SimpleNamespace(returncode=self.code, stdout=self.lines)


def test_what_pytest_is_called_with_and_what_it_tells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first run makes the folder, others go on with it; tests may fail, as claims do."""
    inner = Pytest(monkeypatch)
    search = Search("sim", "placed", ("1.8", "1.9"), tmp_path, ["tests", "-k", "a"])
    search.run(0, 1)
    assert search.ran == {
        "tests.test_a.test_one[sim==1.8-headless]": "",
        "tests.test_a.test_two[sim==1.8-headless]": "Failed: no  more",
        "tests.test_a.test_three[sim==1.9-headless]": "it repeats no task",
    }
    for name, test, release in (("one", "test_one", "1.8"), ("other", "test_four", "1.9")):
        test = f"tests/test_a.py::{test}[sim=={release}-headless]"
        RunFolder(tmp_path).describe(TaskDescription(name, METRICS))
        RunFolder(tmp_path).append(record(1, simulator=f"sim=={release}", task=name, test=test))
    inner.junit = ""
    search.run(1)
    head = [sys.executable, "-m", "pytest", "tests", "-k", "a"]
    assert inner.asked == [
        [*head, f"--sim-output={tmp_path}", "--sim-name=sim==1.8,sim==1.9",
         "--sim-install-missing", "-q"],
        [*head, f"--sim-resume={tmp_path}", "--sim-name=sim==1.9", "--sim-install-missing", "-q"],
    ]  # fmt: skip
    assert search.result(0).records[0].task == "one"
    told = r"no test with placed has run on sim==1.9 \(it repeats no task\); choose one test, with"
    with pytest.raises(BadInput, match=told):
        search.result(1)


def test_a_run_that_ends_with_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    inner = Pytest(monkeypatch)
    search = Search("sim", "placed", ("1.8", "1.9"), tmp_path, [])
    inner.code, inner.lines = 4, "first\nsecond\n\n third\n" + "x" * 700
    with pytest.raises(BadInput) as told:
        search.run(1)
    words = "the run on sim==1.9 ended with exit code 4: second  third "
    assert str(told.value) == words + "x" * (600 - len("second  third "))
    inner.code = 0
    inner.junit = CASES.replace("no\n", "a is not resumed, since b\n")
    with pytest.raises(BadInput, match="^a is not resumed, since b  more; remove that folder to"):
        search.run(0)
