"""Settings: profiles, conversions, and errors that list what is valid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import pytest
from pytest_simbench.sims.mujoco.adapter import MuJoCo
from pytest_simbench.sims.mujoco.settings import MuJoCoSettings

from pytest_simbench.simulator import Settings, SettingsError
from pytest_simbench.simulator.registry import adapter, registered
from pytest_simbench.simulator.settings import (
    EACH,
    Each,
    Linear,
    Log,
    changed,
    changes,
    flaw,
    in_words,
    meanings,
    searched,
)

from ..conftest import ADAPTERS


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("timestep", "0.004", 0.004),
        ("noslip_iterations", "5", 5),
        ("cone", "elliptic", "elliptic"),
        ("condim", "4", 4),
        ("solref", "0.01/1", (0.01, 1.0)),
        ("solref", (0.01, 1), (0.01, 1.0)),
        ("solimp", "0/1/0.5", (0.0, 1.0, 0.5)),
    ],
)
def test_texts_become_values(name: str, text: Any, value: Any) -> None:
    assert getattr(changed(MuJoCoSettings(), {name: text}, "mujoco"), name) == value


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"speed": 1}, "mujoco has no setting 'speed'; choose from .*timestep=0.002"),
        ({"cone": "round"}, "mujoco.cone=round: choose from pyramidal, elliptic"),
        ({"solref": "1"}, "mujoco.solref=1: give 2 numbers, separated by '/'"),
        ({"timestep": "fast"}, "mujoco.timestep=fast: give a finite number"),
        ({"timestep": -1}, "mujoco.timestep=-1: give a number of seconds from 1e-06 to 0.01667"),
        ({"timestep": "0.0167"}, "mujoco.timestep=0.0167: give a number of seconds"),
        ({"timestep": "inf"}, "mujoco.timestep=inf: give a finite number"),
        ({"timestep": float("nan")}, "mujoco.timestep=nan: give a finite number"),
        ({"timestep": True}, "mujoco.timestep=True: give a finite number"),
        ({"timestep": None}, "mujoco.timestep=None: give a finite number"),
        ({"timestep": [0.1]}, "mujoco.timestep=.0.1.: give a finite number"),
        ({"noslip_iterations": 1.5}, "mujoco.noslip_iterations=1.5: give a whole number"),
        ({"noslip_iterations": "1.5"}, "mujoco.noslip_iterations=1.5: give a whole number"),
        ({"solref": "inf/1"}, "mujoco.solref=inf: give a finite number"),
        ({"solref": 3}, "mujoco.solref=3: give 2 numbers, separated by '/'"),
        ({"impratio": 0}, "mujoco.impratio=0: give a number above 0, 1 to 100 for instance"),
        ({"iterations": "-5"}, "mujoco.iterations=-5: give a number above 0"),
        ({"iterations": 10**26}, "mujoco.iterations=1e.26: give a number below 2147483648"),
        ({"noslip_iterations": -1}, "noslip_iterations=-1: give a number from 0 on, 0 to 20 for"),
        ({"solref": (0.02, 0)}, "mujoco.solref/2=0: give a number above 0"),
        ({"solimp": "1.01/5/5"}, "mujoco.solimp/1=1.01: give a number from 0 to 1, 0.5 to 0.999"),
        ({3: 3}, "mujoco has no setting 3; choose from .*timestep=0.002"),
        ({"x" * 9999: 3}, "mujoco has no setting 'xxxxx.{,40}; choose from .*timestep=0.002"),
        ({"cone": "x" * 9999}, "mujoco.cone='xxxxx.{,40}: choose from pyramidal, elliptic"),
        ({"cone": "x" * 40}, "mujoco.cone='xxxxx.{,40}: choose from pyramidal, elliptic"),
        ({"cone": "x" * 39}, f"mujoco.cone={39 * 'x'}: choose from pyramidal, elliptic"),
    ],
)
def test_bad_changes(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        changed(MuJoCoSettings(), changes, "mujoco")


def test_settings_that_are_searched_on_a_logarithmic_scale_may_have_zero() -> None:
    hard = changed(adapter("ode").profiles["tuned"], {"contact_cfm": 0}, "ode")
    assert hard.to_wire()["contact_cfm"] == 0


def test_every_profile_of_every_engine_has_a_time_step_that_is_fine_enough() -> None:
    for name in registered():
        for settings in adapter(name).profiles.values():
            assert 0 < changed(settings, settings.to_wire(), name).timestep <= 1 / 60


def test_settings_are_taken_as_they_are_told() -> None:
    """`simbench list --settings` says None of some, and 0.016667 s: neither was taken."""
    for name in registered():
        for settings in adapter(name).profiles.values():
            told = {key: in_words(value) for key, value in settings.to_wire().items()}
            found = changed(settings, told, name).to_wire()
            assert {key: in_words(value) for key, value in found.items()} == told
    assert in_words((0.123456, True, ("a", None))) == "0.12346/True/a/None"


def test_settings_travel_and_come_back() -> None:
    tuned = MuJoCo.profiles["tuned"]
    assert changed(MuJoCoSettings(), tuned.to_wire(), "mujoco") == tuned


@dataclass(frozen=True)
class Some(Settings):
    """Made up.

    Attributes:
        timestep: of the
            engine [s].
        first, second: two numbers.
    """

    timestep: Annotated[float, Log(1e-3, 0.01)] = 0.002
    first: Annotated[int, Linear(0, 5, when=("third", "a"))] = 3
    second: tuple[float, Annotated[float, Linear(0.5, 4)]] = (0.02, 1.0)
    third: Annotated[Literal["a", "b"], EACH] = "a"
    fourth: Annotated[bool, Each(when=("third", "a", "b"))] = False


@dataclass(frozen=True)
class Named(Settings):
    solver: str = "newton"


class Bare(Settings):
    solver = "newton"


def test_a_setting_may_be_a_text() -> None:
    assert changed(Named(), {"solver": "pgs"}, "sim") == Named(solver="pgs")
    with pytest.raises(SettingsError, match=r"^sim.solver=3: give a str$"):
        changed(Named(), {"solver": 3}, "sim")


def test_profiles_are_instances_of_dataclasses() -> None:
    assert flaw({"default": Settings(), "tuned": Named()}) == ""
    told = "what the class sets counts in a dataclass alone: write @dataclass(frozen=True) above "
    assert flaw({"default": Settings(), "tuned": Bare()}) == f"{told}class Bare"
    told = "profile 'tuned' is no instance of a class of Settings: "
    assert flaw({"tuned": 60 * "x"}) == f"{told}'{59 * 'x'}"


def test_ranges_are_read_from_the_annotations() -> None:
    told = {one.name: str(one) for one in searched(Some)}
    assert told == {
        "timestep": "0.001 to 0.01 log",
        "first": "0 to 5 (third a)",
        "second/2": "0.5 to 4",
        "third": "a or b",
        "fourth": "False or True (third a or b)",
    }
    assert [one.name for one in searched(Some) if one.whole] == ["first"]
    assert changes({"second/2": 3.0, "first": 1}, Some()) == {"second": (0.02, 3.0), "first": 1}
    assert changes({"second/2": 3.0, "second/1": 5.0}, Some()) == {"second": (5.0, 3.0)}


def test_meanings_are_those_of_the_docstring() -> None:
    assert meanings(Some) == {
        "timestep": "of the engine [s].",
        "first": "two numbers.",
        "second": "two numbers.",
        "third": "",
        "fourth": "",
    }


@pytest.mark.parametrize("name", ADAPTERS)
def test_every_adapter_declares_them(name: str) -> None:
    """Of each setting a meaning; the step and more may be searched, and each end can be taken."""
    base = adapter(name).profiles["default"]
    assert all(meanings(type(base)).values())
    declared = searched(type(base))
    assert "timestep" in {one.name for one in declared}
    assert len(declared) >= 5
    for one in declared:
        ends = one.over if isinstance(one.over, tuple) else (one.over.low, one.over.high)
        for end in ends:
            changed(base, changes({one.name: end}, base), name)
        if one.when:
            assert {one.when[0]} < {other.name for other in declared}
            changed(base, {one.when[0]: one.when[1]}, name)
