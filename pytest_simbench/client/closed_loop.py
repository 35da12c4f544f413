"""A closed loop with a world, from this side, its policy asked here or sent to the worker."""

from __future__ import annotations

import contextvars
import inspect
import json
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.client.errors import PolicyFailed, WorkerError, WorkerHung
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.ground.errors import PolicyError
from pytest_simbench.scene import Pose, Scene
from pytest_simbench.scene.policy import (
    Function,
    Kinematics,
    LoopError,
    Observation,
    Policy,
    Rhythm,
    checked,
    name_of,
)
from pytest_simbench.scene.set_points import SetPoints, Sight
from pytest_simbench.worker.loop import raised
from pytest_simbench.worker.wire import named

PLAIN = (bool, int, float, str, bytes, type(None), list, tuple, dict, np.ndarray, np.generic)
"""What a policy may hold that is to run inside the worker."""


def shipped(policy: Policy, seed: int, goal: Pose | None) -> dict[str, Any]:
    """A policy as what a worker can run: its source and what it holds.

    Raises:
        PolicyError: its source is not there, or it holds what does not travel.
    """
    made: Any = policy._act if isinstance(policy, Function) else type(policy)
    state = {} if isinstance(policy, Function) else dict(vars(policy))
    try:
        path = inspect.getsourcefile(made)
        source = Path(path or "").read_text("utf-8")
    except (OSError, TypeError) as error:
        raise PolicyError(
            f"the source of the policy {name_of(policy)} cannot be read: {named(error)}"
        ) from None
    if not made.__qualname__.isidentifier():
        raise PolicyError(
            f"the policy {made.__qualname__} is not at the top of its module, and cannot run "
            "inside the worker"
        )
    if made.__module__ == "__main__" and "__main__" not in source:
        raise PolicyError(
            f"the policy {name_of(policy)} stands in the script that was started, which would run "
            "again inside the worker; put it into a file of its own, or the rest of the script "
            "under if __name__ == '__main__'"
        )
    odd = sorted(name for name, value in state.items() if not isinstance(value, PLAIN))
    if odd:
        raise PolicyError(
            f"the policy {name_of(policy)} holds {', '.join(odd)}, which cannot go to the worker; "
            "only numbers, texts, arrays, lists and dicts can"
        )
    told = None if goal is None else goal.as_array()
    named_so = {"path": path, "source": source, "name": made.__name__}
    return {**named_so, "state": state, "seed": seed, "goal": told}


class Watched:
    """Runs a policy in a thread of its own, so that one that stalls is told.

    Attributes:
        seconds: of wall time that the policy has taken.
    """

    def __init__(self, process: WorkerProcess, name: str) -> None:
        self._process, self._name = process, name
        self._since: float | None = None
        self.seconds = 0.0

    def ask(self, policy: Callable[..., Any], *arguments: Any) -> Any:
        """The policy's answer.

        Raises:
            PolicyFailed: it raised; in its own words.
        """
        began = self._since = time.monotonic()
        try:
            return policy(*arguments)
        except (WorkerError, PolicyError):
            raise
        except (Exception, SystemExit) as error:
            raise self.failed(raised(error)) from error
        finally:
            self._since = None
            self.seconds += time.monotonic() - began

    def failed(self, how: str) -> PolicyFailed:
        return PolicyFailed(f"the policy {self._name} {how}", self._process.where)

    def run(self, work: Callable[[], None]) -> None:
        """Carry out `work`, which asks; errors of it are raised here.

        Raises:
            PolicyFailed: the policy gave no answer within the limit of silence.
        """
        done, raised = threading.Event(), []
        limit = self._process.launch.stall_timeout

        def inner() -> None:
            try:
                work()
            except BaseException as error:
                raised.append(error)
            finally:
                done.set()

        context = contextvars.copy_context()
        threading.Thread(
            target=context.run, args=(inner,), name="simbench-policy", daemon=True
        ).start()
        while not done.wait(min(limit, 1.0)):
            since = self._since
            if since is not None and time.monotonic() - since > limit:
                self._process.kill()
                raise self.failed(
                    f"gave no answer for {limit:g} s (--sim-stall-timeout), and its repetition was "
                    "ended"
                )
        if raised:
            raise raised[0]


@dataclass(frozen=True)
class Looking:
    """What a policy is shown beside the state.

    Attributes:
        picture: width and height of a picture [pixels]; None: none.

    Raises:
        LoopError: a picture of another form.
    """

    forces: bool = False
    picture: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        match self.picture:
            case None | [int(), int()] if min(self.picture or [1]) > 0:
                return
        told = "give its width and height, two whole numbers of pixels"
        raise LoopError(f"picture={self.picture!r:.60}: {told}")


class ClosedLoop:
    """One loop under way: look, answer, look again, until it is over.

    Args:
        timestep: of the simulator [s].
        seconds: of simulated time at most.
        log_period: between samples of the answer's log [s]; None: no log.

    Attributes:
        observation: the newest that the policy may see.
        now: what the simulator's state is; newer where a delay was asked for.
        answer: of the worker, once the loop is over.

    Raises:
        LoopError: no robot, or a rate, latency or delay that fits no time step.
    """

    def __init__(
        self,
        process: WorkerProcess,
        scene: Scene,
        rhythm: Rhythm,
        *,
        timestep: float,
        seconds: float,
        kinematics: Kinematics,
        looking: Looking | None = None,
        goal: Pose | None = None,
        log_period: float | None = None,
    ) -> None:
        every, late, self._old = rhythm.steps(timestep)
        self._sight = Sight(scene, kinematics, goal)
        looking = self._looking = looking or Looking()
        self.answer: Mapping[str, Any] | None = None
        self._seen: list[Observation] = []
        self._questions = process.converse(
            "close_loop", every=every, most=max(1, round(seconds * rhythm.rate)), late=late,
            log_period=log_period, forces=looking.forces, picture=looking.picture, inside=None,
        )  # fmt: skip
        first = next(self._questions)
        self._see(first)
        told = self._sight.told(np.frombuffer(first, count=self._sight.numbers))
        self._points = SetPoints(scene.arm, told[0], told[2], 1 / rhythm.rate, kinematics)

    def _see(self, question: bytes) -> None:
        """Numbers of the state, then a picture, then forces, of what was asked for."""
        end = 8 * self._sight.numbers
        state = np.frombuffer(question, count=self._sight.numbers)
        more: dict[str, Any] = {}
        if self._looking.picture is not None:
            width, height = self._looking.picture
            begin, end = end, end + 3 * width * height
            more["picture"] = np.frombuffer(question[begin:end], np.uint8).reshape(height, width, 3)
        if self._looking.forces:
            more["forces"] = {}
            for first, second, numbers in json.loads(question[end:]):
                wrench = np.array(numbers)
                more["forces"] |= {(first, second): wrench, (second, first): -wrench}
        self._show(self._sight.read(state, **more))

    def _show(self, now: Observation) -> None:
        self.now = now
        self._seen = [*self._seen, self.now][-1 - self._old :]
        self.observation = self._seen[0]

    def reply(self, answer: Any) -> bool:
        """Send a policy's answer, and step until it is asked again; False: time is over.

        Raises:
            PolicyError: it is no command of this robot.
            WorkerError: as `WorkerProcess.request`.
        """
        self._points.after(answer)
        return self._send(self._points.position.tobytes() + self._points.effort.tobytes())

    def end(self) -> None:
        """No more answers."""
        if self.answer is None:
            self._send(None)

    def _send(self, reply: bytes | None) -> bool:
        try:
            self._see(self._questions.send(reply))
        except StopIteration as over:
            self.answer = over.value
            at = self._points.position, np.zeros_like(self._points.position), self._points.effort
            time, joints, bodies = (over.value[name] for name in ("time", "joints", "bodies"))
            self._show(self._sight.seen(time, joints, at, bodies))
            return False
        return True

    def close(self) -> None:
        """End it, whatever state it is in."""
        self._questions.close()


@dataclass(frozen=True)
class Episode:
    """A policy and how it is to be asked.

    Attributes:
        policy: whatever has `act`.
        rhythm: how often, and how late.
        until: simulated seconds, or what ends the loop once it holds of what is (undelayed).
        at_most: seconds that the loop lasts if that never holds.
        looking: what the policy is shown beside the state.
        inside: whether it runs in the worker.
        log_period: between samples of its trace [s]; None: there is none.
    """

    policy: Any
    rhythm: Rhythm
    until: float | Callable[[Observation], bool]
    at_most: float
    seed: int
    looking: Looking
    inside: bool
    goal: Pose | None
    log_period: float | None

    @property
    def seconds(self) -> float:
        """That it lasts at most.

        Raises:
            LoopError: no number above 0.
        """
        seconds = self.at_most if callable(self.until) else self.until
        return checked(seconds, "the seconds of a closed loop", above=True)

    def inner(self, process: WorkerProcess, scene: Scene, timestep: float) -> Mapping[str, Any]:
        """Carry it out inside the worker; its answer."""
        Sight(scene)  # there is a robot
        every, late, old = self.rhythm.steps(timestep)
        asked = {"until=a function": callable(self.until), "observation_delay": old}
        if refused := [name for name, value in {**asked, **vars(self.looking)}.items() if value]:
            raise LoopError(f"a policy inside the worker takes no {refused[0]}")
        most = max(1, round(self.seconds * self.rhythm.rate))
        try:
            answer: Mapping[str, Any] = process.request(
                "close_loop", every=every, most=most, late=late, forces=False, picture=None,
                log_period=self.log_period or 1 / self.rhythm.rate,
                inside=shipped(self.policy, self.seed, self.goal),
            )  # fmt: skip
        except WorkerHung as error:
            told = f"the policy {name_of(self.policy)}, which ran inside it, may be what stalls"
            raise WorkerHung(f"{error.what}; {told}", process.where, error.log_tail) from None
        return answer

    def outer(
        self, process: WorkerProcess, scene: Scene, timestep: float, kinematics: Kinematics
    ) -> tuple[Mapping[str, Any], list[Observation], float]:
        """Carry it out in this process.

        Returns:
            The worker's answer, the states at each observation, and the seconds that the policy
            took.
        """
        watched = Watched(process, name_of(self.policy))
        states: list[Observation] = []
        loop: ClosedLoop | None = None

        def work() -> None:
            nonlocal loop
            reset = getattr(self.policy, "reset", None)
            if reset is not None:
                watched.ask(reset, self.seed)
            loop = ClosedLoop(
                process, scene, self.rhythm, timestep=timestep, seconds=self.seconds,
                kinematics=kinematics, looking=self.looking, goal=self.goal,
                log_period=self.log_period,
            )  # fmt: skip
            try:
                going = True
                while going and not (callable(self.until) and self.until(loop.now)):
                    going = loop.reply(watched.ask(self.policy.act, loop.observation))
                    states.append(loop.now)
                loop.end()
            except PolicyError as error:
                raise PolicyFailed(str(error), process.where) from error
            finally:
                loop.close()

        watched.run(work)
        assert loop is not None  # nothing was raised
        assert loop.answer is not None
        return loop.answer, states, watched.seconds
