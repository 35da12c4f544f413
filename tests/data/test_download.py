"""What is downloaded is what was asked for, to the byte, and reads like what is shared."""

from __future__ import annotations

import gzip
import os
import tarfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from pytest_simbench.data import DataError, DataMissing, read
from pytest_simbench.data.download import digest, download
from pytest_simbench.data.sets import SETS, DataSet, data_set, default_folder
from tests.data.samples import archive, falling, source_file

FILES = {f"data/tosses_processed/{k}.pt": source_file(falling(10 + k)) for k in (0, 1, 10)}


@dataclass(frozen=True)
class Local(DataSet):
    """One whose source is a file."""

    path: str = ""

    @property
    def url(self) -> str:
        return Path(self.path).as_uri()


@pytest.fixture
def source(tmp_path: Path) -> Local:
    packed = archive({"README.md": b"?", **FILES}, tmp_path / "set.tar.gz")
    return Local(**{**vars(SETS["cube_tosses"]), "sha256": digest(FILES), "path": str(packed)})


def test_a_set_is_brought_checked_and_read(source: Local, tmp_path: Path) -> None:
    told: list[str] = []
    download(source, tmp_path / "new" / "data", told.append)
    found = read("cube_tosses", tmp_path / "new" / "data")
    assert [toss.index for toss in found.items] == [0, 1, 10]
    for toss in found.items:
        assert np.allclose(toss.state, falling(10 + toss.index), rtol=0, atol=1e-15)
    size = sum(map(len, FILES.values())) / 1e6
    assert told == [
        "cube_tosses: from github.com/DAIRLab/contact-nets, BSD-3-Clause",
        f"cube_tosses: 3 files, {size:.0f} MB, kept",
    ]
    (tmp_path / "file").touch()
    with pytest.raises(DataError, match="cube_tosses cannot be kept in .*/file: File exists"):
        download(source, tmp_path / "file", told.append)


def test_other_content_is_refused_and_not_kept(source: Local, tmp_path: Path) -> None:
    with pytest.raises(DataError, match="is not cube_tosses: the SHA-256 of its 3 files"):
        download(replace(source, sha256="0" * 64), tmp_path / "data")
    assert not (tmp_path / "data").exists()


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5])
def test_an_archive_that_is_cut_off_is_one_sentence(
    source: Local, tmp_path: Path, share: float
) -> None:
    path = Path(source.path)
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(DataError, match="cube_tosses cannot be downloaded from"):
        download(source, tmp_path / "data")


@pytest.mark.parametrize("kind", ["unwanted", "long name", "pax header", "packed"])
def test_nothing_of_an_archive_passes_the_limit(
    source: Local, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    monkeypatch.setattr("pytest_simbench.data.download.LARGEST", 10**6)
    header = tarfile.TarInfo("set/unwanted")
    header.type = {"long name": tarfile.GNUTYPE_LONGNAME, "pax header": tarfile.XHDTYPE}.get(
        kind, tarfile.REGTYPE
    )
    header.size = 2 * 10**6
    content = header.tobuf() + (os.urandom if kind == "packed" else bytes)(header.size)
    rest = gzip.decompress(Path(source.path).read_bytes())
    Path(source.path).write_bytes(gzip.compress(content + rest, 1))
    with pytest.raises(DataError, match="the archive is larger than any data set"):
        download(source, tmp_path / "data")


def test_a_server_that_is_not_there_is_one_sentence(source: Local, tmp_path: Path) -> None:
    with pytest.raises(DataError, match="cannot be downloaded from .*No such file"):
        download(replace(source, path=str(tmp_path / "none")), tmp_path / "data")


def test_a_set_that_is_not_there_says_what_brings_it(tmp_path: Path) -> None:
    with pytest.raises(DataMissing, match="simbench download cube_tosses, or --sim-data DIR"):
        read("cube_tosses", str(tmp_path))


def test_an_unknown_set_lists_those_there_are() -> None:
    with pytest.raises(DataError, match="no data set 'nosuch'; choose from cube_tosses"):
        data_set("nosuch")


@pytest.mark.parametrize("name", SETS)
def test_a_set_is_pinned(name: str) -> None:
    pinned = SETS[name]
    assert len(bytes.fromhex(pinned.commit)) == 20
    assert len(bytes.fromhex(pinned.sha256)) == 32
    assert pinned.commit in pinned.url


def test_the_users_folder_comes_first(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("SIMBENCH_DATA", str(tmp_path / "mine"))
    assert default_folder() == tmp_path / "mine"
    monkeypatch.delenv("SIMBENCH_DATA")
    assert default_folder() == tmp_path / "cache" / "pytest-simbench" / "data"
