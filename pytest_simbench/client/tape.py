"""A tape of what was asked of a world, to ask the same again: commands, waits, and what they gave.

The boundary between task and simulator carries whole trajectories and waits, so a few dozen
operations are all there is to an episode. Played to another world, they are the same commands
to the last bit, whatever a planner would make of the cubes' poses there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pytest_simbench.client.motion import Motion
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.client.world import World
from pytest_simbench.scene import FloatArray, Scene, SceneError

ARRAYS = ("position", "velocity", "effort")


@dataclass(frozen=True)
class Operation:
    """One thing asked of a world.

    Attributes:
        kind: `follow` or `wait`.
        arguments: as sent to the worker: tick and arrays of a trajectory, duration of a wait [s];
            and of `World.wait` what is not sent.
        phase: of the task, as its `World.phase` named it.
    """

    kind: str
    arguments: Mapping[str, Any]
    phase: str = ""

    @property
    def duration(self) -> float:
        """[s]."""
        if self.kind == "wait":
            return float(self.arguments["duration"])
        return float(self.arguments["tick"]) * (len(self.arguments["position"]) - 1)

    def to_wire(self) -> dict[str, Any]:
        """Plain data for JSON; numbers are kept to the last bit."""
        arguments = {
            key: value.tolist() if isinstance(value, np.ndarray) else value
            for key, value in self.arguments.items()
        }
        return {"kind": self.kind, "arguments": arguments, "phase": self.phase}

    @classmethod
    def from_wire(cls, data: Mapping[str, Any]) -> Operation:
        arguments = {
            key: np.array(value, dtype=float) if key in ARRAYS else value
            for key, value in data["arguments"].items()
        }
        return cls(data["kind"], arguments, data["phase"])


Tape = Sequence[Operation]
"""Operations in the order in which they were asked for."""


class Latency:
    """A controller that is late: every set point reaches the drives `delay` [s] after it was sent.

    The time that an operation takes stays the same, so the end of each motion is carried out
    during the next one, as on a robot whose controller lags behind its planner.
    """

    def __init__(self, delay: float) -> None:
        self.delay = delay
        self._tick = 0.0
        # Rows of `ARRAYS`, (3, n, n_joints): the one that acts now, and those on their way.
        self._queue: FloatArray = np.empty((3, 0, 0))
        self._asked: FloatArray = self._queue

    def late(self, operation: Operation) -> list[Operation]:
        """What the drives get to see while `operation` is asked for."""
        if operation.kind == "follow":
            rows = np.stack([operation.arguments[name] for name in ARRAYS])
            if not self._queue.size:  # until the first motion arrives, the arm is held where it is
                self._tick = float(operation.arguments["tick"])
                self._queue = _held(rows[:, :1], 1 + round(self.delay / self._tick))
            self._asked = rows[:, -1:]
            # Row 0 of a trajectory is where the one before ended.
            return [self._passed(rows[:, 1:], operation.phase)]
        ticks = round(operation.duration / self._tick) if self._tick else 0
        count = min(self._queue.shape[1] - 1, ticks)
        if count <= 0:
            return [operation]
        late = self._passed(_held(self._asked, count), operation.phase)
        rest = operation.duration - late.duration
        if rest < self._tick / 2:
            return [late]
        return [late, Operation("wait", {"duration": rest}, operation.phase)]

    def _passed(self, rows: FloatArray, phase: str) -> Operation:
        """The motion of so many of the oldest rows, once these have joined the others."""
        queue, count = np.concatenate([self._queue, rows], axis=1), rows.shape[1]
        self._queue = queue[:, count:]
        motion = dict(zip(ARRAYS, queue[:, : count + 1], strict=True))
        return Operation("follow", {"tick": self._tick, **motion}, phase)


def _held(row: FloatArray, count: int) -> FloatArray:
    """A set point, (3, 1, n_joints), to stay at."""
    held = np.repeat(row, count, axis=1)
    held[ARRAYS.index("velocity")] = 0.0
    return held


class TapedWorld(World):
    """A world that keeps a tape, and can play one instead of what it is asked for.

    Args:
        process, scene, options: as of `World`.
        period: samples of every operation are kept in `motions` at this period [s], see
            `World.trace`; None: none.
        play: operations to be carried out in place of those asked for, one by one.
        delay: of the controller [s], see `Latency`.
        before: called before each operation, with the world and the operation about to be done.

    Attributes:
        tape: the operations asked for (or played) so far.
        motions: where a period was given, the state after loading, then what each operation
            gave, its end state last.
        left_at: simulated time at which the task asked for another kind of operation than the
            tape to be played had next [s]; from there on it gets what it asks for. None: never.
    """

    def __init__(
        self,
        process: WorkerProcess,
        scene: Scene,
        *,
        period: float | None = None,
        play: Tape | None = None,
        delay: float = 0.0,
        before: Callable[[TapedWorld, Operation], None] | None = None,
        **options: Any,
    ) -> None:
        super().__init__(process, scene, trace_period=period, **options)
        self.tape: list[Operation] = []
        self.motions: list[Motion] = [] if period is None else [self._kept(0)]
        self.left_at: float | None = None
        self._play = play
        self._latency = Latency(delay) if delay else None
        self._before = before

    def _move(self, operation: str, log_period: float | None, **arguments: Any) -> Motion:
        asked = Operation(operation, arguments, self.process.where.phase)
        wanted = self._next(asked)
        if self._before is not None:
            self._before(self, wanted)
        self.tape.append(wanted)
        begun, late = len(self.trace), self._latency.late(wanted) if self._latency else [wanted]
        found = [self.perform(part, log_period) for part in late]
        if self._trace_period is not None:
            self.motions.append(self._kept(begun))
        return Motion.joined(found or [self._still()])

    def perform(self, operation: Operation, log_period: float | None = None) -> Motion:
        """Carry out one operation without putting it on the tape."""
        return super()._move(operation.kind, log_period, **operation.arguments)

    def control(self, policy: Any, **options: Any) -> Motion:
        """No closed loop: its commands hang on what it sees, so there is no tape of it.

        Raises:
            SceneError: always.
        """
        raise SceneError("a world with a tape runs no policy; repeat a task that plans its motions")

    def play(self, tape: Tape) -> None:
        """Carry out the operations of a tape, one after the other."""
        for operation in tape:
            self.process.where.phase = operation.phase
            self._move(operation.kind, None, **operation.arguments)

    def _next(self, asked: Operation) -> Operation:
        if self._play is None or self.left_at is not None:
            return asked
        number = len(self.tape)
        if number >= len(self._play) or self._play[number].kind != asked.kind:
            self.left_at = self.time
            return asked
        return self._play[number]

    def _kept(self, begun: int) -> Motion:
        """What the trace has from there on, and the end state."""
        parts = [motion.at(motion.time < self.time) for motion in self.trace[begun:]]
        end = Motion(np.array([self.time]), self.joints[None], self.bodies[None])
        return Motion.joined([*parts, end])
