"""Checks of what an adapter claims: save and restore, determinism, pictures, window; and that one
process can serve many worlds."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import psutil
import pytest

from pytest_simbench.client.motion import Motion
from pytest_simbench.client.world import World
from pytest_simbench.laws.hands import close_command
from pytest_simbench.scene import Pose, Robot, Scene, Trajectory
from pytest_simbench.simulator import Capability
from pytest_simbench.testing import scenes
from pytest_simbench.testing.kit import any_robot, check, grasping
from pytest_simbench.testing.subject import Subject, require


def busy_scene(robot: Robot) -> Scene:
    """Cubes that fall upon each other before a robot."""
    cubes = [scenes.cube(f"c{i}", Pose.at(0.5, 0.02 * i, 0.1 + 0.08 * i)) for i in range(3)]
    return Scene("busy", tuple(cubes), robot=robot)


def _swing(scene: Scene, timestep: float, share: float) -> Trajectory:
    robot = scene.arm
    start = robot.column("initial_position")
    goal = start + share
    goal[robot.finger_indices] = start[robot.finger_indices]
    return Trajectory.holding(timestep, goal)


def require_same(what: str, a: Motion, b: Motion) -> None:
    """Every sampled bit of both motions is equal; else tell when and by how much they part."""
    for kind in ("time", "bodies", "joints"):
        x, y = getattr(a, kind), getattr(b, kind)
        if x.tobytes() != y.tobytes():
            first = next(i for i in range(len(x)) if x[i].tobytes() != y[i].tobytes())
            gap = float(np.abs(x - y).max())
            require(
                False,
                f"{what}: {kind} differ from t = {a.time[first]:.3f} s on, by up to {gap:.3g}",
            )


def swung(subject: Subject, *, watched: bool = False, **options: Any) -> Motion:
    """What happens in a world of the busy scene while the arm swings; options of its making.
    Watched, the engine is asked at a drawn step, and in the middle, what it holds."""
    scene = busy_scene(subject.arm)
    with subject.world(scene, **options) as world:
        if watched:
            world.watch(1)
        world.follow(_swing(scene, subject.timestep, 0.2))
        if watched:
            world.read_again()
        return world.wait(1.0, log_period=0.02)


@check(Capability.SAVE_RESTORE, any_robot)
def restore_repeats(subject: Subject) -> None:
    """From a restored state the same future follows every time, bit for bit: cubes falling and
    colliding, the arm moving under the command that was in force when the state was saved."""
    scene = busy_scene(subject.arm)
    with subject.world(scene) as world:
        world.follow(_swing(scene, subject.timestep, 0.3))
        world.wait(0.1)
        world.save()
        saved = (world.time, world.bodies.tobytes(), world.joints.tobytes())
        futures = []
        for share in (-0.3, 0.1, None):
            world.restore()
            now = (world.time, world.bodies.tobytes(), world.joints.tobytes())
            require(now == saved, "the restored state is not the saved one")
            futures.append(world.wait(0.5, log_period=0.02))
            if share is not None:  # lead it astray, to see that the command is restored too
                world.follow(_swing(scene, subject.timestep, share))
                world.wait(0.1)
    require_same("second and first future", futures[1], futures[0])
    require_same("third and first future", futures[2], futures[0])


@check(Capability.EXACT_RESTORE, any_robot)
def restore_continues(subject: Subject) -> None:
    """A run that was saved, and one that was restored as well, equal bit for bit the run that was
    not interrupted."""
    scene, runs = busy_scene(subject.arm), []
    for interrupted in (False, True):
        with subject.world(scene) as world:
            world.follow(_swing(scene, subject.timestep, 0.3))
            world.wait(0.1)
            if interrupted:
                world.save()
            runs.append(world.wait(0.5, log_period=0.02))
            if interrupted:
                world.restore()
                runs.append(world.wait(0.5, log_period=0.02))
    require_same("saved and uninterrupted run", runs[1], runs[0])
    require_same("restored and uninterrupted run", runs[2], runs[0])


@check(Capability.SAVE_RESTORE, grasping)
def restore_in_the_grip(subject: Subject) -> None:
    """The same with a cube between the fingers, from two restores."""
    scene = scenes.grip(subject.arm)
    with subject.world(scene) as world:
        world.follow(close_command(scene, subject.timestep))
        world.wait(0.3)
        world.save()
        futures = []
        for _ in range(2):
            world.restore()
            futures.append(world.wait(0.5, log_period=0.02))
    require_same("second and first future in the grip", futures[1], futures[0])


@check(Capability.DETERMINISTIC, any_robot)
def fresh_processes_agree(subject: Subject) -> None:
    """Two fresh processes compute the same, bit for bit."""
    first = swung(subject, fresh=True)
    require_same("two fresh processes", swung(subject, fresh=True), first)


@check(Capability.DETERMINISTIC, any_robot)
def reused_process_agrees(subject: Subject) -> None:
    """A second world in one process, after another scene was in between, computes the same."""
    first = swung(subject)
    with subject.world(scenes.tower()) as world:
        world.wait(0.1)
    require_same("two worlds in one process", swung(subject), first)


WARM, WORLDS, LEFT = 2, 4, 4.0
"""Worlds that fill an engine's caches, those after them, and memory that each of these may leave
behind [MB]. Engines leave 0 to 2, one 13; one whose server was held by an adapter left 28."""


@check()
def worlds_leave_no_memory(subject: Subject) -> None:
    """A process that serves one world after another does not grow by more than 4 MB each."""
    scene, used = busy_scene(subject.arm), []
    subject.can_build(scene)
    process = subject.launch()  # without what other checks left, which would be used first
    try:
        for _ in range(WARM + WORLDS):
            subject.construct(process)
            World(process, scene).wait(0.02)
            used.append(psutil.Process(process.pid).memory_info().rss / 1e6)
    finally:
        process.kill()
    left = (used[-1] - used[WARM - 1]) / WORLDS
    require(left <= LEFT, f"each world leaves {left:.3g} MB behind, at most {LEFT:g} are right")


@check(Capability.WINDOW, any_robot)
def window_changes_nothing(subject: Subject) -> None:
    """With a window the same is computed, bit for bit where determinism is claimed, else within
    1 mm. Skipped where there is no display."""
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        pytest.skip("no display; start one, e.g. with xvfb-run -s -noreset")
    runs = [swung(subject, fresh=True, gui=gui) for gui in (False, True)]
    if subject.can(Capability.DETERMINISTIC):
        require_same("with and without a window", runs[1], runs[0])
    else:
        gap = float(np.abs(runs[0].bodies[:, :, :3] - runs[1].bodies[:, :, :3]).max())
        require(gap < 1e-3, f"with a window the cubes end {1000 * gap:.2g} mm away")


@check(Capability.OFFSCREEN, any_robot)
def picture_shows_something(subject: Subject) -> None:
    """An offscreen picture has the size asked for, (height, width, 3) bytes, more than one
    colour, and another one is drawn when the scene is another."""
    pictures = []
    for scene in (busy_scene(subject.arm), scenes.tower()):
        with subject.world(scene) as world:
            pictures.append(world.render(160, 120))
    for picture in pictures:
        require(picture.shape == (120, 160, 3), f"the picture has shape {picture.shape}")
        require(picture.dtype == np.uint8, f"the picture's values are {picture.dtype}")
        require(len(np.unique(picture.reshape(-1, 3), axis=0)) > 1, "the picture is of one colour")
    require((pictures[0] != pictures[1]).any(), "two different scenes give the same picture")
