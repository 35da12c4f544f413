"""`--sim-history NAME:N[:minor]`: the last releases of a simulator, and where their results lie."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import pytest

from pytest_simbench import __version__
from pytest_simbench.cli.values import Releases
from pytest_simbench.client.package_index import newest_of_minors, releases
from pytest_simbench.ground.host import host
from pytest_simbench.ground.names import digest
from pytest_simbench.plugin import options
from pytest_simbench.simulator.registry import adapter

FOLDER = ".simbench/history"
"""Where histories lie, in pytest's root folder."""

SETTINGS = (
    "sim_robot", "sim_gui", "sim_headless", "sim_protocol", "sim_jitter", "sim_seed", "sim_timeout",
    "sim_stall_timeout", "sim_profile", "sim_set", "sim_sweep",
    "sim_memory_limit", "sim_scene",
)  # fmt: skip
"""Options that make another history: results with other values are not comparable."""

_RELEASES: pytest.StashKey[list[str]] = pytest.StashKey()


def releases_of(config: pytest.Config) -> list[str]:
    """The releases that `--sim-history` means, as names of simulators, oldest first: of those that
    the adapter runs with. None without that option.

    Raises:
        SimulatorError: no such simulator, or no package index answers.
        pytest.UsageError: the adapter runs with fewer than two.
    """
    wanted: Releases | None = options.value(config, "sim_history")
    if wanted is None:
        return []
    if _RELEASES not in config.stash:
        info = adapter(wanted.name).info
        if info.system_packages:
            raise pytest.UsageError(
                f"--sim-history: {wanted.name} comes with packages of the system, which has one "
                "release of it"
            )
        found = [v for v in releases(info.distribution) if not info.refused(v)]
        found = newest_of_minors(found) if wanted.minor else found
        if len(found) < 2:
            raise pytest.UsageError(
                f"--sim-history: the adapter of {wanted.name} runs with {len(found)} of the "
                f"releases of {info.distribution} alone"
            )
        config.stash[_RELEASES] = [f"{wanted.name}=={v}" for v in found[-wanted.number :]]
    return config.stash[_RELEASES]


def folder_of(config: pytest.Config, name: str) -> Path:
    """Where the history of a simulator with these settings on this machine lies: results made with
    others are never in one folder."""
    return config.rootpath / FOLDER / f"{_named(config, name)}-{_digest(host())}"


def on_other_machines(config: pytest.Config, name: str) -> str:
    """That another machine has such a history here, as a sentence; empty where none has."""
    own = folder_of(config, name)
    others = sorted(
        p.name for p in own.parent.glob(f"{_named(config, name)}-*") if p.name != own.name
    )
    if not others:
        return ""
    return (
        f"results of another machine are not reused: {', '.join(others)} in {own.parent}, this "
        f"one's are in {own.name}"
    )


def _named(config: pytest.Config, name: str) -> str:
    values: dict[str, object] = {key: options.value(config, key) for key in SETTINGS}
    return f"{name}-{_digest({**values, 'version': __version__})}"


def _digest(values: Mapping[str, object]) -> str:
    return digest(json.dumps(values, sort_keys=True, default=str))
