"""`--sim-cluster`: the cluster of this process, and what its nodes can do for the run."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import pytest

from pytest_simbench.plugin import options

if TYPE_CHECKING:
    from pytest_simbench.cluster.offers import Node
    from pytest_simbench.cluster.pool import Pool
    from pytest_simbench.records.record import Record

_POOL: pytest.StashKey[Pool] = pytest.StashKey()

HERE_ONLY = ("sim_python", "sim_spec", "sim_pictures", "sim_video", "sim_install_missing")
"""Options of this machine, which mean nothing on a node."""


def asked(config: pytest.Config) -> bool:
    """Whether the run's repetitions go to a cluster."""
    return bool(options.value(config, "sim_cluster"))


def pool(config: pytest.Config) -> Pool:
    """The cluster of `--sim-cluster`; it is joined when it is first asked for.

    Raises:
        pytest.UsageError: an option that does not go with it, no scheduler, or nodes that cannot
            carry out anything of this run; one sentence.
    """
    if _POOL not in config.stash:
        given = f"--sim-cluster={options.value(config, 'sim_cluster')}"
        for name in HERE_ONLY:
            if options.value(config, name) != options.option(name).default:
                flag = options.option(name).sure
                raise pytest.UsageError(
                    f"{given}: {flag} is for simulators on this machine; leave out one of them"
                )
        if options.given(config, "sim_jobs"):
            raise pytest.UsageError(
                f"{given}: leave out --sim-jobs; each node says itself how many repetitions it "
                "takes at once (--slots)"
            )
        from pytest_simbench.client.errors import ExecutorError
        from pytest_simbench.cluster.offers import refusal
        from pytest_simbench.cluster.pool import Pool

        with options.refusing(ExecutorError, given):
            found = Pool(options.value(config, "sim_cluster"))
            config.stash[_POOL] = found
            problem = refusal(found.nodes())
        if problem:
            raise pytest.UsageError(f"{given}: {problem}")
    return config.stash[_POOL]


def nodes(config: pytest.Config) -> tuple[Node, ...]:
    """Those that are there; none without `--sim-cluster`.

    Raises:
        pytest.UsageError: see `pool`.
    """
    return pool(config).nodes() if asked(config) else ()


def lost_nodes(records: Iterable[Record]) -> str:
    """How many repetitions were tried again, as a sentence for the end of the run, or nothing."""
    again = [record for record in records if record.notes.lost_nodes]
    if not again:
        return ""
    failed = sum(record.error is not None and record.error.type == "NodeLost" for record in again)
    return (
        f"nodes were lost: {len(again)} of the repetitions were tried again on another one, and "
        f"{failed} of them failed for it; `notes.lost_nodes` of their records says more"
    )


def leave(config: pytest.Config) -> None:
    """End what this process has under way there."""
    if _POOL in config.stash:
        config.stash[_POOL].close()
