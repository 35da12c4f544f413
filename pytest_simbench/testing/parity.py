"""Checks of what an adapter reads back: honest worlds pass, faulty ones do not, nothing echoes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from pytest_simbench.laws.mechanisms import Part, mechanism
from pytest_simbench.motion.beside import with_thing
from pytest_simbench.parity.compare import ParityResult, compare
from pytest_simbench.parity.quantities import expected_quantities
from pytest_simbench.scene import Pose, Scene
from pytest_simbench.simulator import Capability
from pytest_simbench.testing import scenes
from pytest_simbench.testing.contract import SINGLE
from pytest_simbench.testing.faults import (
    FAULTS,
    Fault,
    mechanisms,
    robot_faults,
    rounds,
    true_scene,
)
from pytest_simbench.testing.kit import any_robot, check
from pytest_simbench.testing.state import require_same, swung
from pytest_simbench.testing.subject import Subject, require


@check(robot=any_robot)
def parity_of_full_scene(subject: Subject) -> None:
    """A world with robot, fixed and free bodies, odd sizes and tilted gravity passes parity."""
    with subject.world(_truth(subject)):
        pass  # loading checks parity


@check(Capability.SELF_COLLIDE, any_robot)
def parity_where_links_collide(subject: Subject) -> None:
    """The robot alone passes parity where its links collide with each other, but for those that one
    joint joins, also where some of them overlap. Where pairs can be kept apart, it passes beside a
    slider, too, with which its links collide, and not with each other."""
    with subject.world(Scene("colliding", robot=replace(subject.arm, self_collide=True))):
        pass  # loading checks parity
    if subject.can(Capability.APART):
        part = Part("slider beside", (0.0, 1.0, 0.0), slides=True, shape=(0.1, 0.1, 0.1))
        slider = mechanism("slider", part, base=Pose.at(0.7, 0.0, 0.3))
        with subject.world(with_thing(Scene("beside", robot=subject.arm), slider)):
            pass


def _truth(subject: Subject) -> Scene:
    """The kit's full scene with the robot that the laws are asked with, and no body of several
    shapes where an engine has none."""
    scene = true_scene()
    if not subject.can(Capability.COMPOUND):
        scene = replace(scene, bodies=tuple(b for b in scene.bodies if len(b.parts) == 1))
    return replace(scene, robot=replace(subject.arm, friction=0.7))


@check(robot=any_robot)
def parity_in_any_posture(subject: Subject) -> None:
    """The links stand where the description has them, at three random joint positions too, with
    the base moved and turned: parity holds there."""
    rng = np.random.default_rng(0)
    robot = subject.arm
    for _ in range(3):
        base = Pose.at(0.2 * rng.uniform(), -0.1, 0.1, yaw=3 * rng.uniform())
        moved = scenes.at_random(replace(robot, base=base), rng)
        with subject.world(scenes.arm_alone(moved, name="posture")):
            pass  # loading checks parity


@check()
def read_back_is_the_engines(subject: Subject) -> None:
    """What is read back comes from the engine: once a cube fell, its pose is the present one, or
    that of the step before, where an engine derives poses at the start of a step."""
    with subject.world(scenes.falling()) as world:
        world.wait(0.3)
        pose = np.asarray(world.process.request("read_back")["body/falling/pose"])
        step = float(np.linalg.norm(world.bodies[0, 7:10])) * subject.timestep
        require(
            np.allclose(pose[:3], world.bodies[0, :3], atol=SINGLE + step),
            f"read_back gives position {pose[:3]} of a cube that is at {world.bodies[0, :3]}",
        )


@check(Capability.DETERMINISTIC, any_robot)
def reading_changes_nothing(subject: Subject) -> None:
    """A world that was read back moves on, bit for bit, as one that was not: at its start and again
    and again, cubes falling and colliding, the arm swinging. What lasts is told the same each
    time."""
    unread = swung(subject, fresh=True, parity=False)
    require_same("read back and not", swung(subject, fresh=True, watched=True), unread)


@check(robot=any_robot)
def planted_faults_are_seen(subject: Subject) -> None:
    """Parity sees each fault of `testing.faults.FAULTS` that the adapter does not declare as not
    told; also when the adapter is made to remember the true scene, so that it must ask the engine.
    With another robot than the Panda the faults are those of `testing.faults.robot_faults`; with
    the Panda also those of `testing.faults.mechanisms`.
    """
    missed = []
    robot, capabilities = subject.robot, subject.cls.info.capabilities
    lacking = [deviation for deviation in subject.cls.info.deviations if deviation.only]
    truth = _truth(subject)
    worlds = [(truth, f) for f in rounds(capabilities, robot_faults(robot) if robot else FAULTS)]
    for scene, faults in worlds if robot else [*worlds, *mechanisms(capabilities)]:
        found = planted(subject, faults.values(), scene)
        for name, fault in faults.items():
            if any(d.only == fault.word and d.quantity and d.within is None for d in lacking):
                continue
            if fault.quantity not in found.wrong and fault.quantity not in found.untold:
                missed.append(f"{name} ({fault.what}): {fault.quantity} equals the true scene's")
    require(not missed, f"parity does not see {'; '.join(missed)}")


def planted(subject: Subject, faults: Iterable[Fault], truth: Scene | None = None) -> ParityResult:
    """A world with the faults, read back by an adapter that remembers the true scene; None: the
    kit's full one."""
    truth = faulty = truth or _truth(subject)
    for fault in faults:
        faulty = fault.plant(faulty)
    with subject.world(faulty, parity=False) as world:
        reported = world.process.request("read_back", remember=truth.to_wire())
    return compare(
        expected_quantities(truth, subject.settings),
        reported,
        [deviation for deviation in subject.cls.info.deviations if deviation.concerns(truth)],
        subject.name,
    )
