"""Interpreters of engines that cannot share pytest's: made for real, with a small package."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from pytest_simbench.sims.mujoco.adapter import MuJoCo

from pytest_simbench.client.environments import (
    MARKER,
    Environment,
    cache_variables,
    interpreter,
    missing,
)
from pytest_simbench.simulator import SimulatorInfo
from pytest_simbench.simulator.errors import SimulatorError


@pytest.fixture
def info(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[SimulatorInfo]:
    """A simulator whose engine is the package `six`."""
    monkeypatch.setenv("SIMBENCH_ENVIRONMENTS", str(tmp_path / "environments"))
    return replace(
        MuJoCo.info,
        name="sixth",
        distribution="six",
        modules=("no_such_module_here",),
        requirements=("six==1.16.0",),
        install="pytest --sim-install sixth",
        caches={"SIXTH_CACHE": "kernels"},
    )


def half_made(info: SimulatorInfo) -> Environment:
    environment = Environment.of(info)
    environment.python.parent.mkdir(parents=True)
    environment.python.touch()
    return environment


def test_create(info: SimulatorInfo) -> None:
    environment = Environment.of(info)
    assert environment.problem is not None
    assert interpreter(info) is None
    environment.create()
    assert environment.problem is None
    assert missing(info) is None
    assert environment.version() == "1.16.0"
    assert interpreter(info) == str(environment.python)
    environment.create()  # over an old one
    assert environment.problem is None


def test_one_that_does_not_install_stays_half_made(info: SimulatorInfo) -> None:
    info = replace(info, requirements=("./no/such/package",))
    with pytest.raises(SimulatorError, match="only half installed"):
        Environment.of(info).create()
    assert "half installed: pytest --sim-install sixth" in str(missing(info))


def test_an_engine_of_this_environment_has_none(info: SimulatorInfo) -> None:
    with pytest.raises(SimulatorError, match="needs no environment of its own"):
        Environment.of(replace(info, requirements=())).create()


def test_absent(info: SimulatorInfo) -> None:
    assert "not there yet: pytest --sim-install sixth" in str(missing(info))


def test_cut_off_while_installing(info: SimulatorInfo) -> None:
    half_made(info)
    assert "half installed" in str(missing(info))


@pytest.mark.parametrize("content", ["", "[]", "{}", "7"])
def test_spoilt_marker(info: SimulatorInfo, content: str) -> None:
    (half_made(info).folder / MARKER).write_text(content)
    assert "half installed" in str(missing(info))


def test_other_requirements_than_wanted(info: SimulatorInfo) -> None:
    (half_made(info).folder / MARKER).write_text(json.dumps({"requirements": ["six==1.15.0"]}))
    assert "holds six==1.15.0 instead of six==1.16.0" in str(missing(info))


def test_lost_interpreter(info: SimulatorInfo) -> None:
    environment = half_made(info)
    environment.python.unlink()
    (environment.folder / MARKER).write_text(json.dumps({"requirements": ["six==1.16.0"]}))
    assert "lost its interpreter" in str(missing(info))


def test_caches_are_kept_beside_it_unless_the_user_says_where(
    info: SimulatorInfo, tmp_path: Path
) -> None:
    environment = Environment.of(info)
    kept = environment.variables()
    assert kept == {"SIXTH_CACHE": str(environment.folder / "cache" / "kernels")}
    os.environ["SIXTH_CACHE"] = "elsewhere"
    try:
        assert cache_variables(info.caches, tmp_path) == {}
    finally:
        del os.environ["SIXTH_CACHE"]
