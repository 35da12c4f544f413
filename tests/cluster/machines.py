"""A head and nodes for tests and benchmarks: processes on loopback, or each in a network.

With `networks` each process lives in a network namespace (`ip netns`, for root alone), joined to
the others by a bridge, so that one can be cut off by `ip link set ... down`.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import psutil

from pytest_simbench.client.environments import MARKER, Environment
from pytest_simbench.simulator.registry import adapter
from tests.plugin.inner import wrapper

START_TIMEOUT = 90.0
"""For a head or a node to be there, on a busy machine [s]."""

NET = f"10.217.{os.getpid() % 256}"
"""Of the networks: a private one, which is another one in each process."""

DOCKER = Path("/sys/class/net/docker0")
"""Where it is, its firewall may let nothing through between two ports of another bridge."""


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


def release_in(folder: Path) -> str:
    """The release of MuJoCo that is installed here, as one with an environment of its own in a
    folder of environments: its interpreter is but another name for this one."""
    name = f"mujoco=={adapter('mujoco').info.tested_version}"
    environment = Environment(adapter(name).info, folder / name)
    wrapper(environment.python)
    told = {"requirements": list(environment.info.requirements)}
    (environment.folder / MARKER).write_text(json.dumps(told))
    return name


class Machines:
    """A cluster's processes; all end with the `with` block.

    Args:
        folder: for their logs.
        lost_after: silence after which a node counts as lost [s].
        networks: whether each has a network of its own.
        head: more options of the head; with `--tls` nodes get an address of that kind.
    """

    def __init__(
        self,
        folder: Path,
        lost_after: float = 5.0,
        *,
        networks: bool = False,
        head: Sequence[str] = (),
    ) -> None:
        self.folder = folder
        self.networks = networks
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self._mark = f"sb{os.getpid() % 10000}"
        self._spaces: list[str] = []
        if networks:
            _ip("link", "add", self._bridge, "type", "bridge")
            _ip("addr", "add", f"{NET}.254/24", "dev", self._bridge)
            _ip("link", "set", self._bridge, "up")
        port = free_port()
        host = self._network("head") if networks else "127.0.0.1"
        self.address = f"{'tls' if '--tls' in head else 'tcp'}://{host}:{port}"
        options = ["--host", host, "--port", str(port), "--lost-after", str(lost_after), *head]
        self._start("head", ["head", *options], "the head listens")

    @property
    def _bridge(self) -> str:
        return f"{self._mark}br"

    def _network(self, name: str) -> str:
        """Make a namespace, joined to the bridge; its address."""
        space, number = f"{self._mark}-{name}", len(self._spaces) + 1
        outside, inside = f"{self._mark}o{number}", f"{self._mark}i{number}"
        _ip("netns", "add", space)
        self._spaces.append(space)
        _ip("link", "add", outside, "type", "veth", "peer", "name", inside)
        _ip("link", "set", outside, "master", self._bridge, "up")
        _ip("link", "set", inside, "netns", space)
        for command in (
            ["addr", "add", f"{NET}.{number}/24", "dev", inside],
            ["link", "set", inside, "up"],
            ["link", "set", "lo", "up"],
        ):
            _ip("netns", "exec", space, "ip", *command)
        return f"{NET}.{number}"

    def _start(
        self,
        name: str,
        arguments: Sequence[str],
        word: str,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        command = [sys.executable, "-m", "pytest_simbench", "cluster", *arguments]
        if self.networks:
            command = ["ip", "netns", "exec", f"{self._mark}-{name}", *command]
        log = self.folder / f"{name}.log"
        place = self.folder / f"{name}-place"
        place.mkdir(exist_ok=True)
        # Not where the tests are: what a node needs of them must come with the job.
        clean = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
        with log.open("ab") as file:
            self.processes[name] = subprocess.Popen(
                command,
                cwd=place,
                stdout=file,
                stderr=subprocess.STDOUT,
                env={**clean, "TMPDIR": str(place), **(environment or {})},
                start_new_session=True,
            )
        self._words = {**getattr(self, "_words", {}), name: word}

    def node(self, name: str, *options: str, environment: Mapping[str, str] | None = None) -> None:
        """Start a node; `wait` says when it is there."""
        if self.networks:
            self._network(name)
        arguments = ["node", self.address, "--name", name, *options]
        self._start(name, arguments, f"{name} has", environment)

    def wait(self, *names: str) -> None:
        """Until these are there."""
        until = time.monotonic() + START_TIMEOUT
        for name in names or tuple(self.processes):
            while self._words[name] not in self.log(name):
                if self.processes[name].poll() is not None or time.monotonic() > until:
                    raise AssertionError(f"{name} did not start:\n{self.log(name)}")
                time.sleep(0.1)

    def log(self, name: str) -> str:
        """All that a process said."""
        return (self.folder / f"{name}.log").read_text(errors="replace")

    def _family(self, name: str) -> list[psutil.Process]:
        with suppress(psutil.Error):
            parent = psutil.Process(self.processes[name].pid)
            return [parent, *parent.children(recursive=True)]
        return []

    def kill(self, name: str) -> None:
        """End a machine at once, as by its power switch."""
        self.signal(name, signal.SIGKILL)
        self.processes[name].wait()

    def signal(self, name: str, number: int) -> None:
        """Send a signal to all processes of a machine."""
        for process in self._family(name):
            with suppress(psutil.Error):
                process.send_signal(number)

    def cut(self, name: str) -> None:
        """Cut a machine's network off. Without networks it is stopped: nobody hears of it either
        way, and nobody is told."""
        if self.networks:
            number = self._spaces.index(f"{self._mark}-{name}") + 1
            _ip("link", "set", f"{self._mark}o{number}", "down")
        else:
            self.signal(name, signal.SIGSTOP)

    def __enter__(self) -> Machines:
        return self

    def __exit__(self, *error: object) -> None:
        for name, process in self.processes.items():
            if process.poll() is None:
                self.signal(name, signal.SIGCONT)
                process.terminate()
        for name, process in self.processes.items():
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                self.kill(name)
        for space in self._spaces:
            _ip("netns", "del", space)
        if self.networks:
            _ip("link", "del", self._bridge)


def _ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, capture_output=True)


def networks_allowed() -> bool:
    """Whether this process may make network namespaces, and join them by a bridge."""
    space, bridge = f"sbtry{os.getpid()}", f"sbb{os.getpid() % 10000}"
    try:
        _ip("netns", "add", space)
        _ip("netns", "exec", space, "ip", "link", "add", "o", "type", "veth", "peer", "name", "i")
        _ip("netns", "del", space)
        _ip("link", "add", bridge, "type", "bridge")
        _ip("link", "del", bridge)
        return not DOCKER.exists()
    except (OSError, subprocess.CalledProcessError):
        return False
