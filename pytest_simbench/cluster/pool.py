"""The nodes of a cluster as a client sees them. Dask carries jobs, watches nodes and tells of them.

Each job is sent to one node that has a free slot, and to no other: Dask would queue all jobs at
once on the nodes that are there, and count those that only waited as tried when a node is lost. So
a node that comes later gets work at once, and what is tried again is decided here.
"""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import Callable, Collection, Mapping
from concurrent.futures import Future as Coming
from dataclasses import replace
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from pytest_simbench.client.errors import ExecutorError
from pytest_simbench.cluster import node as node_side
from pytest_simbench.cluster.job import Packed
from pytest_simbench.cluster.offers import Node
from pytest_simbench.worker.wire import named

if TYPE_CHECKING:
    from distributed import Client, Future

INSTALL = "a cluster needs Dask: pip install 'pytest-simbench[cluster]'"

CONNECT_TIMEOUT = 10.0
"""For the scheduler to answer [s]."""

LOOK_PERIOD = 0.25
"""Age of what is known of the nodes, at most, while somebody waits [s]."""

LOST_AFTER = 30.0
"""Silence of a node after which it is lost [s], unless the head says otherwise (`--lost-after`).
Dask itself takes five minutes, and half a minute more to try whether the node can be restarted."""

SETTINGS = "simbench"
"""Key of the scheduler's metadata under which the head says so."""

TLS = "one that was started with --tls is at tls://, another one at tcp://"

PATIENCE = 60.0
"""How long a job waits for a node that offers what it needs, when there is none left [s]."""


def check_security(role: str, *, tls: bool) -> None:
    """Complain where Dask's configuration has no certificate for a client, worker or scheduler, one
    that cannot be read, or asks for encryption and there is none."""
    from distributed import Security

    security = Security()
    if not tls and security.require_encryption:
        raise ExecutorError(
            "Dask's configuration here asks for encryption; start the head with --tls, and "
            "write tls://"
        )
    try:
        context = security.get_connection_args(role).get("ssl_context") if tls else ""
    except (OSError, ValueError, TypeError) as error:  # of ssl, too
        names = "tls_ca_file", f"tls_{role}_cert", f"tls_{role}_key"
        files = (getattr(security, name) for name in names)
        raise ExecutorError(
            f"the certificates for the {role} in Dask's configuration cannot be read "
            f"({', '.join(map(str, files))}): {named(error)}"
        ) from None
    if context is None:
        raise ExecutorError(
            f"tls:// needs certificates for the {role} in Dask's configuration (docs/cluster.md)"
        )


def reason(error: BaseException) -> str:
    """What began it: Dask's own errors say that something failed, and not why."""
    while error.__cause__ is not None:
        error = error.__cause__
    return named(error) if not str(error) else " ".join(str(error).split())[:300]


class Pool:
    """A cluster's nodes. Safe to use from several threads.

    Args:
        address: of the scheduler: `tcp://head:8786`, `tls://head:8786`.

    Raises:
        ExecutorError: no scheduler answers there, or Dask is not installed.
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise ExecutorError(INSTALL) from None
        check_security("client", tls=address.lower().startswith("tls"))
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # said here, and shorter
        self.address = address
        try:
            self._client: Client = Client(
                address, timeout=CONNECT_TIMEOUT, set_as_default=False, name="pytest-simbench"
            )
            settings = self._client.get_metadata([SETTINGS], default={})
        except (OSError, RuntimeError, ValueError, TypeError) as error:
            raise ExecutorError(
                f"no scheduler of Dask answers at {address} ({reason(error)}); start one: "
                f"simbench cluster head; {TLS}"
            ) from None
        self._begin()
        self.lost_after = float(settings.get("lost-after", LOST_AFTER))
        self._client.subscribe_topic(node_side.TOPIC, self._hear)

    def _begin(self) -> None:
        self.name = uuid4().hex
        self.call: Callable[[Packed, int], dict[str, Any]] = node_side.run
        self._ready = threading.Condition()
        self.began: dict[str, str] = {}  # the versions of the run's simulators
        self._known: Mapping[str, Node] = {}
        self._others: Mapping[str, int] = {}
        self._mine: dict[str, str] = {}
        self._gone: set[str] = set()
        self._looked = float("-inf")
        self._seen: dict[str, tuple[float, float]] = {}
        self._told: dict[str, Mapping[str, Any]] = {}
        self._there: dict[str, set[str]] = {}

    def _hear(self, event: tuple[float, Mapping[str, Any]]) -> None:
        message = event[1]
        if message["key"] in self._mine:
            self._told[message["key"]] = message

    def progress(self, key: str) -> Mapping[str, Any]:
        """What was told last of a job that is under way: `phase`, `done`, `total`; or nothing."""
        return self._told.get(key, {})

    def nodes(self) -> tuple[Node, ...]:
        """Those that are there, by name.

        Raises:
            ExecutorError: the scheduler is gone.
        """
        with self._ready:
            self._look()
            return tuple(sorted(self._known.values(), key=lambda node: (node.name, node.address)))

    def lives(self, node: Node) -> bool:
        """Whether this process of a node is still there, and heard of.

        Raises:
            ExecutorError: the scheduler is gone.
        """
        with self._ready:
            self._look()
            return node.address in self._known

    def _look(self) -> None:
        if time.monotonic() - self._looked < LOOK_PERIOD:
            return
        if not self.joined:
            raise self.gone()
        try:
            workers = self._client.scheduler_info(n_workers=-1)["workers"]
            processing = self._client.processing()
        except (OSError, TimeoutError, RuntimeError) as error:
            raise self.gone(f" ({error})") from None
        now = time.monotonic()
        found = {}
        for address, worker in workers.items():
            node = Node.of(address, worker.get("name"), worker.get("resources", {}))
            heard = worker.get("last_seen", 0.0)  # by the clock of the scheduler
            if self._seen.get(address, (None, 0.0))[0] != heard:
                self._seen[address] = heard, now
            silent = now - self._seen[address][1] > self.lost_after
            if node is not None and not silent and address not in self._gone:
                found[address] = node
        self._known = found
        self.began = self.began or {k: v for n in found.values() for k, v in n.versions.items()}
        self._seen = {address: self._seen[address] for address in workers}
        self._others = {
            address: sum(key not in self._mine for key in keys)
            for address, keys in processing.items()
        }
        self._looked = now

    def reserve(
        self,
        able: Callable[[Node], bool],
        avoid: Collection[str],
        stop: threading.Event,
    ) -> tuple[str, Node] | None:
        """Wait for a free slot, and take it.

        Args:
            able: whether a node offers what is needed.
            avoid: names of nodes that are taken only where there is no other.
            stop: ends the waiting.

        Returns:
            A key for the job and its node; None when stopped, or when for a while no node offered
            what is needed.

        Raises:
            ExecutorError: the scheduler is gone.
        """
        since = time.monotonic()
        with self._ready:
            while not stop.is_set():
                self._look()
                fit = [node for node in self._known.values() if able(node)]
                fit = [node for node in fit if node.name not in avoid] or fit
                if fit:
                    since = time.monotonic()
                    best = max(fit, key=lambda node: (self._free(node), node.name))
                    if self._free(best) > 0:
                        key = f"simbench-{uuid4().hex}"
                        self._mine[key] = best.address
                        return key, best
                elif time.monotonic() - since > PATIENCE:
                    return None
                self._ready.wait(LOOK_PERIOD)
        return None

    def _free(self, node: Node) -> int:
        mine = sum(address == node.address for address in self._mine.values())
        return node.slots - mine - self._others.get(node.address, 0)

    def submit(self, key: str, node: Node, job: Packed, number: int) -> Future:
        """Send a repetition to the node that was reserved for it; all of the job, unless that is
        there."""
        if job.digest in self._there.get(node.address, ()):
            job = replace(job, data=None)
        return self._client.submit(
            self.call, job, number, key=key, workers=[node.address], pure=False, retries=0
        )

    def result(self, future: Future) -> Coming[Mapping[str, Any]]:
        """What a job will give. It may never come: what a node has found is lost with it, and Dask
        waits for another node to find it again, which it may not. (`Client.gather` leaves tasks
        that end in an error which nobody takes: Python tells of it in the middle of anything.)"""

        async def result() -> Mapping[str, Any]:
            found: Mapping[str, Any] = await future
            return found

        return asyncio.run_coroutine_threadsafe(result(), self._client.loop.asyncio_loop)

    @property
    def joined(self) -> bool:
        """Whether there is a connection to the scheduler."""
        return bool(self._client.status == "running")

    def gone(self, reason: str = "") -> ExecutorError:
        """That the scheduler is gone, to be raised."""
        return ExecutorError(
            f"the scheduler at {self.address} is gone{reason}; the records so far are kept, and "
            "--sim-resume completes the run"
        )

    def note(self, node: Node, job: Packed, *, there: bool) -> None:
        """Remember whether a node has a job."""
        with self._ready:
            known = self._there.setdefault(node.address, set())
            (known.add if there else known.discard)(job.digest)

    def give_up(self, node: Node) -> None:
        """Send nothing any more to this process of a node: it is lost."""
        with self._ready:
            self._gone.add(node.address)
            self._known = {a: n for a, n in self._known.items() if a not in self._gone}

    def release(self, key: str, future: Future | None = None) -> None:
        """Give a slot back, and end what may still run in it."""
        if future is not None and not future.done():
            future.cancel(reason="nobody waits for it any more", force=True)
        with self._ready:
            self._mine.pop(key, None)
            self._told.pop(key, None)
            self._ready.notify()

    def close(self) -> None:
        """Leave the cluster; what this client still has under way there ends."""
        self._client.close(timeout=5)
