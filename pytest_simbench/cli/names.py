"""What `--sim` names: simulators, releases of them (`mysim==3.3.7`), builds of them
(`mysim@PYTHON`, `mysim@LABEL=PYTHON`)."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

from pytest_simbench.cli.interpreters import interpreter_path
from pytest_simbench.cli.values import BadInput, shown
from pytest_simbench.client.environments import Environment, create_all, outside
from pytest_simbench.client.system import OLDEST, look_into
from pytest_simbench.ground.versions import BUILD, RELEASE, VersionedName, base_name
from pytest_simbench.simulator.info import no_module
from pytest_simbench.simulator.registry import adapter, check_names

LABEL = re.compile(r"[A-Za-z0-9](?:[\w.+-]{0,58}\w)?", re.ASCII)


def read_names(asked: Iterable[str], here: Path) -> tuple[list[str], dict[str, str]]:
    """Names of simulators, and the interpreters of the builds among them by name.

    A build without a label is called by the version that its interpreter has.

    Args:
        asked: as a user wrote them.
        here: folder where a relative path begins.

    Raises:
        BadInput: an unknown simulator, a version that is none, an interpreter that
            cannot be used; one sentence.
    """
    names: list[str] = []
    builds: dict[str, str] = {}
    for text in asked:
        base, at, rest = text.partition(BUILD)
        if not at:
            _check_release(text)
            names.append(text)
            continue
        check_names([base])
        where = shown(text)
        if base != base_name(base):
            raise BadInput(f"{where}: a build has no release; write {base_name(base)}@PYTHON")
        label, equals, path = rest.partition("=")
        if not equals or "/" in label:  # the path of a release's environment has a = too
            label, path = "", rest
        elif not LABEL.fullmatch(label):
            raise BadInput(f"{where}: a label has letters, digits, and . + - _ between them")
        if not path.strip():
            raise BadInput(f"{where}: write it as {base}@PYTHON or {base}@LABEL=PYTHON")
        python = interpreter_path(path, where, here)
        version = _version(base, python, where)
        if not (label or version):
            raise BadInput(
                f"{where}: {python} does not tell the version of {base}; give the build a label: "
                f"{base}@LABEL=PYTHON"
            )
        name = f"{base}{BUILD}{label or version}"
        if builds.get(name, python) != python:
            raise BadInput(
                f"{where}: another build is called {name} too; give each a label: "
                f"{base}@LABEL=PYTHON"
            )
        if refused := adapter(base).info.refused(version):
            raise BadInput(f"{where}: {refused}")
        builds[name] = python
        names.append(name)
    return names, builds


def _check_release(text: str) -> None:
    """Complain of `==` without a version behind it."""
    base, equals, version = text.partition(RELEASE)
    if equals and VersionedName.of(text).which != version:
        raise BadInput(
            f"{shown(text)}: {shown(version)!r} is no version; write {shown(base)}==3.3.7, "
            "for instance"
        )


def _version(base: str, python: str, where: str) -> str:
    """The version of a simulator's engine in an interpreter that has all that a worker needs;
    empty where the interpreter does not tell it."""
    info = adapter(base).info
    found = look_into(python, info.distribution, ("numpy", *info.modules))
    if found is None:
        raise BadInput(f"{where}: {python} does not run, or is no Python")
    if tuple(found["python"]) < OLDEST:
        raise BadInput(
            f"{where}: {python} is Python {'.'.join(map(str, found['python']))}, older than "
            f"{'.'.join(map(str, OLDEST))}"
        )
    if found["absent"]:
        raise BadInput(f"{where}: {python} has no module {no_module(found['absent'])}")
    return found["version"] or ""


def install_missing(names: Iterable[str], tell: Callable[[str], None]) -> None:
    """Make the environments that these simulators need and that are not ready.

    Raises:
        SimulatorError: one cannot be made.
    """
    found = [outside(adapter(name).info) for name in names]
    create_all([place for place in found if isinstance(place, Environment)], tell)


def progress() -> Callable[[str], None]:
    """Shows the progress of an installation: on a terminal as it goes on, else its end alone."""
    tty = sys.stdout.isatty()

    def tell(text: str) -> None:
        if tty or text.endswith("\n"):
            print(text if tty else text.lstrip("\r"), end="", flush=True)

    return tell
