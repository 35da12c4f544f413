"""Impacts of a square: those that are made up are found again, and unclean ones are not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_simbench.data import DataError, impacts
from pytest_simbench.data.impacts import ANGLE_BIAS, SCALE, Impacts, clean_impacts, corner, tilt
from pytest_simbench.scene import STANDARD_GRAVITY, FloatArray
from tests.conftest import measured
from tests.data.samples import edited

BEFORE, AFTER = np.array([-0.7, -2.4, 3.0]), np.array([-0.4, 0.9, -20.0])


def toss(
    at: float = 20.3,
    angle: float = 0.4,
    height: float = 0.0,
    rows: int = 40,
    after: FloatArray = AFTER,
) -> FloatArray:
    """Rows as the source has them of a square that strikes `at` a row, with an angle [rad], that
    high above the table [m]."""
    time = ((np.arange(rows) - at) / impacts.RATE)[:, None]
    place = np.array([-0.4, height - corner(angle)[1], angle + ANGLE_BIAS])
    fallen = np.array([0.0, STANDARD_GRAVITY[2] / 2, 0.0]) * time**2
    return place + np.where(time < 0, BEFORE, after) * time + fallen


@pytest.mark.parametrize("at", [20.0, 20.3, 20.95])
@pytest.mark.parametrize("turns", [0, 1, -2])
def test_an_impact_is_found_between_rows_with_its_velocities(at: float, turns: int) -> None:
    angle = 0.4 + turns * np.pi / 2
    (found,) = clean_impacts(7, toss(at, angle, height=-0.001))
    assert (found.number, found.order) == (700, 0)
    assert found.place == pytest.approx([-0.4, -corner(angle)[1], angle], abs=1e-9)
    assert found.before == pytest.approx(BEFORE)
    assert found.after == pytest.approx(AFTER)


def test_what_is_no_clean_impact_of_one_corner_is_left_out() -> None:
    later, slow, bent = (toss() for _ in range(3))
    later[21:] += AFTER * 0.002  # the arcs do not meet
    slow[20:22] = slow[19]  # more than a row's time between the arcs
    bent[26:] += np.outer(np.arange(14) / impacts.RATE, [0.0, 0.3, 0.0])  # struck again, weakly
    wall = toss(after=BEFORE * [-1.0, 0.9, -1.0])
    for rows in (later, slow, bent, wall, toss(angle=0.05), toss(height=0.004), toss(at=8.5)):
        assert clean_impacts(1, rows) == []
    assert clean_impacts(1, toss()[:20]) == []  # none at all
    n = impacts.FLIGHT  # as many rows as it takes, on either side
    for at, rows, many in ((n - 0.7, 2 * n, 1), (n - 0.7, 2 * n - 1, 0), (n - 1.7, 2 * n, 0)):
        assert len(clean_impacts(1, toss(at=at, rows=rows))) == many


@pytest.mark.parametrize("way", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1 / SCALE[2])])
@pytest.mark.parametrize(("kick", "order"), [(0.39, 0), (-0.39, 0), (0.41, 1), (-0.41, 1)])
def test_an_earlier_impact_is_one_from_a_kick_on(way: Any, kick: float, order: int) -> None:
    rows = toss()
    rows[:5] += np.outer((np.arange(5) - 5) / impacts.RATE, kick * np.array(way))
    assert [found.order for found in clean_impacts(1, rows)] == [order]


def test_the_lowest_corner_is_the_lowest_of_four() -> None:
    for angle in np.linspace(-7.1, 7.0, 29):
        around = angle + np.pi / 4 + np.arange(4) * np.pi / 2
        corners = 0.03 * np.sqrt(2) * np.stack([np.cos(around), np.sin(around)], axis=1)
        assert corner(angle) == pytest.approx(corners[corners[:, 1].argmin()])
        assert abs(tilt(angle)) <= np.pi / 4


def test_flight_goes_back_and_on_from_the_impact() -> None:
    (found,) = clean_impacts(1, toss())
    place, velocity = found.flying(0.1)
    assert velocity == pytest.approx(BEFORE - [0.0, STANDARD_GRAVITY[2] * 0.1, 0.0])
    rise = BEFORE[1] * 0.1 - STANDARD_GRAVITY[2] * 0.1**2 / 2
    assert place[1] == pytest.approx(found.place[1] - rise)
    assert found.left(0.1) == pytest.approx(AFTER + np.array([0.0, STANDARD_GRAVITY[2] * 0.1, 0.0]))


def arrays() -> dict[str, Any]:
    rows = toss(impacts.FLIGHT - 0.7, rows=2 * impacts.FLIGHT)
    state = np.concatenate([np.stack([rows, rows]), np.zeros((2, len(rows), 3))], axis=2)
    return {"number": np.array([3, 2]), "state": state}


@pytest.mark.parametrize("name", impacts.PATHS)
def test_a_file_is_read_and_halves_are_of_even_and_odd_tosses(tmp_path: Path, name: str) -> None:
    assert impacts.read(tmp_path) is None
    (tmp_path / name).parent.mkdir(exist_ok=True)
    np.savez(tmp_path / name, **arrays())
    found = impacts.read(tmp_path)
    assert [item.number for item in found.half("all")] == [200, 300]
    assert [item.toss for item in found.half("chosen_on")] == [2]
    assert [item.toss for item in found.half("held_out")] == [3]
    assert found == impacts.read(tmp_path)
    assert found != Impacts(found.items[:1])


@pytest.mark.parametrize(
    ("edit", "says"),
    [
        (lambda found: found.pop("state"), "the array 'state' is missing"),
        (edited("number", np.array([1, 1])), "whole numbers, each once"),
        (edited("state", np.zeros((2, 40, 5))), r"the shape \(2, 40, 5\), not \(2, rows, 6\)"),
        (edited("state", np.zeros((2, 19, 6))), "too few rows"),
        (edited("state", np.full((2, 40, 6), np.nan)), "too large or no numbers"),
        (edited("state", np.full((2, 40, 6), -100.0)), "too large or no numbers"),
    ],
)
def test_other_arrays_are_one_sentence(
    tmp_path: Path, edit: Callable[[dict[str, Any]], None], says: str
) -> None:
    found = arrays()
    edit(found)
    np.savez(tmp_path / "planar_square.npz", **found)
    with pytest.raises(DataError, match=f"planar_square.npz holds no impacts: .*{says}"):
        impacts.read(tmp_path)


def test_files_of_the_source_are_converted(tmp_path: Path) -> None:
    table = np.hstack([toss(), np.zeros((40, 3))])
    text = "x,z,th,vx,vz,vth\n" + "\n".join(",".join(map(str, row)) for row in table)
    impacts.convert({f"a b/traj_{k}.csv": text.encode() for k in (10, 9)}, tmp_path)
    found = impacts.read(tmp_path)
    assert [item.number for item in found.items] == [900, 1000]
    assert found.items[0].after == pytest.approx(AFTER, rel=1e-3)
    with pytest.raises(DataError, match=r"a/traj_1.csv holds no toss"):
        impacts.convert({"a/traj_1.csv": b"x,z\n1,2\n"}, tmp_path)


def test_the_real_square_keeps_its_moment_and_no_impact_gives_energy() -> None:
    """By the impulse at the corner, whatever friction and restitution are."""
    chosen = measured("planar_impacts").half("chosen_on")
    assert len(chosen) >= 60
    before, after = (np.array([getattr(i, k) for i in chosen]) for k in ("before", "after"))
    change = after - before
    arm = np.array([corner(item.place[2]) for item in chosen])
    moment = arm[:, 0] * change[:, 1] - arm[:, 1] * change[:, 0]
    turned = float(moment @ change[:, 2]) / float(change[:, 2] @ change[:, 2])
    assert turned == pytest.approx(impacts.MOMENT, rel=0.03)
    energy = [np.linalg.norm(part * SCALE, axis=1) for part in (before, after)]
    assert (energy[1] < energy[0]).all()
