"""What only CoppeliaSim's adapter has to show: what it says of a program that is not whole, that
its files are gone, and what a worker tells that was ended.

The program is the user's own: where it is not, what needs it is skipped.
"""

from __future__ import annotations

import ctypes
import os
import signal
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from pytest_simbench.sims.coppeliasim import library
from pytest_simbench.sims.coppeliasim.adapter import CoppeliaSim
from pytest_simbench.sims.coppeliasim.readback import is_box

from pytest_simbench.client.environments import missing
from pytest_simbench.client.errors import EngineFailed, WorkerExited
from pytest_simbench.scene import Box, Pose, Scene
from pytest_simbench.simulator import UnavailableError
from pytest_simbench.tasks import Jitter, Stacking

from .worlds import Worlds

CUBE = Box("cube", (0.05, 0.05, 0.05), Pose.at(0.0, 0.0, 0.025), mass=0.1)
SCENE = Scene("one", (CUBE,))


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folder of a program that has a library and one engine, and neither is any."""
    for name in (library.LIBRARY, "libsimODE.so"):
        (tmp_path / name).write_text("no library")
    monkeypatch.setenv(library.ROOT, str(tmp_path))
    library.library.cache_clear()
    return tmp_path


def test_no_program(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert missing(CoppeliaSim.info) is None
    (root / library.LIBRARY).unlink()
    told = (
        f"coppeliasim is not here (COPPELIASIM_ROOT_DIR is {root}, which has no {library.LIBRARY}"
    )
    assert str(missing(CoppeliaSim.info)).startswith(told)
    monkeypatch.delenv(library.ROOT)
    assert missing(CoppeliaSim.info) == (
        "coppeliasim is not here (COPPELIASIM_ROOT_DIR is not set): set COPPELIASIM_ROOT_DIR to "
        "the folder of an installed CoppeliaSim 4.10"
    )
    with pytest.raises(UnavailableError, match="is not here"):
        CoppeliaSim(CoppeliaSim.profiles["default"]).load(SCENE)


def test_no_such_engine(root: Path) -> None:
    library.check_engine("ode")
    with pytest.raises(UnavailableError, match=r"no libsimNewton.so, .*newton; choose from ode$"):
        library.check_engine("newton")
    (root / "libsimMujoco.so").touch()
    with pytest.raises(UnavailableError, match=r"no libsimAssimp.so, .*mujoco; choose from ode$"):
        library.check_engine("mujoco")


def test_a_library_that_is_none(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UnavailableError, match=r"Headless.so does not load: .*install what it"):
        library.library()
    monkeypatch.setattr(ctypes, "CDLL", lambda path: object())
    with pytest.raises(UnavailableError, match=r"has no simGet.*: .* older than 4.10; install"):
        library.library()


def test_which_part_is_a_box() -> None:
    corners = np.array(list(product((-1.0, 1.0), repeat=3))) * (1.0, 2.0, 3.0)
    assert is_box(corners + 5.0)
    assert not is_box(corners[:7])
    assert not is_box(np.where(corners[:, 2:] > 0, 0.5 * corners, corners))  # the part of a bowl


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_worker_that_is_ended(number: signal.Signals) -> None:
    """The program is in the worker: no handler of its own hides the end."""
    with Worlds(CoppeliaSim) as worlds:
        world = worlds.load(SCENE)
        os.kill(worlds.worker.pid, number)
        with pytest.raises(WorkerExited, match=number.name):
            world.wait(5.0)


def test_its_files_are_gone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those in the user's folder and those of a run; and one worker loads world after world."""
    for name in ("HOME", *library.FOLDERS):
        monkeypatch.setenv(name, str(tmp_path))
    with Worlds(CoppeliaSim) as worlds:
        for _ in range(2):
            world = worlds.load(SCENE)
            world.wait(0.1)
            assert world.bodies[0, 2] == pytest.approx(0.025, abs=1e-3)
    assert not list(tmp_path.iterdir())


def test_springs_are_mujocos_alone() -> None:
    with (
        Worlds(CoppeliaSim) as worlds,
        pytest.raises(EngineFailed, match="drive=force needs engine=mujoco, not ode"),
    ):
        worlds.load(Stacking().scene(1, Jitter()), engine="ode")
