"""Inserting: the hole is as wide as it says, a perfect arm inserts, what cannot be judged is told
so."""

from __future__ import annotations

import math
from typing import Any, get_args

import numpy as np
import pytest

from pytest_simbench.experiment.case import Case
from pytest_simbench.motion.kinematics import inverse_kinematics, tool_over
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.scene import Pose
from pytest_simbench.tasks import Inserting, Oversized
from pytest_simbench.tasks.base import Outcome
from pytest_simbench.tasks.inserting import ASIDE, CHAMFER, HIGH, HOLE, LONG, WIDE, Section
from tests.conftest import performed
from tests.tasks.scripted import Mishap, ScriptedProcess, perform, slip

SECTIONS = get_args(Section)


class Process(ScriptedProcess):
    """Its shapes are off by `misfit` [m], and a wall pushes with 5 N."""

    misfit = 0.0

    def do_misfit(self, names: list[str]) -> float:
        return self.misfit

    def do_contact_forces(self) -> list[tuple[str, str, Any]]:
        return [("body/wall_01", "body/peg", np.array([3.0, 0.0, 4.0, 0.0, 0.0, 0.0]))]


def inserted(task: Inserting, *script: Mishap, misfit: float = 0.0, seed: int = 1) -> Outcome:
    process = Process()
    process.misfit = misfit
    return perform(task, *script, seed=seed, process=process)[0]


@pytest.mark.parametrize("section", SECTIONS)
@pytest.mark.parametrize("clearance", [1e-3, -1e-3])
def test_the_hole_is_as_wide_as_it_says(section: Section, clearance: float) -> None:
    """Points around its axis are in no wall up to the stated width, and in one beyond the facets'
    corners; in the chamfer that width grows with the height."""
    task = Inserting(section, clearance)
    walls, inside = list(task.hole()), (WIDE + clearance) / 2
    most = inside * math.sqrt(2) if section == "square" else inside + task.facets

    def filled(radius: float, turn: float, height: float) -> bool:
        point = np.array([*HOLE, height]) + radius * np.array([math.cos(turn), math.sin(turn), 0])
        local = [(point - wall.pose.position) @ wall.pose.rotation() for wall in walls]
        pairs = zip(local, walls, strict=True)
        return any((np.abs(at) < np.array(wall.size) / 2).all() for at, wall in pairs)

    for turn in np.linspace(0.0, 2 * math.pi, 97):
        for height in (0.001, HIGH / 2, HIGH - 0.001):
            assert not filled(inside - 1e-6, turn, height)
            assert filled(most + 1e-6, turn + 1e-4, height)
        for up in (0.25, 0.5, 0.75):
            assert not filled(inside + up * CHAMFER - 1e-6, turn, HIGH + up * CHAMFER)
    assert filled(inside + 1e-6, 0.0, HIGH / 2)
    assert filled(inside + CHAMFER / 2 + 1e-6, 0.0, HIGH + CHAMFER / 2)


@pytest.mark.parametrize(("section", "depth"), [("square", 25), ("round", 25), ("square", 4)])
def test_a_perfect_arm_inserts(section: Section, depth: float) -> None:
    """As deep as it is told, also where that is no whole number of steps."""
    task = Inserting(section, 2e-3, depth / 1000)
    outcome = inserted(task)
    assert (set(outcome.details["forces"]), outcome.details["added"]) == ({5.0}, 2 * task.facets)
    assert outcome.metrics == pytest.approx(
        {"inserted": 1.0, "depth": depth, "overlap": 0.0, "force": 5.0}, abs=1e-3
    )
    assert outcome.reasons == ()
    assert 0.0 < np.abs(outcome.details["aside"]).max() < ASIDE * 2e-3 <= 2e-3 / 2


def test_what_slipped_before_the_look_is_made_up_for() -> None:
    outcome = inserted(Inserting(clearance=2e-3), Mishap("bring", 0.2, slip(x=0.003, y=0.002)))
    assert outcome.metrics["inserted"] == 1.0
    assert outcome.metrics["overlap"] == 0.0


def test_what_stands_in_a_wall_and_what_falls_are_told() -> None:
    outcome = inserted(Oversized())
    beside = 1000 * np.abs(outcome.details["aside"]).max()
    assert outcome.metrics["overlap"] == pytest.approx(0.5 + beside, abs=1e-3)
    short = inserted(Inserting(clearance=2e-3), Mishap("insert", 0.1, slip(z=-0.01)))
    assert (short.metrics["inserted"], short.metrics["depth"]) == (0.0, pytest.approx(15, abs=1e-3))
    fallen = inserted(Inserting(), Mishap("bring", 0.2, slip(x=0.05)))
    assert (fallen.metrics["inserted"], fallen.metrics["depth"]) == (0.0, None)
    assert fallen.reasons == ("peg is not in the hand",)


@pytest.mark.parametrize(("phase", "told"), [("bring", None), ("insert", 0.0)])
def test_who_brings_no_peg_to_the_hole_keeps_none_out(phase: str, told: float | None) -> None:
    """Newton's defaults let 20 of 20 fall on the way, and were said to be right."""
    assert inserted(Oversized(), Mishap(phase, 0.2, slip(z=-0.05))).metrics["inserted"] == told


@pytest.mark.parametrize("kind", [Inserting, Oversized])
def test_a_clearance_is_judged_from_three_times_what_is_added(kind: type[Inserting]) -> None:
    task = kind()
    just = abs(task.clearance) / (3 * 4)  # of peg and walls, on both sides
    assert inserted(task, misfit=0.99 * just).metrics["inserted"] is not None
    outcome = inserted(task, misfit=1.01 * just)
    assert set(outcome.metrics.values()) == {None}
    (reason,) = outcome.reasons
    assert reason.startswith(f"not judged: of a clearance of {1000 * task.clearance:g} mm")
    round_one = inserted(Inserting("round", 5e-4))
    assert "the facets of the hole make 0.2 mm" in round_one.reasons[0]


def test_the_tool_gives_way_as_it_says() -> None:
    """Under 1 N along x and along y, by the joints' torques and the arm's kinematics."""
    task = Inserting()
    model = RobotModel(task.arm)
    tool = tool_over(Pose.at(*HOLE, HIGH + LONG / 2), 0.0)
    home = model.home
    arm = inverse_kinematics(model, tool, home, np.random.default_rng(0))
    stiffness, ways = task.arm.column("stiffness")[: model.arm], []
    for axis in np.eye(3)[:2]:
        force = np.concatenate([tool.rotation().T @ axis, np.zeros(3)])
        bent = model.tool_pose(arm + model.tool_jacobian(arm).T @ force / stiffness)
        ways.append(float(np.subtract(bent.position, tool.position) @ axis))
    assert np.mean(ways) == pytest.approx(1 / task.stiffness, rel=0.01)


@pytest.mark.parametrize("task", [Inserting(), Oversized()], ids=lambda task: task.name)
def test_on_an_engine(case: Case, task: Inserting) -> None:
    record = performed(case, task.smoke())
    assert record.metrics["inserted"] == task.references["inserted"]
    assert record.metrics["overlap"] < 0.05
    assert record.details["added"] == 0.0
