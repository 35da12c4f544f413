"""Engines that are imported when they are needed."""

from __future__ import annotations

import importlib
import math
import signal
from contextlib import suppress
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pytest_simbench.ground.errors import NotSupportedError, SimulatorError
from pytest_simbench.laws import LAWS
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import Box, Pose, Scene, SceneError
from pytest_simbench.scene.friction import RULES
from pytest_simbench.scene.scene import WORDS
from pytest_simbench.simulator import (
    Capability,
    Deviation,
    Seen,
    Simulator,
    chosen_on,
    heavy,
    lazy_import,
)
from pytest_simbench.simulator.base import EYE, LOOK_AT, signals_kept, view_axes
from pytest_simbench.simulator.info import BEYOND, check_supported, importable, no_module
from pytest_simbench.testing.faults import mechanisms, true_scene
from tests.approval import assert_approved_message
from tests.worker.hosted import Toy


def test_an_engines_function_is_looked_up_once_and_its_state_each_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    engine = lazy_import("math")
    assert (engine.sqrt(4.0), engine.pi) == (2.0, math.pi)
    monkeypatch.setattr(math, "pi", 3.0)
    assert engine.pi == 3.0
    monkeypatch.delattr(importlib, "import_module")
    assert engine.sqrt(9.0) == 3.0


def test_signals_are_put_back_and_versions_are_those_that_are_installed() -> None:
    """Nothing is imported to be asked for what modules alone have."""
    before = signal.getsignal(signal.SIGUSR1)
    with suppress(KeyError), signals_kept(signal.SIGUSR1, signal.SIGUSR2):
        signal.signal(signal.SIGUSR1, signal.SIG_IGN)
        raise KeyError
    assert signal.getsignal(signal.SIGUSR1) == before
    assert not hasattr(lazy_import("no_such_engine"), "__path__")
    toy = Toy()
    toy.info = replace(Toy.info, distribution="numpy")  # type: ignore[misc]
    assert Simulator.versions(toy) == {"numpy": version("numpy")}
    toy.info = replace(Toy.info, distribution="no-such-engine")  # type: ignore[misc]
    assert Simulator.versions(toy) == {}


def test_what_is_here_of_an_engine(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    found = {name: importable(name) for name in ("json", "json.decoder", "no_such", "no.such", "")}
    assert found == {
        "json": True,
        "json.decoder": True,
        "no_such": False,
        "no.such": False,
        "": False,
    }
    assert no_module(["a|b", "c"]) == "a or b and no module c"
    info = replace(Toy.info, name="toy", install="get it", program=("TOY", "bin/toy"))
    monkeypatch.delenv("TOY", raising=False)
    assert info.no_program == "toy is not here (TOY is not set): get it"
    monkeypatch.setenv("TOY", str(tmp_path))
    assert info.no_program == f"toy is not here (TOY is {tmp_path}, which has no bin/toy): get it"
    (tmp_path / "bin" / "toy").mkdir(parents=True)
    assert info.no_program
    monkeypatch.setenv("TOY", str(tmp_path / "bin"))
    (tmp_path / "bin" / "bin").mkdir()
    (tmp_path / "bin" / "bin" / "toy").touch()
    assert info.no_program == replace(info, program=("", "")).no_program == ""
    assert info.modes == ("headless",)
    assert replace(info, capabilities=Capability.named("window gpu")).modes == ("headless", "gui")


def test_a_world_begins_with_no_steps_and_the_links_that_a_scene_names() -> None:
    toy, scene = Toy(), Scene("s", robot=panda(), apart=(("ground", "link/panda_link4"),))
    toy._steps = 5
    toy.begin(scene)
    assert (toy.scene, toy.prepared.robot, toy._steps) == (scene, scene.robot, 0)
    toy.begin(Scene("s"))
    assert toy.prepared is None
    with pytest.raises(SceneError, match="no such link"):
        toy.begin(Scene("s", robot=panda(), apart=(("ground", "link/elbow"),)))


def test_what_an_adapter_does_not_have_is_told() -> None:
    for method, *given, what in (
        (Simulator.read_file, "x", "reader of files"), (Simulator.push, 0, "forces on bodies"),
        (Simulator.lead, 0, 0, "bodies that move as prescribed"), (Simulator.save, "save and rest"),
        (Simulator.restore, 0, "save and restore"), (Simulator.contact_count, "contact count"),
        (Simulator.contact_forces, "contact forces"), (Simulator.joint_wrenches, "joint wrenches"),
        (Simulator.render, 1, 1, "offscreen picture"),
    ):  # fmt: skip
        with pytest.raises(NotSupportedError, match=f"^toy has no {what}"):
            method(Toy(), *given)


def test_what_adapters_share(monkeypatch: pytest.MonkeyPatch) -> None:
    """A mass far above any body's, the camera's axes, what profiles were chosen on, and that a
    version is none of the tested ones."""
    stone = Box("stone", (1.0, 1.0, 1.0), Pose.at(0.0, 0.0, 1.0), 3.0)
    assert [heavy(Scene("s")), heavy(Scene("s", (stone,)))] == [1e4, 3e4]
    axes = view_axes()
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert axes.T @ np.subtract(LOOK_AT, EYE) == pytest.approx([0, 0, math.dist(LOOK_AT, EYE)])
    assert (axes[2, 0], axes[2, 1] < 0.0) == (0.0, True)  # level, and down
    one, other = (Seen.seeds(name, 1, 2) for name in "ab")
    tosses = Seen.motions("cube_tosses", 0, 564, 6)
    assert chosen_on(one, real=(other,)) == {"tuned": (one,), "real": (one, tosses, other)}
    monkeypatch.setattr(Toy, "info", replace(Toy.info, tested_version="1.2", install="get it"))
    assert_approved_message(Simulator.untested(Toy()))
    monkeypatch.setattr(Toy, "versions", lambda self: {"toy": "1.2"})
    assert Simulator.untested(Toy()) == ""


@pytest.mark.parametrize(
    ("fact", "told"),
    [
        ({"modules": "mujoco"}, r"^info.modules of toy: give a tuple of str, not 'mujoco'$"),
        ({"deviations": ("soft",)}, r"^info.deviations of toy: give a tuple of Deviation, not \('"),
        ({"capabilities": "window"}, r"^info.capabilities of toy: give Capability.named\("),
        (
            {"friction_rule": "mean|most"},
            r"^info.friction_rule of toy: 'mean.most' .* from maximum, ",
        ),
    ],
)
def test_facts_of_another_type_are_refused(fact: dict[str, Any], told: str) -> None:
    with pytest.raises(SimulatorError, match=told):
        replace(Toy.info, name="toy", **fact)
    assert replace(Toy.info, friction_rule="|".join(RULES)).friction_rule


@pytest.mark.parametrize("word", BEYOND)
def test_a_scene_beyond_an_engine_is_refused(word: str) -> None:
    able = replace(Toy.info, capabilities=frozenset(Capability))
    less = replace(able, capabilities=able.capabilities - {BEYOND[word][0]})
    scene: Any = SimpleNamespace(name="s", words=frozenset({word}))
    check_supported(able, scene)
    check_supported(less, Scene("s"))
    with pytest.raises(NotSupportedError, match=f"^{able.name} .* scene 's' "):
        check_supported(less, scene)


def test_a_deviation_counts_in_scenes_that_there_are() -> None:
    with pytest.raises(SimulatorError, match=r"with 'cylindre', which none has; choose from .*box"):
        Deviation("body/*/mass", "weighs hulls", only="cylindre")
    made = [law.build() for law in LAWS] + [scene for scene, _ in mechanisms(Capability)]
    assert {*true_scene().words, *(word for scene in made for word in scene.words)} <= WORDS
