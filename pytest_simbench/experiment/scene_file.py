"""A user's file as a scene: read by the engine whose format it is, in a worker of that engine."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from pytest_simbench.client.environments import Environment, interpreter, missing
from pytest_simbench.client.errors import Where, WorkerError
from pytest_simbench.client.launch import Launch
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.description.carried import Carried
from pytest_simbench.description.mjcf_check import check_mjcf
from pytest_simbench.description.urdf_scene import read_urdf_scene
from pytest_simbench.ground.errors import DescriptionError
from pytest_simbench.scene import Scene, Start
from pytest_simbench.simulator.info import SimulatorInfo
from pytest_simbench.simulator.registry import adapter, address, registered

URDF = ".urdf"
"""Ending of scenes that need no engine to be read."""

NOT_YET = {
    **dict.fromkeys((".sdf", ".world"), "sdformat-mjcf"),
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), "usd2mjcf"),
}
"""By endings of scenes that nobody here reads yet: a package on PyPI that converts them to MJCF."""


@dataclass(frozen=True)
class SceneFile:
    """A file that was read.

    Attributes:
        path: absolute.
        scene: what was carried of it, with its keyframes as starts.
        account: what became of each quantity.
    """

    path: Path
    scene: Scene
    account: tuple[Carried, ...]


def read_scene_file(path: str | Path) -> SceneFile:
    """Read a file by the first engine here that reads such files; a URDF without any.

    What was read is kept, until the file changes. (Files that it includes and meshes are not
    looked at for that.)

    Raises:
        DescriptionError: no such file, something in it that cannot be, or no engine here that reads
            it; one sentence with the file, and its line where that is known.
    """
    whole = Path(path).absolute()
    if whole.suffix.lower() == URDF:
        return SceneFile(whole, *read_urdf_scene(whole))
    name = _reader(whole).name
    check_mjcf(str(whole))
    status = whole.stat()
    return _ask(name, whole, status.st_size, status.st_mtime_ns)


def _reader(path: Path) -> SimulatorInfo:
    """The facts of the engine that reads files of that ending."""
    ending = path.suffix.lower()
    infos = [adapter(name).info for name in registered()]
    reading = [info for info in infos if ending in info.reads]
    here = [info for info in reading if missing(info) is None]
    if here:
        return here[0]
    if reading:
        raise DescriptionError(
            f"{path} is read by {reading[0].title}, which is not here: {reading[0].install}"
        )
    known = ", ".join(sorted({URDF, *(ending for info in infos for ending in info.reads)}))
    if ending in NOT_YET:
        raise DescriptionError(
            f"{path}: {ending} files are not read yet; convert it to MJCF, by {NOT_YET[ending]}"
        )
    raise DescriptionError(f"{path}: no engine here reads {ending or 'such'} files; give {known}")


@cache
def _ask(name: str, path: Path, size: int, modified: int) -> SceneFile:
    """What a simulator reads of a file, of which size and time of change tell whether it is new."""
    info = adapter(name).info
    with tempfile.NamedTemporaryFile(prefix="simbench-reader-", suffix=".log") as log:
        launch = Launch(
            address(name) or "",
            python=interpreter(info),
            environment=Environment.of(info).variables(),
            log=Path(log.name),
        )
        try:
            process = WorkerProcess(launch, Where(name, "headless", phase="reading"))
            try:
                process.construct("default")
                answer = process.request("read_file", path=str(path))
            finally:
                process.close()
        except WorkerError as error:
            raise DescriptionError(error.what) from None
    account = tuple(Carried.from_wire(line) for line in answer["account"])
    keyframes = tuple(map(Start.from_wire, answer["starts"]))
    scene = replace(Scene.from_wire(answer["scene"]), starts=keyframes)
    return SceneFile(path, scene, account)
