"""What execnet does by itself, and must not: stray modules, and words on the terminal."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from execnet.gateway_io import popen_bootstrapline

from pytest_simbench.client.connection import BOOTSTRAP
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from tests.tiny import Falling


def test_modules_of_the_current_folder_are_not_imported(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert popen_bootstrapline.startswith(BOOTSTRAP)
    for name in ("queue", "tempfile", "ctypes", "struct", "json"):
        (tmp_path / f"{name}.py").write_text("raise RuntimeError('stray')")
    monkeypatch.chdir(tmp_path)
    record, error = Repetition(Experiment(case, Falling()), 1).run()
    assert (record.status, error) == ("ok", None)


RAISES = """
import gc, time, types
from pathlib import Path
from pytest_simbench.client.connection import Connection
module = types.ModuleType("module")
module.__file__ = "FILE"
connection = Connection(None, None, {}, None)
connection.open(module, {})
print(connection.receive(60.0) is not None)
time.sleep(1.0)
connection.cut()
connection.close()
del connection
gc.collect()
"""


def test_an_error_that_nobody_asked_for_is_not_printed(tmp_path: Path) -> None:
    there = tmp_path / "there.py"
    there.write_text("if __name__ == '__channelexec__': raise ValueError('late')")
    script = RAISES.replace("FILE", str(there))
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert (done.stdout, done.stderr) == ("True\n", "")
