"""The checks of the kit go red: one planted fault for each, in a real engine."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from textwrap import dedent

import pytest

from pytest_simbench.client.errors import WorkerError, WorldParityError
from pytest_simbench.motion.registry import find
from pytest_simbench.simulator import Simulator
from pytest_simbench.testing import CHECKS, ConformanceFailure, ConformanceTest, Subject, drives

from . import cheats, tampered, wrong

FAULTS: list[tuple[type[Simulator], str]] = [
    *tampered.FAULTS,
    *((getattr(wrong, name), law) for name, (_, _, law) in wrong.TOLD.items()),
    (wrong.ImportsEngine, "imports_without_engine"),
    (wrong.NoTitle, "info_complete"),
    (wrong.NoTuned, "profiles_complete"),
    (wrong.LongStep, "time_advances"),
    (wrong.OwnClock, "time_advances"),
    (wrong.OneShot, "commands_persist"),
    (wrong.Air, "free_fall"),
    (wrong.AngularDamping, "cube_spins_on"),
    (wrong.NoForce, "force_acts_for_its_time"),
    (wrong.DoubleForce, "force_acts_for_its_time"),
    (wrong.EndlessTorque, "torque_acts_for_its_time"),
    (wrong.OwnAxes, "torque_acts_for_its_time"),
    (wrong.FallingBelt, "moves_as_prescribed"),
    (wrong.StandingBelt, "belt_carries"),
    (tampered.SoftDrivesNotTold, "static_hold"),
    (tampered.OtherRule, "pairs_have_their_friction"),
    (wrong.NoFeedForward, "tracks_trajectory"),
    (wrong.EchoLimits, "planted_faults_are_seen"),
    (wrong.EchoGroundFriction, "planted_faults_are_seen"),
    (wrong.EchoLinkInertia, "planted_faults_are_seen"),
    (wrong.EchoScene, "planted_faults_are_seen"),
    (cheats.Welded, "pulled_grip_slips"),
    (cheats.Snaps, "released_cube_is_let_be"),
    (cheats.HalfFlight, "thrown_cube_flies_free"),
    (wrong.Teleports, "squeeze_bounds_the_grip"),
    (wrong.Teleports, "held_weight_is_felt"),
    (wrong.Magnet, "open_hand_holds_nothing"),
    (wrong.Meddler, "reading_changes_nothing"),
    (wrong.TiltedAxis, "parity_in_any_posture"),
    (wrong.ForgetsCommand, "restore_repeats"),
    (wrong.Noisy, "restore_in_the_grip"),
    (wrong.Noisy, "fresh_processes_agree"),
    (wrong.Noisy, "reused_process_agrees"),
    (wrong.Hoarder, "worlds_leave_no_memory"),
    (wrong.Blank, "picture_shows_something"),
]


def test_a_drive_meets_least_where_the_others_give_way() -> None:
    """At the wrist's end that hardly matters, at the arm's foot it does."""
    robot = find("panda")
    start = robot.column("initial_position")
    foot, end = (
        drives._yielding_inertia(robot, start, k, armature=True)
        / drives.own_inertia(robot, start, k, armature=True)
        for k in (0, 6)
    )
    assert 0.5 < foot < 0.8
    assert 0.99 < end <= 1.0


def test_a_copy_of_the_scene_is_no_fault_by_itself() -> None:
    """Parity cannot tell it from what an engine holds: it follows each step."""
    for name in ("parity_of_full_scene", "read_back_is_the_engines", "free_fall"):
        ConformanceTest(Subject(cheats.Copied), CHECKS[name])()


@pytest.mark.parametrize("quantity", cheats.ECHOES)
def test_what_a_copy_of_the_scene_hides_is_felt(quantity: str) -> None:
    """Parity passes: each quantity that it could hide has a law that measures it."""
    subject = Subject(cheats.echo(quantity))
    ConformanceTest(subject, CHECKS["parity_of_full_scene"])()
    with pytest.raises(ConformanceFailure):
        ConformanceTest(subject, CHECKS[cheats.ECHOES[quantity][1]])()


WITH_ROBOTS: list[tuple[type[Simulator], str, str]] = [
    (tampered.SoftDrives, "static_hold", "so101"),
    (wrong.NoFeedForward, "tracks_trajectory", "xarm7"),
    (tampered.NoEffortLimit, "effort_limit_bounds_acceleration", "so101"),
    (tampered.NoEffortLimit, "every_effort_limit_counts", "ur5"),
    (tampered.NoLimits, "joints_stop_at_their_limits", "xarm7"),
    (tampered.FreeFingers, "fingers_stay_coupled", "ur5"),
    (tampered.SlipperyHand, "grip_holds", "ur5"),
    (wrong.LinkAxes, "joint_loads_are_told", "ur5"),
    (wrong.EchoLinkInertia, "planted_faults_are_seen", "so101"),
    (wrong.Noisy, "reused_process_agrees", "so101"),
]


CASES = [*((cls, name, "") for cls, name in FAULTS), *WITH_ROBOTS]


@pytest.mark.parametrize(
    ("adapter", "name", "robot"),
    CASES,
    ids=["-".join(filter(None, (cls.__name__, robot, name))) for cls, name, robot in CASES],
)
def test_fault_is_found(adapter: type[Simulator], name: str, robot: str) -> None:
    test = ConformanceTest(Subject(adapter, robot=find(robot) if robot else None), CHECKS[name])
    with pytest.raises((ConformanceFailure, WorldParityError)):
        test()


def test_parity_check_runs_while_loading() -> None:
    class_without_lie = Subject(wrong.Misbuilt)
    with pytest.raises(WorkerError, match="gravity: scene"):
        CHECKS["parity_of_full_scene"].law(class_without_lie)


def test_springs_that_are_declared_not_to_be_told_may_sag_as_springs_do() -> None:
    """An engine without drives of its own: the adapter computes the law of `scene.Joint`."""
    ConformanceTest(Subject(wrong.DrivesNotTold), CHECKS["static_hold"])()


OWN_PACKAGE = {
    "__init__": "",
    "core": "answer = 42",
    "lazy": """
        from dataclasses import replace
        from pytest_simbench.simulator import lazy_import
        from pytest_simbench.sims.mujoco.adapter import MuJoCo
        core = lazy_import("ownsim.core")
        class Own(MuJoCo):
            info = replace(MuJoCo.info, modules=("ownsim.core",))
        class Vague(MuJoCo):
            info = replace(MuJoCo.info, modules=("ownsim", "ownsim.lazy"))
    """,
    "eager": "from .core import answer\nfrom .lazy import MuJoCo, Own\nclass Eager(Own): ...",
}


def test_an_adapter_may_live_in_its_engines_own_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is not to be imported is then the engine itself, by the name of its module."""
    for name, text in OWN_PACKAGE.items():
        path = tmp_path / "ownsim" / f"{name}.py"
        path.parent.mkdir(exist_ok=True)
        path.write_text(dedent(text))
    monkeypatch.syspath_prepend(tmp_path)
    law = CHECKS["imports_without_engine"].law
    law(Subject(import_module("ownsim.lazy").Own))
    with pytest.raises(ConformanceFailure, match=r"ownsim\.core was imported"):
        law(Subject(import_module("ownsim.eager").Eager))
    with pytest.raises(ConformanceFailure, match=r"name the module that is the engine \(ownsim\."):
        law(Subject(import_module("ownsim.lazy").Vague))


@pytest.mark.parametrize("name", ["static_hold", "planted_faults_are_seen", "links_are_felt"])
def test_laws_of_robots_are_skipped_where_an_adapter_declares_that_it_has_none(name: str) -> None:
    with pytest.raises(pytest.skip.Exception, match="there are no robots here"):
        ConformanceTest(Subject(wrong.NoRobots), CHECKS[name])()


def test_laws_of_boxes_hold_where_there_are_no_robots() -> None:
    ConformanceTest(Subject(wrong.NoRobots), CHECKS["free_fall"])()
