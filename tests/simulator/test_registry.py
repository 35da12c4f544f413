"""What distributions register, and what is wrong with it: no other simulator is lost by it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from pytest_simbench.ground.errors import SimulatorError
from pytest_simbench.simulator.registry import (
    adapter,
    address,
    known,
    problem,
    registered,
    registry,
    settings_of,
)


def distribution(folder: Path, name: str, *entries: str) -> None:
    metadata = folder / f"{name}-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = ["[pytest_simbench.simulators]", *entries]
    (metadata / "entry_points.txt").write_text("\n".join(lines))


MADE = """
from dataclasses import replace
from pytest_simbench.simulator import Settings
from tests.worker.hosted import Toy

def named(name, **more):
    return type(name, (Toy,), {"info": replace(Toy.info, name=name), **more})

tuned = {"profiles": {"tuned": Settings(0.004)}}
fine, other, bare = named("fine", **tuned), named("another", **tuned), named("bare", profiles={})
wrong, plain, number = named("wrong", profiles={"tuned": 3}), type("Plain", (Toy,), {"info": 3}), 3
"""
WHY = {
    "fine": "", "number": "is no Simulator subclass",
    "plain": "has no SimulatorInfo in its attribute info",
    "bare": "has no settings in its attribute profiles",
    "other": "says in its info that its name is 'another'",
    "wrong": "has wrong settings: profile 'tuned' is no instance of a class of Settings: 3",
    "gone": "does not import: AttributeError: module 'sim_made' has no attribute 'gone'",
    "raising": f"does not import: ValueError: {'no luck ' * 36}",
    "exiting": "does not import: SystemExit: 3",
}  # fmt: skip
"""Of adapters in these modules, why they cannot be used."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    distribution(tmp_path, "own", "mine = own:Mine", "twin = own:Mine", "all = own:Mine")
    distribution(tmp_path, "other", "twin = other:Twin", "a b = other:Twin", "mine = own:Mine")
    distribution(tmp_path, "malformed", "no entry")
    modules = {"made": MADE, "exiting": "raise SystemExit(3)", "stopped": "raise KeyboardInterrupt",
               "raising": "raise ValueError('no\\nluck ' * 99)"}  # fmt: skip
    for name, code in modules.items():
        (tmp_path / f"sim_{name}.py").write_text(code)
    places = {name: f"sim_{name if name in modules else 'made'}:{name}" for name in WHY}
    distribution(tmp_path, "tried", *(f"{name} = {place}" for name, place in places.items()))
    monkeypatch.syspath_prepend(tmp_path)
    for cached in (registry, registered, problem, adapter):
        cached.cache_clear()
    yield tmp_path
    sys.modules.pop("sim_made", None)
    for cached in (registry, registered, problem, adapter):
        cached.cache_clear()


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


@pytest.mark.usefixtures("folder")
def test_why_an_adapter_cannot_be_used() -> None:
    """It is known all the same; where it can be, its settings are those that it has."""
    for name, why in WHY.items():
        place = registry().entries[name].value
        told = f"the adapter of {name} ({place}, of tried 1.0) {why}"
        assert problem(name) == (told if why else None)
        assert address(name) == address(f"{name}==1.0") == (None if why else place)
    assert set(WHY) & registered().keys() == {"fine"}
    assert {*WHY, "twin", "all"} <= {*known()}
    assert settings_of("fine", "tuned", {"timestep": "0.001"}).timestep == 0.001
    for name, why in (("fine", "fine has no settings profile 'x'"), ("all", "own 1.0 registers")):
        with pytest.raises(SimulatorError, match=f"^{why}"):
            settings_of(name, "x", {})


def test_ctrl_c_is_no_fault_of_an_adapter(folder: Path) -> None:
    distribution(folder, "last", "stopped = sim_stopped:it")
    registry.cache_clear()
    with pytest.raises(KeyboardInterrupt):
        adapter("stopped")
