"""A test's repetitions as data: what goes to a node, and what comes back.

A task of the package is known on the node. One that a test defines travels as code, so who can
reach the scheduler can run code on the nodes; that is so with Dask anyway. What comes back is text
and bytes, and a record is read from it as from a file.
"""

from __future__ import annotations

import copyreg
import sys
import threading
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import MISSING, dataclass, fields, replace
from hashlib import blake2b
from io import BytesIO
from pathlib import Path
from typing import Any, cast

from pytest_simbench.client import errors
from pytest_simbench.client.environments import Environment, interpreter
from pytest_simbench.client.errors import Where, WorkerError
from pytest_simbench.description.robot_files import content_of, keep
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.scene import Robot
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.tasks.base import Task
from pytest_simbench.tasks.source import is_own

OF_THE_MACHINE = ("folder", "python", "spec", "environment", "display", "contended")
"""Attributes of a case that the node finds by itself."""


_packing = threading.Lock()
"""What cloudpickle sends by value is set for the whole process."""

copyreg.pickle(type(MISSING), lambda missing: "MISSING")
"""Fields of a dataclass are told from others by the identity of this object. cloudpickle 3.1 sends
a copy of it with a class: a class derived from that one gets wrong defaults."""


@dataclass(frozen=True)
class SentRobot:
    """A robot with its description by content.

    Attributes:
        robot: without its paths.
        content: see `description.robot_files`.
        srdf: text of that file.
    """

    robot: Robot
    content: Mapping[str, Any]
    srdf: str

    @classmethod
    def of(cls, robot: Robot) -> SentRobot:
        """A robot, to be sent.

        Raises:
            DescriptionError: a file of it is missing or wrong.
        """
        srdf = Path(robot.srdf).read_text("utf-8") if robot.srdf else ""
        return cls(replace(robot, urdf="", srdf="", packages={}), content_of(robot), srdf)

    def here(self) -> Robot:
        """The robot with paths of this machine.

        Raises:
            OSError: its files cannot be kept here.
        """
        urdf = str(keep(self.content["urdf"], self.content["meshes"]))
        srdf = str(keep(self.srdf, {}, ".srdf")) if self.srdf else ""
        return replace(self.robot, urdf=urdf, srdf=srdf)


@dataclass(frozen=True)
class Packed:
    """A job for the way to a node.

    Attributes:
        data: all of it; None on the way to a node that has it already.
        digest: by which the node knows it.
    """

    data: bytes | None
    digest: str

    @classmethod
    def of(cls, data: bytes) -> Packed:
        return cls(data, blake2b(data, digest_size=16).hexdigest())


@dataclass(frozen=True)
class Job:
    """What all repetitions of an experiment have in common.

    Attributes:
        case: attributes of the case that hold everywhere.
        task: as the test asks for it.
        client: whose it is; others may repeat a test of the same name.
    """

    case: Mapping[str, Any]
    task: Task
    client: str = ""

    @classmethod
    def of(cls, experiment: Experiment, client: str = "") -> Job:
        case = experiment.case
        kept = {f.name: getattr(case, f.name) for f in fields(case) if f.name not in OF_THE_MACHINE}
        return cls(kept, experiment.asked, client)

    def experiment(self, folder: Path, **more: Any) -> Experiment:
        """On this machine, with a folder for logs and traces."""
        info = adapter(self.case["simulator"]).info
        case = Case(
            **self.case,
            folder=folder,
            python=interpreter(info),
            environment=Environment.of(info).variables(),
            **more,
        )
        return Experiment(case, self.task)

    def pack(self) -> Packed:
        """For the way to a node. The task's class, its policy and their bases travel as code, where
        their modules are the tests' own; what else these import must be there on the node. Robots
        travel by content, wherever they stand: in the case, in the task, in a scene of the task.

        Raises:
            DescriptionError: a file of a robot is missing or wrong.
        """
        import cloudpickle

        class Pickler(cloudpickle.Pickler):  # type: ignore[misc]
            def reducer_override(self, obj: Any) -> Any:
                if isinstance(obj, Robot) and obj.urdf:
                    return SentRobot.here, (SentRobot.of(obj),)
                return super().reducer_override(obj)

        with _packing, ExitStack() as stack:
            policy = getattr(self.task, "policy", None)
            policy = getattr(policy, "_act", policy)  # of a wrapped function
            made = [policy, *type(policy).__mro__, *type(self.task).__mro__]
            for name in {getattr(one, "__module__", "") for one in made}:
                module = sys.modules.get(name)
                if getattr(module, "__file__", None) and is_own(module):
                    cloudpickle.register_pickle_by_value(module)
                    stack.callback(cloudpickle.unregister_pickle_by_value, module)
            written = BytesIO()
            Pickler(written).dump(self)
            return Packed.of(written.getvalue())

    @classmethod
    def unpack(cls, data: bytes) -> Job:
        """On the node. It runs code of the client's.

        Raises:
            OSError: a robot's files cannot be kept here.
        """
        import cloudpickle

        return cast("Job", cloudpickle.loads(data))


class TaskFailed(Exception):
    """The task's own code raised on the node; the message ends with the node's traceback."""


def error_to_wire(error: BaseException | None, traceback: str = "") -> dict[str, str] | None:
    """What ended a repetition early, as texts."""
    if error is None:
        return None
    if isinstance(error, WorkerError):
        found = {"what": error.what, "log_tail": error.log_tail, "phase": error.phase}
    else:
        found = {"what": str(error), "traceback": traceback}
    return {"type": type(error).__name__, **found}


def error_from_wire(said: Mapping[str, str] | None, where: Where) -> BaseException | None:
    """The same as an error of this process."""
    if said is None:
        return None
    where.phase = said.get("phase") or where.phase
    kind = getattr(errors, said["type"], None)
    if isinstance(kind, type) and issubclass(kind, WorkerError):
        return kind(said["what"], where, said.get("log_tail", ""))
    return TaskFailed(f"{said['type']}: {said['what']}\n{said.get('traceback', '')}".rstrip())
