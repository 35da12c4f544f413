"""What a machine offers to a cluster, by what it has."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from types import SimpleNamespace

import pytest

from pytest_simbench.cluster import offers
from pytest_simbench.cluster.offers import PLUGIN, PYTHON

DRIVER = "/proc/driver/nvidia/version"
OUTSIDE = {"pybullet": "2.5", "sapien": None}
"""Engines with an environment of their own, and the version that it tells."""


def version(distribution: str) -> str:
    if distribution != "mujoco":
        raise PackageNotFoundError
    return "3.9"


@pytest.fixture(autouse=True)
def _a_bare_machine(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """No device, and no simulator whose name begins with less than m."""

    def outside(info: SimpleNamespace) -> SimpleNamespace | None:
        own = info.name in OUTSIDE
        return SimpleNamespace(version=lambda: OUTSIDE[info.name]) if own else None

    for name in ("DISPLAY", "WAYLAND_DISPLAY", "PATH"):
        monkeypatch.setenv(name, "")
    monkeypatch.setenv("SIMBENCH_ENVIRONMENTS", str(tmp_path))
    monkeypatch.setattr(offers, "missing", lambda info: None if info.name > "m" else "not here")
    monkeypatch.setattr(offers, "outside", outside)
    monkeypatch.setattr(offers, "version", version)
    monkeypatch.setattr(offers, "Path", lambda path: SimpleNamespace(exists=lambda: False))
    monkeypatch.setattr(offers, "VULKAN_PROBE", "raise SystemExit(1)")


def offered(names: Iterable[str] | None = (), slots: int = 3) -> set[str]:
    """What there is besides what every node offers; of each as much as it has slots."""
    found = offers.here(slots, names)
    assert {(type(amount), amount) for amount in found.values()} == {(float, slots)}
    assert {"simbench", PLUGIN, PYTHON} <= {*found}
    return {*found} - {"simbench", PLUGIN, PYTHON}


def test_simulators_are_offered_by_name_and_version(tmp_path: Path) -> None:
    for name in ("mujoco==3.3.7", "drake==1.0", "mujoco", "nothing==1.0"):
        (tmp_path / name).mkdir()
    assert offered(["drake", "pybullet", "sapien"], 2) == {"pybullet==2.5", "sapien==unknown"}
    assert offered() == set()
    found = {name for name in offered(None) if name.startswith(("d", "m", "nothing"))}
    assert found == {"mujoco==3.9", "mujoco==3.3.7==3.9"}


@pytest.mark.parametrize("variable", ["DISPLAY", "WAYLAND_DISPLAY", "PATH"])
def test_a_screen_and_xvfb_are_a_display(
    variable: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "Xvfb").touch(mode=0o755)
    monkeypatch.setenv(variable, str(tmp_path))
    assert offered() == {"display"}


def test_a_gpu_is_what_the_driver_tells_of(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(offers, "Path", lambda path: SimpleNamespace(exists=lambda: path == DRIVER))
    assert offered() == {"gpu"}


@pytest.mark.parametrize(
    ("probe", "timeout", "found"),
    [("", 30.0, {"vulkan"}), ("1/0", 30.0, set()), ("while True: pass", 0.2, set())],
)
def test_a_vulkan_device_is_what_a_probe_finds_quietly_and_in_time(
    probe: str, timeout: float, found: set[str], monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.setattr(offers, "VULKAN_PROBE", f"print('seen', flush=True)\n{probe}")
    monkeypatch.setattr(offers, "PROBE_TIMEOUT", timeout)
    assert offered() == found
    assert capfd.readouterr() == ("", "")
