"""Runs of an arm: read, halved, converted from the source's tables."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pytest_simbench.data import DataError, pushes

URDF = "<robot/>"


def poses(rows: int, seed: int) -> np.ndarray:
    """Made-up ones, (rows, 7)."""
    rng = np.random.default_rng(seed)
    turns = Rotation.random(rows, rng=rng).as_quat(scalar_first=True)
    return np.hstack([rng.uniform(-1, 1, (rows, 3)), turns])


def table(time: np.ndarray, bodies: list[np.ndarray]) -> bytes:
    """As the source has a run."""
    lines = []
    for k, moment in enumerate(time):
        cells = [str(k + 1), f"{moment:.5f}"]
        for body in bodies:
            turn = Rotation.from_quat(body[k, 3:], scalar_first=True).as_matrix()
            numbers = [*(1000 * body[k, :3]), 0, 0, 0, 0.5, *turn.T.ravel()]
            cells += [f"{number:.9f}" for number in numbers] + [""]
        lines.append("\t".join(cells))
    return "\n".join(lines).encode()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four runs that push and one that does not, converted from tables."""
    time = np.arange(30) / 100
    names = [f"CubeExp000{k}" for k in (1, 2, 3, 4)] + ["Single0001"]
    files = {
        f"x/{name}_6D.tsv": table(time, [poses(30, 0), poses(30, 1 + k), poses(30, 9 + k)])
        for k, name in enumerate(names)
    }
    pushes.convert({**files, "y/m1n6s300.urdf": URDF.encode(), "y/a.STL": b"mesh"}, tmp_path)
    return tmp_path


def test_tables_become_what_is_read_and_every_second_pair_is_held_out(folder: Path) -> None:
    found = pushes.read(folder)
    run = found.items[1]
    assert run.name == "CubeExp0002"
    for measured, seed in ((run.hand, 2), (run.cube, 10)):
        real = poses(30, seed)
        sign = np.sign(np.sum(real[:, 3:] * measured[:, 3:], axis=1, keepdims=True))
        assert measured[:, :3] == pytest.approx(real[:, :3], abs=1e-9)
        assert measured[:, 3:] * sign == pytest.approx(real[:, 3:], abs=1e-7)
    assert [r.number for r in found.of("CubeExp", "chosen_on")] == [1, 4]
    assert [r.number for r in found.of("CubeExp", "held_out")] == [2, 3]
    assert (folder / "mico_push" / "meshes" / "a.STL").read_bytes() == b"mesh"
    assert found == pushes.read(folder)


def test_a_folder_without_runs_is_none(tmp_path: Path) -> None:
    assert pushes.read(tmp_path) is None


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (lambda a: a.pop("runs"), "the array 'runs' is missing"),
        (lambda a: a.pop("CubeExp0001/cube"), "the array 'CubeExp0001/cube' is missing"),
        (lambda a: a.update({"runs": np.array(["Cube"])}), "'Cube' has no number of four digits"),
        (lambda a: a.update({"CubeExp0001/hand": poses(29, 0)}), "arrays that do not fit"),
        (lambda a: a.update({"CubeExp0001/cube": poses(31, 0)}), "arrays that do not fit"),
        (lambda a: a.update({"CubeExp0001/time": np.zeros((30, 1))}), "arrays that do not fit"),
        (lambda a: a["CubeExp0001/hand"].fill(np.nan), "values that are no numbers"),
        (lambda a: a["CubeExp0001/cube"].fill(np.inf), "values that are no numbers"),
        (lambda a: a.update({"CubeExp0001/time": np.arange(30)}), "values that are no numbers"),
        (lambda a: a["CubeExp0001/time"].__setitem__(7, 0.06), "time that stands still"),
        (lambda a: a["CubeExp0001/hand"].fill(0.0), "no rotations, or time"),
    ],
)
def test_arrays_that_are_no_runs_are_one_sentence(
    folder: Path, spoil: Callable[[dict[str, Any]], None], sentence: str
) -> None:
    path = folder / "mico_push" / "runs.npz"
    with np.load(path) as held:
        found = dict(held)
    spoil(found)
    np.savez(path, **found)
    with pytest.raises(DataError, match=sentence):
        pushes.read(folder)


def test_a_file_that_is_cut_off_or_no_table_is_one_sentence(folder: Path, tmp_path: Path) -> None:
    path = folder / "mico_push" / "runs.npz"
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(DataError, match="runs.npz holds no arrays"):
        pushes.read(folder)
    with pytest.raises(DataError, match=r"CubeExp0001_6D\.tsv is no table of a run"):
        pushes.convert({"CubeExp0001_6D.tsv": b"1\t2\n"}, tmp_path)
