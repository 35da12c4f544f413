"""`--sim-scene` and the fixture `scene_file`: what a user types, sees, and gets wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.plugin.inner import records

SCENE = """
<mujoco model="blocks">
  <option timestep="0.004"/>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1"/>
    <body name="lower" pos="0 0 0.1"><freejoint/><geom type="box" size="0.2 0.2 0.1"/></body>
    <body name="upper" pos="0 0 0.255"><freejoint/><geom type="box" size="0.05 0.05 0.05"/></body>
  </worldbody>
</mujoco>
"""

TESTS = """
import pytest
from pytest_simbench.tasks import Settling, rests_on

@pytest.mark.reps(5)
def test_upper_sits(repeat, scene_file):
    scene = scene_file("blocks.xml", starts="starts.npz")
    result = repeat(Settling(scene, premises=[rests_on("upper", "lower")], seconds=1.0))
    result.assert_at_least("premises", 1.0)
"""


@pytest.fixture
def blocks(pytester: pytest.Pytester) -> Path:
    path = pytester.path / "blocks.xml"
    path.write_text(SCENE)
    return path


@pytest.mark.engine
def test_alone_it_runs_the_suite_and_says_whether_a_difference_is_noise(
    pytester: pytest.Pytester, blocks: Path
) -> None:
    (pytester.path / "test_other.py").write_text("def test_not_collected(): assert False\n")
    found = pytester.runpytest_subprocess(
        "--sim-scene", str(blocks), "--sim", "mujoco", "--sim-profile", "tuned,file",
        "--sim-output=run", "-p", "no:cacheprovider",
    )  # fmt: skip
    found.assert_outcomes(passed=12)
    out = found.stdout.str()
    assert "As written, blocks ends alike in all 2, within 1 mm." in out
    account = (pytester.path / "run" / "carried.md").read_text()
    assert "| geom solref | not carried |" in account
    assert "| geom type, size, pos, quat | carried |" in account
    steps = {(r["profile"], r["settings"]["timestep"]) for r in records(pytester.path / "run")}
    own = {"tuned": 0.001, "file": 0.004}
    assert steps == {(name, own[name] / times) for name in own for times in (1, 4, 8)}
    page = (pytester.path / "run" / "report.html").read_text()
    assert page.index("ends alike in all 2") < page.index("Scene blocks")


@pytest.mark.engine
def test_a_premise_of_stored_starts_that_are_all_alike(
    pytester: pytest.Pytester, blocks: Path
) -> None:
    pytester.makepyfile(TESTS)
    rows = [[0.1 * k, 0.0, z, 1.0, 0.0, 0.0, 0.0] for k in range(5) for z in (0.1, 0.255)]
    np.savez(pytester.path / "starts.npz", lower=rows[::2], upper=rows[1::2])
    found = pytester.runpytest_subprocess("--sim", "mujoco", "--sim-output=run")
    found.assert_outcomes(passed=1)
    assert "5 starts, and 1 different" in found.stdout.str()
    ends = [r["details"]["places"]["upper"] for r in records(pytester.path / "run")]
    assert sorted(end[0] for end in ends) == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4], abs=1e-3)
    assert [end[2] for end in ends] == pytest.approx([0.25] * 5, abs=1e-3)


@pytest.mark.engine
def test_a_scene_of_joints_is_refused_by_name(pytester: pytest.Pytester, blocks: Path) -> None:
    blocks.write_text(SCENE.replace("<freejoint/>", '<joint name="hinge" type="hinge"/>', 1))
    found = pytester.runpytest("--sim-scene", str(blocks), "--sim", "mujoco")
    assert found.ret == pytest.ExitCode.USAGE_ERROR
    found.stderr.fnmatch_lines(["ERROR: --sim-scene:*hinge*"])


def test_without_a_file_the_test_is_skipped_and_says_so(pytester: pytest.Pytester) -> None:
    pytester.makepyfile("def test_it(sim_case, scene_file): scene_file()")
    found = pytester.runpytest("--sim", "mujoco", "-rs")
    found.assert_outcomes(skipped=1)
    found.stdout.fnmatch_lines(["*takes the scene of --sim-scene FILE*"])
