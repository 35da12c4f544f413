"""Engines that the operating system's packages bring: the system's Python is asked, for real."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pytest
from pytest_simbench.sims.mujoco.adapter import MuJoCo

from pytest_simbench.client.environments import interpreter, missing, outside
from pytest_simbench.client.system import SystemPython
from pytest_simbench.simulator import SimulatorInfo

ABSENT = "no_such_module_here"


@pytest.fixture
def info() -> SimulatorInfo:
    """A simulator whose engine no interpreter has."""
    return replace(
        MuJoCo.info,
        name="packaged",
        distribution="pip",
        modules=(ABSENT,),
        system_packages=("python3-numpy", "python3-packaged"),
        install="apt-get install python3-numpy python3-packaged",
    )


def home(monkeypatch: pytest.MonkeyPatch, path: str | Path) -> None:
    """Let another interpreter be the system's."""
    monkeypatch.setattr(SystemPython, "python", Path(path))


def script(folder: Path, text: str) -> Path:
    """An executable that is no Python."""
    path = folder / "python3"
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return path


def test_absent_engine(info: SimulatorInfo, monkeypatch: pytest.MonkeyPatch) -> None:
    home(monkeypatch, sys.executable)
    assert missing(info) == (
        f"packaged comes with packages of the system, and {sys.executable} has no module {ABSENT}; "
        "on Debian and Ubuntu: apt-get install python3-numpy python3-packaged; or name another: "
        "--sim-python packaged=PATH"
    )
    assert interpreter(info) is None


def test_one_module_of_several_is_enough(
    info: SimulatorInfo, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A package that is not there has no modules; asking for one is an error in Python."""
    home(monkeypatch, sys.executable)
    versions = f"{ABSENT}.eight|{ABSENT}.nine"
    assert SystemPython(replace(info, modules=(f"{versions}|json.decoder",))).problem is None
    told = str(missing(replace(info, modules=(versions,))))
    assert f"has no module {ABSENT}.eight or {ABSENT}.nine; on Debian" in told


def test_engine_in_the_systems_python(
    info: SimulatorInfo, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The system's Python finds a module that this process does not find."""
    home(monkeypatch, sys.executable)
    (tmp_path / f"{ABSENT}.py").write_text("raise SystemExit('a probe imports no engine')\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    info = replace(info, distribution="numpy")  # another question than that of the test above
    other = outside(info)
    assert isinstance(other, SystemPython)
    assert missing(info) is None
    assert interpreter(info) == sys.executable
    assert other.version() == sys.modules["numpy"].__version__
    assert other.place == f"in the system's Python, {sys.executable}"


def test_a_file_in_the_working_folder_is_no_engine(
    info: SimulatorInfo, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    home(monkeypatch, sys.executable)
    monkeypatch.delenv("PYTHONPATH", raising=False)
    monkeypatch.chdir(tmp_path)
    Path("another_absent_module.py").touch()
    Path("json.py").write_text("raise RuntimeError('stray')")
    info = replace(info, modules=("another_absent_module",))
    assert "no module another_absent_module" in str(SystemPython(info).problem)


def test_an_engine_that_is_importable_here_runs_here(info: SimulatorInfo) -> None:
    info = replace(info, modules=("json",))
    assert outside(info) is None
    assert missing(info) is None
    assert interpreter(info) is None


def test_no_such_interpreter(
    info: SimulatorInfo, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    home(monkeypatch, tmp_path / "python3")
    assert f"{tmp_path / 'python3'} does not run" in str(missing(info))
    assert SystemPython(info).version() is None


@pytest.mark.parametrize("text", ["exit 1", "echo hello", "kill -9 $$"])
def test_something_that_is_no_interpreter(
    info: SimulatorInfo, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, text: str
) -> None:
    home(monkeypatch, script(tmp_path, text))
    assert "does not run" in str(missing(info))


def test_python_that_is_too_old(
    info: SimulatorInfo, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    answer = '{"python": [3, 10, 12], "version": "1", "absent": []}'
    home(monkeypatch, script(tmp_path, f"echo '{answer}'"))
    assert "is Python 3.10.12, older than 3.11" in str(missing(info))
