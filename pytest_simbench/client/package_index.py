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
from ast import literal_eval
from bisect import bisect
from collections.abc import Iterable
from contextlib import suppress
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

from pytest_simbench.ground.errors import SimulatorError

PYPI = "https://pypi.org/simple"
"""Where pip asks when nothing is configured."""

TIMEOUT = 30.0
"""For an index to answer [s]."""


class PackageIndexError(SimulatorError):
    """The package index cannot be asked."""


@cache
def releases(distribution: str) -> list[str]:
    """The releases that can be installed here, oldest first.

    Those that were taken back (yanked), pre-releases, and those without a file for this Python and
    machine are left out.

    Raises:
        PackageIndexError: no index answers, or none knows the distribution.
    """
    page, problems = _Page(), []
    for index in _indexes():
        try:
            page.feed(_ask(f"{index.rstrip('/')}/{canonicalize_name(distribution)}/"))
        except (OSError, ValueError) as error:
            reason = getattr(error, "reason", None) or error
            problems.append(f"{urlsplit(index).hostname or 'a local index'}: {reason}")
    if not page.files:
        raise PackageIndexError(
            f"no package index tells the releases of {distribution} ({'; '.join(problems)}); "
            "check the network and pip's configuration (pip config list)"
        )
    return [str(version) for version in sorted(page.versions)]


def newest_of_minors(versions: Iterable[str]) -> list[str]:
    """The last of each minor version (3.2.0, 3.2.1, 3.3.0: 3.2.1 and 3.3.0), oldest first."""
    newest = {(v.major, v.minor): v for v in sorted(map(Version, versions))}
    return [str(version) for version in newest.values()]


def nearest(version: str, versions: Iterable[str]) -> list[str]:
    """The four released versions next to one that is not, oldest first."""
    ordered = sorted(map(Version, versions))
    first = max(0, min(bisect(ordered, Version(version)) - 2, len(ordered) - 4))
    return [str(v) for v in ordered[first : first + 4]]


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
            variable = f"PIP_{name.upper().replace('-', '_')}"
            found[name] = os.environ.get(variable) or literal_eval(value)
    return found


def _indexes() -> list[str]:
    configured = pip_configuration()
    if configured.get("no-index", "0").lower() in ("1", "true", "yes", "y", "t", "on"):
        return []
    return [configured.get("index-url", PYPI), *configured.get("extra-index-url", "").split()]


def _ask(url: str) -> str:
    """The page that an index has of a distribution; empty where it does not know it.

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
            return str(answer.read().decode("utf-8"))
    except urllib.error.HTTPError as error:
        if error.code != 404:
            raise
    except urllib.error.URLError:
        if parts.scheme != "file":
            raise
    return ""  # another one may know it


class _Page(HTMLParser):
    """Indexes' pages of a distribution, by PEP 503.

    Attributes:
        files: how many there are.
    """

    def __init__(self) -> None:
        super().__init__()
        self.files = 0
        self.versions: set[Version] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        if tag != "a" or not found.get("href"):
            return
        self.files += 1
        name = unquote(urlsplit(str(found["href"])).path.rpartition("/")[2])
        here = ".".join(map(str, sys.version_info[:3]))
        with suppress(InvalidSpecifier, InvalidSdistFilename, InvalidWheelFilename):
            version = _version(name)
            fits = here in SpecifierSet(found.get("data-requires-python") or "")
            if version and fits and not version.is_prerelease and "data-yanked" not in found:
                self.versions.add(version)


def _version(name: str) -> Version | None:
    """The version of a file; None of a wheel for another Python or machine, and of other files."""
    if name.endswith(".whl"):
        _, version, _, tags = parse_wheel_filename(name)
        return None if tags.isdisjoint(_tags()) else version
    return parse_sdist_filename(name)[1] if name.endswith((".tar.gz", ".zip")) else None


@cache
def _tags() -> frozenset[object]:
    """Of wheels for this Python and machine."""
    return frozenset(sys_tags())
