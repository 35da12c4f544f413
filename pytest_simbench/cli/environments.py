"""`simbench install`, `uninstall`, `environments`, `download`: what this machine has besides."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pytest_simbench.cli.names import progress
from pytest_simbench.cli.values import BadInput
from pytest_simbench.client.environments import (
    Environment,
    create_all,
    default_folder,
    existing,
    remove,
    size_mb,
)
from pytest_simbench.data import sets
from pytest_simbench.data.download import download as bring
from pytest_simbench.ground.errors import SimulatorError
from pytest_simbench.ground.text import for_terminal
from pytest_simbench.simulator.registry import adapter


def install(names: Sequence[str]) -> int:
    """Make the environments of simulators, also of releases of them."""
    found = {name: Environment.of(adapter(name).info) for name in names}
    create_all(list(found.values()), progress())
    for name, environment in found.items():
        print(f"{name}: {environment.info.title} {environment.version()} is ready")
    return 0


def uninstall(names: Sequence[str]) -> int:
    """Remove environments, whether or not their adapters are still known."""
    there = {folder.name: folder for folder in existing()}
    for name in names:
        if name not in there:
            raise BadInput(
                f"there is no environment {name!r} in {default_folder()}; "
                + (f"choose from {', '.join(there)}" if there else "none is there")
            )
    for name in dict.fromkeys(names):
        size = size_mb(there[name])
        try:
            remove(there[name])
        except OSError as error:
            raise BadInput(f"{there[name]} cannot be removed: {error.strerror}") from None
        print(f"{name}: removed, {size:.0f} MB")
    return 0


def list_environments() -> int:
    """What is there, how large it is, and what is wrong with it."""
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


def download(names: Sequence[str], data: str | None) -> int:
    """Bring data sets from their public sources into a folder, or into the usual one.

    Raises:
        DataError: there is no such set, or it cannot be had.
    """
    folder = Path(data) if data else sets.default_folder()
    for wanted in [sets.data_set(name) for name in names]:
        bring(wanted, folder, lambda text: print(for_terminal(text)))
    return 0
