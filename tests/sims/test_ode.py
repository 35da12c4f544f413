"""What only ODE's adapter has to show: it runs in the system's Python, counts whole turns, and its
drives of the kind `velocity` do what Webots' motors do."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pytest_simbench.sims.ode.adapter import ODE
from pytest_simbench.sims.ode.contacts import APART, _slip, distinct

from pytest_simbench.client.environments import interpreter
from pytest_simbench.client.errors import EngineFailed, Unavailable
from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.laws.mechanisms import Part, Y, mechanism
from pytest_simbench.scene import (
    Box,
    ConvexMesh,
    Coupling,
    FloatArray,
    Pose,
    Robot,
    Scene,
    Trajectory,
)
from pytest_simbench.scene.friction import RULES
from pytest_simbench.scene.pair_friction import OF_PAIRS
from pytest_simbench.testing import scenes
from tests.conftest import case_of, performed
from tests.tiny import Falling

from .ode_faults import Mortal, RawTip, Tip
from .worlds import Worlds


@pytest.fixture(scope="module")
def worlds(worlds_of: Callable[[type[ODE]], Worlds]) -> Worlds:
    return worlds_of(ODE)


def to(world: World, goal: FloatArray, seconds: float = 1.0) -> None:
    """Lead all joints to set points, at an even speed."""
    start = world.joints[0]
    share = np.linspace(0.0, 1.0, round(seconds / 0.004) + 1)[:, None]
    position = start + share * (goal - start)
    velocity = np.repeat([(goal - start) / seconds], len(share), axis=0)
    velocity[-1] = 0.0  # the last set points hold on
    world.follow(Trajectory(0.004, position, velocity, 0 * position))


def test_the_worker_runs_in_the_systems_python(worlds: Worlds) -> None:
    python = interpreter(ODE.info)
    version = subprocess.check_output([python, "-c", "import sys; print(*sys.version_info[:3])"])
    assert worlds.worker.python_version == ".".join(version.decode().split())


def test_a_record_has_the_versions_of_both_libraries(case: Case) -> None:
    versions = performed(case_of(case, "ode"), Falling()).versions
    assert versions["Py3ODE"] == ODE.info.tested_version
    assert versions["libode"][0].isdigit()


def turning_on(robot: Robot, folder: Path) -> Robot:
    """The same robot, whose joint 7 turns by 12 rad."""
    text = Path(robot.urdf).read_text("utf-8").replace('"-2.8973"', '"-6.0"')
    path = folder / "panda.urdf"
    path.write_text(text.replace('"2.8973"', '"6.0"'), "utf-8")
    return replace(robot, urdf=str(path))


def test_whole_turns_are_counted(worlds: Worlds, tmp_path: Path) -> None:
    """ODE tells angles from -180 to 180 degrees; a restore brings back the count, too."""
    robot = turning_on(scenes.arm(), tmp_path)
    world = worlds.load(scenes.arm_alone(robot))
    goal = robot.column("initial_position")
    seen = []
    for angle in (4.5, -4.5):
        goal[6] = angle
        to(world, goal, 3.0)
        world.wait(0.5)
        seen.append(float(world.joints[0, 6]))
        if angle > 0:
            world.save()
    np.testing.assert_allclose(seen, [4.5, -4.5], atol=0.01)
    world.restore()
    assert float(world.joints[0, 6]) == seen[0]


@pytest.mark.parametrize("angle", [-5.5, -3.0, 2.0, 5.5])
def test_a_wide_joint_may_start_anywhere(worlds: Worlds, tmp_path: Path, angle: float) -> None:
    robot = turning_on(scenes.arm(), tmp_path).with_joints("panda_joint7", initial_position=angle)
    world = worlds.load(scenes.arm_alone(robot))
    assert float(world.joints[0, 6]) == pytest.approx(angle, abs=1e-6)
    world.wait(0.1)
    assert float(world.joints[0, 6]) == pytest.approx(angle, abs=0.01)


@pytest.mark.parametrize("end", [-6.0, 6.0])
def test_a_wide_joint_has_stops(worlds: Worlds, tmp_path: Path, end: float) -> None:
    """Behind a whole turn it stops (0.05 rad) and goes back; what it carries then is told with the
    torque of the stop, against that of the drive."""
    robot = turning_on(scenes.arm(), tmp_path)
    world = worlds.load(scenes.arm_alone(robot, (0.0, 0.0, 0.0)))
    goal = robot.column("initial_position")
    goal[6] = 1.1 * end
    to(world, goal, 4.0)
    world.wait(0.5)
    assert float(world.joints[0, 6]) == pytest.approx(end, abs=0.05)
    assert np.abs(world.joint_wrenches()[6, 3:]).max() < 1.0
    goal[6] = 0.0
    to(world, goal, 4.0)
    world.wait(0.5)
    assert float(world.joints[0, 6]) == pytest.approx(0.0, abs=0.01)


def test_a_world_ends_without_the_collector(tmp_path: Path) -> None:
    """A worker that loaded a second arm died by SIGSEGV while collecting the first."""
    with Worlds(Mortal) as worlds:
        world = worlds.load(scenes.arm_alone(turning_on(scenes.arm(), tmp_path)))
        assert world.contact_count() == 0


@pytest.mark.parametrize(("drive", "behind"), [("velocity", 0.1), ("spring", 0.0)])
def test_webots_motors_lag(worlds: Worlds, drive: str, behind: float) -> None:
    """By speed / P, since they know no set point of velocity; springs do not."""
    robot = scenes.arm()
    world = worlds.load(scenes.arm_alone(robot), drive=drive)
    goal = robot.column("initial_position")
    goal[0] += 0.5
    to(world, goal, 1.0)
    assert goal[0] - world.joints[0, 0] == pytest.approx(0.5 * behind, abs=2e-3)


@pytest.mark.parametrize(("kind", "alike"), [(Tip, 1), (RawTip, 40)])
def test_a_corner_of_a_mesh_is_one_contact(kind: type[Tip], alike: int) -> None:
    """ODE tells it once for each triangle, where a normal is rounded so. Of such contacts its
    solver gave up, and the SO-101's jaw flung a cube away."""
    with Worlds(kind) as worlds:
        assert worlds.load(scenes.arm_alone(scenes.arm())).contact_count() == alike


@dataclass(frozen=True)
class Touch:
    """A contact, as pyode tells one."""

    place: tuple[float, float, float]
    normal: tuple[float, float, float]
    depth: float

    def getContactGeomParams(self) -> tuple[object, ...]:
        return self.place, self.normal, self.depth, None, None

    def stands_for(self, other: Touch) -> bool:
        """Whether the other one adds nothing: near, with the same normal, not deeper."""
        near = np.abs(np.subtract(self.place, other.place)).max() <= APART
        return bool(near and self.normal == other.normal and self.depth >= other.depth)


touches = st.builds(
    Touch,
    st.tuples(*[st.sampled_from([0.0, 0.4 * APART, 0.8 * APART, 3 * APART])] * 3),
    st.sampled_from([(0.0, 0.0, 1.0), (1.0, 0.0, 0.0)]),
    st.floats(0.0, 1e-3),
)


@given(st.lists(touches, max_size=12))
def test_what_is_left_stands_for_all(contacts: list[Touch]) -> None:
    kept = distinct(contacts)
    assert all(any(one.stands_for(other) for one in kept) for other in contacts)
    assert not any(
        a.stands_for(b) for k, a in enumerate(kept) for m, b in enumerate(kept) if k != m
    )
    assert [one.depth for one in kept] == sorted((one.depth for one in kept), reverse=True)


LEVER = Part("lever", Y, centre=(0.3, 0.0, 0.0))
ON_LEVER = Part("crossed", (0.0, 0.0, 1.0), (0.6, 0.0, 0.0), (0.3, 0.1, 0.0))
RACK = Part("rack", (0.0, 0.6, 0.8), (0.0, 0.5, 0.0), slides=True, on="mount")


@pytest.mark.parametrize(
    ("other", "ratio"), [(ON_LEVER, 1.5), (RACK, -0.2), (replace(RACK, axis=Y), 0.3)]
)
def test_joints_of_one_link_are_coupled(worlds: Worlds, other: Part, ratio: float) -> None:
    """Also where it hangs on one of them, and of a hinge and a slider."""
    robot = mechanism("pair", LEVER, other, couplings=(Coupling(other.name, "lever", ratio),))
    world = worlds.load(Scene("pair", robot=robot))
    world.wait(0.3)
    led, following = world.joints[0]
    assert abs(led) > 0.1
    assert following == pytest.approx(ratio * led, abs=3e-3)


SLIDE = Part("slide", (1.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.1, 0.0, 0.2), slides=True)


def fallen(worlds: Worlds, **held: float) -> FloatArray:
    """Positions and velocities of a lever that falls, and of a slider on it with this drive."""
    robot = mechanism("polar", LEVER, SLIDE).with_joints("slide", **held)
    world = worlds.load(Scene("polar", robot=robot))
    world.wait(0.3)
    return world.joints


def test_a_slider_that_is_held_on_what_turns_has_no_velocity(worlds: Worlds) -> None:
    assert fallen(worlds, stiffness=1e6, effort_limit=1e6)[1, 1] == pytest.approx(0.0, abs=0.01)


def test_the_rotor_of_a_slider_turns_nothing(worlds: Worlds) -> None:
    """A heavy one holds the slider, which falls with the lever as one body."""
    held = fallen(worlds, stiffness=1e6, effort_limit=1e6)
    np.testing.assert_allclose(fallen(worlds, armature=1e4), held, atol=0.03)


def test_coupled_joints_have_no_wrenches(worlds: Worlds) -> None:
    robot = mechanism("pair", LEVER, RACK, couplings=(Coupling("rack", "lever"),))
    with pytest.raises(EngineFailed, match="no wrenches"):
        worlds.load(Scene("pair", robot=robot)).joint_wrenches()


def test_joints_of_no_common_link_are_refused(worlds: Worlds) -> None:
    far, pair = replace(RACK, on=None), Coupling("rack", "lever")
    robot = mechanism("far", LEVER, ON_LEVER, far, couplings=(pair,))
    with pytest.raises(Unavailable, match="rack and lever have none in common"):
        worlds.load(Scene("far", robot=robot))


@pytest.mark.parametrize("rule", sorted(RULES))
def test_pairs_have_the_scene_s_friction_whatever_else_there_is(worlds: Worlds, rule: str) -> None:
    frictions, pull = [0.3, 0.7, 0.9], (9.81, 0.0, -9.81)
    pucks = tuple(
        Box(f"puck {k}", (0.2, 0.2, 0.02), Pose.at(0.0, float(k), 0.01), 1.0, mu)
        for k, mu in enumerate(frictions)
    )
    scene = Scene("pucks", pucks, None, pull, ground_friction=0.5, friction_rule=rule)
    world = worlds.load(scene)
    assert not any(told.startswith(OF_PAIRS) for told in world.excused)
    world.wait(0.2)
    speeds = world.bodies[:, 7]
    held = [RULES[rule](0.5, mu) for mu in frictions]
    np.testing.assert_allclose(speeds, 9.81 * 0.2 * (1 - np.array(held)), rtol=0.02)


def test_a_convex_body_may_touch_the_mesh_of_a_link(worlds: Worlds) -> None:
    """ODE aborts where it does and the mesh has no angles of its faces."""
    wedge = ConvexMesh("wedge", scenes.wedge(), Pose.at(0.0, 0.0, 1.0), 0.15)
    world = worlds.load(Scene("wedge", (wedge,), scenes.arm()))
    touched = set()
    for _ in range(40):
        world.wait(0.02)
        touched |= {first for first, second in world.contact_forces() if second == "body/wedge"}
    assert any(name.startswith("link/") for name in touched)


def test_a_solver_that_gives_up_in_every_step_ends_the_run(worlds: Worlds) -> None:
    arm = Part("arm", (0.0, 0.0, 1.0), centre=(0.1, 0.0, 0.0))
    led = Part("led", Y, (0.3, 0.0, 0.0), (0.1, 0.0, 0.0), slides=True, stiffness=1e3, effort=25.0)
    other = replace(led, name="other", axis=(0.0, -1.0, 0.0), centre=(0.0, 0.1, 0.0), on="arm")
    robot = mechanism("hand", arm, led, other, couplings=(Coupling("other", "led"),))
    world = worlds.load(Scene("hand", robot=robot, gravity=(0.0, 0.0, 0.0)))
    with pytest.raises(EngineFailed, match=r"given up in every step for 0.2 s, at t = 0.2\d\d s, "):
        to(world, np.array([0.0, 0.1, 0.1]))


def test_no_forces_are_told_of_the_step_in_which_things_fall_asleep(worlds: Worlds) -> None:
    world = worlds.load(Scene("cube", (scenes.cube("cube", Pose.at(0.4, 0.0, scenes.EDGE / 2)),)))
    world.wait(1.0)
    assert (world.contact_count(), world.contact_forces()) == (4, {})


def test_slip_is_along_the_surface_whatever_its_direction() -> None:
    def moving(*velocity: float) -> SimpleNamespace:
        return SimpleNamespace(getPointVel=lambda place: velocity)

    contact = SimpleNamespace(getContactGeomParams=lambda: ((0, 0, 0), (0, 0, 1), 0.0, None, None))
    assert _slip(contact, moving(0.3, 0.4, 5.0), None) == pytest.approx((0.6, 0.8, 0.0))
    between = _slip(contact, moving(0.1, 0.0, 0.0), moving(0.4, 0.4, 0.0))
    assert between == pytest.approx((-0.6, -0.8, 0.0))
    assert _slip(contact, moving(0.0, 0.0, 1.0), None) is None
