"""Checks of the contract in `simulator.Simulator`: facts, settings, states, units, errors."""

from __future__ import annotations

import dataclasses
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from pytest_simbench.client.errors import WorkerError
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.ground.versions import base_name
from pytest_simbench.laws.free import rotation_of
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.scene import Trajectory
from pytest_simbench.simulator.settings import changed, flaw
from pytest_simbench.testing import scenes
from pytest_simbench.testing.kit import any_robot, check
from pytest_simbench.testing.subject import Subject, require, require_close

SINGLE = 1e-5
"""Engines in single precision keep about 7 digits; after some arithmetic 5 are safe."""

_WITHOUT_ENGINE = """
import importlib, sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if any(name == part or name.startswith(part + ".") for part in {engine!r}):
            raise ImportError(name + " was imported")
sys.meta_path.insert(0, Missing())
sys.path[:0] = {path!r}
cls = getattr(importlib.import_module({module!r}), {name!r})
cls.info, cls.profiles
"""


@contextmanager
def refused(what: str) -> Iterator[list[WorkerError]]:
    """What is done in this block must be an error, which the list holds afterwards."""
    found: list[WorkerError] = []
    try:
        yield found
    except WorkerError as error:
        found.append(error)
    require(found, f"{what} accepted")


@check()
def imports_without_engine(subject: Subject) -> None:
    """The adapter's module imports where the engine is not installed, or not loaded: `simbench
    list` reads its facts. The engine is the packages in `info.modules`; in the adapter's own
    package it is just the modules that stand there by name."""
    module, _, name = subject.adapter.partition(":")
    own = module.partition(".")[0]
    if all(subject.cls.info.program):
        return  # no module is the engine
    roots = {part: part.partition(".")[0] for part in subject.cls.info.modules}
    engine = {part if root == own else root for part, root in roots.items()}
    engine = {part for part in engine if not f"{module}.".startswith(f"{part}.")}
    require(
        engine,
        f"info.modules names only packages that {module} itself lies in; name the module that is "
        f"the engine ({own}.core, say), which {module} imports lazily",
    )
    code = _WITHOUT_ENGINE.format(engine=sorted(engine), module=module, name=name, path=sys.path)
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    last = done.stderr.strip().splitlines()[-1:]
    require(done.returncode == 0, f"{module} does not import without the engine: {last}")


@check()
def info_complete(subject: Subject) -> None:
    """Every text in `info` is filled in, its name is short, deviations give their reason."""
    info = subject.cls.info
    require(
        re.fullmatch(r"[a-z][a-z0-9_]*", base_name(info.name)),
        f"{info.name!r} is no lower-case identifier",
    )
    for text in ("title", "distribution", "install", "licence", "engine", "tested_version"):
        require(getattr(info, text).strip(), f"info.{text} is empty")
    told = info.modules or all(info.program)
    require(told, "info.modules is empty: nothing tells whether the engine is here")
    silent = [d.quantity for d in info.deviations if not d.reason.strip()]
    require(not silent, f"deviations without a reason: {silent}")


@check()
def profiles_complete(subject: Subject) -> None:
    """Profiles `default` and `tuned` exist; every value of theirs can be set again."""
    cls = subject.cls
    missing = {"default", "tuned"} - set(cls.profiles)
    require(not missing, f"profiles lack {sorted(missing)}")
    require(not (wrong := flaw(cls.profiles)), wrong)
    for name, settings in cls.profiles.items():
        require(settings.timestep > 0, f"profile {name} has timestep {settings.timestep}")
        values = {f.name: getattr(settings, f.name) for f in dataclasses.fields(settings)}
        require(changed(settings, values, cls.info.name) == settings, f"profile {name} changes")


@check()
def unknown_setting_rejected(subject: Subject) -> None:
    """A setting that does not exist is an error which lists those there are."""
    with refused("an unknown setting was") as error:
        subject.construct(subject.shared(), {"no_such_setting": 1})
    known = [f.name for f in dataclasses.fields(subject.settings)]
    silent = [name for name in known if name not in str(error[0])]
    require(not silent, f"the error does not list {silent}: {error[0].what}")


@check()
def time_advances(subject: Subject) -> None:
    """n steps take exactly n time steps (relative 1e-6), also at half the profile's step."""
    for step in (subject.timestep, subject.timestep / 2):
        with subject.world(scenes.falling(), changes={"timestep": step}) as world:
            require_close("time after loading", world.time, 0.0, 0.0, "s")
            motion = world.wait(100 * step, log_period=0)
            require(len(motion) == 100, f"100 steps gave {len(motion)} samples")
            wrong = np.abs(motion.time - step * np.arange(1, 101)).max()
            require_close("largest error of time", wrong, 0.0, 1e-6 * 100 * step, "s")


@check(robot=any_robot)
def state_as_loaded(subject: Subject) -> None:
    """After loading, free bodies are at rest at their poses, (n_free, 13) in the scene's order,
    quaternion w first; joints at rest at their initial positions, (2, n_joints)."""
    scene = scenes.falling()
    with subject.world(scene) as world:
        require(world.bodies.shape == (2, 13), f"body_state has shape {world.bodies.shape}")
        require(world.joints.shape == (2, 0), f"joint_state has shape {world.joints.shape}")
        for box, row in zip(scene.free_bodies, world.bodies, strict=True):
            expected = box.pose.as_array()
            sign = np.sign(row[3:7] @ expected[3:]) or 1.0
            row = np.concatenate([row[:3], sign * row[3:7], row[7:]])
            require(
                np.allclose(row[:7], expected, atol=SINGLE),
                f"pose of {box.name} is {row[:7].round(6)}, expected {expected.round(6)}",
            )
            require(np.abs(row[7:]).max() < SINGLE, f"{box.name} moves after loading: {row[7:]}")
    robot = subject.arm
    with subject.world(scenes.arm_alone(robot)) as world:
        n = len(robot.joints)
        require(world.joints.shape == (2, n), f"joint_state has shape {world.joints.shape}")
        require(
            np.allclose(world.joints[0], robot.column("initial_position"), atol=SINGLE),
            f"joints start at {world.joints[0].round(5)}",
        )
        require(np.abs(world.joints[1]).max() < SINGLE, "joints move after loading")


@check()
def velocity_frames(subject: Subject) -> None:
    """Velocities are the time derivatives of the poses, in the world frame.

    For a box tumbling in free flight, each over 20 ms: the displacement of the centre within 1 %
    of the mean speed; the rotation between two samples, as a vector in the world frame, within
    5 % of omega dt plus what omega itself turned.
    """
    motion = subject.motion(scenes.tumbling((0.1, 0.06, 0.03)), 0.8, 0.02)
    free = motion.bodies[:, 0, 2] < 4.8
    rows, times = motion.bodies[free, 0][:10], motion.time[free][:10]
    require(len(rows) >= 6, "the box did not leave the ledge")
    for a, b, dt in zip(rows[:-1], rows[1:], np.diff(times), strict=True):
        moved, speed = (b[:3] - a[:3]) / dt, (a[7:10] + b[7:10]) / 2
        slip = float(np.linalg.norm(moved - speed))
        require_close(
            "linear velocity's error", slip, 0.0, 0.01 * float(np.linalg.norm(speed)), "m/s"
        )
        omega = (rotation_of(b[3:7]) * rotation_of(a[3:7]).inv()).as_rotvec() / dt
        mean = (a[10:] + b[10:]) / 2
        turned = float(np.linalg.norm(omega - mean))
        limit = 0.05 * float(np.linalg.norm(mean)) + float(np.linalg.norm(b[10:] - a[10:]))
        require_close(
            "error of the angular velocity, in the world's axes,", turned, 0.0, limit, "rad/s"
        )


@check()
def quaternions_are_unit(subject: Subject) -> None:
    """Quaternions have norm 1 within single precision, also of a body that tumbles."""
    motion = subject.motion(scenes.tumbling((0.1, 0.06, 0.03)), 0.8, 0.02)
    norms = np.linalg.norm(motion.bodies[:, :, 3:7], axis=2)
    require_close("largest error of a norm", float(np.abs(norms - 1).max()), 0.0, SINGLE, "")


@check(robot=any_robot)
def commands_persist(subject: Subject) -> None:
    """A command holds until the next one: 1 s after a single one, every joint is there (5 mrad,
    fingers that slide 1 mm), and stays there; no command at all means hold the initial positions
    (5 mrad)."""
    robot = subject.arm
    start = robot.column("initial_position")
    goal = start.copy()
    arm, fingers = len(robot.arm_joints), robot.finger_indices
    goal[:arm] += 0.05
    goal[fingers] -= 0.01
    unit = RobotModel(robot).finger_unit
    allowed = 1e-3 if unit == "m" else 5e-3
    once = Trajectory.holding(subject.timestep, goal)
    with subject.world(scenes.arm_alone(robot, (0.0, 0.0, 0.0), "arm weightless")) as world:
        world.wait(0.2)
        idle = float(np.abs(world.joints[0] - start).max())
        require_close("motion without a command", idle, 0.0, 5e-3, "rad")
        world.follow(once)
        for _ in range(2):
            world.wait(1.0)
            error = np.abs(world.joints[0] - goal)
            require_close("joint error after the command", error[:arm].max(), 0, 5e-3, "rad")
            worst = error[fingers].max(initial=0.0)
            require_close("finger error after the command", worst, 0, allowed, unit)


@check(robot=any_robot)
def bad_description_rejected(subject: Subject) -> None:
    """A robot description that does not exist is an error which names the file, and the same
    worker then loads a good scene."""
    robot = dataclasses.replace(subject.arm, urdf="/nowhere/robot.urdf")
    wire = scenes.arm_alone(robot).to_wire()
    process = _refused_load(
        subject, wire, "a robot description that does not exist was", robot.urdf
    )
    require(process.alive, "the worker died of a bad robot description")
    with subject.world(scenes.falling()) as world:
        require(world.time == 0, "the next scene does not start at time 0")


@check()
def overlap_rejected(subject: Subject) -> None:
    """A scene whose bodies overlap is rejected by the worker too, with both their names."""
    wire = scenes.tower().to_wire()
    wire["bodies"][1]["pose"]["position"][2] -= 0.01
    _refused_load(subject, wire, "overlapping bodies were", "level0", "level1")


def _refused_load(subject: Subject, wire: dict[str, Any], what: str, *named: str) -> WorkerProcess:
    """A scene that must be an error which names some things; the process that refused it."""
    process = subject.shared()
    subject.construct(process)
    with refused(what) as error:
        process.request("load", timeout=600.0, scene=wire, parity=False)
    missing = [name for name in named if name not in error[0].what]
    require(not missing, f"the error does not name {missing}: {error[0].what}")
    return process
