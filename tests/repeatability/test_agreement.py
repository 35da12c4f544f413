"""When and where two simulators part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pytest_simbench.client.motion import Motion
from pytest_simbench.repeatability.agreement import (
    FOLDER,
    Agreement,
    Parting,
    Sample,
    agreement,
    agreements,
)
from tests.repeatability.scripted import episode, motion, operation


def sample(label: str, times: Sequence[float], x: Sequence[float]) -> Sample:
    """One cube at positions x, at rest, in one wait; another that stays where it is."""
    motions = [motion([0.0], x[:1], [0.5]), motion(times, x, [0.5] * len(x))]
    return Sample(label, "t", 1, ["moving", "resting"], {"n": 1.0}, motions, np.array([[1.0]]))


TIMES = (0.1, 0.2, 0.3, 0.4)
WHAT = ("t, seed 1", "")


def test_an_agreement_is_known_in_full() -> None:
    """Time and place of the first sample beyond each distance."""
    first = sample("a", TIMES, [0.2, 0.2, 0.2, 0.2])
    second = replace(sample("b", TIMES, [0.2, 0.2005, 0.2015, 0.25]), counts={"n": 0.5})
    place = (0.2, 0.0, 0.0)
    partings = {0.001: Parting(0.3, "moving", place), 0.01: Parting(0.4, "moving", place)}
    assert agreement(first, second) == Agreement(WHAT, "a", "b", partings, None, 0.4, False)
    assert str(partings[0.01]) == "0.40 s, moving at (0.20, 0.00, 0.00)"
    near = sample("b", TIMES, [0.2009] * 4)
    never = Agreement(WHAT, "a", "b", {0.001: None, 0.01: None}, None, 0.4, True)
    assert agreement(first, near) == never


def test_commands_that_part() -> None:
    first, near, far, longer, waits, none = (
        replace(sample("a", TIMES, [0.2] * 4), asked=np.array(rows).reshape(-1, 3))
        for rows in (
            [1.0, 0.1, 0.2], [1.0, 0.1, 0.2005], [1.0, 0.1, 0.21], [1.1, 0.1, 0.2],
            [1.0, np.nan, np.nan], [],
        )
    )  # fmt: skip
    assert agreement(first, near).commands_part is None
    for other in (far, longer, waits, none):
        assert agreement(first, other).commands_part == 0.0
        assert agreement(other, first).commands_part == 0.0


def moving(label: str, ends: Sequence[float]) -> Sample:
    """A cube that falls sideways, with 2 m/s2, from the moment at which the second of two waits
    begins, however long the first one took; `ends` are the ends of the waits [s]."""
    motions, began = [], 0.0
    for number, end in enumerate((0.0, *ends)):
        time = np.array([0.0]) if number == 0 else np.linspace(began, end, 6)[1:]
        bodies = np.zeros((len(time), 1, 13))
        if number == 2:
            bodies[:, 0, 0], bodies[:, 0, 7] = (time - began) ** 2, 2 * (time - began)
        motions.append(Motion(time, np.zeros((len(time), 2, 0)), bodies))
        began = end
    return Sample(label, "t", 1, ["cube"], {}, motions, np.array([[0.4], [0.5]]))


def test_each_operation_has_a_clock_of_its_own() -> None:
    """The steps of one simulator make a wait of 0.4 s last 0.41 s. At the same moment of the same
    motion the cubes are together; at the same simulated time they are 10 mm apart."""
    first, second = moving("a", (0.4, 0.9)), moving("b", (0.41, 0.91))
    found = agreement(first, second)
    assert found.partings == {0.001: None, 0.01: None}
    assert found.until == pytest.approx(0.9)


def test_partings_are_told_by_the_first_one_s_time() -> None:
    first, second = moving("a", (0.4, 0.9)), moving("b", (0.41, 0.91))
    second.motions[2].bodies[3:, 0, 0] += 0.02
    second = replace(second, asked=np.array([[0.4], [0.6]]))
    for one, other, when, asked in ((first, second, 0.8, 0.4), (second, first, 0.81, 0.41)):
        found = agreement(one, other)
        millimetre = found.partings[0.001]
        assert millimetre.time == pytest.approx(when)
        assert found.commands_part == pytest.approx(asked)


def test_kept_and_read_back(tmp_path: Path) -> None:
    """Only what is of the same task, seed and scene is compared."""
    others = {
        "c": {"seed": 2}, "d": {"task": "u"}, "e": {"bodies": ["moving", "other"]},
        "f": {"test": "test_other"}, "g": {"parameters": '{"task.n": 2}'}, "h": {"label": "a"},
    }  # fmt: skip
    for name in "abdefghc":
        kept = replace(
            sample(name, TIMES, [0.2] * 4),
            asked=np.array([[0.2, np.nan, np.nan], [0.2, 1.0, 2.0]]),
            **others.get(name, {}),
        )
        kept.save(tmp_path, f"{FOLDER}/{name}.npz")
    read = Sample.load(tmp_path / FOLDER / "c.npz")
    assert (read.label, read.seed, read.bodies) == ("c", 2, ["moving", "resting"])
    assert read.counts == {"n": 1.0}
    assert np.array_equal(read.asked, kept.asked, equal_nan=True)
    assert [len(motion) for motion in read.motions] == [1, 4]
    none = replace(
        kept, motions=kept.motions[:1], asked=np.zeros((0, 3))
    )  # a task that asks nothing
    none.save(tmp_path, "none.npz")
    assert [len(motion) for motion in Sample.load(tmp_path / "none.npz").motions] == [1]
    pairs = [(a.first, a.second) for a in agreements(tmp_path)]
    assert pairs == [("a", "b"), ("b", "a")]
    assert agreements(tmp_path / "nothing") == []


@pytest.mark.parametrize(
    "wrong",
    [
        {"facts": np.array("[]")},
        {"facts": np.array("nonsense")},
        {"facts": np.array("[" * 9999)},
        {"facts": np.array('{"label": "a", "task": "t", "seed": "x", "bodies": [], "counts": {}}')},
        {"time": np.zeros(2)},
        {"time": np.array([0.0, 0.4, 0.3, 0.2, 0.1])},
        {"time": np.full(5, np.nan)},
        {"lengths": np.array([5, 0])},
        {"lengths": np.array([-1, 6])},
        {"lengths": np.array([2.5, 2.5])},
        {"bodies": np.zeros((5, 2, 7))},
        {"bodies": np.full((5, 2, 13), np.inf)},
        {"joints": np.zeros(5)},
        {"commands": np.array(["x"])},
        {"durations": np.zeros(3)},
        {"durations": None},
    ],
    ids=lambda wrong: next(iter(wrong)),
)
def test_a_file_with_something_else_in_it(tmp_path: Path, wrong: dict[str, object]) -> None:
    path = tmp_path / "a.npz"
    sample("a", TIMES, [0.2] * 4).save(path.parent, path.name)
    with np.load(path) as data:
        arrays = {**data, **wrong}
    np.savez(path, **{k: v for k, v in arrays.items() if v is not None})
    with pytest.raises(ValueError, match=f"{path} holds no motion of pytest-simbench"):
        Sample.load(path)


def test_what_is_commanded_is_the_end_of_each_motion() -> None:
    """And nothing where the world is left alone."""
    tape = [operation("wait", "a", 0.5), operation("follow", "b", 0.2, np.array([0.3]))]
    motions = [motion([0.0], [0.0], [0.5])] * 3
    found = Sample.of(episode({}, motions, tape), "sim", "t", 7)
    assert found.motions is motions
    assert Sample.of(episode({}, motions, tape[:1]), "sim", "t", 7).asked.tolist() == [[0.5]]
    assert np.array_equal(found.asked, [[0.5, np.nan], [0.2, 0.3]], equal_nan=True)
    assert (found.label, found.task, found.seed, found.bodies) == ("sim", "t", 7, ("a", "b"))
