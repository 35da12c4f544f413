"""`simbench cluster head` and `node tcp://head:8786`: the machines of a cluster.

They listen on loopback unless told otherwise. TLS is Dask's own (docs/cluster.md).
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import logging
import os
import signal
import socket
import sys
from collections.abc import Awaitable, Callable, Sequence
from typing import Any

from pytest_simbench.cluster.offers import Node, here
from pytest_simbench.cluster.pool import LOST_AFTER, SETTINGS
from pytest_simbench.ground.errors import SimulatorError
from pytest_simbench.simulator.registry import check_names

LOOPBACK = "127.0.0.1"
PORT = 8786
"""Dask's own."""

AGAIN = 5.0
"""Between two attempts of a node to reach its head [s]."""

LEAST_TCP = 11.0
"""Dask's least time-out of a connection [s]."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a head or a node until it is told to end."""
    given = _parser().parse_args(arguments)
    os.environ.setdefault("DASK_LOGGING__DISTRIBUTED", "warning")  # its processes inherit it
    try:
        from distributed import Nanny, Scheduler  # noqa: F401
    except ImportError:
        print("a cluster needs Dask: pip install 'pytest-simbench[cluster]'", file=sys.stderr)
        return 2
    try:
        return int(asyncio.run(given.run(given)))
    except (SimulatorError, ValueError) as error:
        told = _reason(error)
    except (OSError, RuntimeError) as error:
        told = given.failing.format(given, _reason(error))
    print(f"ERROR: {told}", file=sys.stderr)
    return 2


def _reason(error: BaseException) -> str:
    """What began it: Dask's own errors say that something failed, and not why."""
    while error.__cause__ is not None:
        error = error.__cause__
    return " ".join(str(error).split())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="simbench cluster", description="Repetitions on several machines."
    )
    kinds = parser.add_subparsers(required=True, metavar="head|node")
    head = kinds.add_parser("head", help="the scheduler, which knows all nodes; one of it")
    head.add_argument(
        "--host", default=LOOPBACK, help="address to listen on (default: %(default)s)"
    )
    head.add_argument("--port", type=int, default=PORT, help="(default: %(default)s)")
    head.add_argument(
        "--lost-after",
        type=float,
        default=LOST_AFTER,
        metavar="SECONDS",
        help="silence after which a node counts as lost (default: %(default)s)",
    )
    head.add_argument(
        "--tls", action="store_true", help="encrypted, by the certificates of Dask's configuration"
    )
    head.add_argument(
        "--pages", action="store_true", help="serve Dask's pages, to whoever reaches this machine"
    )
    advice = "the head cannot listen on {0.host}:{0.port} ({1}); give another --host or --port"
    head.set_defaults(run=_head, failing=advice)
    node = kinds.add_parser("node", help="a machine that carries repetitions out")
    node.add_argument("address", help="of the head: tcp://head:8786, or tls://head:8786")
    node.add_argument("--host", help="address to listen on (default: the one that faces the head)")
    node.add_argument(
        "--name", default=socket.gethostname(), help="in records (default: %(default)s)"
    )
    node.add_argument(
        "--slots",
        type=int,
        default=1,
        metavar="N",
        help="repetitions at once; with more than one, records are contended (default: 1)",
    )
    node.add_argument(
        "--sim", help="simulators to offer, with commas (default: all that are ready here)"
    )
    node.set_defaults(run=_node, failing="no node for a head at {0.address}: {1}")
    return parser


async def _head(given: argparse.Namespace) -> int:
    import dask
    from distributed import Scheduler

    if not 1.0 <= given.lost_after <= 1e6:
        raise ValueError("--lost-after: give 1 to 1000000 seconds")
    if not 0 <= given.port < 2**16:
        raise ValueError("--port: give a whole number from 0, for any that is free, to 65535")
    if not given.pages:
        dask.config.set({"distributed.scheduler.http.routes": []})
    dask.config.set(
        {
            "distributed.scheduler.allowed-failures": 0,
            "distributed.scheduler.worker-ttl": f"{given.lost_after:g}s",
            "distributed.comm.timeouts.tcp": f"{max(given.lost_after, LEAST_TCP):g}s",
        }
    )
    async with Scheduler(
        host=given.host,
        port=given.port,
        protocol="tls" if given.tls else "tcp",
        dashboard=given.pages,
        dashboard_address=f"{given.host}:0",
    ) as scheduler:
        scheduler.set_metadata(keys=[SETTINGS], value={"lost-after": given.lost_after})
        print(f"the head listens on {scheduler.address}", flush=True)
        if given.pages:
            print(f"Dask's pages: http://{given.host}:{scheduler.http_server.port}", flush=True)
        await _either(scheduler.finished, _told())
    return 0


async def _node(given: argparse.Namespace) -> int:
    import dask
    from distributed import Nanny, Security
    from distributed.comm import get_address_host, resolve_address
    from distributed.utils import get_ip

    dask.config.set({"distributed.worker.http.routes": []})  # its process inherits that
    names = [name.strip() for name in given.sim.split(",")] if given.sim else None
    if given.slots < 1:
        raise ValueError("--slots: give a whole number from 1")
    tls = given.address.lower().startswith("tls")
    if tls and Security().get_connection_args("worker").get("ssl_context") is None:
        raise ValueError(
            "tls:// needs certificates for the worker in Dask's configuration (docs/cluster.md)"
        )
    check_names(names or [])
    offers = here(given.slots, names)
    head = get_address_host(resolve_address(given.address))
    logging.getLogger("distributed.nanny").setLevel(logging.CRITICAL)  # what it logs is told below
    told = _told()

    async def serve() -> None:
        async with Nanny(
            given.address,
            host=given.host or (LOOPBACK if head.startswith("127.") else get_ip(head)),
            name=given.name,
            nthreads=given.slots,
            resources=offers,
            memory_limit=0,
            dashboard=False,
        ) as nanny:
            node = Node.of(nanny.worker_address or "", given.name, offers)
            print(f"{node}; {given.slots} at once; it serves {given.address}", flush=True)
            await nanny.finished()

    while not told.is_set():
        try:
            await _either(serve, told)
        except (OSError, RuntimeError, TimeoutError, ValueError) as error:
            print(not_taken(given, error), flush=True)
        if not told.is_set():
            print(f"it tries again every {AGAIN:g} s", flush=True)
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(told.wait(), AGAIN)
    return 0


def not_taken(given: argparse.Namespace, error: BaseException) -> str:
    """That no head takes the node; why one refuses it stands in the log of Dask alone."""
    reason = _reason(error)
    told = f"no head at {given.address} takes this node ({reason})"
    if reason.startswith("Worker failed to start"):
        told += f"; if Dask says above that the name {given.name!r} is taken, give another --name"
    return told


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


if __name__ == "__main__":
    sys.exit(main())
