"""CoppeliaSim's library in this process, by its C interface.

The program is the user's own: `$COPPELIASIM_ROOT_DIR` names the folder that holds it. It is loaded
in the worker alone, never in pytest's process. It replaces handlers of signals, and writes into the
user's settings and into a folder for temporary files; here it gets a folder of this process for
both, which is removed when it ends.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.simulator import SimulatorError, UnavailableError
from pytest_simbench.simulator.base import signals_kept

ROOT = "COPPELIASIM_ROOT_DIR"
"""Variable that names the program's folder, as the program's own clients read it."""

LIBRARY = "libcoppeliaSimHeadless.so"

NEEDED = "simGetPropertyInfo"
"""A function that came with the properties of objects, by which this adapter sets everything."""

ENGINES: dict[str, tuple[tuple[int, int], tuple[str, ...]]] = {
    "bullet": ((0, 0), ("simBullet-2-78",)),
    "bullet283": ((0, 283), ("simBullet-2-83",)),
    "ode": ((1, 0), ("simODE",)),
    "newton": ((3, 0), ("simNewton",)),
    "mujoco": ((4, 0), ("simMujoco", "simAssimp")),
}
"""By engine: what the program calls it (type and version), and its plug-ins. Without the one that
writes meshes a world of MuJoCo's stands still, and nothing says so."""

SCENE, APP, ALL, NONE = -12, -13, -2, -1
"""Handles: of the scene, of the program, of every object, of none (simConst.h)."""

SANDBOX = 8
"""Kind of the program's own script (sim_scripttype_sandbox)."""

HANDLED = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGSEGV)
"""Signals that the program takes over."""

OWN_SETTINGS = ".CoppeliaSim/usrset.txt"
"""The user's settings of the program, in the folder of such."""

SETTINGS = "verbosity = errors\nrunAddOns = false\npreferredSandboxLang = bareLua\n"
"""No add-ons: one of them opens a port. The program's own script is empty, so that nothing waits
for another process."""

FOLDERS = ("XDG_CONFIG_HOME", "TMPDIR")
"""Variables that say where the program writes."""


def root() -> Path:
    """The program's folder, which is there (`SimulatorInfo.program`)."""
    return Path(os.environ[ROOT])


def check_engine(engine: str) -> None:
    """Raise `UnavailableError` where the program was installed without an engine."""
    lacks = {
        name: [file for p in plugins if not (root() / (file := f"lib{p}.so")).is_file()]
        for name, (_, plugins) in ENGINES.items()
    }
    if lacks[engine]:
        there = ", ".join(name for name, files in lacks.items() if not files)
        raise UnavailableError(
            f"the CoppeliaSim in {root()} has no {lacks[engine][0]}, and so not engine={engine}; "
            f"choose from {there or 'none: it has no engine at all'}"
        )


@cache
def library() -> Any:
    """The program's library, not started.

    Raises:
        UnavailableError: it is not there, does not load, or is too old.
    """
    path = root() / LIBRARY
    try:
        found = ctypes.CDLL(str(path))
    except OSError as error:
        raise UnavailableError(f"{path} does not load: {error}; install what it needs") from error
    if not hasattr(found, NEEDED):
        raise UnavailableError(
            f"{path} has no {NEEDED}: it is of a CoppeliaSim older than 4.10; install that"
        )
    found._simGetObject.restype = ctypes.c_void_p
    for name in (
        "simGetLastError",
        "simGetStringProperty",
        "simGetFloatArrayProperty",
        "simGetIntArrayProperty",
    ):
        getattr(found, name).restype = ctypes.c_void_p
    return found


def call(name: str, *arguments: Any) -> int:
    """Call a function of the program that answers with a negative number when it fails.

    Raises:
        SimulatorError: it failed; with the program's own words.
    """
    answer = int(getattr(library(), name)(*arguments))
    if answer < 0:
        raise SimulatorError(f"CoppeliaSim's {name} failed: {last_error()}")
    return answer


def last_error() -> str:
    """What the program says of the last call that failed."""
    return _text(library().simGetLastError()) or "it says nothing"


@cache
def _folder() -> Path:
    """Where the program writes: it asks once in the life of a process."""
    return Path(tempfile.mkdtemp(prefix="simbench-coppeliasim-"))


def start() -> None:
    """Start the program, with an empty scene."""
    made = library()
    own = _folder() / OWN_SETTINGS
    own.parent.mkdir(parents=True, exist_ok=True)
    own.write_text(SETTINGS, "utf-8")
    before = {name: os.environ.get(name) for name in FOLDERS}
    os.environ.update(dict.fromkeys(FOLDERS, str(_folder())))
    with signals_kept(*HANDLED):
        made.simInitialize(os.fsencode(root()), 0)
    for name, value in before.items():
        os.environ.pop(name) if value is None else os.environ.update({name: value})


def end() -> None:
    """End the program, and remove what it wrote."""
    sys.stderr.flush()
    with signals_kept(*HANDLED):
        library().simDeinitialize()
    shutil.rmtree(_folder(), ignore_errors=True)


def version() -> str:
    """Of the program that runs."""
    return ".".join(get_text(APP, "productVersion").split(".")[:3])  # the fourth is a revision


def forget_events() -> None:
    """Empty the queue of what the program would tell its clients of: stepped from outside it grows
    with each step and each joint that moves, without end."""
    own = call("simGetScriptHandleEx", SANDBOX, NONE, None)
    call("simExecuteScriptString", own, b"sim.getGenesisEvents()@lua", 0)


def stepper(timestep: float) -> Callable[[], bool]:
    """What has the engine make one step of that length [s], and says whether it did."""
    step, length = library().simHandleDynamics_D, ctypes.c_double(timestep)
    return lambda: step(length) > 0


def address(handle: int) -> int:
    """Of an object, by which some engines order bodies."""
    return int(library()._simGetObject(handle))


def doubles(values: Sequence[float] | FloatArray) -> Any:
    """An array of C."""
    flat = np.ravel(np.asarray(values, dtype=float))
    return (ctypes.c_double * len(flat))(*flat)


def integers(values: Sequence[int]) -> Any:
    """An array of C."""
    return (ctypes.c_int * len(values))(*values)


def set_int(handle: int, name: str, value: int) -> None:
    call("simSetIntProperty", ctypes.c_longlong(handle), name.encode(), int(value))


def get_int(handle: int, name: str) -> int:
    found = ctypes.c_int()
    call("simGetIntProperty", ctypes.c_longlong(handle), name.encode(), ctypes.byref(found))
    return found.value


def set_bool(handle: int, name: str, value: bool) -> None:
    call("simSetBoolProperty", ctypes.c_longlong(handle), name.encode(), int(value))


def get_bool(handle: int, name: str) -> bool:
    found = ctypes.c_int()
    call("simGetBoolProperty", ctypes.c_longlong(handle), name.encode(), ctypes.byref(found))
    return bool(found.value)


def set_float(handle: int, name: str, value: float) -> None:
    call("simSetFloatProperty", ctypes.c_longlong(handle), name.encode(), ctypes.c_double(value))


def get_float(handle: int, name: str) -> float:
    found = ctypes.c_double()
    call("simGetFloatProperty", ctypes.c_longlong(handle), name.encode(), ctypes.byref(found))
    return found.value


def set_floats(handle: int, name: str, values: Sequence[float] | FloatArray) -> None:
    data = doubles(values)
    call("simSetFloatArrayProperty", ctypes.c_longlong(handle), name.encode(), data, len(data))


def get_floats(handle: int, name: str) -> FloatArray:
    return np.array(_array("simGetFloatArrayProperty", ctypes.c_double, handle, name))


def _array(function: str, kind: Any, handle: int, name: str) -> list[Any]:
    count = ctypes.c_int()
    found = getattr(library(), function)(
        ctypes.c_longlong(handle), name.encode(), ctypes.byref(count)
    )
    if not found:
        raise SimulatorError(f"CoppeliaSim has no property {name}: {last_error()}")
    values = list((kind * count.value).from_address(found))
    library().simReleaseBuffer(ctypes.c_void_p(found))
    return values


def get_integers(handle: int, name: str) -> tuple[int, ...]:
    return tuple(_array("simGetIntArrayProperty", ctypes.c_int, handle, name))


def set_vector(handle: int, name: str, values: Sequence[float] | FloatArray) -> None:
    call("simSetVector3Property", ctypes.c_longlong(handle), name.encode(), doubles(values))


def get_vector(handle: int, name: str) -> FloatArray:
    found = doubles([0.0] * 3)
    call("simGetVector3Property", ctypes.c_longlong(handle), name.encode(), found)
    return np.array(found)


def get_text(handle: int, name: str) -> str:
    return _text(library().simGetStringProperty(ctypes.c_longlong(handle), name.encode()))


def _text(found: int | None) -> str:
    if not found:
        return ""
    text = ctypes.string_at(found).decode("utf-8", "replace")
    library().simReleaseBuffer(ctypes.c_void_p(found))
    return text


def get_pose(handle: int) -> Pose:
    """Of an object, in the world; the program has quaternions x, y, z, w."""
    found = doubles([0.0] * 7)
    call("simGetObjectPose_D", handle, NONE, found)
    return _pose(found)


def _pose(found: Any) -> Pose:
    return Pose.from_array([*found[:3], found[6], *found[3:6]])


def set_pose(handle: int, pose: Pose) -> None:
    w, x, y, z = pose.quaternion
    call("simSetObjectPose_D", handle, NONE, doubles([*pose.position, x, y, z, w]))


def local_pose(handle: int) -> Pose:
    """Of an object, in what it hangs on, a joint at zero."""
    found = doubles([0.0] * 7)
    call("simGetPoseProperty", ctypes.c_longlong(handle), b"pose", found)
    return _pose(found)
