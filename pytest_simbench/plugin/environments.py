"""`--sim-install`, `--sim-uninstall`, `--sim-environments`: the environments of simulators."""

from __future__ import annotations

import pytest

from pytest_simbench.client.environments import (
    Environment,
    create_all,
    default_folder,
    existing,
    remove,
    size_mb,
)
from pytest_simbench.ground.text import for_terminal
from pytest_simbench.plugin import options
from pytest_simbench.plugin.simulator_names import progress
from pytest_simbench.simulator.errors import SimulatorError
from pytest_simbench.simulator.registry import adapter


def install(config: pytest.Config) -> int:
    """`--sim-install`: make the environments of simulators, also of releases of them."""
    with options.refusing(SimulatorError):
        names = options.value(config, "sim_install")
        found = {name: Environment.of(adapter(name).info) for name in names}
        create_all(list(found.values()), progress())
    for name, environment in found.items():
        print(f"{name}: {environment.info.title} {environment.version()} is ready")
    return 0


def uninstall(config: pytest.Config) -> int:
    """`--sim-uninstall`: remove environments, whether or not their adapters are still known."""
    there = {folder.name: folder for folder in existing()}
    names = options.value(config, "sim_uninstall")
    for name in names:
        if name not in there:
            known = ", ".join(there) or "none is there"
            raise pytest.UsageError(
                f"there is no environment {name!r} in {default_folder()}; choose from {known}"
            )
    for name in dict.fromkeys(names):
        size = size_mb(there[name])
        try:
            with options.refusing(SimulatorError, "--sim-uninstall"):
                remove(there[name])
        except OSError as error:
            raise pytest.UsageError(f"{there[name]} cannot be removed: {error.strerror}") from None
        print(f"{name}: removed, {size:.0f} MB")
    return 0


def list_environments(config: pytest.Config) -> int:
    """`--sim-environments`: what is there, how large it is, and what is wrong with it."""
    total = 0.0
    for folder in existing():
        size = size_mb(folder)
        total += size
        try:
            environment = Environment.of(adapter(folder.name).info)
            state = environment.problem or f"{environment.info.title} {environment.version()}"
        except SimulatorError as error:
            state = f"of no simulator that is known here: {error}"
        print(for_terminal(f"{folder.name}: {size:.0f} MB, {state}"))
    print(f"{total:.0f} MB in {default_folder()}")
    return 0
