"""A keyframe that is held by its drives: what they are told, and what is measured."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.scene_file import read_scene_file
from pytest_simbench.scene import Scene, SceneError, Start
from pytest_simbench.tasks import Holding, Jitter
from tests.conftest import case_of, performed
from tests.tasks.scripted import perform
from tests.tasks.scripted_scene import SCENE, Moved

MASS, LENGTH, STIFFNESS = 0.5, 0.2, 40.0
ARM = f"""
<mujoco model="arm">
  <worldbody>
    <geom type="plane" size="2 2 .1"/>
    <body name="ball" pos="1 0 .05"><freejoint/><geom size=".05"/></body>
    <body name="rail" pos="0 0 1">
      <joint name="rail" type="slide" axis="0 1 0" range="-1 1"/>
      <geom type="box" size=".05 .05 .05" mass="1"/>
      <body name="arm">
        <joint name="elbow" axis="0 1 0" range="-90 90"/>
        <geom type="box" size=".01 .01 .01" pos="{LENGTH} 0 0" mass="{MASS}"
              contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position joint="rail" kp="200" kv="20"/>
    <position joint="elbow" kp="{STIFFNESS}" kv="2"/>
  </actuator>
  <keyframe><key qpos="1 0 .05 1 0 0 0 .1 .2" ctrl=".1 .2"/></keyframe>
</mujoco>
"""


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    return path


def test_drives_are_told_the_keyframe_s_targets() -> None:
    starts = (
        Start((), (), (0.1, 0.2), (0.3, 0.4)),
        Start((), (), (0.1, 0.2)),
        Start((), ()),
    )
    task = Holding(replace(SCENE, starts=starts))
    told = [task.commands(seed)[0].tolist() for seed in range(4)]
    assert told == [[0.3, 0.4], [0.1, 0.2], [0.0, 0.05], [0.3, 0.4]]
    assert Holding(SCENE).commands(7).tolist() == [[0.0, 0.05], [0.0, 0.0], [0.0, 0.0]]
    pushed = Holding(replace(SCENE, starts=(Start((), (), speeds=(1.0, 0.0), efforts=(0.0, 3.0)),)))
    assert pushed.commands(0)[1:].tolist() == [[1.0, 0.0], [0.0, 3.0]]


def test_joints_are_measured_by_kind_each_in_its_unit() -> None:
    """Hinge by 0.01 rad, slider by 2 mm; both at a steady speed in the last half second."""
    process = Moved(end=(0.01, 0.048), speed=(0.002, -0.003))
    outcome, _ = perform(Holding(SCENE), process=process)
    assert outcome.metrics == pytest.approx({
        "gone_hinges": np.degrees(0.01), "gone_sliders": 2.0,
        "restless_hinges": np.degrees(0.002), "restless_sliders": 3.0,
    })  # fmt: skip
    assert {m.name: m.unit for m in Holding(SCENE).metrics} == {
        "gone_hinges": "deg", "gone_sliders": "mm",
        "restless_hinges": "deg/s", "restless_sliders": "mm/s",
    }  # fmt: skip
    assert process.asked[0].arguments["position"].tolist() == [[0.0, 0.05]] * 2
    gone, targets = {"hinge": 0.01, "slider": pytest.approx(-0.002)}, {"hinge": 0.0, "slider": 0.05}
    assert outcome.details == {"gone": gone, "targets": targets, "places": {}}


def test_without_joints_it_says_what_to_do() -> None:
    with pytest.raises(SceneError, match="has no joints.*Settling"):
        Holding(Scene("empty"))


@pytest.mark.engine
@pytest.mark.parametrize("profile", ["tuned", "file"])
def test_an_arm_sags_as_its_spring_and_its_own_stop_at_the_keyframe(
    arm: Path, case: Case, profile: str
) -> None:
    """k (q - q*) = m g l cos(q); the rail, which bears no load, stays."""
    case = replace(case_of(case, "mujoco"), profile=profile)
    record = performed(case, Holding(read_scene_file(arm).scene))
    sag = 0.0
    for _ in range(50):
        sag = MASS * 9.81 * LENGTH * np.cos(0.2 + sag) / STIFFNESS
    assert record.metrics["gone_hinges"] == pytest.approx(np.degrees(sag), rel=0.01)
    assert record.metrics["gone_sliders"] < 0.05
    assert record.metrics["restless_hinges"] < 0.01
    assert record.metrics["farthest"] < 1.0
    assert record.details["targets"] == pytest.approx({"rail": 0.1, "elbow": 0.2})


BELT = """
<mujoco model="belt">
  <worldbody>
    <body name="belt" pos="0 0 1"><joint name="belt" type="slide" axis="1 0 0" range="-2 2"/>
      <geom type="box" size=".1 .1 .1" mass="1"/></body>
  </worldbody>
  <actuator><velocity joint="belt" kv="30"/></actuator>
  <keyframe><key ctrl=".1"/></keyframe>
</mujoco>
"""


@pytest.mark.engine
@pytest.mark.parametrize("name", ["mujoco", "pybullet", "dart"])
def test_a_velocity_servo_moves_as_fast_as_the_keyframe_asks(
    tmp_path: Path, case: Case, name: str
) -> None:
    """Also where drives are no springs and dampers; with m / d = 1/30 s it is 3.3 mm late."""
    path = tmp_path / "belt.xml"
    path.write_text(BELT)
    record = performed(case_of(case, name), Holding(read_scene_file(path).scene, seconds=1.0))
    assert record.metrics["gone_sliders"] == pytest.approx(100.0, abs=4.0)


def test_it_starts_at_the_keyframe() -> None:
    scene = replace(SCENE, starts=(Start((), (), (0.1, 0.2)),))
    robot = Holding(scene).scene(5, Jitter()).robot
    assert robot.column("initial_position").tolist() == [0.1, 0.2]
