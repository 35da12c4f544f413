"""A tape of what was asked of a world, to ask the same again: commands, waits, and what they gave.

The boundary between task and simulator carries whole trajectories and waits, so a few dozen
operations are all there is to an episode. Played to another world, they are the same commands
to the last bit, whatever a planner would make of the cubes' poses there.
"""

from __future__ import annotations

import math
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


LONGEST_TICK = 0.004
"""Of what arrives late [s], that of planned motions."""

AFTERWARDS = 1e-9
"""So long after a motion the next one begins [s]; its efforts may be others."""


class Latency:
    """A controller that is late: every set point reaches the drives `delay` [s] after it was sent.

    The time that an operation takes stays the same, so the end of each motion is carried out
    during the next one, as on a robot whose controller lags behind its planner.
    """

    def __init__(self, delay: float) -> None:
        self.delay = delay
        self._now = self._until = 0.0
        # When set points arrive [s], (n,), and rows of `ARRAYS`, (3, n, n_joints), linear between.
        self._time: FloatArray = np.empty(0)
        self._rows: FloatArray = np.empty((3, 0, 0))

    def late(self, operation: Operation) -> Operation:
        """What the drives get to see while `operation` is asked for."""
        told, duration, follows = operation.arguments, operation.duration, operation.kind != "wait"
        began, arrives = self._now, self._now + self.delay
        if not (follows or self._time.size):
            return operation
        rows = np.stack([told[name] for name in ARRAYS]) if follows else _held(self._rows[:, -1:])
        if not self._time.size:  # until the first motion arrives, the arm is held where it is
            self._time, self._rows = np.array([began, arrives]), _held(rows[:, :1])
        sent = np.linspace(0.0, duration, rows.shape[1]).clip(AFTERWARDS)
        self._time = np.append(self._time, arrives + sent)
        self._rows = np.concatenate([self._rows, rows], axis=1)
        self._now = began + duration
        late = operation
        if follows or began < self._until:
            ticks = rows.shape[1] - 1
            ticks *= math.ceil(duration / max(1, ticks) / LONGEST_TICK - 1e-6)
            found = self._at(np.linspace(began, self._now, ticks + 1))
            motion = {name: value for name, value in told.items() if name == "striking"}
            motion |= {"tick": duration / max(1, ticks) or LONGEST_TICK}
            motion |= zip(ARRAYS, found, strict=True)
            late = Operation("follow", motion, operation.phase)
        if follows:
            self._until = arrives + duration
        kept = int(np.searchsorted(self._time, self._now, "right")) - 1
        self._time, self._rows = self._time[kept:], self._rows[:, kept:]
        return late

    def _at(self, time: FloatArray) -> FloatArray:
        """The set points of these moments [s], before the last one that is known."""
        below = np.searchsorted(self._time, time, "right") - 1
        first, last = self._time[below], self._time[below + 1]
        share = ((time - first) / (last - first))[:, None]
        return self._rows[:, below] * (1 - share) + self._rows[:, below + 1] * share


def _held(row: FloatArray) -> FloatArray:
    """A set point, (3, 1, n_joints), to stay at from one moment to another."""
    held = np.repeat(row, 2, axis=1)
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
        begun, late = len(self.trace), self._latency.late(wanted) if self._latency else wanted
        found = self.perform(late, log_period)
        if self._trace_period is not None:
            self.motions.append(self._kept(begun))
        return found

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
