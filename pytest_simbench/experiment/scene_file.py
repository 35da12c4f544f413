"""Users' scenes: a file is read by the engine whose format it is, in a worker of its own."""

from __future__ import annotations

import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from pytest_simbench.client.environments import missing
from pytest_simbench.client.errors import Where, WorkerError
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.description.carried import Carried
from pytest_simbench.description.urdf_check import read_xml
from pytest_simbench.experiment.case import Case
from pytest_simbench.ground.errors import DescriptionError
from pytest_simbench.scene import Scene
from pytest_simbench.simulator.registry import adapter, registered

TIMEOUT = 120.0
"""For reading a file [s]."""

NOT_YET = {
    ".sdf": "SDF", ".world": "SDF", ".usd": "USD", ".usda": "USD", ".usdc": "USD", ".usdz": "USD",
}  # fmt: skip
"""Formats that are known and not read."""


@dataclass(frozen=True)
class SceneFile:
    """A file that was read.

    Attributes:
        path: absolute.
        scene: that it describes.
        account: what of the file the scene has, and what not.
        timestep: that the file asks for [s].
    """

    path: Path
    scene: Scene
    account: tuple[Carried, ...]
    timestep: float


def read_scene_file(path: str | Path) -> SceneFile:
    """The scene of a file, as it is now; a file that did not change is read once.

    Raises:
        DescriptionError: it cannot be read; one sentence with file and, where known, line.
    """
    at = Path(path).absolute()
    reader = _reader(at)
    read_xml(str(at), "the scene")  # sizes, entities, what is no XML at all
    status = at.stat()
    return _read(at, reader, status.st_mtime_ns, status.st_size)


def _reader(path: Path) -> str:
    """The simulator that reads such a file."""
    ending = path.suffix.lower()
    endings: dict[str, str] = {}
    for name in registered():
        endings |= dict.fromkeys(adapter(name).info.reads, name)
    if ending in endings:
        name = endings[ending]
        if absent := missing(adapter(name).info):
            raise DescriptionError(f"{path} is read by {name}, and {absent}")
        return name
    known = NOT_YET.get(ending)
    what = f"{known} is not read yet; convert it" if known else "no such scenes are read"
    raise DescriptionError(f"{path}: {what}; known endings: {', '.join(sorted(endings))}")


@lru_cache(maxsize=32)
def _read(path: Path, reader: str, _changed: int, _size: int) -> SceneFile:
    where = Where(reader, "headless")
    with tempfile.TemporaryDirectory() as folder:
        case = Case.of(
            reader, test="scene_file", mode="headless", profile="default", folder=Path(folder)
        )
        process = WorkerProcess(case.launch("scene"), where)
        try:
            process.deadline = time.monotonic() + TIMEOUT
            process.construct(case.profile, {}, gui=False)
            answer = process.request("read_file", path=str(path))
        except WorkerError as error:
            raise DescriptionError(error.what) from None
        finally:
            with suppress(WorkerError):
                process.close(timeout=5.0)
    return SceneFile(
        path,
        Scene.from_wire(answer["scene"]),
        tuple(map(Carried.from_wire, answer["account"])),
        float(answer["timestep"]),
    )
