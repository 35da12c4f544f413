"""Which releases of a distribution a package index has for this Python.

Asked is the index that pip is configured with, by the pages of the simple repository API (PEP 503),
which every index has. pip itself does not tell which releases were taken back.
"""

from __future__ import annotations

import base64
import os
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from html.parser import HTMLParser
from urllib.parse import unquote, urlsplit, urlunsplit

from packaging.specifiers import InvalidSpecifier, SpecifierSet
from packaging.tags import sys_tags
from packaging.utils import (
    InvalidSdistFilename,
    InvalidWheelFilename,
    canonicalize_name,
    parse_sdist_filename,
    parse_wheel_filename,
)
from packaging.version import InvalidVersion, Version

from pytest_simbench.simulator.errors import SimulatorError

PYPI = "https://pypi.org/simple"
"""Where pip asks when nothing is configured."""

TIMEOUT = 30.0
"""For an index to answer [s]."""


class PackageIndexError(SimulatorError):
    """The package index cannot be asked."""


@dataclass(frozen=True)
class File:
    """One file of a distribution.

    Attributes:
        name: of the file.
        yanked: whether it was taken back.
        python: which versions of Python it is for, as a specifier; empty for all.
    """

    name: str
    yanked: bool = False
    python: str = ""


def releases(distribution: str) -> list[str]:
    """The releases that can be installed here, oldest first.

    Those that were taken back (yanked), pre-releases, and those without a file for this Python and
    machine are left out.

    Raises:
        PackageIndexError: no index answers, or none knows the distribution.
    """
    return usable(_files(canonicalize_name(distribution)))


def usable(files: Iterable[File]) -> list[str]:
    """Versions, oldest first, of those files that can be installed here."""
    here, tags = ".".join(map(str, sys.version_info[:3])), frozenset(sys_tags())
    found = set()
    for file in files:
        try:
            fits = not file.python or here in SpecifierSet(file.python)
            version = _version(file.name, tags)
        except (InvalidSpecifier, InvalidSdistFilename, InvalidWheelFilename):
            continue
        if version is not None and fits and not file.yanked and not version.is_prerelease:
            found.add(version)
    return [str(version) for version in sorted(found)]


def newest_of_minors(versions: Iterable[str]) -> list[str]:
    """The last of each minor version (3.2.0, 3.2.1, 3.3.0: 3.2.1 and 3.3.0), oldest first."""
    newest: dict[tuple[int, int], Version] = {}
    for version in sorted(map(Version, versions)):
        newest[version.major, version.minor] = version
    return [str(version) for version in newest.values()]


def nearest(version: str, versions: Iterable[str], number: int = 4) -> list[str]:
    """The released versions next to one that is not, oldest first."""
    ordered = sorted(map(Version, versions))
    below = [v for v in ordered if v < Version(version)]
    above = ordered[len(below) :]
    chosen = below[-(number - min(len(above), number // 2)) :] + above
    return [str(v) for v in chosen[:number]]


def unreleased(distribution: str, version: str, known: Iterable[str]) -> str:
    """That a version is none of the releases, with the nearest ones; empty if it is one."""
    known = list(known)
    try:
        wanted = Version(version)
    except InvalidVersion:
        return f"{version!r} is no version; the newest releases are {', '.join(known[-4:])}"
    if wanted in map(Version, known) or wanted.is_prerelease or wanted.local:
        return ""
    python = ".".join(map(str, sys.version_info[:2]))
    return (
        f"the package index has no {distribution} {version} for Python {python}; the nearest "
        f"releases are {', '.join(nearest(version, known))}"
    )


def _version(name: str, tags: frozenset[object]) -> Version | None:
    """The version of a file; None of a wheel for another Python or machine, and of other files."""
    if name.endswith(".whl"):
        _, version, _, fits = parse_wheel_filename(name)
        return version if tags & fits else None
    if name.endswith((".tar.gz", ".zip")):
        return parse_sdist_filename(name)[1]
    return None


@cache
def _files(distribution: str) -> tuple[File, ...]:
    found: list[File] = []
    problems = []
    for index in _indexes():
        try:
            found += _ask(f"{index.rstrip('/')}/{distribution}/")
        except (OSError, ValueError) as error:
            reason = getattr(error, "reason", None) or error
            problems.append(f"{urlsplit(index).hostname or 'a local index'}: {reason}")
    if not found:
        raise PackageIndexError(
            f"no package index tells the releases of {distribution} ({'; '.join(problems)}); "
            "check the network and pip's configuration (pip config list)"
        )
    return tuple(found)


def pip_configuration() -> dict[str, str]:
    """What pip is configured with, by the option's name; empty where pip is not installed.

    Environment variables win over the user's file, and that over the machine's, as in pip.
    """
    command = [sys.executable, "-P", "-m", "pip", "config", "list", "--disable-pip-version-check"]
    answer = subprocess.run(command, capture_output=True, text=True, check=False).stdout
    found: dict[str, str] = {}
    for line in answer.splitlines():
        key, equals, value = line.partition("=")
        section, _, name = key.rpartition(".")
        if equals and section in ("global", "install", ":env:"):
            kept = section != ":env:" and os.environ.get(f"PIP_{name.upper().replace('-', '_')}")
            found[name] = kept or value[1:-1]
    return found


def _indexes() -> list[str]:
    configured = pip_configuration()
    if "no-index" in configured:
        return []
    return [configured.get("index-url", PYPI), *configured.get("extra-index-url", "").split()]


def _ask(url: str) -> Sequence[File]:
    """The files that an index has of a distribution.

    Raises:
        OSError: no answer.
        ValueError: an answer that is none.
    """
    parts = urlsplit(url)
    if parts.scheme == "file":
        url += "index.html"
    headers = {"Accept": "text/html"}
    if parts.username:  # urllib does not take them out of the address
        user = f"{unquote(parts.username)}:{unquote(parts.password or '')}"
        headers["Authorization"] = f"Basic {base64.b64encode(user.encode()).decode()}"
        url = urlunsplit(parts._replace(netloc=parts.netloc.rpartition("@")[2]))
    try:
        request = urllib.request.Request(url, headers=headers)
        with urllib.request.urlopen(request, timeout=TIMEOUT) as answer:
            text = answer.read().decode("utf-8")
    except urllib.error.HTTPError as error:
        if error.code == 404:  # this index does not know it, another may
            return ()
        raise
    except urllib.error.URLError:
        if parts.scheme == "file":
            return ()
        raise
    page = _Page()
    page.feed(text)
    return page.files


class _Page(HTMLParser):
    """An index's page of a distribution, by PEP 503."""

    def __init__(self) -> None:
        super().__init__()
        self.files: list[File] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        if tag == "a" and found.get("href"):
            name = unquote(urlsplit(str(found["href"])).path.rpartition("/")[2])
            python = found.get("data-requires-python") or ""
            self.files.append(File(name, "data-yanked" in found, python))
