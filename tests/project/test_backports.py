"""`.ci/backports` finds Debian's backports where the machine's own sources have Debian."""

from __future__ import annotations

import shutil
import subprocess
from hashlib import sha256
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / ".ci" / "backports"

pytestmark = pytest.mark.skipif(not shutil.which("apt-get"), reason="this machine has no apt")

LIST = """\
# a comment
deb [trusted=yes] file:{debian} bookworm main
deb [trusted=yes] file:{debian} bookworm-security main
deb [trusted=yes] file:{other} bookworm main
"""

SOURCES = """\
Types: deb
# a comment
URIs: file:{debian}
Suites: bookworm bookworm-security
Components: main
Trusted: yes

Types: deb
URIs: file:{other}
Suites: bookworm
Components: main
Trusted: yes
"""


PACKAGE = b"""\
Package: nothing
Version: 1
Architecture: all
Maintainer: nobody <nobody@example.org>
Description: nothing
Filename: nothing.deb
Size: 0
SHA256: e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855

"""


def archive(folder: Path, origin: str, *suites: str) -> Path:
    """An archive of one package."""
    for suite in suites:
        dist = folder / "dists" / suite
        packages = dist / "main" / "binary-amd64" / "Packages"
        packages.parent.mkdir(parents=True)
        packages.write_bytes(PACKAGE)
        (dist / "Release").write_text(
            f"Origin: {origin}\nCodename: {suite}\nSuite: {suite}\nArchitectures: amd64\n"
            "Components: main\nDate: Sat, 01 Jan 2022 00:00:00 UTC\n"
            f"SHA256:\n {sha256(PACKAGE).hexdigest()} {len(PACKAGE)} main/binary-amd64/Packages\n"
        )
    return folder


@pytest.mark.parametrize(("name", "text"), [("d.list", LIST), ("d.sources", SOURCES)])
def test_backports_come_from_where_debian_comes_from(tmp_path: Path, name: str, text: str) -> None:
    debian = archive(tmp_path / "mirror", "Debian", "bookworm", "bookworm-security")
    other = archive(tmp_path / "other", "Somebody else", "bookworm")
    parts, state, cache = (tmp_path / part for part in ("parts", "state", "cache"))
    parts.mkdir()
    (parts / name).write_text(text.format(debian=debian, other=other))
    options = [
        "-oDir::Etc::SourceList=/dev/null",
        f"-oDir::Etc::SourceParts={parts}",
        f"-oDir::State={state}",
        f"-oDir::Cache={cache}",
        "-oDir::State::Status=/dev/null",
        "-oAPT::Architecture=amd64",
        "-oAPT::Architectures::=amd64",
        "-oAPT::Sandbox::User=",
    ]
    for folder in (state / "lists" / "partial", cache / "archives" / "partial"):
        folder.mkdir(parents=True)
    subprocess.run(["apt-get", *options, "-qq", "update"], check=True)

    found = subprocess.run(
        [SCRIPT, "bookworm", *options], check=True, capture_output=True, text=True
    )

    assert found.stdout == f"deb file:{debian}/ bookworm-backports main\n"


def test_ci_names_no_host() -> None:
    assert [path.name for path in SCRIPT.parent.iterdir() if "://" in path.read_text()] == []
