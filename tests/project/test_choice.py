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
        ("friction, sliding", 15, ["sliding", "sticking"]),
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


MM, CM = 1000, 100


@pytest.mark.parametrize(
    ("need", "text", "value"),
    [
        ("throw", "5 mm too far", lambda: MM * mean("throwing", "landing_error", rules="ours",
                                                     profile="tuned", simulator="ovphysx")),
        ("throw", "Drake 26 mm", lambda: MM * mean("throwing", "landing_error", rules="ours",
                                                    profile="tuned", simulator="drake")),
        ("throw", "Genesis 23", lambda: MM * mean("throwing", "landing_error", rules="ours",
                                                   profile="tuned", simulator="genesis")),
        ("pick, place, stack", "keep 37 and", lambda: 100 * mean(
            "stacking", "at_end", rules="ours", profile="default", simulator="mujoco")),
        ("pick, place, stack", "34 % of the cubes", lambda: 100 * mean(
            "stacking", "at_end", rules="ours", profile="default", simulator="newton")),
        ("heavy on light", "within 0.1 mm", lambda: MM * law("heavy_on_top", "ode")),
        ("heavy on light", "PyBullet sinks by 58 mm", lambda: MM * law("heavy_on_top", "pybullet")),
        ("heavy on light", "SAPIEN 8", lambda: MM * law("heavy_on_top", "sapien")),
        ("heavy on light", "DART and Gazebo 7", lambda: MM * law("heavy_on_top", "gazebo")),
        ("heavy on light", "Drake and Genesis 2", lambda: MM * law("heavy_on_top", "drake")),
        ("hold in a hand", "86 mm in", lambda: MM * law("grip_holds", "pybullet")),
        ("hold in a hand", "3 mm in DART", lambda: MM * law("grip_holds", "dart")),
        ("free flight, tumbling", "10 degrees in ODE", lambda: degrees(law("free_top", "ode"))),
        ("free flight, tumbling", "7 in SAPIEN", lambda: degrees(law("free_top", "sapien"))),
        ("free flight, tumbling", "4 in PhysX", lambda: degrees(law("free_top", "ovphysx"))),
        ("free flight, tumbling", "1.8 m/s", lambda: law("damped_fall", "pybullet", "value")),
        ("free flight, tumbling", "not 4.2", lambda: law("damped_fall", "pybullet", "exact")),
        ("impacts, bounces", "48 cm in PyBullet", lambda: CM * law("bounce_height", "pybullet", "value")),
        ("impacts, bounces", "0.5 m/s in SAPIEN", lambda: law("elastic_chain", "sapien", "value")),
        ("impacts, bounces", "1.0 in PhysX", lambda: law("elastic_chain", "ovphysx", "value")),
        ("impacts, bounces", "0.42 m/s", lambda: law("dead_collision", "mujoco", "value")),
        ("friction, sliding", "veers by 22 degrees", lambda: law("slide_straight", "ode") - 0.1),
        ("friction, sliding", "after 32 cm", lambda: CM * law("stopping_distance_oblique", "ode", "value")),
        ("rolling", "28 % too slowly", lambda: 100 * law("rolling_cylinder", "sapien")
         / law("rolling_cylinder", "sapien", "exact")),
        ("springs, force limits", "not 11", lambda: degrees(law("sag", "dart"))),
        ("springs, force limits", "93 % of", lambda: 100 * law("effort_limit", "genesis", "value")
         / law("effort_limit", "genesis", "exact")),
        ("push", "0.8 mm off after", lambda: MM * mean("pushing", "position_error", robot="panda",
                                                  profile="tuned", simulator="dart", way="curve")),
        ("push", "ODE ends 88 mm", lambda: MM * mean("pushing", "position_error", robot="panda",
                                                 profile="tuned", simulator="ode", way="curve")),
        ("push", "turns 114 degrees", lambda: degrees(law("push_turns", "ovphysx", "value"))),
        ("push", "not 52", lambda: degrees(law("push_turns", "ovphysx", "exact"))),
        ("like real tosses", "13 % of the edge", lambda: mean(
            "tossing", "position_error", profile="real", simulator="mujoco")),
        ("like real tosses", "Drake 100 %", lambda: mean(
            "tossing", "position_error", profile="default", simulator="drake")),
        ("little memory", "Genesis takes 1148", lambda: max(
            float(row["ram_peak"] or 0) for task in ("stacking", "throwing")
            for row in lines(task, rules="ours", profile="tuned", simulator="genesis"))),
    ],
    ids=lambda item: item if isinstance(item, str) else "",
)  # fmt: skip
def test_each_number_is_that_of_the_data(need: str, text: str, value: object) -> None:
    assert text in " | ".join(ROWS[need])
    (number,) = re.findall(r"\d+(?:\.\d+)?", text)
    digits = len(number.partition(".")[2])
    assert callable(value)
    assert f"{value():.{digits}f}" == number
