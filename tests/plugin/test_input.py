"""Bad input is one clear sentence with the valid choices, exit code 4, and no traceback of ours."""

from __future__ import annotations

import pytest

TEST = """
    from tests.tiny import Falling

    def test_falling(repeat):
        repeat(Falling()).assert_at_least("landed", 0.1)
"""


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
    pytester.makepyfile(TEST)
    result = pytester.runpytest_subprocess(*arguments)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([f"*{message}*"])
    assert "Traceback" not in result.stderr.str() + result.stdout.str()


@pytest.mark.parametrize(
    ("mark", "message"),
    [
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
    ],
)
def test_bad_mark(pytester: pytest.Pytester, mark: str, message: str) -> None:
    pytester.makepyfile("import pytest\npytestmark = pytest.mark." + mark + "\n" + _dedented())
    result = pytester.runpytest_subprocess("--sim=mujoco")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    assert "Traceback" not in result.stderr.str() + result.stdout.str()
    text = result.stdout.str() + result.stderr.str()
    assert all(part in text for part in message.split("*") if part), text


def _dedented() -> str:
    import textwrap

    return textwrap.dedent(TEST)


def test_settings_of_a_fixture_are_checked(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        "import pytest\n@pytest.fixture\ndef sim_settings():\n    return {'speed': 3}\n"
        + _dedented()
    )
    result = pytester.runpytest_subprocess("--sim=mujoco", "--reps=1")
    assert result.ret != 0
    result.stdout.fnmatch_lines(["*mujoco has no setting 'speed'; choose from timestep=*"])


def test_unreadable_robot_description(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        from dataclasses import replace
        from pytest_simbench.robot.panda import panda
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
