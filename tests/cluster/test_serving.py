"""What a head and a node ask Dask for, and say. Neither runs."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
from types import SimpleNamespace
from typing import Any

import pytest

from pytest_simbench.cluster import serving as module
from pytest_simbench.cluster.offers import PYTHON, plugin
from pytest_simbench.cluster.pool import SETTINGS

dask: Any = pytest.importorskip("dask")
distributed: Any = pytest.importorskip("distributed")


class Served:
    """In the place of a scheduler or a nanny, whose beginnings may fail, one after the other."""

    def __init__(self, *fails: Any) -> None:
        self.fails, self.given, self.metadata = list(fails), list[Any](), list[Any]()
        self.address = self.worker_address = "tcp://127.0.0.1:1"
        self.http_server = SimpleNamespace(port=99)
        self.set_metadata = lambda **told: self.metadata.append(told)

    def __call__(self, *where: Any, **how: Any) -> Served:
        self.given.append((*where, how))
        return self

    async def __aenter__(self) -> Served:
        if self.fails and (error := self.fails.pop(0)):
            raise error
        return self

    async def __aexit__(self, *error: object) -> None: ...

    async def finished(self) -> None: ...


@pytest.fixture
def configured(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What Dask's configuration is told, and the roles that need security (`asked`)."""
    told: dict[str, Any] = {"asked": []}
    monkeypatch.setattr(dask.config, "set", told.update)
    monkeypatch.setattr(
        module, "check_security", lambda role, *, tls: told["asked"].append((role, tls))
    )
    return told


@pytest.mark.parametrize(("tls", "pages"), [(False, False), (True, True)])
def test_a_head(
    configured: dict[str, Any], monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str], tls: bool, pages: bool,
) -> None:  # fmt: skip
    made = Served()
    monkeypatch.setattr(distributed, "Scheduler", made)
    assert module.head("h", 7, 2.5 if pages else 25.0, tls, pages) == 0
    assert made.given == [
        ({"host": "h", "port": 7, "protocol": "tls" if tls else "tcp", "dashboard": pages,
          "dashboard_address": "h:0"},)
    ]  # fmt: skip
    lost = 2.5 if pages else 25.0
    assert made.metadata == [{"keys": [SETTINGS], "value": {"lost-after": lost}}]
    assert configured == {
        "asked": [("scheduler", tls)],
        **({} if pages else {"distributed.scheduler.http.routes": []}),
        "distributed.scheduler.allowed-failures": 0,
        "distributed.scheduler.worker-ttl": "2.5s" if pages else "25s",
        "distributed.comm.timeouts.tcp": "11s" if pages else "25s",
    }
    assert capsys.readouterr().out == "the head listens on tcp://127.0.0.1:1\n" + (
        "Dask's pages: http://h:99\n" if pages else ""
    )


@pytest.mark.parametrize(
    ("address", "host", "at"),
    [
        ("tcp://127.0.0.1:7", None, "127.0.0.1"),
        ("tls://127.0.0.1:7", "own", "own"),
        ("tcp://10.1.2.3:7", None, "as seen from 10.1.2.3"),
    ],
)
def test_a_node_looks_for_its_head_until_it_is_told_to_end(
    configured: dict[str, Any], monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str], address: str, host: str | None, at: str,
) -> None:  # fmt: skip
    ended = asyncio.Event()

    class Nanny(Served):
        async def finished(self) -> None:
            if len(self.given) == 3:
                ended.set()

    made = Nanny(OSError("Timed out"), None)
    offers = {"simbench": 2.0, plugin(): 2.0, PYTHON: 2.0, "mujoco==4.0": 2.0}
    monkeypatch.setattr(distributed, "Nanny", made)
    monkeypatch.setattr("distributed.utils.get_ip", lambda head: f"as seen from {head}")
    monkeypatch.setattr(module, "here", lambda *asked: configured.update(here=asked) or offers)
    monkeypatch.setattr(module, "_told", lambda: ended)
    monkeypatch.setattr(module, "AGAIN", 0.001)
    log = logging.getLogger("distributed.nanny")  # what it would say is told
    monkeypatch.setattr(log, "level", logging.INFO)
    assert module.node(address, host, "vm", 2, ["mujoco"]) == 0
    assert log.level == logging.CRITICAL
    how = {
        "host": at, "name": "vm", "nthreads": 2, "resources": offers, "memory_limit": 0,
        "dashboard": False,
    }  # fmt: skip
    assert made.given == [(address, how)] * 3
    assert configured == {
        "asked": [("worker", address.startswith("tls"))],
        "here": (2, ["mujoco"]),
        "distributed.worker.http.routes": [],
    }
    again = "it tries again every 0.001 s"
    told = capsys.readouterr().out.splitlines()
    assert told[:2] == [module.not_taken(address, "vm", OSError("Timed out")), again]
    has = f"vm has mujoco 4.0; 2 at once; it serves {address}"
    assert told[2:6] == [has, f"the head at {address} is gone", again, has]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_process_is_told_to_end_by_a_signal(number: signal.Signals) -> None:
    async def ends() -> None:
        told = module._told()
        assert not told.is_set()
        os.kill(os.getpid(), number)
        await module._either(lambda: asyncio.Event().wait(), told)

    asyncio.run(ends())
