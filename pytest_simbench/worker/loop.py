"""A policy's hold on the stepping loop: asked each period, its set points as late as declared.

The policy itself is in the client's process, or here, from its source text.
"""

from __future__ import annotations

import json
import sys
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import repeat
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from pytest_simbench.scene import FloatArray, Pose, Scene
from pytest_simbench.scene.policy import Function
from pytest_simbench.scene.set_points import SetPoints, Sight, written
from pytest_simbench.simulator import PolicyError
from pytest_simbench.worker.wire import named

Row = tuple[FloatArray, FloatArray, FloatArray]
"""Set points of one step: position, velocity, effort, (n_joints,) each."""

Answer = Callable[[float, FloatArray, Row, FloatArray], tuple[FloatArray, FloatArray] | None]
"""From time, joints, the set points in force and bodies to the next position and effort; None ends
the loop."""

MODULE = "simbench_policy"
"""Name of the module that a policy's source becomes here."""


class Loop:
    """Asks after each period, and gives the steps their set points.

    Args:
        every: time steps of a period.
        most: periods after which the loop ends.
        late: time steps from an answer to when it begins to act.
        told: the set points in force at the start.
        period: [s].

    Attributes:
        told: the set points in force.
    """

    def __init__(
        self, every: int, most: int, late: int, told: Row, period: float, answer: Answer
    ) -> None:
        self.every, self.steps, self._answer = every, every * most, answer
        held = told[0], np.zeros_like(told[0]), told[2]
        self.told = self._target = held
        self._queue: deque[Row] = deque([held] * late)
        self._shares = (np.arange(1, every + 1) / every)[:, None]
        self._period = period
        self._left = most

    def ask(self, time: float, joints: FloatArray, bodies: FloatArray) -> bool:
        """One answer of the policy, to what it sees now; False: it is over."""
        if not self._left:
            return False
        self._left -= 1
        answer = self._answer(time, joints, self.told, bodies)
        if answer is None:
            return False
        before, (position, effort) = self._target[0], answer
        way = position - before
        speed = way / self._period
        rows = before + self._shares * way
        self._queue.extend(zip(rows, repeat(speed), repeat(effort), strict=False))
        self._target = position, speed, effort
        return True

    def rows(self) -> Iterator[Row]:
        """The set points of each step; as many as were answered."""
        while True:
            self.told = self._queue.popleft()
            yield self.told


def outside(
    exchange: Callable[[bytes], bytes | None], looks: Sequence[Callable[[], bytes]]
) -> Answer:
    """The client's policy: what there is to see goes there, and two rows of numbers come back.

    Args:
        exchange: sends a question and waits for its answer.
    """

    def answer(
        time: float, joints: FloatArray, told: Row, bodies: FloatArray
    ) -> tuple[FloatArray, FloatArray] | None:
        state = written(time, joints, told, bodies)
        came = exchange(b"".join([state, *(look() for look in looks)]))
        if came is None:
            return None
        position, effort = np.frombuffer(came).reshape(2, -1)
        return position, effort

    return answer


def told_forces(pairs: Sequence[tuple[str, str, FloatArray]]) -> bytes:
    """Contact forces as text."""
    return json.dumps([(first, second, list(wrench)) for first, second, wrench in pairs]).encode()


def inside(scene: Scene, told: Row, period: float, policy: Mapping[str, Any]) -> Answer:
    """A policy that runs here.

    Args:
        told: the set points in force.
        period: of the policy [s].
        policy: `path` and `source` of its module, `name` of the class or function in it, `state`:
            what the policy holds, `seed` and `goal` of the episode.

    Raises:
        PolicyError: its source does not run here.
    """
    made = _made(policy)
    act = getattr(made, "act", made)
    if reset := getattr(made, "reset", None):
        _asked(policy, reset, policy["seed"])
    goal = None if policy["goal"] is None else Pose.from_array(policy["goal"])
    sight = Sight(scene, goal=goal)
    points = SetPoints(scene.arm, told[0], told[2], period)

    def answer(
        time: float, joints: FloatArray, told: Row, bodies: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        state = written(time, joints, told, bodies)  # as outside: it cannot be written to
        points.after(_asked(policy, act, sight.read(np.frombuffer(state))))
        return points.position, points.effort

    return answer


def _asked(policy: Mapping[str, Any], what: Callable[[Any], Any], given: Any) -> Any:
    try:
        return what(given)
    except PolicyError:
        raise
    except (Exception, SystemExit) as error:
        raise PolicyError(f"the policy {policy['name']} {raised(error)}") from error


def raised(error: BaseException) -> str:
    """What a policy raised that was asked where `error` was caught, and in which line."""
    line = error.__traceback__ and error.__traceback__.tb_next
    if line is not None and line.tb_frame.f_code is Function.act.__code__:
        line = line.tb_next
    at = f" ({Path(line.tb_frame.f_code.co_filename).name}:{line.tb_lineno})" if line else ""
    return f"raised {named(error)}{at}"


def _made(policy: Mapping[str, Any]) -> Any:
    """The policy: an object, or a function."""
    module = ModuleType(MODULE)
    module.__file__ = policy["path"]
    sys.modules[MODULE] = module  # dataclasses look their module up
    try:
        exec(compile(policy["source"], policy["path"], "exec"), vars(module))
        found = getattr(module, policy["name"])
        if not isinstance(found, type):
            return found
        made: Any = object.__new__(found)
        vars(made).update(policy["state"])
    except (Exception, SystemExit) as error:
        raise PolicyError(
            f"the policy {policy['name']} cannot run inside the worker: {named(error)}; put it "
            "into a file of its own that imports numpy and what the worker has"
        ) from error
    return made
