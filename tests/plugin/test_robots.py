"""`--robot`: ids, records, baselines, and what a robot or a task cannot do."""

from __future__ import annotations

import pytest

from tests.motion.small_arm import TOML, small_arm
from tests.plugin.inner import records, run_pytest

HOLDING = '''
    """A robot stands still, whichever it is."""

    from dataclasses import dataclass
    from typing import ClassVar

    from pytest_simbench.motion.panda import panda
    from pytest_simbench.scene import Robot, Scene
    from pytest_simbench.tasks.base import Outcome, Task
    from pytest_simbench.records.metrics import Metric

    @dataclass(frozen=True)
    class Holding(Task):
        name: ClassVar[str] = "holding"
        study_timeout: ClassVar[float] = 60.0
        robot: Robot | None = None

        @property
        def metrics(self):
            return (Metric("joints", "joints", better=None),)

        def problem(self):
            narrow = self.robot is not None and self.robot.gripper.opened < 0.03
            return f"robot {self.robot.name!r} opens too little" if narrow else None

        def scene(self, seed, jitter):
            return Scene("holding", (), self.robot or panda())

        def perform(self, world, seed, count):
            world.mark("start")
            world.wait(0.02)
            world.mark("end")
            return Outcome({"joints": float(world.joints.shape[1])})

    @dataclass(frozen=True)
    class Own(Task):
        name: ClassVar[str] = "own"
        study_timeout: ClassVar[float] = 60.0
        metrics = ()

        def scene(self, seed, jitter):
            return Scene("own", (), panda())

        def perform(self, world, seed, count):
            return Outcome()

    def test_holding(repeat):
        repeat(Holding())
'''


def run(pytester: pytest.Pytester, *more: str, ret: int = 0, **outcomes: int) -> pytest.RunResult:
    return run_pytest(pytester, "--sim=mujoco -p no:cacheprovider", *more, ret=ret, **outcomes)


def test_a_run_with_another_robot(pytester: pytest.Pytester) -> None:
    """Its name is in the id and in the record; the default robot leaves no trace. A baseline of
    another robot is said to be one."""
    pytester.makepyfile(HOLDING)
    path = small_arm(pytester.path)
    run(pytester, "--reps=1", "--sim-output=panda", "--robot=panda", passed=1)
    run(pytester, "--reps=1", "--sim-output=ur5", "--robot=ur5", passed=1)
    small_run = ("--reps=1", f"--robot={path}")
    result = run(pytester, *small_run, "--sim-output=small", "--sim-baseline=ur5")
    told = " ".join(result.stdout.str().split())
    assert "with ur5, this run with small: different robots are not comparable" in told
    panda, ur5, small = (records(name)[0] for name in ("panda", "ur5", "small"))
    name = "test_a_run_with_another_robot.py::test_holding[mujoco-headless{}]"
    assert [r["test"] for r in (panda, ur5, small)] == [
        name.format(""), name.format("-ur5"), name.format("-small"),
    ]  # fmt: skip
    assert "robot" not in panda
    assert [r["robot"]["name"] for r in (ur5, small)] == ["ur5", "small"]
    assert [r["metrics"] for r in (panda, ur5, small)] == [
        {"joints": 9.0}, {"joints": 8.0}, {"joints": 5.0},
    ]  # fmt: skip
    path.write_text(TOML.replace("8.0", "9.0"))  # another limit of acceleration, the same name
    result = run(pytester, *small_run, "--sim-baseline=small")
    result.stdout.fnmatch_lines(["*robot.digest was *, is *"])


def test_what_a_robot_or_a_task_cannot_do(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        HOLDING,
        test_more="""
            from pytest_simbench.tasks import LeaningTowers, Throwing
            from test_what_a_robot_or_a_task_cannot_do import Own

            def test_throwing(repeat):
                repeat(Throwing())

            def test_own(repeat):
                repeat(Own())

            def test_replay(replay):
                replay(Throwing())

            def test_perturb(perturb):
                perturb(Throwing())

            def test_without_a_robot(repeat):
                repeat(LeaningTowers(margins=(0.01,), levels=1, settle=0.01))

            def test_fixture(robot):
                assert robot.name == "small"
        """,
    )
    path = small_arm(pytester.path, TOML.replace("opened = 0.04", "opened = 0.02"))
    result = run(
        pytester, "--reps=1", f"--robot={path}", "--sim-output=out", ret=1, passed=2, failed=5
    )
    for sentence in (
        "--robot: robot 'small' opens too little",
        "--robot: robot 'small' has no swing for the throw",
        "--robot: the task 'own' takes no other robot than its own: give it a field",
    ):
        assert f"\n{sentence}" in result.stdout.str()
    assert "robot" not in records("out")[0]  # the towers know no robot


def test_every_robot(pytester: pytest.Pytester) -> None:
    """What a robot cannot do is a skip with the reason, since nobody named it. A task without a
    robot runs once. A test that takes a robot gets each, with a simulator and without."""
    pytester.makepyfile(
        HOLDING,
        test_more="""
            import pytest
            from pytest_simbench.tasks import LeaningTowers
            from test_every_robot import Holding

            class Sixth(Holding):
                def problem(self):
                    few = len(self.robot.arm_joints) < 6
                    return f"robot {self.robot.name!r} has too few joints" if few else None

            def test_small(repeat, robot, sim_name):
                if robot.name != "so101":
                    pytest.skip("another time")
                repeat(Sixth())

            def test_without_a_robot(repeat):
                repeat(LeaningTowers(margins=(0.01,), levels=1, settle=0.01))

            def test_fixture(robot, request):
                assert robot.name in request.node.name
        """,
    )
    result = run(
        pytester,
        "--reps=1",
        "--robot=all",
        "--sim-output=out",
        "-rs",
        "-v",
        passed=5 + 1 + 5,
        skipped=5 + 4,
    )
    names = ["panda", "so101", "ur10", "ur5", "xarm7"]
    found = [record["test"] for record in records("out") if record["task"] == "holding"]
    assert found == [
        f"test_every_robot.py::test_holding[mujoco-headless{'-' * bool(i) + name * bool(i)}]"
        for i, name in enumerate(names)
    ]
    text = result.stdout.str()
    for name in names:
        assert f"test_fixture[{name}]" in text
    assert "--robot=all: robot 'so101' has too few joints" in text
    assert "--robot=all: the task 'leaning towers' has no robot, and ran once" in text
