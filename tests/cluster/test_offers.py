"""What a machine offers to a cluster, by what it has."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError
from pathlib import Path
from types import SimpleNamespace

import pytest

from pytest_simbench.cluster import offers
from pytest_simbench.cluster.offers import PYTHON, plugin
from pytest_simbench.simulator import SimulatorError

OUTSIDE = {
    "pybullet": SimpleNamespace(version=lambda: "2.5"),
    "sapien": SimpleNamespace(version=lambda: None),
}
"""Engines with an environment of their own, and the version that it tells."""


def version(distribution: str) -> str:
    if distribution != "mujoco":
        raise PackageNotFoundError
    return "3.9"


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> pytest.MonkeyPatch:
    """No display, and no simulator whose name begins with less than m."""
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "PATH"):
        monkeypatch.setenv(name, "")
    monkeypatch.setenv("SIMBENCH_ENVIRONMENTS", str(tmp_path))
    monkeypatch.setattr(offers, "missing", lambda info: None if info.name > "m" else "not here")
    monkeypatch.setattr(offers, "outside", lambda info: OUTSIDE.get(info.name))
    monkeypatch.setattr(offers, "version", version)
    return monkeypatch


def offered(*names: str) -> set[str]:
    """What there is besides what every node offers."""
    return {*offers.here(1, names)} - {"simbench", plugin(), PYTHON}


def test_simulators_are_offered_by_name_and_version(
    bare: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name in ("mujoco==3.3.7", "drake==1.0", "mujoco", "nothing==1.0"):
        (tmp_path / name).mkdir()
    assert offered("pybullet", "sapien") == {"pybullet==2.5", "sapien==unknown"}
    with pytest.raises(SimulatorError, match="drake cannot be offered: not here"):
        offered("drake")
    assert offers.here(3, []) == {"simbench": 3.0, plugin(): 3.0, PYTHON: 3.0}
    found = {name for name in offers.here(1) if name.startswith(("drake", "mujoco", "nothing"))}
    assert found == {"mujoco==3.9", "mujoco==3.3.7==3.9"}


def test_another_commit_is_another_version(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Wherever it lies; also where an adapter alone is another."""
    found = set()
    for place, text in (("a", "1"), ("b", "1"), ("c", "2")):
        files = {"pytest_simbench/x.py": "0", "pytest_simbench.sims/x.py": text}
        for name, code in (files | {"pytest_simbench/suites/x.py": place}).items():
            path = tmp_path / place / name
            path.parent.mkdir(parents=True)
            path.write_text(code)
        origin = str(tmp_path / place / "{}" / "__init__.py")
        monkeypatch.setattr(
            offers, "find_spec", lambda name, at=origin: SimpleNamespace(origin=at.format(name))
        )
        found.add(offers._code())
    assert len(found) == 2
    monkeypatch.setattr(offers, "find_spec", lambda name: None)  # adapters that are not installed
    assert offers._code() not in found


def test_a_display_is_a_screen_or_what_makes_one(bare: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "Xvfb").touch(mode=0o755)
    for variable in ("DISPLAY", "WAYLAND_DISPLAY", "PATH"):
        assert offered() == set()
        bare.setenv(variable, str(tmp_path))
        assert offered() == {"display"}
        bare.setenv(variable, "")
