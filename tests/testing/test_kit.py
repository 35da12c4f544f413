"""The kit as a third party uses it: ids, robots, laws that are skipped, expected failures."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from pytest_simbench.sims.mujoco.adapter import MuJoCo
from pytest_simbench.sims.mujoco.settings import MuJoCoSettings

from pytest_simbench.client.errors import SceneRefused, Where
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.registry import BUILT_IN, find
from pytest_simbench.simulator.registry import UnknownSimulatorError
from pytest_simbench.testing import (
    CHECKS,
    ConformanceTest,
    ConformanceWarning,
    Subject,
    scenes,
    subject,
)
from pytest_simbench.testing.faults import robot_faults, rounds
from pytest_simbench.testing.kit import (
    Kit,
    any_robot,
    conformance_checks,
    coupled,
    grasping,
    read_expected_failures,
    reason_for,
    unmatched,
)
from pytest_simbench.testing.scenes import approaches, at_random, beside, lifted, link_clouds
from pytest_simbench.testing.subject import ConformanceFailure

LAWS = ("free_fall", "static_hold", "grip_holds", "fingers_stay_coupled")
KIT = Kit((Subject(MuJoCo),), LAWS, {})


def test_ids_name_other_robots_than_the_panda_and_a_law_about_no_robot_is_one_test() -> None:
    assert [test.id for test in KIT.tests([None])] == [f"mujoco-tuned-{law}" for law in LAWS]
    ids = [test.id for test in KIT.tests([find("ur5"), find("so101")])]
    assert ids[:3] == [
        "mujoco-tuned-free_fall",
        "mujoco-tuned-ur5-static_hold",
        "mujoco-tuned-so101-static_hold",
    ]
    assert len(ids) == 1 + 2 * 3


@dataclass(frozen=True)
class Answering(Subject):
    """Says this when a simulator is made, without a process."""

    said: str = ""

    def shared(self) -> Any:
        return self

    def construct(self, process: object, changes: object = None, gui: bool = False) -> Any:
        assert (process, changes, gui) == (self, {"no_such_setting": 1}, False)
        if self.said:
            raise SceneRefused(self.said, Where("mujoco", "headless"))


def test_an_unknown_setting_must_be_refused_with_those_that_there_are() -> None:
    law, known = CHECKS["unknown_setting_rejected"].law, [f.name for f in fields(MuJoCoSettings)]
    law(Answering(MuJoCo, said=" ".join(known)))
    for said, told in (
        ("", "an unknown setting was accepted"),
        (" ".join(known[1:]), f"does not list ['{known[0]}']: {known[1]}"),
    ):
        with pytest.raises(ConformanceFailure, match=re.escape(told)):
            law(Answering(MuJoCo, said=said))


@pytest.mark.parametrize("costly", [True, False])
def test_a_worker_gets_what_its_engine_needs(monkeypatch: pytest.MonkeyPatch, costly: bool) -> None:
    info = replace(MuJoCo.info, name="own", costly_start=costly, compile_timeout=77.0)
    own = type("Own", (MuJoCo,), {"info": info, "__module__": "some.where"})
    monkeypatch.setattr(subject, "WorkerProcess", lambda *given: given)
    for gui, mode in ((True, "gui"), (False, "headless")):
        launch, where = Subject(own, python="/opt/python").launch(gui=gui)  # type: ignore[misc]
        assert (launch.adapter, launch.python) == ("some.where:Own", "/opt/python")
        assert (launch.stall_timeout, launch.compile_timeout) == (120.0, 77.0 if costly else 0.0)
        assert launch.log.name.startswith("own-")
        assert where == Where("own", mode)


def test_shared_workers_are_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    living, dead = Mock(alive=True), Mock(alive=False)
    shared = {(None, "a", "a"): living, (None, "b", "b"): dead}
    monkeypatch.setattr(subject, "_shared", shared)
    subject.close_workers()
    assert (living.close.call_count, dead.close.call_count, shared) == (1, 0, {})


def test_links_that_no_cube_reaches_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scenes, "_POSTURES", 0)
    with pytest.raises(LookupError, match="^no cube can be flown to panda_link1, .* of panda$"):
        list(approaches(find("panda")))


def test_what_a_hand_cannot_do_is_skipped_with_the_reason() -> None:
    ur5, so101 = find("ur5"), find("so101")
    narrow = replace(ur5, gripper=replace(ur5.gripper, opened=0.03))
    assert {law(ur5) for law in (any_robot, coupled, grasping)} == {None}
    assert any_robot(so101) is None
    assert grasping(narrow) == "ur5 opens its fingers to 0.03 m; the law takes 0.035 m"
    for law, reason in (
        ("grip_holds", "so101 has no hand with two parallel fingers"),
        ("fingers_stay_coupled", "so101 has 1 finger joints: none is coupled"),
    ):
        with pytest.raises(pytest.skip.Exception, match=reason):
            ConformanceTest(Subject(MuJoCo, robot=so101), CHECKS[law])()


@pytest.mark.parametrize("robot", ["ur5", "of_a_file"])
def test_expected_failures_of_other_robots_match(robot: str) -> None:
    right = f"mujoco-tuned-{robot}-static_hold", f"*-{robot}-static_hold"
    with warnings.catch_warnings(action="error"):
        conformance_checks("mujoco", expected_failures=dict.fromkeys(right, "soft"))
    for pattern in (f"mujoco-tuned-{robot}-hold", f"mujoco-tune-{robot}-static_hold"):
        with pytest.warns(ConformanceWarning, match="matches no check"):
            conformance_checks("mujoco", expected_failures={pattern: "soft"})


def test_a_scene_that_is_refused_although_it_is_claimed_fails() -> None:
    def law(subject: Subject) -> None:
        raise SceneRefused("it has no boxes", Where("mujoco", "headless"))

    with pytest.raises(ConformanceFailure, match="it has no boxes"):
        ConformanceTest(Subject(MuJoCo), replace(CHECKS["free_fall"], law=law))()


@pytest.mark.parametrize(("pattern", "warned"), [("static_hold", 0), ("*-ur5-static_hold", 1)])
def test_what_the_panda_fails_another_robot_may_pass(pattern: str, warned: int) -> None:
    check = replace(CHECKS["static_hold"], law=lambda subject: None)
    with warnings.catch_warnings(record=True) as told:
        ConformanceTest(Subject(MuJoCo, robot=find("ur5")), check, {pattern: "soft"})()
    assert len(told) == warned


def test_the_robot_of_the_command_line(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
from pytest_simbench.testing import conformance_checks

@conformance_checks("mujoco", only=["free_fall", "weak_joint_sags", "grip_holds"])
def test_conformance(check):
    check()
"""
    )
    result = pytester.runpytest_subprocess("-v", "-rs", "--robot", "so101")
    result.stdout.fnmatch_lines_random(
        [
            "*test_conformance?mujoco-tuned-free_fall? PASSED*",
            "*test_conformance?mujoco-tuned-so101-weak_joint_sags? PASSED*",
            "*SKIPPED*so101 has no hand with two parallel fingers*",
        ]
    )
    result.assert_outcomes(passed=2, skipped=1)


@pytest.mark.parametrize("name", BUILT_IN)
def test_a_cube_reaches_every_link_that_moves(name: str) -> None:
    robot = find(name)
    reached = [approach.link for _, group in approaches(robot) for approach in group]
    assert sorted(reached) == sorted(link_clouds(robot).keys() - {"base"})


@pytest.mark.parametrize("name", BUILT_IN)
def test_lifted_robots_touch_no_ground(name: str) -> None:
    rng = np.random.default_rng(1)
    for _ in range(5):
        clouds = link_clouds(at_random(lifted(find(name)), rng))
        assert min(cloud[:, 2].min() for cloud in clouds.values()) > 0.1


def test_places_beside_a_robot_are_clear() -> None:
    robot = find("ur10")
    assert beside(robot, 0.7, 0.0) == (0.7, 0.0)
    (x, y), clouds = beside(robot, -0.3, 0.0), link_clouds(robot).values()
    assert x < -0.3
    assert y == 0.0
    for cloud in clouds:
        assert x < cloud[:, 0].min() or not cloud[:, 1].min() < y < cloud[:, 1].max()


@pytest.mark.parametrize("name", [name for name in BUILT_IN if name != "panda"])
def test_faults_of_a_robot_stand_in_two_worlds(name: str) -> None:
    robot = find(name)
    faults = robot_faults(robot)
    quantities = [fault.quantity for fault in faults.values()]
    assert len(faults) == 19
    words = {"passive_damping", "joint_friction", "spring", "link_gravity"}  # `Deviation.only`
    assert {fault.word for fault in faults.values()} == {"", *words}
    assert [len(group) for group in rounds((), faults)] == [17, 2]
    joints = {quantity.split("/")[1] for quantity in quantities if quantity.startswith("joint/")}
    assert joints <= set(RobotModel(robot).robot.joint_names)


def test_file_of_expected_failures(tmp_path: Path) -> None:
    path = tmp_path / "expected.txt"
    path.write_text("# why\n\nfree_fall: air\nmysim-tuned-tower*: soft: very\n")
    reasons = read_expected_failures(path)
    assert reasons == {"free_fall": "air", "mysim-tuned-tower*": "soft: very"}
    assert reason_for("mysim-default-free_fall", reasons) == "air"
    assert reason_for("mysim-tuned-tower_stands", reasons) == "soft: very"
    assert reason_for("mysim-default-tower_stands", reasons) is None
    assert unmatched(reasons, ["mysim-default-free_fall"]) == ["mysim-tuned-tower*"]


@pytest.mark.parametrize("line", ["free_fall", "free_fall:  "])
def test_line_without_reason_is_an_error(tmp_path: Path, line: str) -> None:
    path = tmp_path / "expected.txt"
    path.write_text(f"# first\n{line}\n")
    with pytest.raises(ValueError, match=r"expected.txt, line 2: write"):
        read_expected_failures(path)


def test_line_that_matches_nothing_warns() -> None:
    with pytest.warns(ConformanceWarning, match="'free_fal' matches no check; there are"):
        conformance_checks("mujoco", expected_failures={"free_fal": "typing error"})


def test_each_adapter_is_asked_with_each_profile_by_its_own_interpreter() -> None:
    other = type("Other", (MuJoCo,), {"info": replace(MuJoCo.info, name="other")})
    mark: Any = conformance_checks(
        "mujoco", other, profiles=("default", "tuned"), python={"other": "/opt/python"},
        only=["free_fall"],
    )  # fmt: skip
    (kit,) = mark.args
    told = [(s.cls.info.name, s.profile, s.python, s.robot) for s in kit.subjects]
    assert told == [
        (name, profile, python, None)
        for name, python in (("mujoco", None), ("other", "/opt/python"))
        for profile in ("default", "tuned")
    ]
    assert (kit.names, kit.expected_failures) == (("free_fall",), {})


def test_unknown_names_list_the_known() -> None:
    with pytest.raises(ValueError, match="no checks named .*choose from .*free_fall"):
        conformance_checks("mujoco", only=["free_fal"])
    with pytest.raises(UnknownSimulatorError, match="mujoco"):
        conformance_checks("mujocco")


def test_every_check_states_its_law() -> None:
    assert [check.name for check in CHECKS.values() if len(check.doc) < 40] == []


def test_third_partys_test_file(pytester: pytest.Pytester) -> None:
    """Readable ids; expected failure, passing expected failure, missing capability, failure."""
    pytester.makepyfile(
        mysim="""
from dataclasses import replace
from pytest_simbench.sims.mujoco.adapter import MuJoCo
from pytest_simbench.simulator import Capability

class MySim(MuJoCo):
    info = replace(
        MuJoCo.info, name="mysim", capabilities=frozenset({Capability.SAVE_RESTORE})
    )

    def restore(self, state):
        pass
""",
        test_mysim="""
from mysim import MySim
from pytest_simbench.testing import conformance_checks

@conformance_checks(
    MySim,
    only=["restore_repeats", "free_fall", "contacts_counted", "restore_in_the_grip"],
    expected_failures={"restore_repeats": "known", "mysim-tuned-free_fall": "no more"},
)
def test_conformance(check):
    check()
""",
    )
    result = pytester.runpytest_subprocess("-v", "-rA")
    result.stdout.fnmatch_lines_random(
        [
            "XFAIL *test_conformance?mysim-tuned-restore_repeats? - known (*",
            "PASSED *test_conformance?mysim-tuned-free_fall?",
            "SKIPPED *mysim does not claim contact_count",
            "FAILED *test_conformance?mysim-tuned-restore_in_the_grip?*",
            "*ConformanceWarning: mysim-tuned-free_fall is listed as an expected failure*",
        ]
    )
    result.assert_outcomes(passed=1, failed=1, skipped=1, xfailed=1, warnings=1)


def test_missing_engine_is_skipped(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
from dataclasses import replace
from pytest_simbench.sims.mujoco.adapter import MuJoCo
from pytest_simbench.testing import conformance_checks

class Gone(MuJoCo):
    info = replace(MuJoCo.info, name="gone", modules=("no_such_engine",), install="buy it")

@conformance_checks(Gone, only=["free_fall"])
def test_conformance(check):
    check()
"""
    )
    result = pytester.runpytest_subprocess("-rs")
    result.stdout.fnmatch_lines(
        ["*gone is not installed (no module no_such_engine); install it: buy it*"]
    )
    result.assert_outcomes(skipped=1)
