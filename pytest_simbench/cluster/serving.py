"""`simbench cluster head` and `node tcp://head:8786`: the machines of a cluster.

They listen on loopback unless told otherwise. TLS is Dask's own (docs/cluster.md).
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import signal
import socket
from collections.abc import Awaitable, Callable, Coroutine
from functools import partial
from typing import Any

from pytest_simbench.client.errors import ExecutorError
from pytest_simbench.cluster.offers import Node, here
from pytest_simbench.cluster.pool import INSTALL, LOST_AFTER, SETTINGS, TLS, check_security, reason
from pytest_simbench.simulator.registry import check_names

LOOPBACK = "127.0.0.1"
PORT = 8786
"""Dask's own."""

AGAIN = 5.0
"""Between two attempts of a node to reach its head [s]."""

LEAST_TCP = 11.0
"""Dask's least time-out of a connection [s]."""

say = partial(print, flush=True)  # it may go to a file that somebody waits for


def head(
    host: str | None, port: int | None, lost_after: float | None, tls: bool, pages: bool
) -> int:
    """Run a head until it is told to end.

    Raises:
        ExecutorError: it cannot begin.
    """
    at, number = host or LOOPBACK, PORT if port is None else port
    serve = partial(_head, at, number, lost_after or LOST_AFTER, tls, pages)
    return _run(serve, f"the head cannot listen on {at}:{number}", "give another --host or --port")


def node(
    address: str, host: str | None, name: str | None, slots: int | None, sim: list[str] | None
) -> int:
    """Run a node until it is told to end; it looks for its head for ever.

    Raises:
        ExecutorError: it cannot begin.
        SimulatorError: an unknown simulator.
    """
    check_names(sim or [])
    serve = partial(_node, address, host, name or socket.gethostname(), slots or 1, sim)
    return _run(serve, f"no node for a head at {address}", "look at its address")


def _run(serve: Callable[[], Coroutine[Any, Any, None]], otherwise: str, advice: str) -> int:
    os.environ.setdefault("DASK_LOGGING__DISTRIBUTED", "warning")  # its processes inherit it
    try:
        from distributed import Nanny, Scheduler  # noqa: F401
    except ImportError:
        raise ExecutorError(INSTALL) from None
    try:
        asyncio.run(serve())
    except (OSError, ValueError, RuntimeError) as error:
        raise ExecutorError(f"{otherwise} ({reason(error)}); {advice}") from None
    return 0


async def _head(host: str, port: int, lost_after: float, tls: bool, pages: bool) -> None:
    import dask
    from distributed import Scheduler

    check_security("scheduler", tls=tls)
    if not pages:
        dask.config.set({"distributed.scheduler.http.routes": []})
    dask.config.set(
        {
            "distributed.scheduler.allowed-failures": 0,
            "distributed.scheduler.worker-ttl": f"{lost_after:g}s",
            "distributed.comm.timeouts.tcp": f"{max(lost_after, LEAST_TCP):g}s",
        }
    )
    async with Scheduler(
        host=host,
        port=port,
        protocol="tls" if tls else "tcp",
        dashboard=pages,
        dashboard_address=f"{host}:0",
    ) as scheduler:
        scheduler.set_metadata(keys=[SETTINGS], value={"lost-after": lost_after})
        say(f"the head listens on {scheduler.address}")
        if pages:
            say(f"Dask's pages: http://{host}:{scheduler.http_server.port}")
        await _either(scheduler.finished, _told())


async def _node(
    address: str, host: str | None, name: str, slots: int, names: list[str] | None
) -> None:
    import dask
    from distributed import Nanny
    from distributed.comm import get_address_host, resolve_address
    from distributed.utils import get_ip

    dask.config.set({"distributed.worker.http.routes": []})  # its process inherits that
    check_security("worker", tls=address.startswith("tls"))
    offers = here(slots, names)
    head = get_address_host(resolve_address(address))
    logging.getLogger("distributed.nanny").setLevel(logging.CRITICAL)  # what it logs is told below
    told = _told()

    async def serve() -> None:
        async with Nanny(
            address,
            host=host or (LOOPBACK if head.startswith("127.") else get_ip(head)),
            name=name,
            nthreads=slots,
            resources=offers,
            memory_limit=0,
            dashboard=False,
        ) as nanny:
            this = Node.of(nanny.worker_address or "", name, offers)
            say(f"{this}; {slots} at once; it serves {address}")
            await nanny.finished()
            say(f"the head at {address} is gone")

    while not told.is_set():
        try:
            await _either(serve, told)
        except (OSError, RuntimeError, TimeoutError, ValueError) as error:
            say(not_taken(address, name, error))
        if not told.is_set():
            say(f"it tries again every {AGAIN:g} s")
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(told.wait(), AGAIN)


def not_taken(address: str, name: str, error: BaseException) -> str:
    """That no head takes the node; why one refuses it stands in the log of Dask alone."""
    why = reason(error)
    told = f"no head at {address} takes this node ({why})"
    if "name taken" in why or why.startswith("Worker failed to start"):
        return f"{told}; if Dask says above that the name {name!r} is taken, give another --name"
    return f"{told}; {TLS}"


def _told() -> asyncio.Event:
    """Set when this process gets SIGINT or SIGTERM."""
    told = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, told.set)
    return told


async def _either(finished: Callable[[], Awaitable[Any]], told: asyncio.Event) -> None:
    """Until it has ended, or this process is told to."""
    waiting = [asyncio.ensure_future(finished()), asyncio.ensure_future(told.wait())]
    await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
    for task in waiting:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task
