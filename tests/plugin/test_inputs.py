"""What tests read of the user's: `--sim-data`, `--sim-scene` and their fixtures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pytest_simbench.data import tosses
from tests.data.samples import falling
from tests.plugin.inner import records, run_pytest

TOSSING = """
from pytest_simbench.tasks import Tossing

def test_tossing(repeat, data_set):
    repeat(Tossing(data_set("{name}")))
"""


def test_a_set_is_read_from_the_folder_and_each_toss_is_a_repetition(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("SIMBENCH_DATA", raising=False)
    pytester.makepyfile(TOSSING.format(name="cube_tosses"))
    folder = pytester.mkdir("here")
    path = folder / "contactnets_cube_tosses_3.npz"
    tosses.write(path, [1, 2, 3], [falling(5), falling(6), falling(7)])
    result = run_pytest(pytester, "--sim=mujoco --sim-data=here", passed=1)
    result.stdout.fnmatch_lines(["tossing: 2 repetitions, protocol fast"])


def test_what_is_not_there_or_broken_is_one_sentence(pytester: pytest.Pytester) -> None:
    names = ("cube_tosses", "planar_impacts", "nosuch")
    tests = (TOSSING.format(name=name).replace("test_tossing", f"test_{name}") for name in names)
    pytester.makepyfile("".join(tests))
    folder = Path(pytester.mkdir("here"))
    (folder / "contactnets_cube_tosses_1.npz").write_bytes(b"x")
    result = run_pytest(pytester, "--sim=mujoco --sim-data=here -rsf", skipped=1, failed=2)
    result.stdout.fnmatch_lines_random([
        "*contactnets_cube_tosses_1.npz holds no arrays*",
        "*is not in *: simbench download planar_impacts*",
        "*no data set 'nosuch'; choose from cube_tosses*",
    ])  # fmt: skip


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
@pytest.mark.usefixtures("drawn")
def test_alone_it_runs_the_suite_and_says_whether_a_difference_is_noise(
    pytester: pytest.Pytester, blocks: Path
) -> None:
    (pytester.path / "test_other.py").write_text("def test_not_collected(): assert False\n")
    found = run_pytest(
        pytester,
        f"--sim-scene {blocks} --sim mujoco --sim-profile tuned,file --sim-output=run",
        "-pno:cacheprovider",
        passed=12,
    )
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
    assert page.index("Scene blocks") < page.index("What was carried of blocks.xml")
    assert "softness of contacts" in page


@pytest.mark.engine
def test_a_premise_of_stored_starts_that_are_all_alike(
    pytester: pytest.Pytester, blocks: Path
) -> None:
    pytester.makepyfile(TESTS)
    rows = [[0.1 * k, 0.0, z, 1.0, 0.0, 0.0, 0.0] for k in range(5) for z in (0.1, 0.255)]
    np.savez(pytester.path / "starts.npz", lower=rows[::2], upper=rows[1::2])
    (pytester.mkdir("run") / "carried.md").mkdir()
    found = run_pytest(pytester, "--sim mujoco --sim-output=run -n1", ret=1, passed=1)
    assert "carried.md could not be written (Is a directory)" in found.stdout.str()
    assert "5 starts, and 1 different" in found.stdout.str()
    ends = [r["details"]["places"]["upper"] for r in records(pytester.path / "run")]
    assert sorted(end[0] for end in ends) == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4], abs=1e-3)
    assert [end[2] for end in ends] == pytest.approx([0.25] * 5, abs=1e-3)


@pytest.mark.engine
def test_starts_are_where_the_file_has_them_though_its_ground_is_elsewhere(
    pytester: pytest.Pytester, blocks: Path
) -> None:
    """The floor lies at z = 0.5 m in the file, at 0 in a scene."""
    places = "{x} 0 .6 1 0 0 0  {x} 0 .755 1 0 0 0"
    keys = "".join(f'<key qpos="{places.format(x=x)}"/>' for x in (0.3, 0.4))
    floor = SCENE.replace('<geom name="floor"', '<geom name="floor" pos="0 0 .5"')
    lifted = floor.replace("0 0 0.1", "0 0 0.6").replace("0 0 0.255", "0 0 0.755")
    blocks.write_text(lifted.replace("</mujoco>", f"<keyframe>{keys}</keyframe></mujoco>"))
    stored = {"lower": [[0.5, 0, 0.6, 1, 0, 0, 0]], "upper": [[0.5, 0, 0.755, 1, 0, 0, 0]]}
    np.savez(pytester.path / "starts.npz", **stored)
    own = TESTS.replace("test_upper_sits", "test_own").replace("starts.npz", "keyframes")
    pytester.makepyfile(TESTS + own.replace("import pytest", ""))
    run_pytest(
        pytester, "--sim mujoco --sim-profile tuned,file --sim-output=run --reps=2", passed=4
    )
    ends = [r["details"]["places"]["upper"] for r in records(pytester.path / "run")]
    assert sorted(end[0] for end in ends) == pytest.approx(
        [0.3, 0.3, 0.4, 0.4, 0.5, 0.5],
        abs=1e-3,  # MuJoCo does the one stored start once
    )
    assert [end[2] for end in ends] == pytest.approx([0.25] * 6, abs=1e-3)
    assert max(r["metrics"]["farthest"] for r in records(pytester.path / "run")) < 10  # [mm]


@pytest.mark.engine
def test_keyframes_that_are_not_there_end_the_run(pytester: pytest.Pytester, blocks: Path) -> None:
    pytester.makepyfile(TESTS.replace("starts.npz", "keyframes"))
    found = run_pytest(pytester, "--sim mujoco", ret=pytest.ExitCode.USAGE_ERROR)
    why = f"{blocks} has no keyframes; name a file of starts, or none"
    assert why in found.stdout.str()
    assert why in run_pytest(pytester, "--sim mujoco -n 2", failed=1).stdout.str()


@pytest.mark.engine
def test_what_hangs_on_a_joint_settles_too(pytester: pytest.Pytester, blocks: Path) -> None:
    """A flap that falls by a quarter of a turn, to the end of its range."""
    flap = '<joint axis="0 1 0" range="0 90"/><geom type="box" size=".2 .1 .01" pos=".2 0 0"/>'
    blocks.write_text(
        f'<mujoco><worldbody><geom type="plane" size="1 1 1"/><body name="flap" pos="0 0 1">{flap}'
        "</body></worldbody></mujoco>"
    )
    run_pytest(
        pytester,
        f"--sim-scene {blocks} --sim mujoco,drake --sim-output=run",
        "-k not step and not mm",
        passed=2,
    )
    for record in records(pytester.path / "run"):
        assert record["details"]["places"]["flap"][:3] == pytest.approx([0, 0, 0.8], abs=0.02)
        assert record["metrics"]["tilt"] == pytest.approx(90, abs=3)
        assert record["metrics"]["restless"] is None


def test_without_a_file_the_test_is_skipped_and_says_so(pytester: pytest.Pytester) -> None:
    pytester.makepyfile("def test_it(sim_case, scene_file): scene_file()")
    found = pytester.runpytest("--sim", "mujoco", "-rs")
    found.assert_outcomes(skipped=1)
    found.stdout.fnmatch_lines(["*takes the scene of --sim-scene FILE*"])


FOLLOWING = """
from pytest_simbench.tasks import Replaying

def test_it_follows(repeat, scene_file):
    scene = scene_file("door.xml")
    repeat(Replaying(scene, scene_file.log("run.csv", scene)))
"""


@pytest.mark.engine
def test_a_log_beside_the_test_is_followed_and_a_broken_one_ends_the_run(
    pytester: pytest.Pytester,
) -> None:
    joint = '<joint name="hinge"/><geom type="box" size=".2 .1 .01" pos=".2 0 0"/>'
    drive = '<actuator><position joint="hinge" kp="500" kv="50"/></actuator>'
    (pytester.path / "door.xml").write_text(
        f'<mujoco><worldbody><body pos="0 0 1">{joint}</body></worldbody>{drive}</mujoco>'
    )
    log = pytester.path / "run.csv"
    log.write_text("time,hinge\n0,0\n0.5,0.05\n1,0.05\n")
    pytester.makepyfile(FOLLOWING)
    found = run_pytest(pytester, "--sim mujoco --sim-output=run --reps=1", passed=1)
    (record,) = records(pytester.path / "run")
    assert record["details"]["joints"]["hinge"] == pytest.approx(0.05, abs=0.01)
    assert 0.0 < record["metrics"]["worst_hinges"] < 2.0
    log.write_text("time,hinge\n0,7\n0.5,7\n")
    found = run_pytest(pytester, "--sim mujoco --reps=1", passed=1)
    found.stdout.fnmatch_lines(["*run.csv: hinge goes from 7 to 7 rad or m, and in scene 'door' *"])
    log.write_text("time,hinge\n0,0\n0.5,nan\n")
    found = run_pytest(pytester, "--sim mujoco", ret=pytest.ExitCode.USAGE_ERROR)
    found.stdout.fnmatch_lines(["*the log * has no finite number of 'hinge' in row 1*"])


CABINET = """
<robot name="cabinet"><link name="carcass"/>
  <link name="drawer">
    <inertial><mass value="2"/>
      <inertia ixx=".02" iyy=".02" izz=".02" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size=".2 .2 .2"/></geometry></collision>
  </link>
  <joint name="rail" type="prismatic"><parent link="carcass"/><child link="drawer"/>
    <origin xyz="0 0 .5"/><axis xyz="0 0 1"/><limit lower="-.2" upper=".3" effort="5"/></joint>
</robot>
"""


@pytest.mark.engine
def test_a_urdf_is_a_scene_and_a_broken_one_ends_the_run(pytester: pytest.Pytester) -> None:
    path = pytester.path / "cabinet.urdf"
    path.write_text(CABINET)
    asked = "--sim-scene", str(path), "--sim", "mujoco", "--sim-output=run"
    found = run_pytest(pytester, "", *asked, "-k not step and not mm", passed=1)
    (record,) = records(pytester.path / "run")
    assert record["metrics"]["farthest"] == pytest.approx(200, abs=5)  # onto its stop
    assert "limit effort, velocity | not carried" in (pytester.path / "run/carried.md").read_text()
    path.write_text(CABINET.replace('value="2"', 'value="-2"'))
    found = run_pytest(pytester, "", *asked, ret=pytest.ExitCode.USAGE_ERROR)
    found.stderr.fnmatch_lines(["ERROR: --sim-scene: *cabinet.urdf, line 4: *mass -2 kg*"])
    still = '<mujoco><worldbody><geom type="box" size="1 1 1"/></worldbody></mujoco>'
    pytester.path.joinpath("wall.xml").write_text(still)
    found = run_pytest(
        pytester, "--sim-scene=wall.xml --sim=mujoco", ret=pytest.ExitCode.USAGE_ERROR
    )
    found.stderr.fnmatch_lines(["ERROR: --sim-scene: nothing in 'wall' can move; free a body"])
