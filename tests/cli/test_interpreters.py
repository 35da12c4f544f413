"""`--sim-python` and `--sim-spec`: whatever cannot be one is said before a worker is started."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from pytest_simbench.cli.interpreters import checked_specification, interpreter_path
from pytest_simbench.cli.values import BadInput
from tests.approval import assert_approved
from tests.plugin.inner import wrapper

NO_INTERPRETERS = """/nowhere/python no-such-program ~/no-such-file/python ~no-such-user/python
folder ./folder ./venv ./plain.txt folder//none /dev/null"""


def test_no_interpreter(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    wrapper(tmp_path / "venv" / "bin" / "python")
    wrapper(tmp_path / "plain.txt").chmod(0o644)
    told = []
    for text in NO_INTERPRETERS.split():
        with pytest.raises(BadInput) as refused:
            interpreter_path(text, "--sim-python=x", tmp_path)
        told.append(f"{text}: {refused.value}".replace(f"{tmp_path}", "DIR"))
    assert_approved("no_interpreters", "\n".join(told))


def test_paths_become_absolute(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    python = wrapper(tmp_path / "a, b" / "bin" / "python")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("PATH", f"{python.parent}:{os.environ['PATH']}")
    for text in (str(python), "a, b/bin/python", "./a, b//bin///python", f"/{python}", "python",
                 "~/a, b/bin/python", "venv/../a, b/bin/python"):  # fmt: skip
        assert interpreter_path(text, "", tmp_path) == str(python)


def test_a_link_is_not_followed(tmp_path: Path) -> None:
    """A virtual environment's interpreter is a link, and knows by its path where it belongs."""
    (tmp_path / "link").symlink_to(sys.executable)
    assert interpreter_path("./link", "", tmp_path) == str(tmp_path / "link")


def test_a_worker_runs_in_a_folder_of_any_name(pytester: pytest.Pytester) -> None:
    wrapper(pytester.path / """a//b, it's "50%" ü""" / "python")
    pytester.makepyfile(
        """
        from pytest_simbench.scene import Scene

        def test_it(sim):
            sim(Scene("s")).wait(0.1)
        """
    )
    path = """a//b, it's "50%" ü/python"""
    result = pytester.runpytest_subprocess("--sim=mujoco", f"--sim-python=mujoco={path}")
    result.assert_outcomes(passed=1)


WRONG = """
garbage popen// popen//pyhton=x popen//_spec=x popen//python= popen=3 ssh ssh= python=/bin/sh
popen//ssh=host popen//popen popen//execmodel=magic popen//nice=very socket=host socket=host:99999
socket=:22 socket=host:0 socket=host:65536 socket=host:x popen//env:=3 popen//via=other
popen//python=/nowhere/python popen//python=' popen//dont_write_bytecode=1
"""


def test_no_specification() -> None:
    told = []
    for text in WRONG.split():
        with pytest.raises(BadInput) as refused:
            checked_specification(text, "--sim-spec=x")
        told.append(f"{text}: {refused.value}")
    assert_approved("specifications", "\n".join(told))


@pytest.mark.parametrize(
    "text",
    ["popen", f"popen//python={sys.executable} -u", "ssh=user@host//python=/usr/bin/python3",
     "socket=localhost:65535", "popen//env:A=b//nice=-5//chdir=/tmp//dont_write_bytecode",
     "socket=h:1", "ssh=-p 2222 host//ssh_config=~/c//execmodel=thread", "vagrant_ssh=box"],
)  # fmt: skip
def test_specifications(text: str) -> None:
    assert checked_specification(text, "") == text
