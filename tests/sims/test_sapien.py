"""What only SAPIEN's adapter has to show: its settings reach PhysX, `default` is what PhysX and
SAPIEN do by themselves, groups keep apart what the scene does, and what a restored world keeps."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pytest_simbench.sims.sapien.adapter import SAPIEN
from pytest_simbench.sims.sapien.bodies import ROBOT, WORLD, groups_apart
from pytest_simbench.sims.sapien.readback import _compatible

from pytest_simbench.laws.loops import FourBarSwing
from pytest_simbench.laws.mechanisms import Part, Y, mechanism
from pytest_simbench.scene import Coupling, FloatArray, Scene
from pytest_simbench.simulator import NotSupportedError, PreparedRobot
from pytest_simbench.tasks import Jitter, Stacking
from pytest_simbench.testing import joints, scenes

from .settings_told import told_sapien
from .worlds import loaded, stepped

sapien = pytest.importorskip("sapien")


def world(scene: Scene) -> Any:
    """Until it is left."""
    return closing(loaded(SAPIEN, scene))


def test_default_is_what_the_engine_does_by_itself(tmp_path: Path) -> None:
    """A world built by SAPIEN's own tools, nothing set, reports the profile `default`."""
    from sapien import physx

    physx.set_scene_config(physx.PhysxSceneConfig())
    physx.set_body_config(physx.PhysxBodyConfig())
    physx.set_shape_config(physx.PhysxShapeConfig())
    simulator = SAPIEN(SAPIEN.profiles["default"])
    simulator._system = physx.PhysxCpuSystem()
    bare = sapien.Scene([simulator._system])
    builder = bare.create_actor_builder()
    builder.add_box_collision(half_size=[0.025] * 3)
    builder.initial_pose = sapien.Pose([0.6, 0.3, 0.025])
    cube = builder.build("cube").find_component_by_type(physx.PhysxRigidDynamicComponent)
    simulator._ground, simulator._free = cube, [cube]
    path = PreparedRobot(scenes.arm()).write_urdf(tmp_path, visuals=False)
    loader = bare.create_urdf_loader()
    simulator._robot = loader.load_file_as_articulation_builder(str(path)).build(True)
    expected = {k: v for k, v in vars(simulator.settings).items() if k != "coupling_stiffness"}
    assert told_sapien(simulator) == pytest.approx(expected)


@pytest.mark.parametrize("ratio", [-3.0, 2.0, 0.2])
def test_couplings_hold_at_any_ratio(ratio: float) -> None:
    """With coefficients above 1 they stuck, 0.2 rad apart."""
    pair = Coupling("turned", "falling", ratio, 0.1)
    levers = joints.lever("falling"), joints.lever("turned", (0.0, 0.5, 0.0), start=0.1)
    with world(Scene("coupled", robot=mechanism("coupled", *levers, couplings=(pair,)))) as made:
        stepped(made, 0.4)
        leads, follows = made.joint_state()[0]
    assert follows == pytest.approx(ratio * leads + 0.1, abs=1e-3)
    assert abs(leads) > 0.2


@pytest.mark.parametrize("mass", [0.05, 20.0])
def test_coupled_levers_fall_as_fast_as_both_let_them(mass: float) -> None:
    """One turns another of a fifth its mass, -2 times as far; a stiff tendon had it not fall."""
    parts = [
        Part(name, Y, offset, (0.05, 0.0, 0.0), m, (4e-4 * m,) * 3, on="mount")
        for name, offset, m in (("falling", (0, 0, 0), mass), ("turned", (0, 0.5, 0), mass / 5))
    ]
    robot = mechanism("coupled", *parts, couplings=(Coupling("turned", "falling", -2.0),))
    with world(Scene("coupled", robot=robot)) as made:
        stepped(made, 0.12)
        leads, follows = made.joint_state()[0]

    def law(q: float, v: float) -> float:
        torque = 0.05 * joints.G * (np.cos(q) - 2 / 5 * np.cos(-2 * q))
        return float(torque / ((0.05**2 + 4e-4) * (1 + 4 / 5)))

    right = joints.followed(law, np.array([0.0, 0.12]))[-1]
    assert [leads, follows] == pytest.approx([right, -2 * right], rel=0.04)


def test_joints_of_two_links_are_not_coupled() -> None:
    second = Part("second", Y, (0.3, 0.0, 0.0))
    pair = Coupling("second", "first")
    robot = mechanism("chain", joints.lever("first"), second, couplings=(pair,))
    with pytest.raises(NotSupportedError, match="'first' is on 'base', 'second' on 'first link'"):
        loaded(SAPIEN, Scene("chain", robot=robot))


@pytest.mark.parametrize("own", ["spring", "passive_damping", "friction"])
def test_joints_with_something_beside_them_have_no_wrenches(own: str) -> None:
    lever = Part("lever", Y, centre=(0.3, 0.0, 0.0), **{own: 2.0})
    with (
        world(Scene("beside", robot=mechanism("beside", lever))) as made,
        pytest.raises(NotSupportedError, match="no wrenches"),
    ):
        made.joint_wrenches()


def test_a_hinge_s_spring_ends_half_a_turn_away() -> None:
    """At rest there it is refused; a slider's is not, and what passes there is declared."""
    for slides in (True, False):
        part = Part("sprung", Y, slides=slides, spring=2.0, rest=3.2)
        scene = Scene("sprung", robot=mechanism("sprung", part))
        if slides:
            loaded(SAPIEN, scene).close()
    told = [d.reason for d in SAPIEN.info.deviations if d.only in scene.words]
    assert any("half a turn" in reason for reason in told)
    with pytest.raises(NotSupportedError, match="rest at 3.2 rad"):
        loaded(SAPIEN, scene)


def test_links_of_a_loop_have_no_wrenches() -> None:
    with world(FourBarSwing().build()) as made, pytest.raises(NotSupportedError, match="wrenches"):
        made.joint_wrenches()


PARTS = ("ground", *(f"{kind}/{n}" for kind in ("body", "link") for n in range(4)))


@given(
    st.sets(st.tuples(*[st.sampled_from(PARTS)] * 2).filter(lambda pair: pair[0] < pair[1])),
    st.booleans(),
)
def test_groups_keep_apart_what_the_scene_does(pairs: set[Any], self_collide: bool) -> None:
    robot = replace(scenes.arm(), self_collide=self_collide)
    scene: Any = SimpleNamespace(apart=pairs, robot=robot)
    found = groups_apart(scene)
    own = [ROBOT, WORLD | (ROBOT if self_collide else 0), 0, 0]
    for a in PARTS:
        for b in PARTS:
            links = [name.startswith("link/") for name in (a, b)]
            plain = [own if link else [WORLD, WORLD | ROBOT, 0, 0] for link in links]
            groups = [found.get(name, default) for name, default in zip((a, b), plain, strict=True)]
            meet = (a, b) not in pairs and (b, a) not in pairs and (self_collide or not all(links))
            assert a == b or _compatible(*groups) == meet, (a, b)


def future(simulator: SAPIEN, steps: int) -> FloatArray:
    rows = []
    for _ in range(steps):
        simulator.step()
        rows.append(simulator.body_state())
    return np.array(rows)


def test_a_restored_flight_goes_on_bit_for_bit() -> None:
    with world(scenes.tumbling((0.1, 0.06, 0.03))) as simulator:
        stepped(simulator, 0.4)
        assert simulator.contact_count() == 0
        state = simulator.save()
        straight = future(simulator, 50)
        simulator.restore(state)
        assert np.array_equal(future(simulator, 50), straight)


def test_a_restored_tower_is_built_of_new_contacts() -> None:
    """PhysX saves no contacts: those of a restored tower begin anew. It must not show: every
    cube stays within 1 mm of where it would have been; that the bits differ is the declared
    failure of `restore_continues`."""
    with world(scenes.tower()) as simulator:
        stepped(simulator, 1.0)
        state = simulator.save()
        straight = future(simulator, 500)
        simulator.restore(state)
        again = future(simulator, 500)
    assert not np.array_equal(again, straight)
    assert np.abs(again - straight)[:, :, :3].max() < 1e-3


@settings(max_examples=10, deadline=None)
@given(astray=st.integers(0, 300), share=st.floats(-0.3, 0.3), finger=st.floats(0.0, 0.035))
def test_what_was_before_a_restore_leaves_no_trace(
    astray: int, share: float, finger: float
) -> None:
    """With a cube in the grip: PhysX keeps the contacts of a world that lives on."""
    scene = scenes.grip()
    robot = scene.robot
    closed = robot.column("initial_position")
    closed[robot.finger_indices] = robot.gripper.closed
    elsewhere = closed + share
    elsewhere[robot.finger_indices] = finger
    with world(scene) as simulator:
        simulator.command(closed, 0 * closed, 0 * closed)
        future(simulator, 200)
        state = simulator.save()
        futures = []
        for steps in (0, astray):
            simulator.command(elsewhere, 0 * closed, 0 * closed)
            future(simulator, steps)
            simulator.restore(state)
            futures.append((future(simulator, 100), simulator.joint_state()))
    assert np.array_equal(futures[0][0], futures[1][0])
    assert np.array_equal(futures[0][1], futures[1][1])


def test_bodies_are_read_in_one_call_as_each_tells_itself() -> None:
    """With fixed boxes and a robot among them, moving, and after a restore."""
    scene = Stacking(levels=1).scene(3, Jitter())
    simulator = loaded(SAPIEN, scene)
    saved = simulator.save()
    stepped(simulator, 0.08)

    def told() -> list[list[float]]:
        return [
            [*b.entity.pose.p, *b.entity.pose.q, *b.linear_velocity, *b.angular_velocity]
            for b in simulator._free
        ]

    assert np.abs(simulator.body_state()[:, 7:]).max() > 1e-3
    np.testing.assert_array_equal(simulator.body_state(), told())
    simulator.restore(saved)
    np.testing.assert_array_equal(simulator.body_state(), told())
    simulator.close()
