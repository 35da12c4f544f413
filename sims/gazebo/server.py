"""Gazebo's server in this process, stepped in lock-step.

A world of SDF goes in through a file. `TestFixture` is the one class of the bindings that gives the
entities and their components (the "ecm"): they come with the first step, and stay valid.

Two messages go to its services, here in protobuf's wire format: the worker needs no protobuf, and
no package of Gazebo's messages in the system's Python (protobuf.dev/programming-guides/encoding).
The names of Gazebo's Python modules carry the version of their library up to release 9.
"""

from __future__ import annotations

import importlib
import os
import re
import signal
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any
from uuid import uuid4
from weakref import ref

from pytest_simbench.simulator import SimulatorError, UnavailableError
from pytest_simbench.simulator.base import signals_kept

RELEASES: dict[str, tuple[str, str, str]] = {
    "8 (Harmonic)": ("gz.math7", "gz.transport13", "gz.sim8"),
    "9 (Ionic)": ("gz.math8", "gz.transport14", "gz.sim9"),
    "10 (Jetty)": ("gz.math", "gz.transport", "gz.sim"),
}
"""Modules of each release of gz-sim, as its and its libraries' python/CMakeLists.txt name them
(read at the tags gz-sim8_8.14.0, gz-sim9_9.5.0, gz-sim10_10.4.0). Those of 10 are 11's too."""

MODULES = tuple("|".join(names) for names in zip(*RELEASES.values(), strict=True))
"""What must be importable, for `SimulatorInfo.modules`."""

LIBRARY = re.compile(r"/libgz-sim\d*\.so\.(\d+\.\d+\.\d+)")
"""File of gz-sim's own library. Its Python package has no metadata that tells a version."""


@dataclass(frozen=True)
class Bindings:
    """The modules of one release: geometry, messages between processes, the simulator."""

    math: ModuleType
    transport: ModuleType
    sim: ModuleType


@cache
def bindings() -> Bindings:
    """Gazebo's modules, of the oldest release that is whole.

    Raises:
        UnavailableError: no release is.
    """
    for names in RELEASES.values():
        if all(map(_there, names)):
            return Bindings(*map(importlib.import_module, names))
    wanted = "; ".join(f"{release}: {', '.join(names)}" for release, names in RELEASES.items())
    raise UnavailableError(
        f"no release of gz-sim has all of its Python modules here; it takes these of one: {wanted}"
    )


def library_version() -> str:
    """Of the gz-sim library that this process has loaded; empty if there is none."""
    for line in Path("/proc/self/maps").read_text("utf-8", "replace").splitlines():
        if found := LIBRARY.search(line):
            return found[1]
    return ""


def _there(name: str) -> bool:
    try:
        return find_spec(name) is not None
    except ImportError:
        return False


HANDLED = (signal.SIGINT, signal.SIGTERM)
"""Signals that a server takes over from Python."""

PATIENCE = 10_000
"""For an answer of the server, which is in this process [ms]."""


class Server:
    """A world that runs.

    Args:
        name: its name in it.

    Attributes:
        ecm: the world's entities and components, as the bindings take them.
        timestep: that the last step advanced by [s].

    Raises:
        SimulatorError: Gazebo refused the world; the message has its own words.
    """

    def __init__(self, text: str, name: str) -> None:
        _own_partition()
        self.name = name
        self.timestep = 0.0
        self._ecm: Any = None
        with tempfile.TemporaryDirectory(prefix="simbench-gazebo-") as folder, _told() as told:
            path = Path(folder) / "world.sdf"
            path.write_text(text, "utf-8")
            with signals_kept(*HANDLED):
                self._fixture = bindings().sim.TestFixture(str(path))
            self._fixture.on_pre_update(_held_weakly(self))
            self._fixture.finalize()
            self._server = self._fixture.server()
            self._server.run(True, 1, False)
        if self._ecm is None:
            words = " ".join(told[0].split()) or "it said nothing"
            raise SimulatorError(f"Gazebo refused the world: {words}")
        self.ecm: Any = self._ecm
        self.world: Any = bindings().sim.World(bindings().sim.world_entity(self.ecm))

    def reset(self) -> None:
        """Go back to the state that the file describes.

        The server reads the request at the end of a step. In the next one it makes the world anew
        instead of advancing it.
        """
        if not self._request("control", reset_request(), "gz.msgs.WorldControl", BOOLEAN):
            raise SimulatorError("Gazebo did not answer the request to reset the world")
        self._server.run(True, 2, False)

    def step(self) -> None:
        """Advance by one step, and return when it is done."""
        self._server.run(True, 1, False)

    def sdf(self) -> ET.Element:
        """The world as Gazebo holds it at present, the element <world>."""
        answer = self._request(
            "generate_world_sdf", b"", "gz.msgs.SdfGeneratorConfig", "gz.msgs.StringMsg"
        )
        world = ET.fromstring(text_of(answer)).find("world")
        assert world is not None
        return world

    def _request(self, service: str, request: bytes, asked: str, answered: str) -> bytes:
        node = bindings().transport.Node()
        ok, answer = node.request_raw(
            f"/world/{self.name}/{service}", request, asked, answered, PATIENCE
        )
        if not ok:
            raise SimulatorError(f"Gazebo did not answer its service {service}")
        return bytes(answer)


def _held_weakly(server: Server) -> Callable[[Any, Any], None]:
    """What Gazebo calls in each step, before it acts. A method of the server would keep it, and all
    of Gazebo's world, for ever: 28 MB each."""
    this = ref(server)

    def seen(info: Any, ecm: Any) -> None:
        if (server := this()) is not None:
            server._ecm, server.timestep = ecm, info.dt.total_seconds()

    return seen


def new_name() -> str:
    """Of a world that no other run on this machine has."""
    return f"simbench_{uuid4().hex[:12]}"


def _own_partition() -> None:
    """Messages of this process and of no other: servers of one partition hear each other."""
    os.environ["GZ_PARTITION"] = f"simbench-{os.getpid()}-{uuid4().hex[:12]}"
    os.environ.setdefault("GZ_IP", "127.0.0.1")


@contextmanager
def _told() -> Iterator[list[str]]:
    """What Gazebo writes on the error stream meanwhile; it goes there all the same."""
    told: list[str] = []
    sys.stderr.flush()
    kept = os.dup(2)
    with tempfile.TemporaryFile() as file:
        os.dup2(file.fileno(), 2)
        try:
            yield told
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            file.seek(0)
            data = file.read()
            told.append(data.decode("utf-8", "replace"))
            os.write(2, data)


BOOLEAN = "gz.msgs.Boolean"
"""Type of the answer of the service `control`."""

STRING_DATA = 2
"""Number of the field `data` of gz.msgs.StringMsg."""

VARINT, I64, LEN, I32 = 0, 1, 2, 5
"""Wire types."""


def reset_request() -> bytes:
    """A gz.msgs.WorldControl whose field `reset` (5) is a gz.msgs.WorldReset with `all` (2)."""
    everything = bytes([2 << 3 | VARINT, 1])
    return bytes([5 << 3 | LEN, len(everything)]) + everything


def text_of(message: bytes) -> str:
    """The text in a gz.msgs.StringMsg; empty if it has none.

    Raises:
        ValueError: it is no message.
    """
    at, text = 0, b""
    while at < len(message):
        key, at = _varint(message, at)
        kind = key & 7
        if kind == VARINT:
            _, at = _varint(message, at)
            continue
        if kind == LEN:
            size, at = _varint(message, at)
        elif kind in (I32, I64):
            size = 4 if kind == I32 else 8
        else:
            raise ValueError(f"no wire type of protobuf: {kind}")
        if key == STRING_DATA << 3 | LEN:
            text = message[at : at + size]
        at += size
    if at > len(message):
        raise ValueError("the message ends too early")
    return text.decode()


def _varint(message: bytes, at: int) -> tuple[int, int]:
    """A number that begins at `at`, and where it ends."""
    value = shift = 0
    while True:
        if at >= len(message):
            raise ValueError("the message ends too early")
        byte = message[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at
