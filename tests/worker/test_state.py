"""States that are none, from a real engine with an adapter that errs: found, named, survived."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.repeater import Repeater
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.records.record import Record
from pytest_simbench.scene import Scene, Trajectory
from pytest_simbench.tasks import Stacking
from pytest_simbench.tasks.base import Count, Jitter, Outcome
from tests.client.test_faults import Silent
from tests.tiny import Falling
from tests.worker.misshapen import BODIES, JOINTS, LATER, TIMES

ROBOT = Stacking().scene(1, Jitter()).robot


@dataclass(frozen=True)
class Turning(Falling):
    """The arm turns joints 1 to 3, each by another angle, while two cubes lie beside it."""

    name: ClassVar[str] = "turning"

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        cubes = Stacking().scene(seed, jitter).bodies
        return Scene("turning", cubes, ROBOT)

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        assert ROBOT is not None
        start = ROBOT.column("initial_position")
        position = np.tile(start, (200, 1))
        for joint, angle in enumerate((0.5, -0.1, -0.4)):
            position[:, joint] += angle * np.minimum(1.0, np.linspace(0.0, 2.0, 200))
        rest = np.zeros_like(position)
        with world.phase("turn"):
            world.follow(Trajectory(0.01, position, rest, rest), log_period=0.05)
        return Outcome({"landed": 1.0})


def misshapen(case: Case, fault: str) -> Case:
    adapter = "tests.worker.misshapen:Misshapen"
    return replace(case, adapter=adapter, environment={"UNRULY": fault}, stall_timeout=60.0)


EXPECTED = {
    "too few joints": "joint_state() must be an array of float64 (2, 9), not float64 (2, 8)",
    "no velocities": "joint_state() must be an array of float64 (2, 9), not float64 (9,)",
    "joints transposed": "joint_state() must be an array of float64 (2, 9), not float64 (9, 2)",
    "joints as a list": "joint_state() must be an array of float64 (2, 9), not a list",
    "joints of float32": "joint_state() must be an array of float64 (2, 9), not float32 (2, 9)",
    "joints of int": "joint_state() must be an array of float64 (2, 9), not int64 (2, 9)",
    "joints of objects": "joint_state() must be an array of float64 (2, 9), not object (2, 9)",
    "complex joints": "joint_state() must be an array of float64 (2, 9), not complex128 (2, 9)",
    "joints exchanged": "row 1, 'panda_joint2', starts at (-2.356), where the scene has (-0.7854); "
    "that is the place of 'panda_joint4', so the order is another",
    "joints reversed": "row 0, 'panda_joint1', starts at (0.035), where the scene has (0)",
    "joints not a number": "the state of the joints is not finite after loading",
    "joints of nothing": "joint_state() must be an array of float64 (2, 9), not a NoneType",
    "too few bodies": "body_state() must be an array of float64 (N, 13), not float64 (N-1, 13)",
    "too many bodies": "body_state() must be an array of float64 (N, 13), not float64 (N+1, 13)",
    "no velocity columns": "body_state() must be an array of float64 (N, 13), not float64 (N, 7)",
    "bodies of float32": "body_state() must be an array of float64 (N, 13), not float32 (N, 13)",
    "bodies of objects": "body_state() must be an array of float64 (N, 13), not object (N, 13)",
    "bodies exchanged": "so the order is another",
    "quaternion not a number": "must have length 1, but (nan, ",
    "quaternion of length 2": "must have length 1, but (2, 0, 0, 0) has 2",
    "quaternion of zeros": "must have length 1, but (0, 0, 0, 0) has 0",
    "quaternion x y z w": "(w, x, y, z)",
    "position infinite": "the state of the bodies is not finite after loading",
    "time as a text": "the time must be a float, not '0.0'",
    "time of nothing": "the time must be a float, not None",
    "time complex": "the time must be a float, not 0j",
    "time an array": "the time must be a float, not array([0.])",
}


def test_all_are_expected() -> None:
    assert set(EXPECTED) == {*JOINTS, *BODIES, *TIMES}


@pytest.mark.parametrize("fault", EXPECTED)
def test_found_when_the_world_is_loaded(case: Case, fault: str) -> None:
    free = len(Turning().scene(1, Jitter()).free_bodies)
    message = EXPECTED[fault]
    for text, number in (("N-1", free - 1), ("N+1", free + 1), ("N", free)):
        message = message.replace(f"({text},", f"({number},")
    record, _ = Repetition(misshapen(case, fault), Turning(), 1).run()
    assert record.error is not None
    assert (record.error.type, record.error.phase) == ("BadState", "load")
    assert message in record.error.message
    assert "mujoco" in record.error.message


@pytest.mark.parametrize(
    ("fault", "kind", "message"),
    [
        ("later float32", "BadState", "must be an array of float64 (2, 9), not float32 (2, 9)"),
        ("later too few", "EngineFailed", "ValueError"),  # numpy cannot even stack such samples
        (
            "joints 1 and 3 exchanged",
            "BadState",
            "panda_joint1, panda_joint3 stand at each other's",
        ),
    ],
)
def test_found_after_a_motion(case: Case, fault: str, kind: str, message: str) -> None:
    record, _ = Repetition(misshapen(case, fault), Turning(), 1).run()
    assert record.error is not None
    assert (record.error.type, record.error.phase) == (kind, "turn")
    assert message in record.error.message
    assert fault in LATER or "exchanged" in fault


def test_an_honest_adapter_passes(case: Case) -> None:
    record, error = Repetition(misshapen(case, "nothing"), Turning(), 1).run()
    assert error is None
    assert record.status == "ok"


def test_it_ends_that_repetition_alone(case: Case) -> None:
    kept: list[Record] = []
    repeater = Repeater(misshapen(case, "too few bodies"), 1, Silent(), kept.append)  # type: ignore[arg-type]
    repeater.run(Falling(), [1, 2])
    assert [record.status for record in kept] == ["failed", "failed"]
