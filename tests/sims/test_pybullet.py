"""What only PyBullet's adapter has to show: what its motors follow, springs and dampers that it
pushes itself, and parity faults of gears that the common tests do not plant."""

from __future__ import annotations

from contextlib import closing

import numpy as np
import pytest
from pytest_simbench.sims.pybullet.adapter import PyBullet

from pytest_simbench.laws.mechanisms import Part, Y, mechanism
from pytest_simbench.scene import Box, Coupling, Pose, Robot, Scene
from pytest_simbench.simulator import NotSupportedError
from pytest_simbench.testing import scenes

from .worlds import loaded, stepped


@pytest.mark.parametrize("way", [0.002, 9.0])
def test_motors_follow_the_drive_law(way: float) -> None:
    """In a step h whose efforts they have the arm's motors get to the velocity at which the drive
    law asks for no effort at its end, also to a set point beyond the joints' limits."""
    robot = scenes.arm()
    simulator = loaded(PyBullet, scenes.arm_alone(robot))
    step = simulator.settings.timestep
    k, d, q = (robot.column(of) for of in ("stiffness", "damping", "initial_position"))
    told, speed = q + way, 0.03 - k / d * way
    simulator.command(told, speed, 0 * q)
    simulator.step()
    law = (k * (told - q) + d * speed) / (step * k + d)
    np.testing.assert_allclose(simulator.joint_state()[1, :7], law[:7], atol=1e-5)
    simulator.close()


def test_default_is_what_the_engine_does_by_itself() -> None:
    """Tumbling boxes end bit for bit where an engine leaves them whose parameters nobody set."""
    import pybullet
    from pybullet_utils.bullet_client import BulletClient

    boxes = [
        Box(
            f"box{k}",
            (0.05, 0.06, 0.07),
            Pose((0.02 * k, 0.0, 0.2 + 0.1 * k), Pose.at(0, 0, 0, yaw=0.5 + k).quaternion),
            0.1,
        )
        for k in range(3)
    ]
    scene = Scene("tumbling", tuple(boxes))
    simulator = stepped(loaded(PyBullet, scene, "default"), 2.0)
    ours = simulator.body_state()
    simulator.close()

    engine = BulletClient(pybullet.DIRECT)
    engine.setGravity(*scene.gravity)
    bodies = [engine.createMultiBody(0, engine.createCollisionShape(pybullet.GEOM_PLANE))]
    for box in boxes:
        half = [edge / 2 for edge in box.size]
        shape = engine.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half)
        w, *xyz = box.pose.quaternion
        bodies.append(engine.createMultiBody(box.mass, shape, -1, box.pose.position, [*xyz, w]))
    for body in bodies:  # the scene's friction; nothing else
        engine.changeDynamics(body, -1, lateralFriction=1.0)
    for _ in range(480):
        engine.stepSimulation()
    alone = [engine.getBasePositionAndOrientation(body)[0] for body in bodies[1:]]
    engine.disconnect()
    assert np.array_equal(ours[:, :3], np.array(alone))


def test_contacts_turn_with_the_hand() -> None:
    """An anchored contact keeps its normal in the world's axes. After a turn of 2 rad with a cube
    in the hand the fingers still press along the line between them: normals are off by 0.3 rad at
    most. They were off by 1.2 rad before the adapter made anchors anew."""
    import pybullet

    scene = scenes.grip()
    robot = scene.robot
    with closing(loaded(PyBullet, scene)) as simulator:
        target, rest = robot.column("initial_position"), np.zeros(len(robot.joints))
        wrist = robot.joint_names.index("panda_joint7")
        target[robot.finger_indices] = robot.gripper.closed
        angles = np.concatenate([np.zeros(120), np.linspace(0.0, -2.0, 240)])
        for angle in target[wrist] + angles:
            target[wrist] = angle
            simulator.command(target, rest, rest)
            simulator.step()
        fingers = [simulator._links[name] for name in ("panda_leftfinger", "panda_rightfinger")]
        c, number = simulator.client, simulator._robot
        places = [pybullet.getLinkState(number, link, physicsClientId=c)[4] for link in fingers]
        line = np.subtract(*places)
        points = [point for point in pybullet.getContactPoints(number, physicsClientId=c)
                  if point[3] in fingers and point[9] > 0.1]  # fmt: skip
        assert {point[3] for point in points} == set(fingers)
        along = [abs(np.dot(point[7], line)) / np.linalg.norm(line) for point in points]
        assert min(along) > np.cos(0.5), along


LIGHT = Part("light", Y, centre=(0.03, 0.0, 0.0), mass=0.01, inertia=(1e-6,) * 3, on="mount",
             passive_damping=0.01)  # fmt: skip
"""A lever of 10 g that a step of 1/240 s of its damping would stop four times over."""


def built(robot: Robot, *bodies: Box) -> PyBullet:
    return loaded(PyBullet, Scene(robot.name, bodies, robot))


def test_a_damper_that_a_step_outruns_does_not_throw_its_joint() -> None:
    """The weight turns the lever at torque / damping."""
    angle, speed = stepped(built(mechanism("light", LIGHT)), 0.5).joint_state()[:, 0]
    assert 0.1 < angle < 0.2
    assert speed == pytest.approx(0.01 * 9.80665 * 0.03 * np.cos(angle) / 0.01, rel=0.02)


def test_what_blocks_a_damped_joint_feels_all_of_its_spring() -> None:
    """A press of 0.1 kg whose spring pushes with 20 N on a table, damped by 50 N s/m: two thirds
    of the force are lost where a damper takes a blocked joint for a free one."""
    press = Part("press", (0.0, 0.0, 1.0), mass=0.1, slides=True, shape=(0.1, 0.1, 0.1),
                 passive_damping=50.0, spring=400.0, rest=-0.4)  # fmt: skip
    simulator = built(
        mechanism("press", press, base=Pose.at(0.0, 0.0, 0.6)),
        Box("table", (0.4, 0.4, 0.2), Pose.at(0.0, 0.0, 0.1)),
    )
    assert stepped(simulator, 1.0).joint_state()[0] == pytest.approx(-0.35, abs=1e-3)
    force = sum(abs(wrench[2]) for *_, wrench in simulator.contact_forces())
    assert force == pytest.approx(0.1 * 9.80665 + 400 * 0.05, rel=0.01)


def test_restored_springs_and_dampers_go_on_as_they_were() -> None:
    simulator = built(mechanism("light", LIGHT))
    stepped(simulator, 0.1)
    saved = simulator.save()
    straight = stepped(simulator, 0.2).joint_state()
    simulator.restore(saved)
    assert np.array_equal(stepped(simulator, 0.2).joint_state(), straight)


def test_gears_are_read_and_joints_with_them_have_no_wrenches() -> None:
    import pybullet

    rubs = Part("rubs", Y, friction=3.0, on="mount")
    robot = mechanism("geared", LIGHT, rubs, couplings=(Coupling("rubs", "light", 2.0, 0.0),))
    simulator = built(robot)
    told = simulator.read_back()
    assert told["coupling/rubs"] == pytest.approx([2.0, 0.0])
    assert (told["joint/light/friction"], told["joint/rubs/friction"]) == (0.0, 3.0)
    with pytest.raises(NotSupportedError, match="no wrenches"):
        simulator.joint_wrenches()
    coupling, friction = simulator._couplings
    pybullet.changeConstraint(coupling, gearRatio=-1.0, physicsClientId=simulator.client)
    pybullet.changeConstraint(friction, maxForce=4.0, physicsClientId=simulator.client)
    told = simulator.read_back()
    assert told["coupling/rubs"] == pytest.approx([1.0, 0.0])
    assert told["joint/rubs/friction"] == 4.0
