"""The table that tells which simulator to take says what docs/data holds."""

from __future__ import annotations

import csv
import re
import statistics
from collections.abc import Iterator
from math import degrees
from pathlib import Path

import pytest

from pytest_simbench.laws import LAWS
from pytest_simbench.testing import CHECKS

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "docs" / "data"
TABLE = (ROOT / "README.md").read_text("utf-8").partition("<!-- choose -->\n")[2]
ROWS = {
    cells[0]: cells
    for line in TABLE.partition("<!-- /choose -->")[0].strip().splitlines()[2:]
    if (cells := line.strip("| ").split(" | "))
}
NAMES = {
    "SAPIEN": "sapien", "Omniverse PhysX": "ovphysx", "PhysX": "ovphysx", "ODE": "ode",
    "MuJoCo": "mujoco", "DART": "dart", "PyBullet": "pybullet", "Drake": "drake",
    "Gazebo": "gazebo", "Genesis": "genesis", "Newton": "newton",
}  # fmt: skip


def lines(name: str, **wanted: str) -> Iterator[dict[str, str]]:
    """Of a CSV in docs/data, those that have the wanted values."""
    with (DATA / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        yield from (row for row in csv.DictReader(file) if wanted.items() <= row.items())


def mean(name: str, column: str, **wanted: str) -> float:
    return statistics.mean(float(row[column] or 0) for row in lines(name, **wanted))


def law(name: str, simulator: str, column: str = "error") -> float:
    (row,) = lines("truth", profile="tuned", law=name, simulator=simulator)
    return abs(float(row[column]))


@pytest.mark.parametrize("need", ROWS)
def test_each_row_names_a_simulator_its_cost_who_is_wrong_and_the_page(need: str) -> None:
    _, take, because, cost, wrong, whence = ROWS[need]
    simulator = NAMES[take.split(",")[0]]
    assert because
    assert any(name in wrong for name in NAMES)
    assert re.match(r"\[\w+\]\(docs/\w+\.md\)", whence)
    if simulator != "ode":  # its costs stand on its page alone
        measured = mean("stacking", "cpu_cost", rules="ours", profile="tuned", simulator=simulator)
        assert float(cost) == pytest.approx(measured, abs=0.006)


@pytest.mark.parametrize(
    ("need", "count", "phenomena"),
    [
        ("hold in a hand", 3, ["grasping"]),
        ("free flight, tumbling", 14, ["free motion"]),
        ("impacts, bounces", 9, ["impact"]),
        ("friction, sliding", 17, ["sliding", "sticking"]),
        ("rolling", 7, ["rolling"]),
        ("springs, force limits", 15, ["joints"]),
    ],
)
def test_who_keeps_all_laws_does(need: str, count: int, phenomena: list[str]) -> None:
    simulator = NAMES[ROWS[need][1]]
    found = [
        float(row["ratio"])
        for phenomenon in phenomena
        for row in lines("truth", profile="tuned", simulator=simulator, phenomenon=phenomenon)
    ]
    assert f"keeps all {count} laws" in ROWS[need][2]
    assert (len(found), max(found) <= 1) == (count, True)


@pytest.mark.parametrize("simulator", sorted(set(NAMES.values())))
def test_the_page_of_an_engine_says_how_many_laws_it_keeps(simulator: str) -> None:
    page = " ".join((ROOT / "docs" / "engines" / f"{simulator}.md").read_text("utf-8").split())
    ratios = [row["ratio"] for row in lines("truth", profile="tuned", simulator=simulator)]
    kept = sum(bool(ratio) and float(ratio) <= 1 for ratio in ratios)
    assert f" {kept} of {len(ratios)} laws are kept with `tuned`" in page


def test_the_pages_count_laws_and_checks_right() -> None:
    glossary = (ROOT / "docs" / "glossary.md").read_text("utf-8")
    assert f"measures by {len(LAWS)} of them" in glossary
    assert f"conformance kit asks of an adapter; there are {len(CHECKS)}" in glossary
    assert f"conformance kit has {len(CHECKS)} checks" in " ".join(
        (ROOT / "docs" / "add_a_simulator.md").read_text("utf-8").split()
    )


THROW = {"rules": "ours", "profile": "tuned"}
STACK = {"rules": "ours", "profile": "default"}
CURVE = {"robot": "panda", "profile": "tuned", "way": "curve"}

TOLD = {
    "pick, place, stack": [
        ("keep 37 and", 100 * mean("stacking", "at_end", **STACK, simulator="mujoco")),
        ("34 % of the cubes", 100 * mean("stacking", "at_end", **STACK, simulator="newton")),
    ],
    "throw": [
        ("5 mm too far", 1000 * mean("throwing", "landing_error", **THROW, simulator="ovphysx")),
        ("Drake 26 mm", 1000 * mean("throwing", "landing_error", **THROW, simulator="drake")),
        ("Genesis 23", 1000 * mean("throwing", "landing_error", **THROW, simulator="genesis")),
    ],
    "heavy on light": [
        ("within 0.1 mm", 1000 * law("heavy_on_top", "ode")),
        ("PyBullet sinks by 58 mm", 1000 * law("heavy_on_top", "pybullet")),
        ("SAPIEN 8", 1000 * law("heavy_on_top", "sapien")),
        ("DART and Gazebo 7", 1000 * law("heavy_on_top", "gazebo")),
        ("Drake and Genesis 2", 1000 * law("heavy_on_top", "drake")),
    ],
    "hold in a hand": [
        ("11 mm in", 1000 * law("grip_holds", "pybullet")),
        ("3 mm in DART", 1000 * law("grip_holds", "dart")),
    ],
    "free flight, tumbling": [
        ("10 degrees in ODE", degrees(law("free_top", "ode"))),
        ("7 in SAPIEN", degrees(law("free_top", "sapien"))),
        ("4 in PhysX", degrees(law("free_top", "ovphysx"))),
        ("1.8 m/s", law("damped_fall", "pybullet", "value")),
        ("not 4.2", law("damped_fall", "pybullet", "exact")),
    ],
    "impacts, bounces": [
        ("48 cm in PyBullet", 100 * law("bounce_height", "pybullet", "value")),
        ("0.5 m/s in SAPIEN", law("elastic_chain", "sapien", "value")),
        ("1.0 in PhysX", law("elastic_chain", "ovphysx", "value")),
        ("0.42 m/s", law("dead_collision", "mujoco", "value")),
    ],
    "friction, sliding": [
        ("22 degrees in ODE", int(law("slide_straight", "ode"))),  # 22.5
        ("after 32 cm", 100 * law("stopping_distance_oblique", "ode", "value")),
    ],
    "rolling": [
        (
            "28 % too slowly",
            100 * law("rolling_cylinder", "sapien") / law("rolling_cylinder", "sapien", "exact"),
        ),
    ],
    "springs, force limits": [
        ("not 11", degrees(law("sag", "dart"))),
        (
            "93 % of",
            100 * law("effort_limit", "genesis", "value") / law("effort_limit", "genesis", "exact"),
        ),
    ],
    "push": [
        ("0.7 mm off after", 1000 * mean("pushing", "position_error", **CURVE, simulator="dart")),
        ("ODE ends 88 mm", 1000 * mean("pushing", "position_error", **CURVE, simulator="ode")),
        ("turns 119 degrees", degrees(law("push_turns", "ovphysx", "value"))),
        ("not 52", degrees(law("push_turns", "ovphysx", "exact"))),
    ],
    "like real tosses": [
        ("13 % of", mean("tossing", "position_error", profile="real", simulator="mujoco")),
        ("Drake 100 %", mean("tossing", "position_error", profile="default", simulator="drake")),
    ],
}
"""Words of a row with one number, and what the data have there, by the row."""


@pytest.mark.parametrize(
    ("need", "text", "value"),
    [(need, text, value) for need, told in TOLD.items() for text, value in told],
)
def test_each_number_is_that_of_the_data(need: str, text: str, value: float) -> None:
    assert text in " | ".join(ROWS[need])
    (number,) = re.findall(r"\d+(?:\.\d+)?", text)
    digits = len(number.partition(".")[2])
    assert f"{value:.{digits}f}" == number
