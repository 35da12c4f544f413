"""A scene that is left to itself: what is measured, and what moved starts do."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pytest_simbench.client.motion import Motion
from pytest_simbench.experiment.case import Case
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import Box, Compound, Pose, Scene, SceneError, Start
from pytest_simbench.tasks import Carrying, Holding, Jitter, Nesting, Settling, Task, rests_on
from pytest_simbench.tasks.resting import by_poses, spread
from pytest_simbench.tasks.settling import deepest, kinetic_energy, tilted
from tests.conftest import performed
from tests.tasks.scripted import Mishap, ScriptedProcess, move, perform
from tests.tasks.scripted_scene import ROBOT, Moved

NONE = Jitter(0.0, 0.0)
FRAME = Pose((0.0, 0.0, -0.05), (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0))
SLAB = Box("slab", (0.3, 0.3, 0.1), Pose.at(0, 0, 0.05), 1.0)
LEGS = tuple(Box(str(x), (0.02, 0.02, 0.1), Pose.at(x, 0, 0)) for x in (-0.05, 0.05))
STOOL = Compound("stool", LEGS, Pose.at(0, 0, 0.16), 0.5, moments=(1e-3,) * 3, file_frame=FRAME)
SCENE = Scene("stool on slab", (SLAB, STOOL))


def test_a_tilt_is_that_of_what_was_upright() -> None:
    start = Pose.at(0, 0, 1, yaw=0.3) * Pose(quaternion=FRAME.quaternion)
    for angle in (0.0, 0.2, 1.0, 3.0):
        turn = Pose(quaternion=(math.cos(angle / 2), math.sin(angle / 2), 0.0, 0.0))
        after = Pose.at(1, 0, 0, yaw=1.0) * turn * start
        assert tilted(start, after) == pytest.approx(math.degrees(angle), abs=1e-6)


def test_the_deepest_overlap_is_that_of_bodies_or_of_the_ground() -> None:
    ends = {body.name: body for body in SCENE.bodies}
    assert deepest(SCENE, ends) == pytest.approx(0.0, abs=1e-9)
    lower = ends | {"stool": STOOL.moved_to(Pose.at(0, 0, 0.147))}
    assert deepest(SCENE, lower) == pytest.approx(0.003)
    sunk = ends | {"slab": SLAB.moved_to(Pose.at(0, 0, 0.045))}
    assert deepest(SCENE, sunk) == pytest.approx(0.005)
    apart = replace(SCENE, apart=(("ground", "body/slab"), ("body/slab", "body/stool")))
    assert deepest(apart, sunk) == deepest(apart, lower) == 0.0


class Drawing(Settling):
    draws = True


def test_as_many_repetitions_differ_as_there_are_starts_unless_they_are_moved() -> None:
    """A deterministic simulator made 20 copies of one, and they proved 83 %."""
    starts = tuple(Start(("slab",), (Pose.at(x, 0, 0.05),)) for x in (0.0, 0.1, 0.2))
    for scene, different in ((SCENE, 1), (replace(SCENE, starts=starts), 3)):
        assert Settling(scene).different == different
        assert Settling(scene, moved=0.001).different is None
        assert Drawing(scene).different is None  # somebody's own may draw by the seed


def test_starts_are_moved_on_request_alone_and_by_the_seed() -> None:
    assert Settling(SCENE).scene(3, Jitter()) == SCENE
    moved = Settling(SCENE, moved=0.001)
    first, again, other = (moved.scene(seed, NONE) for seed in (3, 3, 4))
    assert first == again != other
    for body in first.free_bodies:
        way = np.subtract(body.pose.position, SCENE.body(body.name).pose.position)
        assert 0 < np.abs(way[:2]).max() <= 0.001
        assert way[2] == 0


def test_joints_start_elsewhere_too_but_for_coupled_ones_and_within_their_ranges() -> None:
    scene = Scene("arm", (), panda())
    lowest = replace(scene.robot.joints[0], initial_position=-2.8973)  # the end of its range
    robot = replace(scene.robot, joints=(lowest, *scene.robot.joints[1:]))
    was = robot.column("initial_position")
    task = Settling(replace(scene, robot=robot), moved=0.001)
    starts = [task.scene(seed, NONE).robot for seed in range(9)]
    ways = [start.column("initial_position") - was for start in starts if start is not None]
    assert (np.abs(ways) <= 0.001).all()
    assert (np.array(ways)[:, 1:7] != 0).all()
    assert (np.array(ways)[:, 7:] == 0).all()  # one finger follows the other
    assert 0 == np.min(ways, axis=0)[0] < np.max(ways, axis=0)[0]


def test_repetitions_go_through_starts_which_are_in_the_file_s_frames() -> None:
    starts = tuple(Start(("stool",), (Pose.at(0.1 * k, 0, 0.2),)) for k in range(3))
    task = Settling(replace(SCENE, starts=starts))
    for seed in range(6):
        pose = task.scene(seed, NONE).body("stool").pose * FRAME
        assert pose.position == pytest.approx((0.1 * (seed % 3), 0.0, 0.2))
    told = {"task.scene": "stool on slab", "task.starts": 3, "task.premises": []}
    told |= {"task.scene_digest": task.parameters()["task.scene_digest"]}
    assert task.parameters() == {**told, "task.seconds": 2.5, "task.moved": 0.0}
    assert "starts" not in task.scene(0, NONE).to_wire()


@pytest.mark.parametrize(
    ("scene", "premises", "message"),
    [
        (Scene("empty"), [], "has nothing that moves"),
        (SCENE, [rests_on("chair", "slab")], "'chair', which is no free body .* has slab, stool"),
    ],
)
def test_what_it_cannot_do_is_one_sentence(scene: Scene, premises: list[Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        Settling(scene, premises)


@pytest.mark.parametrize(
    ("task", "of"),
    [(Settling(SCENE), "seconds"), (Holding(Scene("arm", (), ROBOT)), "seconds"),
     (Nesting(), "settle"), (Carrying(), "still")],
)  # fmt: skip
def test_a_time_too_short_to_rest_in_is_refused(task: Task, of: str) -> None:
    assert getattr(task.smoke(), of) == 1.0
    for seconds in (0.9, -3.0, np.nan):
        with pytest.raises(SceneError, match=rf"time \[s\] of {task.name} is .* from 1 to"):
            replace(task, **{of: seconds})  # type: ignore[arg-type]


def test_energy_is_that_of_motion_and_of_spin_about_the_body_s_own_axes() -> None:
    box = Box("box", (0.3, 0.2, 0.1), Pose.at(0, 0, 1), 2.0, moments=(0.1, 0.2, 0.25))
    turned = np.sqrt(0.5) * np.array([1.0, 0.0, 0.0, 1.0])  # its x axis is the world's y
    rows = np.array([[0, 0, 1, *turned, 3.0, 0, 0, 0, 4.0, 0], [0, 0, 1, *turned, *[0.0] * 6]])
    both = (2.0 * 3.0**2 + 0.1 * 4.0**2) / 2
    assert kinetic_energy(Scene("s", (box,)), rows[:, None]) == pytest.approx(both / 2)


def test_what_rests_is_as_fast_as_its_poses_say() -> None:
    """One body is told to move and stays; another is told to stay, moves and turns."""
    told, still = np.array([0.0, 0, 0.01, 0, 0, 2.0]), np.zeros(6)
    turned = [(np.cos(a), 0.0, 0.0, np.sin(a)) for a in (0.0, 0.05, 0.1)]
    rows = [
        [[0, 0, 1, 1, 0, 0, 0, *told], [0.003 * k, 0, 1, *turn, *still]]
        for k, turn in enumerate(turned)
    ]
    seen = Motion(np.array([0.0, 0.01, 0.02]), np.empty((3, 2, 0)), np.array(rows))
    moves = [0.3, 0.0, 0.0, 0.0, 0.0, 10.0]
    assert by_poses(seen)[..., 7:] == pytest.approx(np.array([[still, moves]] * 2))


def test_the_spread_of_forces_is_of_the_weight() -> None:
    box = Box("box", (0.1,) * 3, Pose.at(0, 0, 1), 2.0)
    scene, pair = Scene("s", (box,), gravity=(0.0, 0.0, -10.0)), ("body/box", "ground")
    looks = [{pair: np.array([0, 0, force, 0, 0, 0])} for force in (19.0, 21.0)]
    assert spread(scene, looks) == pytest.approx(5.0)
    assert spread(scene, [{}, {pair: np.array([0, 0, 2.0, 0, 0, 0])}]) == pytest.approx(5.0)
    assert spread(scene, []) is None


class Restless(Moved):
    """Its slab goes 1 mm to and fro, pressed by 19 N and 21 N in turns; its speed is told wrong."""

    def do_contact_forces(self) -> list[Any]:
        turn = (-1) ** len(self.asked)
        self.velocities["slab"][0] = 0.03
        self.poses["slab"] = self.poses["slab"].translated(0.001 * turn)
        return [("body/slab", "ground", np.array([0, 0, 20 + turn, 0, 0, 0]))]


@pytest.mark.parametrize(("awake", "spreads"), [(2, 0.0), (0, None)])
def test_what_falls_asleep_is_held_by_the_forces_of_before(awake: int, spreads: Any) -> None:
    """After so many looks; what slept at the first one was not measured."""
    process = ScriptedProcess()
    looks = [("body/slab", "ground", np.array([0, 0, 10.0, 0, 0, 0]))] * awake

    def told() -> list[Any]:
        process.velocities["slab"][0] = 0.01 * (len(looks) > 1)
        return [looks.pop()] if looks else []

    process.do_contact_forces = told  # type: ignore[method-assign]
    assert perform(Settling(SCENE), process=process)[0].metrics["force_jitter"] == spreads


def test_the_whole_score_of_what_ends_elsewhere() -> None:
    """The slab goes 30 mm aside and 4 mm down, the stool leans 6 mm beside it, the door opens.
    Between 9 of 45 samples at rest the slab goes 1 mm, and one body of two."""
    squares = 4 * (0.001 / 0.012) ** 2 + 5 * (0.001 / 0.018) ** 2  # over so many seconds
    scene = replace(SCENE, robot=ROBOT, gravity=(0.0, 0.0, -10.0))
    asked = {"tilt": 30.0}, {}, {"tilt": 30.0, "within": 0.005}
    premises = [rests_on("stool", "slab", **how) for how in asked]
    task = Settling(scene, [*premises, rests_on("slab", "stool", within=0.1)], seconds=2.0)
    shove, tip = move("slab", y=0.03, z=-0.004), move("stool", tilt=0.5)
    script = Mishap("settle", 1.4, shove), Mishap("rest", 0.0, tip)
    outcome, process = perform(task, *script, process=Restless((0.1, 0.05)))
    assert outcome.metrics == pytest.approx({
        "farthest": np.sqrt(30**2 + 4**2 + 1), "tilt": np.degrees(0.5), "sunk": 4.0,
        "restless": 1e3 * np.sqrt(squares / 44 / 2), "energy": 1e6 * squares / 44 / 2,
        "force_jitter": 100 / 15, "premises": 0.25,
    })  # fmt: skip
    assert outcome.reasons == tuple(f"not: {premise}" for premise in task.premises[1:])
    assert outcome.reasons[0] == "not: stool rests on slab (within 20 mm, tilt at most 20 deg)"
    stool = STOOL.pose * Pose(quaternion=(np.cos(0.25), np.sin(0.25), 0.0, 0.0)) * FRAME
    way = 1000 * np.linalg.norm(np.subtract(stool.position, (STOOL.pose * FRAME).position))
    ways, tilts = {"slab": 30.282, "stool": round(way, 4)}, {"slab": 0.0, "stool": 28.6479}
    assert outcome.details["ways"] == {**ways, "door": 0.0, "drawer": 0.0}
    assert outcome.details["tilts"] == {**tilts, "door": 5.7296, "drawer": 0.0}
    assert outcome.details["places"]["stool"] == pytest.approx(stool.as_array())
    assert [a.phase for a in process.asked if a.began >= 1.75] == ["rest"] * 10


@pytest.mark.engine
def test_a_stool_rests_on_a_slab(case: Case) -> None:
    record = performed(case, Settling(SCENE, [rests_on("stool", "slab")]))
    assert record.metrics["premises"] == 1.0
    assert record.metrics["farthest"] == pytest.approx(10.0, abs=1.0)
    assert record.metrics["tilt"] < 1.0
    assert record.metrics["restless"] < 1.0
    assert record.metrics["energy"] < 1.0
    assert 0.0 < record.metrics["force_jitter"] < 1.0
    assert record.details["places"]["stool"][2] == pytest.approx(0.15 - 0.05, abs=1e-3)
