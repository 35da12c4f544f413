"""What distributions register, and what is wrong with it: no other simulator is lost by it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from pytest_simbench.simulator.registry import registry


def distribution(folder: Path, name: str, *entries: str) -> None:
    metadata = folder / f"{name}-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = ["[pytest_simbench.simulators]", *entries]
    (metadata / "entry_points.txt").write_text("\n".join(lines))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    distribution(tmp_path, "own", "mine = own:Mine", "twin = own:Mine", "all = own:Mine")
    distribution(tmp_path, "other", "twin = other:Twin", "a b = other:Twin", "mine = own:Mine")
    distribution(tmp_path, "malformed", "no entry")
    monkeypatch.syspath_prepend(tmp_path)
    registry.cache_clear()
    yield tmp_path
    registry.cache_clear()


def test_what_is_broken_spoils_nothing_else(folder: Path) -> None:
    found = registry()
    assert {"mine", "mujoco"} <= found.entries.keys()
    assert list(found.entries) == sorted(found.entries)
    wrong = "cannot be its name: use letters, digits, _ and - (not all, not none)"
    assert {name: found.broken[name] for name in ("all", "a b")} == {
        "all": f"own 1.0 registers a simulator as 'all', which {wrong}",
        "a b": f"other 1.0 registers a simulator as 'a b', which {wrong}",
    }
    both = "own 1.0 (own:Mine)", "other 1.0 (other:Twin)"
    assert found.broken["twin"] in {
        f"twin is registered by {first} and {second}; uninstall or rename one of them"
        for first, second in (both, both[::-1])
    }
    (told,) = found.unreadable
    path = folder / "malformed-1.0.dist-info"
    assert told.startswith(f"the metadata of the distribution {path} cannot be read (")
    assert told.endswith("); simulators in it are not known")
