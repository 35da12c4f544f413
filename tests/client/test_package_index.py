"""Which releases there are: an index of files, as pip reads one too."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_simbench.client import package_index
from pytest_simbench.client.package_index import (
    PackageIndexError,
    nearest,
    newest_of_minors,
    releases,
    unreleased,
)

PAGE = """<!DOCTYPE html><html><body>
<a href="../../files/engine-1.9.0-py3-none-any.whl#sha256=00">engine-1.9.0-py3-none-any.whl</a>
<a href="engine-1.10.0.tar.gz" data-requires-python="&gt;=3.8">engine-1.10.0.tar.gz</a>
<a href="engine-1.11.0.tar.gz" data-yanked="broken">engine-1.11.0.tar.gz</a>
<a href="engine-2.0.0rc1.tar.gz">engine-2.0.0rc1.tar.gz</a>
<a href="engine-3.0.0.tar.gz" data-requires-python="&gt;=99">engine-3.0.0.tar.gz</a>
<a href="engine-1.8.0-cp27-cp27m-win32.whl">engine-1.8.0-cp27-cp27m-win32.whl</a>
<a href="readme.txt">readme.txt</a> <a href="engine.whl">engine.whl</a>
</body></html>"""


@pytest.fixture(autouse=True)
def forget() -> None:
    package_index.releases.cache_clear()


def test_what_can_be_installed_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without yanked ones, pre-releases, and files for other Pythons and machines."""
    (tmp_path / "engine").mkdir()
    (tmp_path / "engine" / "index.html").write_text(PAGE)
    monkeypatch.setenv("PIP_INDEX_URL", tmp_path.as_uri())
    monkeypatch.setenv("PIP_EXTRA_INDEX_URL", (tmp_path / "empty").as_uri())
    assert releases("Engine") == ["1.9.0", "1.10.0"]
    with pytest.raises(PackageIndexError, match=r"no package index tells the releases of nosuch"):
        releases("nosuch")


def test_an_index_that_does_not_answer_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIP_INDEX_URL", "http://127.0.0.1:9/simple")
    monkeypatch.setenv("PIP_EXTRA_INDEX_URL", "http://127.0.0.1:9/more")
    with pytest.raises(PackageIndexError, match=r"127.0.0.1: .*refused.*; check the network"):
        releases("engine")


def test_the_last_of_each_minor_version() -> None:
    assert newest_of_minors(["3.10.0", "3.2.0", "3.2.7", "3.9.0"]) == ["3.2.7", "3.9.0", "3.10.0"]


@pytest.mark.parametrize(
    ("version", "near"),
    [("3.5", ["3.1", "3.2", "4.0", "4.1"]), ("9", ["3.1", "3.2", "4.0", "4.1"]),
     ("1", ["3.0", "3.1", "3.2", "4.0"])],
)  # fmt: skip
def test_the_nearest_releases(version: str, near: list[str]) -> None:
    assert nearest(version, ["3.0", "3.1", "3.2", "4.0", "4.1"]) == near


def test_no_release_is_one_sentence() -> None:
    assert unreleased("engine", "3.0.0", ["3.0", "3.1"]) == ""
    assert unreleased("engine", "4.0rc1", ["3.0"]) == ""  # whoever asks for one may have it
    assert "nearest releases are 3.0, 3.1" in unreleased("engine", "3.9", ["3.0", "3.1"])
    assert "'abc' is no version" in unreleased("engine", "abc", ["3.0"])
