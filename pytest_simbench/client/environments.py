"""Interpreters of their own for engines whose packages clash with pytest's or with each other's.

One folder per simulator and release, a plain virtual environment with the adapter's pinned
requirements and nothing else: the worker's code reaches it from here. `simbench install NAME`
makes it, and it is found by its place. A marker file, written last, tells a finished environment
from half of one and remembers what was installed. Compiled kernels are kept in its `cache` folder.

uv makes it where that is there, else venv and pip. uv is quick, and environments share what they
have in common in its cache. It is told what pip is configured with, so that both ask the same
package index.
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import distributions
from pathlib import Path

from pytest_simbench.client import package_index
from pytest_simbench.client.system import SystemPython
from pytest_simbench.ground.errors import SimulatorError
from pytest_simbench.ground.versions import RELEASE, VersionedName
from pytest_simbench.records.paths import opened, write_whole
from pytest_simbench.simulator.info import SimulatorInfo, alternatives, importable, no_module

MARKER = "simbench.json"
VARIABLE = "SIMBENCH_ENVIRONMENTS"

LOCK = ".{}.lock"
"""Beside an environment, from when it is begun: what has neither that nor a marker is not ours."""

LOOK_PERIOD = 0.5
"""Between two looks at what is there already [s]."""

UV_VARIABLES = {
    "index-url": "UV_DEFAULT_INDEX",
    "extra-index-url": "UV_INDEX",
    "find-links": "UV_FIND_LINKS",
    "cert": "SSL_CERT_FILE",
}
"""uv's names for what pip's configuration says."""

Tell = Callable[[str], None]
"""Shows progress: lines that end, and lines that the next one overwrites."""


def default_folder() -> Path:
    """Where environments live: $SIMBENCH_ENVIRONMENTS, else a folder of the user's data."""
    given = os.environ.get(VARIABLE)
    if given:
        return Path(given)
    data = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    return Path(data) / "pytest-simbench" / "environments"


@dataclass(frozen=True)
class Environment:
    """The environment of one simulator, whether it exists or not."""

    info: SimulatorInfo
    folder: Path

    @classmethod
    def of(cls, info: SimulatorInfo) -> Environment:
        return cls(info, default_folder() / (info.home or info.name))

    @property
    def python(self) -> Path:
        """Its interpreter."""
        return self.folder / "bin" / "python"

    @property
    def place(self) -> str:
        """Where that is, for `simbench list`."""
        return f"in its own environment, {self.folder}"

    @property
    def problem(self) -> str | None:
        """Why it cannot be used, in words that end with what mends it; None when it can."""
        name, command = self.info.name, self.info.install
        if not self.folder.exists():
            return f"{name} needs an environment of its own, which is not there yet: {command}"
        try:
            installed = json.loads((self.folder / MARKER).read_text("utf-8"))["requirements"]
        except (OSError, ValueError, KeyError, TypeError):
            return f"the environment of {name} ({self.folder}) is only half installed: {command}"
        if list(installed) != list(self.info.requirements):
            return (
                f"the environment of {name} ({self.folder}) holds {', '.join(installed)} instead "
                f"of {', '.join(self.info.requirements)}: {command}"
            )
        if not self.python.exists():
            return f"the environment of {name} ({self.folder}) has lost its interpreter: {command}"
        return None

    def version(self) -> str | None:
        """Version of the engine in it."""
        packages = [str(path) for path in self.folder.glob("lib/python*/site-packages")]
        wanted = self.info.distribution.lower().replace("_", "-")
        for found in distributions(path=packages):
            if found.metadata["Name"].lower().replace("_", "-") == wanted:
                return found.version
        return None

    def variables(self) -> dict[str, str]:
        """Variables that keep compiled kernels between runs, unless the user set them."""
        return {
            variable: str(self.folder / "cache" / name)
            for variable, name in self.info.caches.items()
            if variable not in os.environ
        }

    def check(self) -> None:
        """Complain of what can be known before anything is made.

        Raises:
            SimulatorError: it needs none, something else is in its place, or there is no such
                release.
        """
        if not self.info.requirements:
            raise SimulatorError(
                f"{self.info.name} needs no environment of its own: {self.info.install}"
            )
        if wrong := foreign(self.folder):
            raise SimulatorError(wrong)
        name = VersionedName.of(self.info.name)
        if name.kind == RELEASE:
            with suppress(package_index.PackageIndexError):  # then installing it tells
                known = package_index.releases(self.info.distribution)
                if wrong := package_index.unreleased(self.info.distribution, name.which, known):
                    raise SimulatorError(f"{self.info.name}: {wrong}")

    def create(self, tell: Tell = lambda text: None) -> None:
        """Make it anew, unless another process has made it meanwhile.

        Raises:
            SimulatorError: see `check`; or the packages do not install, or the folder cannot be
                written to; what is there stays half installed.
        """
        self.check()
        with alone(self.folder, tell):
            if self.folder.exists() and self.problem is None:
                return
            try:
                self._install(tell)
                marker = {"requirements": list(self.info.requirements)}
                write_whole(self.folder, MARKER, f"{json.dumps(marker)}\n".encode())
            except (SimulatorError, OSError) as error:
                raise SimulatorError(
                    f"the environment of {self.info.name} is only half installed: {error}"
                ) from None

    def _install(self, tell: Tell) -> None:
        """What is there is lost."""
        folder, requirements, program = self.folder, self.info.requirements, uv()
        if folder.exists():
            shutil.rmtree(folder)
        python, variables = str(self.python), {}
        if program is not None:
            variables = _as_uv(package_index.pip_configuration())
            commands = [
                [program, "venv", "--quiet", "--python", sys.executable, str(folder)],
                [program, "pip", "install", "--quiet", "--python", python,
                 "--index-strategy", "unsafe-best-match", *requirements],
            ]  # fmt: skip
        else:
            pip = [python, "-P", "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
            commands = [[sys.executable, "-P", "-m", "venv", str(folder)], [*pip, *requirements]]
        began = time.monotonic()

        def look(end: str = "") -> None:
            seconds = time.monotonic() - began
            tell(f"\r{folder.name}: {size_mb(folder):.0f} MB, {seconds:.0f} s {end}")

        for command in commands:
            _run(command, variables, look)
        look("\n")


def create_all(environments: Sequence[Environment], tell: Tell) -> None:
    """Make those that are not ready, once nothing is wrong with any of them.

    Raises:
        SimulatorError: see `Environment.create`.
    """
    wanted = [environment for environment in environments if environment.problem]
    for environment in wanted:
        environment.check()
    for environment in wanted:
        environment.create(tell)


def uv() -> str | None:
    """The program uv: on the PATH, or beside this interpreter."""
    beside = Path(sys.executable).with_name("uv")
    return str(beside) if os.access(beside, os.X_OK) else shutil.which("uv")


@contextmanager
def alone(folder: Path, tell: Tell) -> Iterator[None]:
    """Only one process makes an environment at a time; another one waits until that is done.

    The lock ends with its process, however that ends.

    Raises:
        SimulatorError: their folder cannot be written to.
    """
    try:
        lock = opened(folder.parent, LOCK.format(folder.name), os.O_RDWR | os.O_CREAT)
    except OSError as error:
        raise SimulatorError(
            f"environments cannot be made in {folder.parent} ({error.strerror})"
        ) from None
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            tell(f"another run is making the environment {folder.name}; waiting for it\n")
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield
    finally:
        os.close(lock)


def size_mb(folder: Path) -> float:
    """What a folder holds [MB]."""
    sizes = 0
    for place, _, names in os.walk(folder):
        for name in names:
            try:
                sizes += os.lstat(os.path.join(place, name)).st_size
            except OSError:  # gone while we looked
                continue
    return sizes / 1e6


def _run(command: Sequence[str], variables: Mapping[str, str], look: Callable[[], None]) -> None:
    process = subprocess.Popen(
        command,
        env={**os.environ, **variables},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
    )
    with process:
        try:
            while True:
                try:
                    said, _ = process.communicate(timeout=LOOK_PERIOD)
                    break
                except subprocess.TimeoutExpired:
                    look()
        except BaseException:
            process.kill()
            raise
    if process.returncode:
        reason = " ".join(said.split())[-600:]
        raise SimulatorError(f"{' '.join(command)} failed: {reason}")


def _as_uv(configuration: Mapping[str, str]) -> dict[str, str]:
    """pip's configuration in uv's variables, but for those that the user has set."""
    found = {}
    for option, variable in UV_VARIABLES.items():
        if option in configuration and variable not in os.environ:
            separator = "," if option == "find-links" else " "
            found[variable] = separator.join(configuration[option].split())
    return found


def foreign(folder: Path) -> str:
    """That something else is in an environment's place, as a sentence; empty if nothing is."""
    if folder.is_symlink():
        return f"{folder} is a link, which is left alone; remove it, then there is room for ours"
    ours = (folder / MARKER).exists() or folder.with_name(LOCK.format(folder.name)).exists()
    if os.path.lexists(folder) and not (ours and folder.is_dir()):
        return f"{folder} is no environment of ours; move it away, then there is room for one"
    return ""


def remove(folder: Path) -> None:
    """Take an environment off the disk, with what it has compiled.

    Raises:
        SimulatorError: a link is in its place.
        OSError: somebody else's files.
    """
    if wrong := foreign(folder):
        raise SimulatorError(wrong)
    with alone(folder, lambda text: None):
        # Without its marker, what a break leaves is half installed.
        (folder / MARKER).unlink(missing_ok=True)
        shutil.rmtree(folder)


def existing() -> Iterator[Path]:
    """The folders of the environments that are there, also of half-made ones, by name."""
    root = default_folder()
    if root.is_dir():
        yield from sorted(p for p in root.iterdir() if p.is_dir() and not p.name.startswith("."))


def missing(info: SimulatorInfo) -> str | None:
    """Why an engine can be imported neither here nor where it lives, and what mends it."""
    other, absent = outside(info), _absent(info)
    if other is not None and (absent or VersionedName.of(info.name).kind):
        return other.problem
    if absent:
        module = no_module(absent[:1])
        return f"{info.name} is not installed (no module {module}); install it: {info.install}"
    return info.no_program or None


def outside(info: SimulatorInfo) -> Environment | SystemPython | None:
    """Where an engine lives that is not for this interpreter; None for one that is.

    An engine of the system's packages may be importable here, where this is the system's Python.
    """
    if info.requirements:
        return Environment.of(info)
    if info.system_packages and _absent(info):
        return SystemPython(info)
    return None


def interpreter(info: SimulatorInfo) -> str | None:
    """The interpreter that an engine lives in, where it is ready; None for this one."""
    other = outside(info)
    return None if other is None or other.problem else str(other.python)


def _absent(info: SimulatorInfo) -> list[str]:
    """The engine's modules that cannot be imported here."""
    return [names for names in info.modules if not any(map(importable, alternatives(names)))]
