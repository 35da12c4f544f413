"""Interpreters of engines that cannot share pytest's: made for real, with a small package."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest
from pytest_simbench.sims.mujoco.adapter import MuJoCo

from pytest_simbench.client import installing
from pytest_simbench.client.environments import (
    MARKER,
    Environment,
    cache_variables,
    create_all,
    existing,
    interpreter,
    missing,
    remove,
)
from pytest_simbench.simulator import SimulatorInfo
from pytest_simbench.simulator.errors import SimulatorError
from pytest_simbench.simulator.registry import adapter


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
        install="simbench install sixth",
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


def test_two_that_make_the_same_wait_for_each_other(info: SimulatorInfo) -> None:
    """The second one finds it made, and says meanwhile what it waits for."""
    environment, told = Environment.of(info), []
    with ThreadPoolExecutor() as pool, installing.alone(environment.folder, told.append):
        second = pool.submit(environment.create, told.append)
        while not told:
            assert not second.done()
        half_made(info)
        (environment.folder / MARKER).write_text(json.dumps({"requirements": ["six==1.16.0"]}))
        assert environment.problem is None
    # flock belongs to an open file, so that a thread waits as another process would
    assert told == ["another run is making the environment sixth; waiting for it\n"]
    second.result()
    assert environment.python.stat().st_size == 0  # nobody made it anew


def test_what_is_there_and_removing_it(info: SimulatorInfo) -> None:
    assert list(existing()) == []
    environment = half_made(info)
    with installing.alone(environment.folder, print):
        assert list(existing()) == [environment.folder]
    remove(environment.folder)
    assert list(existing()) == []


@pytest.mark.parametrize("kind", ["link", "dangling link", "file"])
def test_what_else_is_in_its_place_is_left_alone(
    info: SimulatorInfo, tmp_path: Path, kind: str
) -> None:
    environment, elsewhere = Environment.of(info), tmp_path / "elsewhere"
    environment.folder.parent.mkdir()
    if kind == "file":
        environment.folder.touch()
    else:
        environment.folder.symlink_to(elsewhere)
    if kind == "link":
        elsewhere.mkdir()
        (elsewhere / MARKER).write_text("mine")
    for act in (environment.create, lambda: remove(environment.folder)):
        with pytest.raises(SimulatorError, match="is a link|is no folder"):
            act()
    assert environment.folder.is_symlink() == (kind != "file")
    assert kind != "link" or (elsewhere / MARKER).read_text() == "mine"


def test_nothing_is_made_while_something_is_wrong_with_another(info: SimulatorInfo) -> None:
    wrong = replace(info, name="wrong", requirements=())
    with pytest.raises(SimulatorError, match="wrong needs no environment of its own"):
        create_all([Environment.of(info), Environment.of(wrong)], print)
    assert list(existing()) == []


def test_a_folder_that_takes_none_is_one_sentence(info: SimulatorInfo, tmp_path: Path) -> None:
    (tmp_path / "environments").touch()
    with pytest.raises(SimulatorError, match="environments cannot be made in .*exists"):
        Environment.of(info).create()


def test_a_release_lives_in_its_own_even_where_the_engine_is_installed_here(
    info: SimulatorInfo,
) -> None:
    release = adapter("mujoco==3.3.7").info
    assert "not there yet: simbench install mujoco==3.3.7" in str(missing(release))
    assert Environment.of(release).folder.name == "mujoco==3.3.7"
    assert missing(adapter("mujoco").info) is None


def test_pips_configuration_is_uvs_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("UV_INDEX", "mine")
    told = {"index-url": "a", "extra-index-url": "b c", "find-links": "d e", "timeout": "9"}
    assert installing._as_uv(told) == {"UV_DEFAULT_INDEX": "a", "UV_FIND_LINKS": "d,e"}


def test_one_that_does_not_install_stays_half_made(info: SimulatorInfo) -> None:
    info = replace(info, requirements=("./no/such/package",))
    with pytest.raises(SimulatorError, match="only half installed"):
        Environment.of(info).create()
    assert "half installed: simbench install sixth" in str(missing(info))


def test_an_engine_of_this_environment_has_none(info: SimulatorInfo) -> None:
    with pytest.raises(SimulatorError, match="needs no environment of its own"):
        Environment.of(replace(info, requirements=())).create()


def test_absent(info: SimulatorInfo) -> None:
    assert "not there yet: simbench install sixth" in str(missing(info))


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
