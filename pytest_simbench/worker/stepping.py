"""The stepping loop: everything that happens between two messages, natively in the worker; and what
moves a scene's bodies from outside: forces for a time, and motions that are prescribed."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from pytest_simbench.scene import Body, FloatArray, Pose, Scene, Trajectory
from pytest_simbench.simulator import DivergedError, Simulator
from pytest_simbench.worker.control import Clock, Control, Family
from pytest_simbench.worker.loop import Loop, Row
from pytest_simbench.worker.state import States
from pytest_simbench.worker.watching import Watch


class Acting:
    """Tells a simulator before each step what acts on the bodies of its loaded scene in that step.

    Raises:
        NotSupportedError: the scene has forces or prescribed bodies, and the simulator takes none.
    """

    def __init__(self, simulator: Simulator, scene: Scene) -> None:
        self.simulator = simulator
        self._wrenches = [body.wrenches for body in scene.free_bodies]
        self._pushes = any(self._wrenches)
        self._led = scene.prescribed_bodies
        self._acts = True
        # Who takes neither says so now. Without force: engines add up what acts before a step.
        if self._pushes:
            simulator.push(np.zeros((len(self._wrenches), 6)))
        self._lead(0.0)

    @classmethod
    def of(cls, simulator: Simulator, scene: Scene) -> Acting | None:
        """None where nothing acts from outside."""
        return cls(simulator, scene) if scene.words & {"wrench", "prescribed"} else None

    def steps(self) -> Callable[[], None]:
        """What to call before each of the coming steps."""
        count = round(self.simulator.time / self.simulator.settings.timestep) - 1
        self._acts = True  # a restored world may have forces of another time

        def act() -> None:
            nonlocal count
            count += 1
            self._act(count)

        return act

    def _act(self, step: int) -> None:
        timestep = self.simulator.settings.timestep
        begin, end = step * timestep, (step + 1) * timestep
        if self._pushes:
            rows = self.wrenches(begin, end)
            acts = bool(rows.any())
            if acts or self._acts:
                self.simulator.push(rows)
            self._acts = acts
        self._lead(begin)

    def _lead(self, begin: float) -> None:
        if self._led:
            end = begin + self.simulator.settings.timestep
            self.simulator.lead(
                np.array([prescribed(body, begin) for body in self._led]),
                np.array([prescribed(body, end) for body in self._led]),
            )

    def wrenches(self, begin: float, end: float) -> FloatArray:
        """Mean force and torque on each free body between two times [s], (n_free, 6)."""
        rows = np.zeros((len(self._wrenches), 6))
        for row, wrenches in zip(rows, self._wrenches, strict=True):
            for wrench in wrenches:
                row += wrench.mean(begin, end)
        return rows


def prescribed(body: Body, time: float) -> FloatArray:
    """State of a body that moves with constant velocities, as a row of body states, (13,)."""
    place = np.asarray(body.pose.position) + time * np.asarray(body.linear_velocity)
    speed = math.hypot(*body.angular_velocity)
    half = speed * time / 2
    axis = np.asarray(body.angular_velocity) / speed if speed else np.zeros(3)
    x, y, z = (float(value) for value in math.sin(half) * axis)
    turned = Pose(quaternion=(math.cos(half), x, y, z)) * Pose(quaternion=body.pose.quaternion)
    return np.array([*place, *turned.quaternion, *body.velocity])


HEARTBEAT_PERIOD = 0.5
"""Wall time between two signs of life while stepping [s]."""

WINDOW_PERIOD = 1 / 30
"""Least wall time between two pictures in the window [s]; of a slow window, at least the time that
a picture takes, so that half of the time is left for stepping."""

CHECK_PERIOD = 0.1
"""Simulated time between two looks at the state for values that are not finite [s]. A log of this
period is made of these looks, and costs next to nothing."""

LOOK_PERIOD = 0.01
"""Simulated time between two looks at the wall clock, for window and pacing [s]."""

LOG = ("time", "joints", "bodies")
"""What is sampled while stepping."""


@dataclass
class Clocks:
    """What stepping has cost since the world was loaded.

    Attributes:
        simulated: [s].
        wall: seconds in the stepping loop, without log, window, pacing and control [s].
        waited: how much of that the thread waited for a processor that others had [s].
        cpu: CPU seconds in that time of this process and of all that it started [s].
    """

    steps: int = 0
    simulated: float = 0.0
    wall: float = 0.0
    waited: float = 0.0
    cpu: float = 0.0


class Stepper:
    """Steps one simulator through trajectories and waits, and keeps its clocks.

    Attributes:
        acting: what moves bodies from outside; None: nothing.
        film: every how many steps since loading a picture is due, and what takes one, outside of
            the measured stepping time; None: no pictures.
        clocks: totals since loading.
        control: the workload that shows the machine's speed meanwhile.
        watch: what looks whether the world stays as it was loaded; None: nothing.
        real_time: wait for the wall clock after each step, as the study's simulators did.
        told: the set points that the drives were told last.
    """

    def __init__(
        self,
        simulator: Simulator,
        scene: Scene,
        heartbeat: Callable[[float], None],
        acting: Acting | None = None,
    ) -> None:
        self.simulator = simulator
        self.states = States(simulator, scene)
        self.heartbeat = heartbeat
        self.acting = acting
        self.clocks = Clocks()
        self._clock, self._family = Clock(), Family()
        self.control = Control(self._clock)
        self.real_time = False
        self.film: tuple[int, Callable[[], None]] | None = None
        self.watch: Watch | None = None
        self._next_picture = 0.0
        robot = scene.robot
        start = np.empty(0) if robot is None else robot.column("initial_position")
        self.told: Row = start, np.zeros_like(start), np.zeros_like(start)

    def follow(self, trajectory: Trajectory, log_period: float | None) -> dict[str, Any]:
        """Command the trajectory's set points step by step; see `_advance`."""
        points = trajectory.resampled(self.simulator.settings.timestep)
        rows = list(zip(points.position, points.velocity, points.effort, strict=True))
        self.told = rows[-1]
        return self._advance(len(rows), iter(rows), log_period)

    def wait(self, duration: float, log_period: float | None) -> dict[str, Any]:
        """Step for `duration` [s] under the last command; see `_advance`."""
        steps = max(1, round(duration / self.simulator.settings.timestep))
        return self._advance(steps, None, log_period)

    def close_loop(self, loop: Loop, log_period: float | None) -> dict[str, Any]:
        """Step under the set points of a policy, until it ends or its time is over."""
        states = self.states
        if not loop.ask(states.time(), states.joints(), states.bodies()):
            return {}
        log = self._advance(loop.steps, loop.rows(), log_period, loop)
        self.told = loop.told
        return log

    def _advance(
        self,
        steps: int,
        rows: Iterator[Row] | None,
        log_period: float | None,
        loop: Loop | None = None,
    ) -> dict[str, Any]:
        """Advance by `steps`; a log sample every `log_period` [s] (0: every step; None: no log).

        A loop is asked for more rows after each of its periods, and may end it all. Looking and
        asking do not stop the clocks, which takes longer: what they took is taken out, and what
        asking took in other threads and processes too, as of a policy or a renderer.

        Returns:
            The log: time (n,), joints (n, 2, n_joints), bodies (n, n_free, 13); {} where there is
            no sample.

        Raises:
            DivergedError: joint or body state is not finite.
            ParityError: the world is not what it was, see `Watch`.
            StateError: a state or a time is none, see `States`.
        """
        simulator, timestep = self.simulator, self.simulator.settings.timestep
        log_every = 0 if log_period is None else max(1, round(log_period / timestep))
        check_every = max(1, round(CHECK_PERIOD / timestep))
        watched = simulator.gui or self.real_time
        look_every = max(1, round((LOOK_PERIOD if watched else CHECK_PERIOD) / timestep))
        film_every = self.film[0] if self.film is not None else 0
        ask_every = loop.every if loop is not None else 0
        states, from_time = self.states, self.states.time()
        quick = states.quick()
        times: list[float] = []
        samples: list[Any] = []
        watch, from_start = self.watch, self.clocks.steps
        due = watch.due - from_start if watch is not None else 0
        step, command, clock = simulator.step, simulator.command, self._clock
        totals, keep_up = self.clocks, self.control.keep_up
        act = self.acting.steps() if self.acting is not None else None
        family = self._family
        family.meet()
        cpu_began = family.cpu()
        began, waited = clock()
        beat = resumed = began
        aside = aside_waited = aside_cpu = 0.0
        for k in range(1, steps + 1):
            if rows is not None:
                command(*next(rows))
            if act is not None:
                act()
            step()
            logs = log_every and k % log_every == 0
            asks = ask_every and k % ask_every == 0
            checks = k % check_every == 0 or k in (steps, due)
            films = film_every and (totals.steps + k) % film_every == 0
            if logs or asks or checks:
                spent = family.cpu if asks else time.thread_time
                paused, cpu, waits = time.perf_counter(), spent(), clock.waited()
                now = states.time_after(k, from_time)
                if checks or asks or not quick:
                    joints, bodies = states.joints(), states.bodies()
                if logs:
                    times.append(now)
                    samples.append(simulator.sample() if quick else (joints, bodies))
                if checks or asks:
                    self._check_finite(now, joints, bodies)
                if checks and watch is not None:
                    watch.look(from_start + k, joints, bodies)
                    due = watch.due - from_start
                if loop is not None and asks and not loop.ask(now, joints, bodies):
                    steps = k
                aside_waited += clock.waited() - waits
                aside_cpu += spent() - cpu
                aside += time.perf_counter() - paused
            if not (checks or films or k % look_every == 0 or k == steps):
                continue
            stopped, waited_now = clock()
            totals.wall += stopped - resumed - aside
            totals.waited += waited_now - waited - aside_waited
            if k == steps:
                family.meet()
            totals.cpu += family.cpu() - cpu_began - aside_cpu
            aside = aside_waited = aside_cpu = 0.0
            if stopped - beat > HEARTBEAT_PERIOD:
                beat = stopped
                self.heartbeat(states.time())
            if films and self.film is not None:
                self.film[1]()
            if simulator.gui and stopped > self._next_picture:
                simulator.refresh_window()
                drawn = time.perf_counter()
                self._next_picture = drawn + max(WINDOW_PERIOD, drawn - stopped)
            if self.real_time:
                ahead = k * timestep - (time.perf_counter() - began)
                if ahead > 0:
                    time.sleep(ahead)
            # The CPU time of an engine with threads, the wall time of a busy machine: the less.
            keep_up(min(totals.wall, totals.cpu))
            if k == steps:
                break
            cpu_began = family.cpu()
            resumed, waited = clock()
        totals.steps += steps
        totals.simulated += steps * timestep
        if not samples:
            return {}
        logged = states.sampled(samples) if quick else map(np.array, zip(*samples, strict=True))
        return dict(zip(LOG, (np.array(times), *logged), strict=True))

    def _check_finite(self, time: float, joints: FloatArray, bodies: FloatArray) -> None:
        for what, state in (("joints", joints), ("bodies", bodies)):
            square = float(np.vdot(state, state))  # one quick call where all is well
            if not math.isfinite(square) and not np.isfinite(state).all():
                raise DivergedError(
                    f"the state of the {what} is not finite at t = {time:.3f} s with "
                    f"{self.simulator.settings}; a smaller timestep may help"
                )
