"""A world: one scene in one worker, as tasks see it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.client.answers import Frame, is_picture
from pytest_simbench.client.closed_loop import Episode, Looking
from pytest_simbench.client.errors import BadState, Diverged, EngineFailed, PolicyFailed
from pytest_simbench.client.motion import Motion
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.client.stopwatch import Stopwatch
from pytest_simbench.description.robot_files import with_content
from pytest_simbench.ground.errors import PolicyError
from pytest_simbench.ground.files import FileError
from pytest_simbench.scene import FloatArray, Pose, Scene, SceneError, Trajectory
from pytest_simbench.scene.checks import check_number
from pytest_simbench.scene.plausibility import implausible
from pytest_simbench.scene.policy import Kinematics, Observation, Policy, Rhythm, as_policy
from pytest_simbench.simulator import DescriptionError

TRACE_PERIOD = 0.02
"""Between two samples of a trace [s]: 50 Hz. A task's own log is thinned to that."""

PART = 2.0
"""A sampled wait is asked for in parts of this simulated time [s]: the worker holds the samples of
one. Those of a minute took 27 MB there, which looked like the simulator's memory."""

LONGEST = 1e9
"""A wait [s]."""


class World:
    """The scene as it is now, and the means to move it on.

    Loading, moving and restoring raise `Diverged` where the cubes end up in a state that cannot
    be, see `scene.plausibility`.

    Attributes:
        time: simulated [s].
        joints: position and velocity of the driven joints, (2, n_joints).
        bodies: rows of the free bodies, (n_free, 13): position [m], quaternion w, x, y, z, linear
            [m/s] and angular velocity [rad/s], in the world frame.
        excused: differences from the scene that the adapter declares.
        trace: samples at `trace_period` of everything since loading, if asked for; up to 50 Hz
            where the task itself sampled.
        phases: when each phase began, in simulated time [s], and its name.
        moments: what the task noted, and when [s].
        stopwatch: wall seconds of this repetition by kind; `plan` is the task's to measure.
        timeline: wall seconds from launch of the moments that the task marked.
        worked: clocks of stepping where the work ended and a wait for its count began; empty where
            there was none. Rest costs otherwise than work, and not every wait is as long.
    """

    def __init__(
        self,
        process: WorkerProcess,
        scene: Scene,
        *,
        stopwatch: Stopwatch | None = None,
        on_phase: Callable[[str], None] = lambda name: None,
        trace_period: float | None = None,
        after_phase: Callable[[World, str], None] = lambda world, name: None,
        parity: bool = True,
        kinematics: Callable[[Scene], Kinematics] | None = None,
    ) -> None:
        self.process = process
        self.scene = scene
        self.stopwatch = stopwatch or Stopwatch()
        self.timeline: dict[str, float] = {}
        self.worked: dict[str, float] = {}
        self.time = 0.0
        self.trace: list[Motion] = []
        self.phases: list[tuple[float, str]] = []
        self.moments: list[tuple[str, float]] = []
        self._saved: dict[str, tuple[list[Motion], list[tuple[float, str]]]] = {}
        self._trace_period = trace_period
        self._after_phase: Callable[[World, str], None] = lambda world, name: None
        self._on_phase, self._kinematics = on_phase, kinematics
        self._servo: Kinematics | None = None
        self._names = [body.name for body in scene.free_bodies]
        if process.launch.compile_timeout:
            self._compile()
        with self.phase("load"), self.stopwatch.measuring("load"):
            answer = process.request("load", scene=self._wire(), parity=parity)
            self._take(answer)
        self.excused: list[str] = answer["excused"]
        self._timestep = float(answer["timestep"])
        self._enter("task")  # between the phases that the task names
        self._after_phase = after_phase

    def _take(self, answer: Mapping[str, Any], striking: bool = False) -> None:
        self.time = float(answer["time"])
        self.joints: FloatArray = answer["joints"]
        self.bodies: FloatArray = answer["bodies"]
        wrong = implausible(self.scene, self.bodies, striking)
        if wrong is not None:
            raise Diverged(
                f"{wrong}, at t = {self.time:.3f} s; a smaller timestep may help",
                self.process.where,
            )

    def _wire(self) -> dict[str, Any]:
        """The scene, its robot described by content: a path means nothing in the worker."""
        try:
            return with_content(self.scene.to_wire(), self.scene.robot)
        except (DescriptionError, FileError) as error:
            raise EngineFailed(
                str(error), self.process.where, self.process.launch.log_tail()
            ) from None

    def _compile(self) -> None:
        """Have the engine compile; the repetition's time-out stands still meanwhile."""
        process, deadline, began = self.process, self.process.deadline, time.monotonic()
        process.deadline = None
        with self.phase("compiling"), self.stopwatch.measuring("compile"):
            limits = process.launch.compile_timeout, process.launch.stall_timeout
            process.request("compile", timeout=max(limits), scene=self._wire())
        if deadline is not None:
            process.deadline = deadline + time.monotonic() - began

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Name what happens now, for errors, progress and the resource samples."""
        before = self.process.where.phase
        self._enter(name)
        yield  # on an error the phase stays, so that the error and the record name it
        self._after_phase(self, name)
        self._enter(before)

    def _enter(self, name: str) -> None:
        self.process.where.phase = name
        self.phases.append((self.time, name))
        self._on_phase(name)

    def mark(self, moment: str) -> None:
        """Note the wall time since launch under the name of this moment ("start", "end")."""
        self.timeline[moment] = self.stopwatch.elapsed()

    def note(self, moment: str, time: float) -> None:
        """Tell what happened at a simulated time [s], for pictures of it (`Task.pictured`)."""
        self.moments.append((moment, time))

    def pose(self, name: str) -> Pose:
        """Present pose of a free body, by name."""
        return Pose.from_array(self.bodies[self._names.index(name)])

    def poses(self) -> dict[str, Pose]:
        """Present poses of all free bodies."""
        return {
            name: Pose.from_array(row) for name, row in zip(self._names, self.bodies, strict=True)
        }

    @property
    def tool(self) -> Pose:
        """Present pose of the robot's tool centre point."""
        return self._model().tool_pose(self.joints[0])

    def _model(self) -> Kinematics:
        """Of the robot, made once.

        Raises:
            SceneError: this world was made without.
        """
        if self._kinematics is None:
            raise SceneError("this world has no model of its robot")
        if self._servo is None:
            self._servo = self._kinematics(self.scene)
        return self._servo

    def follow(self, trajectory: Trajectory, *, log_period: float | None = None) -> Motion:
        """Have the robot follow a trajectory; the motion sampled every `log_period` [s] (0: each
        step, None: no samples). A `SceneError` where it is one of other joints than the robot's."""
        __tracebackhide__ = True
        told, joints = trajectory.position.shape[1], self.joints.shape[1]
        if told != joints:
            raise SceneError(f"a trajectory of {told} joints; give all {joints} of the robot")
        return self._move("follow", log_period, **vars(trajectory))

    def wait(
        self, duration: float, *, log_period: float | None = None, striking: bool = False
    ) -> Motion:
        """Let `duration` [s] of simulated time, one step at least, pass under the last command; the
        motion as of `follow`. Where bodies are `striking` at its end, nobody looks how deep.

        Raises:
            SceneError: the duration is no number, not finite, or negative.
        """
        __tracebackhide__ = True
        check_number(duration, "the duration [s] of a wait", 0.0, LONGEST)
        ends = {"striking": True} if striking else {}
        return self._move("wait", log_period, duration=float(duration), **ends)

    def control(
        self,
        policy: Any,
        *,
        until: float | Callable[[Observation], bool],
        at_most: float = 60.0,
        rate: float | None = None,
        seed: int | None = None,
        command_latency: float = 0.0,
        observation_delay: float = 0.0,
        forces: bool = False,
        picture: tuple[int, int] | None = None,
        inside: bool = False,
        goal: Pose | None = None,
    ) -> Motion:
        """Let a policy act: it sees, answers, and sees what came of it, at its own rate.

        Args:
            policy: see `scene.policy`: an object with `act`, or a function of an observation.
            until: simulated seconds, to the nearest period and one at least; or what ends the loop
                once it holds of what is (undelayed).
            at_most: seconds that the loop lasts if that never holds.
            rate: how often it is asked [Hz]; default: the policy's own.
            seed: of its `reset`; default: the repetition's.
            command_latency: from an observation to when its command begins to act [s].
            observation_delay: age of what the policy is shown [s]; whole periods.
            forces, picture: show it contact forces, and a picture of this width and height.
            inside: run it in the worker, which takes less time than to ask it; it commands joints
                then, its file imports what the worker has, and `until` is a time.
            goal: what `Observation.goal` says.

        Returns:
            The states at each observation, without the first.

        Raises:
            LoopError: no robot, or a rate, latency or delay that fits no time step.
            PolicyFailed: the policy raised, gave no answer, or one that is no command.
        """
        __tracebackhide__ = True
        chosen = as_policy(policy, rate)
        episode = Episode(
            chosen,
            Rhythm(
                rate if rate is not None else getattr(chosen, "rate", Policy.rate),
                command_latency,
                observation_delay,
            ),
            until,
            at_most,
            seed if seed is not None else self.process.where.seed or 0,
            Looking(forces, picture),
            inside,
            goal,
            self._trace_period,
        )
        states: list[Observation] = []
        if inside:
            try:
                answer = episode.inner(self.process, self.scene, self._timestep)
            except PolicyError as error:
                raise PolicyFailed(str(error), self.process.where) from error
        else:
            answer, states, seconds = episode.outer(
                self.process, self.scene, self._timestep, self._model()
            )
            self.stopwatch.add("policy", seconds)
        logged = Motion(**answer["log"]) if answer["log"] else self._still()
        motion = Motion.of(states) if states else logged
        self._leave_out(answer.get("aside", 0.0))
        if self._trace_period is not None and len(motion):
            self.trace.append(self._thinned(max(motion, logged, key=len)))
        self._take(answer)
        return motion

    def _still(self) -> Motion:
        """No samples."""
        return Motion(np.empty(0), self.joints[None][:0], self.bodies[None][:0])

    def _move(
        self, operation: str, log_period: float | None, *, striking: bool = False, **arguments: Any
    ) -> Motion:
        __tracebackhide__ = True
        if log_period is not None:
            check_number(log_period, "the log_period [s] of a motion", 0.0)
        period = log_period if log_period is not None else self._trace_period
        requests = [arguments]
        if operation == "wait" and period is not None:
            requests = [{"duration": part} for part in self._parts(arguments["duration"], period)]
        motions = []
        for request in requests:
            answer = self.process.request(operation, log_period=period, **request)
            self._leave_out(answer.get("aside", 0.0))
            motion = Motion(**answer["log"]) if answer["log"] else self._still()
            if self._trace_period is not None and len(motion):
                self.trace.append(self._thinned(motion))  # also where it ends in what cannot be
            if log_period is not None:
                motions.append(motion)
        self._take(answer, striking)
        return Motion.joined(motions or [self._still()])

    def _parts(self, duration: float, period: float) -> list[float]:
        """A sampled wait in parts of whole steps and samples [s]."""
        step = self._timestep
        steps, every = max(1, round(duration / step)), max(1, round(period / step))
        most = every * max(1, round(PART / (every * step)))
        whole, rest = divmod(steps, most)
        return [most * step] * whole + [rest * step] * (rest > 0)

    def _thinned(self, motion: Motion) -> Motion:
        """A denser log, reduced to about `TRACE_PERIOD`."""
        if len(motion) < 2:
            return motion
        period = (motion.time[-1] - motion.time[0]) / (len(motion) - 1)
        return motion.at(slice(None, None, max(1, round(TRACE_PERIOD / period))))

    def save(self, name: str = "saved") -> None:
        """Keep the whole state in the worker under `name`."""
        self.process.request("save", name=name)
        self._saved[name] = [*self.trace], [*self.phases]

    def restore(self, name: str = "saved") -> None:
        """Go back to a kept state, and to what had led to it."""
        self._take(self.process.request("restore", name=name))
        if name in self._saved:
            trace, phases = self._saved[name]
            self.trace, self.phases = [*trace], [*phases]

    def misfit(self, *names: str) -> float:
        """How far from where the scene has it one of these bodies touches others, at most [m],
        across its own z axis: what the engine made of its size and margin when it loaded it."""
        misfit: float = self.process.request("misfit", names=list(names))
        return misfit

    def contact_count(self) -> int:
        return int(self.process.request("contact_count"))

    def contact_forces(self) -> dict[tuple[str, str], FloatArray]:
        """Contact forces of the last step, by the pair that touches: `("body/cube", "ground")`.

        Names are "ground", `body/NAME` and `link/NAME`; each pair is there in both orders. The
        wrench, (6,), is what the second does to the first: net force [N], and torque about the
        world's origin [N m], in the world frame. Pairs that do not touch may be missing.
        """
        found: dict[tuple[str, str], FloatArray] = {}
        for first, second, wrench in self.process.request("contact_forces"):
            found[first, second], found[second, first] = wrench, -wrench
        return found

    def joint_wrenches(self) -> FloatArray:
        """What each joint transmitted in the last step, (n_joints, 6).

        The wrench of the link above on the link below, of constraint and drive together: force [N],
        and torque about the origin of the link below [N m], which is where the joint is; both in
        the world frame.
        """
        wrenches: FloatArray = self.process.request("joint_wrenches")
        return wrenches

    def render(self, width: int = 640, height: int = 480) -> NDArray[np.uint8]:
        """An offscreen picture, (height, width, 3); a `BadState` where the engine drew none."""
        drawn: NDArray[np.uint8] = self.process.request("render", width=width, height=height)
        if not is_picture(drawn, (width, height)):
            came = f"{drawn.dtype} {drawn.shape}, not uint8 {(height, width, 3)}"
            raise BadState(f"the engine drew what is no picture: {came}", self.process.where)
        return drawn

    def film(
        self, take: Callable[[Frame], None] | None, period: float, size: tuple[int, int]
    ) -> None:
        """Offscreen pictures along the way, see `WorkerProcess.film`."""
        self.process.film(take, period, size)

    def watch(self, seed: int) -> None:
        """From now on, have the worker look whether the world stays as it was loaded.

        What changes, jumps or falls as it must not ends the motion under way with
        `WorldParityError`.

        Args:
            seed: draws the steps at which the engine is asked again what it holds.
        """
        self.process.request("watch", seed=seed)

    def read_again(self) -> None:
        """Ask the engine once more what it holds, if it is watched; errors as `watch`."""
        began = time.perf_counter()
        self.process.request("read_again")
        self._leave_out(time.perf_counter() - began)

    def _leave_out(self, seconds: float) -> None:
        """Looking whether the world is still the same is no part of the repetition."""
        self.stopwatch.leave_out(seconds)
        if self.process.deadline is not None:
            self.process.deadline += seconds

    def stats(self) -> dict[str, Any]:
        """The worker's clocks of stepping and its exact memory peak."""
        stats: dict[str, Any] = self.process.request("stats")
        return stats
