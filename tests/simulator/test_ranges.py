"""How settings may be searched: what adapters declare, and how it is read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import pytest

from pytest_simbench.simulator import Settings
from pytest_simbench.simulator.ranges import EACH, Linear, Log, changes, meanings, searched
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.simulator.settings import changed

from ..conftest import ADAPTERS


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


def test_ranges_are_read_from_the_annotations() -> None:
    told = {one.name: str(one) for one in searched(Some)}
    assert told == {
        "timestep": "0.001 to 0.01 log",
        "first": "0 to 5 (third a)",
        "second/2": "0.5 to 4",
        "third": "a or b",
    }
    assert [one.name for one in searched(Some) if one.whole] == ["first"]
    assert changes({"second/2": 3.0, "first": 1}, Some()) == {"second": (0.02, 3.0), "first": 1}


def test_meanings_are_those_of_the_docstring() -> None:
    assert meanings(Some) == {
        "timestep": "of the engine [s].",
        "first": "two numbers.",
        "second": "two numbers.",
        "third": "",
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
