"""`--policies`: which tests are made of which policies, and what is said of a file without any."""

from __future__ import annotations

import shlex
from fnmatch import fnmatchcase
from pathlib import Path

import pytest

import pytest_simbench.motion.planning  # noqa: F401 - pytester would import native modules a second time
from tests.plugin.conftest import Configure
from tests.plugin.inner import records, run_pytest
from tests.plugin.test_input import refusal

MINE = """
import numpy as np
from pytest_simbench.scene.policy import Policy

class Still(Policy):
    rate = 10.0
    task = "reaching"

    def reset(self, seed):
        self.start = None

    def act(self, seen):
        self.start = seen.position[:7] if self.start is None else self.start
        return self.start

class Other(Still):
    name, task = "other", "elsewhere"

policies = {"still": Still(), "other": Other(), "nothing": lambda seen: None}
"""

TESTS = """
import pytest
from pytest_simbench.tasks import Reaching

@pytest.mark.policies("reaching", "scripted")
def test_reaching(repeat, policy):
    repeat(Reaching(policy, seconds=0.2, settle=0.0, rate=10.0))
"""


@pytest.mark.parametrize("below", [".", "sub"])
def test_the_command_that_runs_a_failed_one_again_names_its_files(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, below: str
) -> None:
    claiming = TESTS.replace("    repeat(", "    assert not repeat(").replace(
        "y):", "y, scene_file):"
    )
    pytester.makepyfile(mine=MINE, test_it=claiming)
    pytester.makefile(".xml", scene="<mujoco/>")
    pytester.makefile(".toml", own="simulator = 'mujoco'")
    pytester.makeini("[pytest]")
    (pytester.path / "sub").mkdir()
    monkeypatch.chdir(below)
    up = "../" * (below != ".")
    files = (
        f"--sim-scene={up}scene.xml --sim-profile={up}own.toml --sim-output={up}o {up}test_it.py"
    )
    policies = f"{up}mine.py:nothing,{up}mine.py:still"
    result = run_pytest(pytester, f"--sim=mujoco --reps=1 --policies={policies} {files}", failed=2)
    for name in ("nothing", "still"):
        result.stdout.fnmatch_lines([f"FAILED *test_reaching[[]mujoco-headless-{name}[]]*"])
    again = next(line for line in result.outlines if "again: pytest" in line)
    if not up:
        assert f"--sim-policies={policies}" in again
    run_pytest(pytester, "", *shlex.split(again.partition("again: pytest ")[2]), failed=1)
    told = (pytester.path / "o" / "report.md").read_text().partition("again: `pytest ")[2]
    monkeypatch.chdir(pytester.path)
    run_pytest(pytester, "", *shlex.split(told.partition("`")[0]), failed=1)


def test_a_test_is_made_for_each_policy_of_its_task(pytester: pytest.Pytester) -> None:
    mine = MINE.replace("import numpy as np", "import beside")  # a module in the same folder
    pytester.makepyfile(mine=mine, beside="", test_it=TESTS)
    pytester.makepyfile(one="def policy(seen):\n    return None\n")
    run_pytest(
        pytester,
        "--sim=mujoco --reps=2 --sim-jobs=2 --sim-output=out --policies=mine.py,one.py",
        passed=3,
    )
    found = records("out")
    name = "test_it.py::test_reaching[mujoco-headless-{}]"
    assert [r["test"] for r in found[::2]] == [name.format(n) for n in ("still", "nothing", "one")]
    assert [r["variant"] for r in found[::2]] == ["still", "nothing", "one"]
    assert [r["settings"]["task.policy"] for r in found[::2]] == ["still", "nothing", "one"]
    assert len({r["settings"]["task.policy_digest"] for r in found}) == 3
    assert all(r["reused_worker"] for r in found[2:])


def test_without_policies_the_shipped_ones_wait_for_their_file(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_it=TESTS.replace('"reaching", "scripted"', '"pushing", "scripted"'))
    for arguments, shown in (
        ((), "test_it.py::test_reaching[[]mujoco-headless-none[]]"),
        (("test_it.py",), "test_it.py::test_reaching[[]mujoco-headless-scripted[]]"),
    ):
        result = run_pytest(pytester, "--sim=mujoco --collect-only -q", *arguments)
        result.stdout.fnmatch_lines([shown, "1 test collected*"])


@pytest.mark.parametrize(
    ("spec", "sentence"),
    [
        ("gone.py", "*--policies=gone.py: there is no such file; give FILE.py or FILE.py:NAME"),
        ("mine.py:third", "*mine.py has no policy 'third'; choose from still, other, nothing"),
        ("empty.py", "*empty.py defines neither a 'policy' nor a dict of 'policies'"),
        ("list.py", "*list.py: policies is list, no dict of policies"),
        ("broken.py", "*broken.py cannot be imported: ModuleNotFoundError: No module named 'gone'"),
        ("ends.py", "*ends.py cannot be imported: SystemExit: 3"),
        ("number.py", "*number.py: 3 is no policy: give a function of an observation*"),
        ("text.txt", "*text.txt is no file of Python"),
        ("mine.py:still,mine.py", "*two policies are named 'still'; give one of them another*"),
    ],
)
def test_what_is_no_policy(configure: Configure, spec: str, sentence: str) -> None:
    files = {
        "mine.py": MINE, "empty.py": "", "list.py": "policies = [3]", "broken.py": "import gone",
        "number.py": "policy = 3", "ends.py": "raise SystemExit(3)", "text.txt": "policy = 3",
    }  # fmt: skip
    for name, text in files.items():
        Path(name).write_text(text)
    assert fnmatchcase(refusal(configure, f"--policies={spec}"), sentence)
