"""Worlds whose outcome is known: a perfect hand, and the mishaps that a script says.

`ScriptedProcess` stands where a worker stands. The task, the planner and `World` run unchanged, but
behind them is kinematics: joints are where they are commanded, a closed hand holds the cube between
its fingers, an open one lets it go, and it rests on what is below. What goes wrong is written
down beforehand, so the right score is known. This calibrates the instrument; it is no simulator.

A subclass may let cubes fly that the hand lets go (`fall`, `fly`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np

from pytest_simbench.client.answers import Constructed
from pytest_simbench.client.errors import Where, WorkerError
from pytest_simbench.client.world import World
from pytest_simbench.description.robot_files import received
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.scene import FloatArray, Pose, Scene
from pytest_simbench.tasks import Jitter, Task
from pytest_simbench.tasks.base import CUBE_SIZE, Outcome
from tests.approval import assert_approved_message

REACH = 0.03
"""A cube whose centre is nearer than this to the tool centre point is between the fingers [m]."""

HALF = CUBE_SIZE / 2
"""Where a finger stands that presses on a cube of the study [m]."""

Effect = Callable[["ScriptedProcess"], None]
Cube = Callable[["ScriptedProcess"], str]
"""Which cube it is, when the time comes: cubes are taken in an order by seed."""


@dataclass(frozen=True)
class Mishap:
    """What happens, and when: `after` seconds of simulated time into a phase of the task."""

    phase: str
    after: float
    effect: Effect


@dataclass(frozen=True)
class Asked:
    """One operation that a task asked for: phase, `follow` or `wait`, its time [s], arguments."""

    phase: str
    kind: str
    began: float
    duration: float
    arguments: dict[str, Any]


class ScriptedProcess:
    """Answers a `World` as a worker does.

    Args:
        script: mishaps; `pending` are those that have not happened yet.
        scale: of the scene's lengths over those of the study's.

    Attributes:
        half: where a finger stands that presses on a cube of the scene [m].
        asked: every operation so far.
        counts, marks: what the task reported as progress, the moments that it marked [s].
        released: cubes that the hand let go, in order, and the pose that each had then.
        held: name of the cube in the hand, or None.
        time: simulated [s].
        commanded, position: of all joints, as told and as they are.
        poses, velocities: of all cubes.
    """

    pid = None
    python_version = "3"
    busy = False
    alive = True

    def __init__(
        self, script: Iterable[Mishap] = (), *, timestep: float = 0.004, scale: float = 1.0
    ) -> None:
        self.where = Where("scripted", "headless")
        self.launch = SimpleNamespace(compile_timeout=0.0, log=None)
        self.deadline: float | None = None
        self.pending = list(script)
        self.timestep = timestep
        self.half = HALF * scale
        self.asked: list[Asked] = []
        self.released: list[tuple[str, Pose]] = []
        self.time = 0.0
        self.held: str | None = None
        self.counts: list[tuple[int, int]] = []
        self.marks: dict[str, float] = {}
        self._phase, self._phase_began = "", 0.0
        self._samples: list[tuple[float, FloatArray, FloatArray]] = []

    def request(self, operation: str, *, timeout: float | None = None, **arguments: Any) -> Any:
        return getattr(self, f"do_{operation}")(**arguments)

    def kill(self) -> None:
        self.alive = False

    def close(self, timeout: float = 0.0) -> None:
        self.alive = False

    def log_tail(self) -> str:
        return ""

    def construct(self, *arguments: Any, **more: Any) -> Constructed:
        return Constructed({"timestep": self.timestep})

    def do_load(self, scene: dict[str, Any], parity: bool) -> dict[str, Any]:
        self.scene = Scene.from_wire(received(scene))
        robot = self.scene.robot
        self.model = None if robot is None else RobotModel(robot)
        self.position = np.zeros(0) if robot is None else robot.column("initial_position")
        self.commanded = self.position
        self.poses = {body.name: body.pose for body in self.scene.free_bodies}
        self.velocities = {name: np.zeros(6) for name in self.poses}
        return {"excused": [], "timestep": self.timestep, **self.do_state()}

    def do_state(self) -> dict[str, Any]:
        return {"time": self.time, "joints": self._joints(), "bodies": self._bodies()}

    def do_watch(self, seed: int) -> None: ...

    def do_read_again(self) -> None: ...

    def do_contact_forces(self) -> list[Any]:
        return []

    def do_stats(self) -> dict[str, Any]:
        return {"stepping": {"wall": 0.0, "simulated": self.time}, "peak_rss_mb": None}

    def do_wait(self, duration: float, log_period: float | None) -> dict[str, Any]:
        self._note("wait", duration, {"duration": duration, "log_period": log_period})
        rows = np.repeat(self.commanded[None], 2, axis=0)
        return self._advance(duration, np.array([0.0, duration]), rows, log_period)

    def do_follow(
        self, tick: float, position: Any, velocity: Any, effort: Any, log_period: float | None
    ) -> dict[str, Any]:
        duration = tick * (len(position) - 1)
        arguments = {"tick": tick, "position": position, "velocity": velocity, "effort": effort}
        self._note("follow", duration, arguments)
        return self._advance(duration, tick * np.arange(len(position)), position, log_period)

    def _note(self, kind: str, duration: float, arguments: dict[str, Any]) -> None:
        if self.where.phase != self._phase:
            self._phase, self._phase_began = self.where.phase, self.time
        self.asked.append(Asked(self._phase, kind, self.time, duration, arguments))

    def _advance(
        self, duration: float, times: FloatArray, rows: FloatArray, log_period: float | None
    ) -> dict[str, Any]:
        """Go through the instants of one operation at which anything happens, in order."""
        began = self.time
        self._samples = []
        instants: set[float] = {0.0, duration}
        if rows.size:  # where the fingers pass the cube's width
            pressing = rows[:, -1] < self.half - 1e-4
            instants |= {float(times[k]) for k in np.flatnonzero(np.diff(pressing)) + 1}
        due: list[tuple[float, Mishap]] = []
        for mishap in self.pending:
            after = self._phase_began + mishap.after - began
            if mishap.phase == self._phase and after <= duration + 1e-9:
                due.append((max(after, 0.0), mishap))
        instants |= {after for after, _ in due}
        samples: set[float] = set()
        if log_period is not None:
            period = max(log_period, self.timestep)
            samples = {float(k * period) for k in range(1, int(duration / period + 1e-9) + 1)}
        for instant in sorted(instants | samples):
            self.fly(began + instant - self.time)
            self.time = began + instant
            if rows.size:
                self._command(np.array([np.interp(instant, times, c) for c in rows.T]))
            for after, mishap in due:
                if after == instant:
                    self.pending.remove(mishap)
                    mishap.effect(self)
            if instant in samples:
                self._samples.append((self.time, self._joints(), self._bodies()))
        log = {}
        if samples:
            log = {
                "time": np.array([sample[0] for sample in self._samples]),
                "joints": np.array([sample[1] for sample in self._samples]),
                "bodies": np.array([sample[2] for sample in self._samples]),
            }
        return {"log": log, **self.do_state()}

    def fly(self, seconds: float) -> None:
        """Time passes for the cubes that fly; here none does."""

    def fall(self, name: str) -> None:
        """What becomes of a cube that is let go: it rests on what is below, its yaw as it was."""
        self.poses[name] = self.resting(name)

    def tool(self) -> Pose:
        """Pose of the tool centre point."""
        return self.model.tool_pose(self.position[: self.model.arm])

    def _command(self, position: FloatArray) -> None:
        """The joints are there at once, and the cube in the hand with them."""
        self.position = self.commanded = position
        pressing = position[-1] < self.half - 1e-4
        if pressing and self.held is None:
            self._grasp()
        elif self.held is not None:
            self.poses[self.held] = self.tool() * self.grip
            if not pressing:
                self.let_go()
        if self.held is not None:
            self.position = np.concatenate([position[:-2], [self.half, self.half]])

    def _grasp(self) -> None:
        tool = self.tool()
        for name, pose in self.poses.items():
            if np.linalg.norm(np.subtract(pose.position, tool.position)) < REACH:
                self.held, self.grip = name, tool.inverse() * pose
                return

    def let_go(self) -> None:
        """The hand opens, or the cube slips out of it."""
        assert self.held is not None, f"nothing is in the hand at {self.time:.3f} s"
        name, self.held = self.held, None
        self.released.append((name, self.poses[name]))
        self.fall(name)

    def resting(self, name: str) -> Pose:
        """Where a cube comes to rest that falls straight down from where it is."""
        pose = self.poses[name]
        x, y, z = pose.position
        tops = [0.0]
        others = {**self.poses, **{b.name: b.pose for b in self.scene.fixed_bodies}}
        for other, place in others.items():
            if other not in (name, self.held):
                half = np.array(self.scene.body(other).size) / 2
                apart = np.abs(np.subtract(place.position, pose.position))
                top = place.position[2] + half[2]
                if apart[0] < half[0] + self.half and apart[1] < half[1] + self.half and top <= z:
                    tops.append(top)
        return Pose.at(x, y, max(tops) + self.half, yaw=pose.yaw)

    def _joints(self) -> FloatArray:
        return np.array([self.position, np.zeros_like(self.position)])

    def _bodies(self) -> FloatArray:
        rows = [[*pose.as_array(), *self.velocities[name]] for name, pose in self.poses.items()]
        return np.array(rows).reshape(-1, 13)


class ScriptedWorld(World):
    """A world that also knows the simulated time of each moment that the task marked."""

    def __init__(self, process: ScriptedProcess, scene: Scene) -> None:
        super().__init__(process, scene)
        self.scripted = process

    def mark(self, moment: str) -> None:
        super().mark(moment)
        self.scripted.marks[moment] = self.time


def perform(
    task: Task,
    *script: Mishap,
    seed: int = 1,
    jitter: Jitter | None = None,
    process: ScriptedProcess | None = None,
    says: bool = True,
) -> tuple[Outcome, ScriptedProcess]:
    """A task's score in the world of the script, every mishap of which must have happened; nothing
    is drawn but by the seed."""
    process = process or ScriptedProcess()
    process.pending += script
    world = ScriptedWorld(process, task.scene(seed, jitter or Jitter()))
    with patch.object(np.random, "SeedSequence", wraps=np.random.SeedSequence) as drawn:
        outcome = task.perform(world, seed, lambda *count: process.counts.append(count))
    assert all(call.args == (seed,) for call in drawn.call_args_list)
    assert not process.pending, f"never happened: {process.pending}"
    asked = dict(Counter(asked.phase for asked in process.asked))
    told = rounded([asked, process.counts, process.marks, outcome])
    if says:
        assert_approved_message(f"{task.name} seed {seed}: {told}")
    return outcome, process


def rounded(value: Any) -> Any:
    """Without digits that differ between processors, and of long lists eight items."""
    value = value.item() if isinstance(value, np.number) else getattr(value, "__dict__", value)
    if isinstance(value, float):
        return round(value, 5) + 0.0
    if isinstance(value, Mapping):
        return {key: rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [rounded(item) for item in value[:: -(-len(value) // 8) or 1]]
    return value


def stacked(number: int) -> Cube:
    """The cube that was let go as the `number`th, from 1."""
    return lambda process: process.released[number - 1][0]


def untouched(number: int) -> Cube:
    """The `number`th cube, from 1, of those that the hand never let go."""

    def name(process: ScriptedProcess) -> str:
        let_go = {name for name, _ in process.released}
        return [name for name in process.poses if name not in let_go][number - 1]

    return name


def move(cube: str | Cube, *, tilt: float = 0.0, **offset: float) -> Effect:
    """A cube is suddenly elsewhere: by x, y, z [m], tilted by `tilt` [rad] about x."""

    def effect(process: ScriptedProcess) -> None:
        name = cube if isinstance(cube, str) else cube(process)
        pose = process.poses[name].translated(**offset)
        turn = Pose(quaternion=(np.cos(tilt / 2), np.sin(tilt / 2), 0.0, 0.0))
        process.poses[name] = Pose(
            pose.position, (turn * Pose(quaternion=pose.quaternion)).quaternion
        )

    return effect


def put(cube: str | Cube, pose: Pose) -> Effect:
    """A cube is suddenly at `pose`."""

    def effect(process: ScriptedProcess) -> None:
        process.poses[cube if isinstance(cube, str) else cube(process)] = pose

    return effect


def slip(**offset: float) -> Effect:
    """The cube in the hand is suddenly elsewhere in it: by x, y, z in the tool's frame [m]."""

    def effect(process: ScriptedProcess) -> None:
        process.grip = process.grip.translated(**offset)

    return effect


def drop(process: ScriptedProcess) -> None:
    """The cube in the hand slips out of it."""
    process.let_go()


def fail(error: type[BaseException], what: str = "as the script says") -> Effect:
    """The worker fails: what its request raises."""

    def effect(process: ScriptedProcess) -> None:
        raise error(what, process.where) if issubclass(error, WorkerError) else error(what)

    return effect
