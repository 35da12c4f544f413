"""A policy asked in this process, and a policy sent to the worker."""

from __future__ import annotations

import contextvars
import inspect
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.client.errors import PolicyFailed, WorkerError
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.ground.errors import PolicyError
from pytest_simbench.scene import Pose
from pytest_simbench.scene.policy import Function, Policy
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
            f"the source of the policy {policy.name} cannot be read: {named(error)}"
        ) from None
    if not made.__qualname__.isidentifier():
        raise PolicyError(
            f"the policy {made.__qualname__} is not at the top of its module, and cannot run "
            "inside the worker"
        )
    odd = sorted(name for name, value in state.items() if not isinstance(value, PLAIN))
    if odd:
        raise PolicyError(
            f"the policy {policy.name} holds {', '.join(odd)}, which cannot go to the worker; only "
            "numbers, texts, arrays, lists and dicts can"
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
        except Exception as error:
            line = error.__traceback__ and error.__traceback__.tb_next
            at = (
                f" ({Path(line.tb_frame.f_code.co_filename).name}:{line.tb_lineno})" if line else ""
            )
            raise self.failed(f"raised {named(error)}{at}") from error
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
