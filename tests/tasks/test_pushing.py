"""Pushes whose right score is known, and the real ones of two simulators."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.client.errors import Diverged
from pytest_simbench.experiment.case import Case
from pytest_simbench.motion.files import read_robot
from pytest_simbench.motion.kinematics import DOWNWARD
from pytest_simbench.motion.panda import panda
from pytest_simbench.motion.registry import find
from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.tasks import CurvePushing, Jitter, Pushing
from pytest_simbench.tasks.pushing import BLOCK_SIZE, START, lever, smallest_turning_radius
from tests.conftest import case_of, performed
from tests.motion.small_arm import small_arm
from tests.tasks.scripted import Mishap, ScriptedProcess, fail, move, perform, put, slip

LINE, CURVE = Pushing(), CurvePushing()
EXACT = Jitter(0.0, 0.0)
CONTACT = 0.00875 + BLOCK_SIZE[0] / 2
"""From the tool centre point to the block's: the Panda's fingertips are 17.5 mm thick [m]."""


class PushedProcess(ScriptedProcess):
    """The block goes with the hand, flush, from the moment at which its front reaches it."""

    def _grasp(self) -> None:
        pass

    def _command(self, position: FloatArray) -> None:
        super()._command(position)
        if self.where.phase != "push":
            return
        if not hasattr(self, "grip"):
            reached = self.tool().inverse() * self.poses["block"]
            if reached.position[0] > CONTACT:
                return
            self.grip = Pose((CONTACT, *reached.position[1:]), DOWNWARD.inverse().quaternion)
        self.poses["block"] = self.tool() * self.grip


def pushed(task: Pushing, *script: Mishap, jitter: Jitter = EXACT) -> dict[str, float | None]:
    outcome, _ = perform(task, *script, jitter=jitter, process=PushedProcess())
    return outcome.metrics


@pytest.mark.parametrize("task", [LINE, CURVE, Pushing(turn=-0.5, length=0.15)])
def test_a_block_that_goes_with_the_hand_has_no_error(task: Pushing) -> None:
    metrics = pushed(task)
    assert metrics["position_error"] == pytest.approx(0.0, abs=2e-4)
    assert metrics["heading_error"] == pytest.approx(0.0, abs=0.05)
    assert metrics["path_error"] == pytest.approx(0.0, abs=2e-4)
    assert metrics["tipped"] == 0.0


def test_each_error_is_told() -> None:
    """Slipped by 7 mm for a while; 3 mm aside and turned at the end; tilted for an instant."""
    metrics = pushed(
        LINE,
        Mishap("push", 2.0, slip(y=0.007)),
        Mishap("push", 2.5, slip(y=-0.007)),
        Mishap("settle", 0.1, move("block", y=0.003)),
        Mishap("settle", 0.2, turn(0.1)),
    )
    assert metrics["path_error"] == pytest.approx(0.007, abs=2e-4)
    assert metrics["position_error"] == pytest.approx(0.003, abs=2e-4)
    assert metrics["heading_error"] == pytest.approx(math.degrees(0.1), abs=0.05)
    assert metrics["tipped"] == 0.0


@pytest.mark.parametrize(("tilt", "tipped"), [(9.0, 0.0), (11.0, 1.0)])
@pytest.mark.parametrize("phase", ["push", "settle"])
def test_a_tilt_is_seen_at_any_time(phase: str, tilt: float, tipped: float) -> None:
    def lean(process: ScriptedProcess) -> None:
        assert isinstance(process, PushedProcess)
        half = math.radians(tilt) / 2
        if phase == "push":
            process.grip = process.grip * Pose(quaternion=(math.cos(half), math.sin(half), 0, 0))
        else:
            move("block", tilt=math.radians(tilt))(process)

    assert pushed(LINE, Mishap(phase, 1.0, lean))["tipped"] == tipped


def turn(angle: float):
    def effect(process: ScriptedProcess) -> None:
        process.poses["block"] = process.poses["block"] * Pose.at(0, 0, 0, yaw=angle)

    return effect


def test_a_heading_beyond_half_a_turn_is_off_by_what_is_left() -> None:
    """Of a way that turns by 172 degrees: 17 further is -171."""
    task = replace(CURVE, turn=3.0)
    end = task.at(task.way) * Pose.at(0, 0, 0, yaw=0.3)
    found = task._score(end, None, lambda done, total: None, {}).metrics["heading_error"]
    assert found == pytest.approx(math.degrees(0.3))


def test_a_block_that_stays_is_a_whole_way_off() -> None:
    stays = PushedProcess(
        [Mishap("push", 0.0, out_of_the_way), Mishap("settle", 0.5, put("block", START))]
    )
    outcome, _ = perform(LINE, jitter=EXACT, process=stays)
    assert outcome.metrics["position_error"] == pytest.approx(0.2)
    assert (stays.counts, [*stays.marks]) == ([(0, 1)], ["start", "end"])
    assert [a.duration for a in stays.asked if a.kind == "wait"] == [0.2, LINE.settle]
    assert outcome.details["end"] == [*START.position, *START.quaternion]
    far, _ = perform(replace(LINE, length=2.0), jitter=EXACT, process=PushedProcess())
    assert far.details["failed_push"].startswith("unreachable: path to ")
    assert (far.metrics["position_error"], far.metrics["path_error"]) == (2.0, None)
    assert perform(LINE, jitter=EXACT, process=PushedProcess())[1].counts == [(1, 1)]


def out_of_the_way(process: ScriptedProcess) -> None:
    process.grip = Pose()
    process.poses["block"] = START


def test_a_world_that_fails_has_no_score() -> None:
    with pytest.raises(Diverged):
        pushed(LINE, Mishap("push", 0.1, fail(Diverged)))


@pytest.mark.parametrize("task", [LINE, CURVE])
def test_the_way_has_its_length_and_its_heading(task: Pushing) -> None:
    ways = np.linspace(-0.01, task.length, 400)
    points = np.array([task.at(float(way)).position for way in ways])
    steps = np.diff(points, axis=0)
    assert np.linalg.norm(steps, axis=1).sum() == pytest.approx(task.length + 0.01, abs=1e-5)
    headings = np.arctan2(steps[:, 1], steps[:, 0])
    told = [task.at(float(way)).yaw for way in (ways[:-1] + ways[1:]) / 2]
    assert headings == pytest.approx(told, abs=3e-3)
    assert task.at(task.length).yaw == pytest.approx(task.turn)


def test_the_front_of_the_hand_is_at_the_block() -> None:
    """8.75 mm before the tool centre point, from behind the block to the end."""
    for tool, way in zip(CURVE.tools(), np.linspace(-0.01, 0.2, 22), strict=True):
        back = CURVE.at(float(way)) * Pose.at(-BLOCK_SIZE[0] / 2, 0.0, 0.01)
        front = tool * Pose.at(0.00875, 0.0, 0.0)
        assert front.position == pytest.approx(back.position, abs=1e-6)
        assert front.rotation()[:, 0] == pytest.approx(back.rotation()[:, 0], abs=1e-9)


def test_theory_holds_where_the_curve_is_not_too_sharp() -> None:
    assert CURVE.sharpest == pytest.approx(0.159, abs=0.001)
    assert set(CURVE.references.values()) == {0.0}
    assert set(CURVE.references) < {metric.name for metric in CURVE.metrics}
    sharp = replace(CURVE, turn=1.01 * CURVE.length / CURVE.sharpest)
    assert sharp.references == {}
    assert replace(sharp, turn=-0.99 * CURVE.length / CURVE.sharpest).references


def test_the_jitter_disturbs_the_block() -> None:
    (block,) = LINE.scene(7, Jitter()).free_bodies
    assert 0 < abs(block.pose.position[1]) < 1e-3
    assert LINE.scene(7, EXACT).free_bodies[0].pose == START


def test_an_arm_takes_an_elbow_that_is_free() -> None:
    """The first solution for the UR5's place behind the block has its forearm in the ground."""
    task = LINE.on(find("ur5"))
    outcome, _ = perform(task, seed=3, jitter=EXACT, process=PushedProcess())
    assert "failed_push" not in outcome.details
    assert outcome.metrics["position_error"] == pytest.approx(0.0, abs=2e-4)


def test_a_small_arm_has_a_way_of_its_size() -> None:
    """Its scene, and that of the others: `test_base`."""
    for name in ("panda", "ur5", "ur10", "xarm7"):
        task = CURVE.on(find(name))
        assert "task.scale" not in task.parameters()
        assert task.arm.friction == CURVE.arm.friction < panda().friction
    small = CURVE.on(find("so101"))
    end, full = small.at(small.way), CURVE.at(CURVE.way)
    assert end.position == pytest.approx(np.array(full.position) / 2)
    assert end.yaw == pytest.approx(full.yaw)
    assert small.sharpest < small.way / small.turn  # so theory holds, and zero errors are right
    assert small.references
    tools, others = (np.array([tool.position for tool in t.tools()]) for t in (small, CURVE))
    assert tools[:, 2] == pytest.approx(others[:, 2] / 2)
    ways = [np.linalg.norm(np.diff(rows, axis=0), axis=1) for rows in (tools, others)]
    assert ways[0][0] == pytest.approx(ways[1][0] / 2)  # of the gap, where the way is straight


def test_the_smallest_arm_pushes_too(case: Case) -> None:
    """One jaw that turns, five joints: the block goes where it should, within its jitter."""
    case = replace(case_of(case, "mujoco"), robot=find("so101"))
    record = performed(case, LINE)
    assert "failed_push" not in record.details
    assert record.metrics["position_error"] < 0.0025
    assert record.metrics["tipped"] == 0.0


def test_what_a_robot_cannot_do_is_a_sentence(tmp_path: Path) -> None:
    problem = LINE.on(read_robot(small_arm(tmp_path))).problem()
    assert "cannot push the block: unreachable" in problem


@pytest.mark.parametrize("name", ["mujoco", "pybullet"])
@pytest.mark.parametrize("task", [LINE, CURVE], ids=["line", "curve"])
def test_on_simulators(case: Case, name: str, task: Pushing) -> None:
    """Within the jitter of the start, which is 1 mm in x and y, and a turn of 1 degree."""
    record = performed(case_of(case, name), task)
    assert "failed_push" not in record.details
    assert record.metrics["position_error"] < 0.005
    assert record.metrics["heading_error"] < 1.0
    assert record.metrics["tipped"] == 0.0


EDGES = st.floats(0.02, 0.5)


def corners(length: float, width: float) -> np.ndarray:
    return np.array([[x, y] for x in (-1, 1) for y in (-1, 1)]) * [length / 2, width / 2]


def spread(length: float, width: float) -> np.ndarray:
    """Even pressure."""
    middles = (np.arange(100) + 0.5) / 100 - 0.5
    return np.stack(np.meshgrid(length * middles, width * middles), axis=-1).reshape(-1, 2)


@given(EDGES, EDGES)
def test_in_a_wide_curve_it_is_the_mean_square_of_the_length_over_the_radius(
    length: float, width: float
) -> None:
    """Friction turns aside by x / R where the block moves so; to first order nothing else does."""
    radius = 100.0
    assert lever(corners(length, width), radius) == pytest.approx(length**2 / 4 / radius, rel=0.02)
    assert lever(spread(length, width), radius) == pytest.approx(length**2 / 12 / radius, rel=0.02)


@given(EDGES, EDGES, st.floats(0.3, 3.0))
def test_both_ways_round_and_on_corners_most(length: float, width: float, radius: float) -> None:
    on_corners = lever(corners(length, width), radius)
    assert lever(corners(length, width), -radius) == pytest.approx(-on_corners)
    assert lever(spread(length, width), radius) < on_corners


def test_a_block_that_turns_on_the_spot_asks_for_any_lever() -> None:
    """No force, but a torque."""
    assert lever(corners(0.1, 0.1), 1e-6) > 100


@given(EDGES, st.floats(0.01, 0.5))
def test_in_the_sharpest_curve_the_force_acts_at_the_end_of_the_contact(
    edge: float, share: float
) -> None:
    contact = share * edge
    radius = smallest_turning_radius(edge, edge, contact)
    assert lever(corners(edge, edge), radius) == pytest.approx(contact / 2)
    assert smallest_turning_radius(edge, edge, 0.9 * contact) > radius
