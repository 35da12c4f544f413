"""Bad input is one clear sentence with the valid choices, exit code 4, and no traceback of ours."""

from __future__ import annotations

from fnmatch import fnmatchcase

import pytest

from pytest_simbench.plugin.session import session_of
from tests.plugin.inner import CLAIMING


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--sim=mujocco"], "unknown simulator 'mujocco'; choose from *mujoco, *pybullet*all"),
        (["--reps=0"], "--reps=0: give a whole number from 1 to 100000, auto or auto:LIMIT"),
        (["--reps=many"], "--reps=many: give a whole number from 1 to 100000, auto or auto:LIMIT"),
        (
            ["--reps=auto:x"],
            "--reps=auto:x: give a whole number from 1 to 100000, auto or auto:LIMIT",
        ),
        (["--reps=auto:0"], "--reps=auto:0: give a whole number from 1"),
        (["--jitter=-1"], "--jitter=-1: give a number from 0 to 1000"),
        (["--protocol=quick"], "--protocol=quick: choose from fast, paper, smoke"),
        (["--sim-trace=maybe"], "--sim-trace=maybe: choose from first, first-and-failed, *, off"),
        (["--sim-set=mujoco.timestep"], "--sim-set=mujoco.timestep: write it as SIM.SETTING=VALUE"),
        (["--sim-set=timestep=1"], "--sim-set=timestep=1: write it as SIM.SETTING=VALUE"),
        (["--sim-set=mujoco.speed=1"], "mujoco has no setting 'speed'; choose from timestep=*"),
        (["--sim-set=mujoco.timestep=x"], "mujoco.timestep=x: give a finite number"),
        (
            ["--sim-set=mujoco.timestep=0"],
            "mujoco.timestep=0: give a number of seconds from 1e-06 to 0.01667",
        ),
        (
            ["--sim-set=mujoco.timestep=1e9"],
            "mujoco.timestep=1e+09: give a number *in which a thrown cube moves*",
        ),
        (["--sim-set=mujoco.cone=round"], "mujoco.cone=round: choose from pyramidal, elliptic"),
        (
            ["--sim-profile=best"],
            "no simulator has a settings profile 'best'; choose from default, tuned",
        ),
        (["--sim-python=mujoco"], "--sim-python=mujoco: write it as SIM=PATH"),
        (
            ["--sim-threshold=placed=x"],
            "--sim-threshold=placed=x: the value must be a finite number",
        ),
        (
            ["--sim-threshold=crashed=90"],
            "--sim-threshold=crashed=90: crashed is a share, so its threshold lies between 0 and "
            "1, not at 90; did you mean 0.9?",
        ),
        (
            ["--sim-threshold=rtf=0"],
            "--sim-threshold=rtf=0: rtf is always at least 0, so that this threshold can never "
            "fail",
        ),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_bad_option(pytester: pytest.Pytester, arguments: list[str], message: str) -> None:
    def begin() -> None:
        session = session_of(pytester.parseconfig(*arguments))
        session.check_options()
        session.pytest_sessionstart()

    with pytest.raises(pytest.UsageError) as raised:
        begin()
    assert fnmatchcase(str(raised.value), f"*{message}*")
    assert "\n" not in str(raised.value)


def test_a_bad_option_ends_the_run(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(CLAIMING)
    result = pytester.runpytest_subprocess("--sim=mujocco")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: unknown simulator 'mujocco'; choose from *, or all"])
    assert "Traceback" not in result.stderr.str() + result.stdout.str()


BAD_MARKS = [
    ("only_sim('mujocco')", "unknown simulator 'mujocco'; choose from *mujoco, *pybullet*"),
    ("skip_sim()", "skip_sim needs the name of a simulator"),
    ("skip_sim(['mujoco'])", "unknown simulator \"['mujoco']\"; choose from"),
    ("skip_sim('mujoco', reson='x')", "skip_sim has no keyword argument 'reson'; *reason"),
    ("only_sim('mujoco', strict=1)", "only_sim has no keyword argument 'strict'; *none"),
    ("xfail_sim('mujoco', reason=3)", "xfail_sim: reason must be a text"),
    ("needs('wings')", "needs('wings'): choose from *window*offscreen*"),
    ("needs()", "needs() without a capability: choose from *window*offscreen*"),
    ("reps(0)", "reps(0): give a whole number from 1 to 100000"),
    ("reps(1.5)", "reps(1.5): give a whole number from 1"),
    ("reps(2, 3)", "reps(2, 3): give one number"),
    ("sim_timeout('long')", "sim_timeout('long'): give a number from 0.001 to 1e+06"),
    ("sim_timeout(float('nan'))", "sim_timeout(nan): give a number from 0.001"),
]


def test_bad_marks_are_told_all_at_once(pytester: pytest.Pytester) -> None:
    tests = (
        f"@pytest.mark.{mark}\ndef test_{number}(repeat):\n    pass\n"
        for number, (mark, _) in enumerate(BAD_MARKS)
    )
    pytester.makepyfile("\n".join(["import pytest", *tests]))
    result = pytester.runpytest_subprocess("--sim=mujoco")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    assert "Traceback" not in result.stderr.str() + result.stdout.str()
    lines = [*result.stdout.lines, *result.stderr.lines]
    for number, (_, message) in enumerate(BAD_MARKS):
        (told,) = (line for line in lines if f"::test_{number}: " in line)
        assert all(part in told for part in message.split("*")), told


def test_unreadable_robot_description(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        from dataclasses import replace
        from pytest_simbench.motion.panda import panda
        from pytest_simbench.scene import Scene

        def test_it(sim):
            sim(Scene("s", (), replace(panda(), urdf="/nowhere/panda.urdf")))
        """
    )
    result = pytester.runpytest_subprocess("--sim=mujoco")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        ["*cannot read the robot description /nowhere/panda.urdf: No such file or directory*"]
    )


def test_overlapping_cubes(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        from pytest_simbench.scene import Box, Pose, Scene
        SIZE = (0.05, 0.05, 0.05)
        SCENE = Scene("s", (Box("a", SIZE, Pose(), 0.1), Box("b", SIZE, Pose(), 0.1)))
        """
    )
    result = pytester.runpytest_subprocess("--sim=mujoco")
    result.stdout.fnmatch_lines(["*scene 's': 'a' and 'b' overlap by 50.0 mm; move one of them"])
