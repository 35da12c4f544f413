"""The command `simbench` as a user types it, in a process of its own or in this one."""

from __future__ import annotations

import os
import sys

import pytest

from pytest_simbench.cli.main import BAD_INPUT, main
from tests.approval import assert_approved_message


def simbench(pytester: pytest.Pytester, *words: str) -> pytest.RunResult:
    """What it prints and how it ends. It draws where the test's inner runs of pytest do."""
    undrawn = "tests.undrawn" in os.environ["PYTEST_ADDOPTS"]
    module = "tests.undrawn" if undrawn else "pytest_simbench"
    return pytester.run(sys.executable, "-m", module, *words)


def said(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command line in this process."""
    try:
        status = main(words)
    except SystemExit as error:
        status = int(error.code or 0)
    out, err = capsys.readouterr()
    if status == BAD_INPUT and not err.startswith("usage:"):  # help is as wide as the terminal
        assert_approved_message(err)
    return status, out, err
