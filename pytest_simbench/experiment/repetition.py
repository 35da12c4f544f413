"""One repetition, from launching a worker to its record."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from typing import Any
from typing import Protocol as Interface

from pytest_simbench.client.answers import Constructed
from pytest_simbench.client.errors import DisplayError, DisplayLost, Interrupted, Where, WorkerError
from pytest_simbench.client.motion import Motion
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.client.resources import ResourceSampler
from pytest_simbench.client.stopwatch import Stopwatch
from pytest_simbench.client.world import TRACE_PERIOD, World
from pytest_simbench.description.links import opening
from pytest_simbench.description.urdf import PreparedRobot
from pytest_simbench.experiment.camera import Camera
from pytest_simbench.experiment.ending import checked, failure, status
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.identity import file_stem, record_of, settings
from pytest_simbench.experiment.interrupts import Interrupts
from pytest_simbench.experiment.workers import IdleWorkers
from pytest_simbench.ground.host import host
from pytest_simbench.recordings import film
from pytest_simbench.recordings.trace import FOLDER, Trace
from pytest_simbench.records.notes import Notes
from pytest_simbench.records.record import Record, RecordError
from pytest_simbench.scene import Scene
from pytest_simbench.scene.policy import Kinematics
from pytest_simbench.simulator import DescriptionError
from pytest_simbench.tasks.base import Outcome
from pytest_simbench.tasks.own import own
from pytest_simbench.worker.stepping import CHECK_PERIOD
from pytest_simbench.worker.wire import named

OPEN = 1e-3
"""By how much a loop of links is open that is told [m]."""

__tracebackhide__ = True  # a mistake in a task is told at its own line


@dataclass(frozen=True)
class Hooks:
    """What is told of a repetition, from the thread that runs it.

    Attributes:
        begin: it begins, on the node of that name; empty for this machine.
        phase, count: progress, see `tasks.base`.
        interrupts: held from the moment that the task has ended or failed, so that the record is
            made; the caller ends the block when it has kept it.
    """

    begin: Callable[[str], None] = lambda node: None
    phase: Callable[[str], None] = lambda name: None
    count: Callable[[int, int], None] = lambda done, total: None
    interrupts: Interrupts = field(default_factory=Interrupts)


Ended = tuple[Record, BaseException | None]
"""The record of a repetition, and what ended it early if anything did."""


class AnyRepetition(Interface):
    """One repetition, carried out wherever."""

    def run(self) -> Ended:
        """Carry it out."""

    def kill(self) -> None:
        """End it at once, from any thread; `run` then returns an interrupted record."""


Slot = Callable[[Callable[[], bool]], AbstractContextManager[bool]]
"""Waits for a slot until it is told to stop, and holds it; whether there is one."""


class Repetition:
    """One repetition of a task. `run` once; `kill` from any thread.

    Its worker is fresh, unless the case reuses workers and one is idle.

    Args:
        experiment: the task, the simulator and its settings.
        number: of the repetition, from 1; 0 starts and ends the simulator alone.
        idle: where workers come from and go to, if the case reuses them.
        slot: what it waits for before it begins; None: nothing.
        camera: takes pictures by the engine's own renderer, see there; default: one for the film
            that the case asks for of every repetition.
    """

    def __init__(
        self,
        experiment: Experiment,
        number: int,
        *,
        idle: IdleWorkers | None = None,
        hooks: Hooks | None = None,
        slot: Slot | None = None,
        camera: Camera | None = None,
    ) -> None:
        self.experiment = experiment
        self.case = case = experiment.case
        self.number = number
        self.hooks = hooks or Hooks()
        self.seed = experiment.seed(number)
        self.where = Where(case.simulator, case.mode, number, self.seed)
        self.stopwatch = Stopwatch()
        self._slot = slot or (lambda stop: nullcontext(True))
        self._camera = camera or self._filming()
        self._idle = idle if idle is not None and experiment.reuses_worker else None
        self._reused = False
        self._killed = threading.Event()
        self._process: WorkerProcess | None = None
        self._sampler: ResourceSampler | None = None
        self._world: World | None = None
        self._constructed = Constructed()
        self._stats: dict[str, Any] = {}
        self._closing: str | None = None
        self._opened = 0.0

    def kill(self) -> None:
        """End the worker at once; `run` then returns the record of an interrupted repetition."""
        self._killed.set()  # before the look at the process: it may just be starting
        if self._process is not None:
            self._process.interrupt()

    def run(self) -> Ended:
        """Wait for a slot, and carry it out.

        Raises:
            Interrupted: it was killed before it had one.
            ExecutorError: there are no slots any more.
        """
        with self._slot(self._killed.is_set) as granted:
            if not granted:
                raise Interrupted("the run was interrupted", self.where)
            self.hooks.begin("")
            self.stopwatch = Stopwatch()
            return self._run()

    def _run(self) -> Ended:
        found, error = self._ended()
        outcome = found if error is None else Outcome()
        resources = self._finish(error)
        noted = {
            "trace": self._write_trace(failed=error is not None),
            **self._end_film(failed=error is not None),
        }
        record = self._record(outcome, error, resources)
        try:
            if error is None and self.number:
                record = checked(record, self.experiment.task)
        except RecordError as wrong:
            record, error = self._record(Outcome(), wrong, resources), wrong
        return record.noting(**noted), error

    def _ended(self) -> tuple[Any, BaseException | None]:
        """What the task found, or what it raised; nothing interrupts from here on."""
        result, error = None, None
        try:
            result = self._perform()
            self.hooks.interrupts.hold()
        except BaseException as raised:
            self.hooks.interrupts.hold()
            error = raised
        return result, self._because_of_display(error)

    def _because_of_display(self, error: BaseException | None) -> BaseException | None:
        """The error, unless the display of the window has ended: then that is the cause."""
        if self._process is None or self.case.display is None:
            return error
        lost = self.case.display.problem(self._process.launch.environment)
        if not lost or not isinstance(error, WorkerError | None):
            return error
        what = f"{lost}; {error.what}" if error else lost
        return DisplayLost(what, self.where, error.log_tail if error else "")

    def _perform(self) -> Outcome:
        process = self._construct()
        if not self.number:
            return Outcome()
        world = self._world = World(
            process,
            self.experiment.scene(self.seed),
            stopwatch=self.stopwatch,
            on_phase=self._enter,
            trace_period=self._trace_period(),
            after_phase=self._leave,
            kinematics=kinematics,
        )
        world.watch(self.seed)
        if self._camera is not None:
            self._camera.enter(world, self.where.phase)
        outcome = own(self.experiment.task).perform(world, self.seed, self.hooks.count)
        if not isinstance(outcome, Outcome):
            raise TypeError(f"perform() returns an Outcome, not {type(outcome).__name__}")
        self._stats = world.stats()
        world.read_again()
        robot = world.scene.robot
        if robot is not None and robot.closures:
            self._opened = opening(PreparedRobot(robot), world.joints[0])
        return outcome

    def _leave(self, world: World, phase: str) -> None:
        if self._camera is not None:
            self._camera.leave(world, group(phase))

    def _construct(self) -> WorkerProcess:
        """Launch the worker and give the simulator its settings."""
        case = self.case
        deadline = time.monotonic() + self.experiment.timeout
        self._enter("launch")
        with self.stopwatch.measuring("launch"):
            process = self._worker(deadline)
            self._sample(process)
            if case.protocol.before:
                self._enter("before")
                self._killed.wait(case.protocol.before)
                self._enter("launch")
            self._constructed = process.construct(
                case.base,
                case.changes,
                gui=case.mode == "gui",
                real_time=case.protocol.real_time,
            )
        return process

    def _worker(self, deadline: float) -> WorkerProcess:
        try:
            launch = self.case.launch(file_stem(self.experiment, self.number))
        except DisplayError as error:
            raise DisplayLost(str(error), self.where) from None
        process = self._idle.take(launch) if self._idle is not None else None
        if process is not None:
            self._reused = True
            process.where = self.where
            process.deadline = deadline
            self._made(process)
            return process
        return WorkerProcess(launch, self.where, deadline=deadline, made=self._made)

    def _made(self, process: WorkerProcess) -> None:
        self._process = process
        if self._killed.is_set():
            process.interrupt()

    def _sample(self, process: WorkerProcess) -> None:
        limit = self.case.memory_limit
        if process.pid is not None and (self.case.spec or "popen").startswith("popen"):
            self._sampler = ResourceSampler(
                process.pid,
                limit_mb=limit,
                on_limit=lambda used: process.kill_for_memory(used, limit or 0.0),
            )

    def _enter(self, phase: str) -> None:
        self.where.phase = phase
        if self._sampler is not None:
            self._sampler.phase = group(phase)
        if self._camera is not None and self._world is not None:
            self._camera.enter(self._world, group(phase))
        self.hooks.phase(phase)

    def _finish(self, error: BaseException | None) -> dict[str, Any]:
        """End sampling and worker; resource use for the record."""
        use: dict[str, Any] = {}
        if self._sampler is not None:
            use = self._sampler.stop(self._stats.get("peak_rss_mb")).to_wire()
        if self._process is not None:
            if error is None and self._idle is not None:
                self._idle.give(self._process)
            elif error is None:
                self._closing = self._process.close()
            else:
                self._process.kill()
        return use

    def _record(
        self, outcome: Outcome, error: BaseException | None, resources: dict[str, Any]
    ) -> Record:
        case, total = self.case, self.stopwatch.elapsed()
        python = self._process.python_version if self._process else ""
        stepping = self._stats.get("stepping", {})
        kinds = ("launch", "compile", "load", "plan", "policy")
        seconds = {k: self.stopwatch.seconds.get(k, 0.0) for k in kinds}
        seconds["step"] = stepping.get("wall", 0.0)
        if self._world is not None:
            stepping = {**stepping, **self._world.worked}
        seconds["other"] = max(0.0, total - sum(seconds.values()))
        seconds["total"] = total
        notes = Notes(
            log=self._log_name(),
            closing=self._closing or "",
            untested=self._constructed.untested or "",
            own_timestep=case.own_timestep,
            chosen_on=case.chosen_on,
            profile_file=case.file.path if case.file else "",
            needs=case.needs,
            sample=self.experiment.task.sample(self.seed),
            reading=outcome.reading,
            wait=outcome.wait,
            sole=self.experiment.sole,
            opened=self._opened if self._opened > OPEN else 0.0,
        )
        return record_of(
            self.experiment,
            self.number,
            status=status(error),
            settings=self._constructed.settings or settings(case),
            versions={**({"python": python} if python else {}), **self._constructed.versions},
            error=None if error is None else failure(error, self.where),
            metrics=outcome.metrics,
            details=outcome.details,
            notes=notes,
            reasons=outcome.reasons,
            seconds=seconds,
            stepping=stepping,
            timeline={} if self._world is None else self._world.timeline,
            resources=resources,
            host=host(),
            deviations=tuple(self._world.excused if self._world else ()),
            reused_worker=self._reused,
        )

    def _log_name(self) -> str:
        log = self._process.launch.log if self._process else None
        if log is None or self.case.folder not in log.parents:
            return ""
        return str(log.relative_to(self.case.folder))

    def _filming(self) -> Camera | None:
        """For the film of a repetition that counts."""
        if self.case.video not in ("on", "retain-on-failure"):
            return None
        name = file_stem(self.experiment, self.number)
        return Camera(film=film.Film(self.case.folder, f"{film.FOLDER}/{name}.mp4"))

    def _end_film(self, *, failed: bool) -> dict[str, Any]:
        """What the record tells of it: that there was one, and why it ended early."""
        camera = self._camera
        if camera is None:
            return {}
        camera.finish(self._world, keep=failed or self.case.video != "retain-on-failure")
        filmed = camera.film is not None and bool(camera.film.frames)
        return {"filmed": filmed, "video": camera.problem or ""}

    def _trace_period(self) -> float | None:
        """Of samples of the motion [s]. Which repetition fails is known at its end: until then a
        sample of each look at the state must do, which costs nothing."""
        if self._keeps(failed=False):
            return TRACE_PERIOD
        return CHECK_PERIOD if self._keeps(failed=True) else None

    def _keeps(self, *, failed: bool) -> bool:
        """Whether the motion of this repetition is kept."""
        first, when = self.number == 1, self.case.trace
        wanted = when == "on" or (first and when in ("first", "first-and-failed"))
        return wanted or (failed and when in ("first-and-failed", "retain-on-failure"))

    def _write_trace(self, *, failed: bool) -> str:
        """Joint and body states over time, and what is needed to draw them, in the run folder.

        Returns:
            why it could not be written; the repetition counts all the same.
        """
        world, case = self._world, self.case
        if world is None or not world.trace or not self._keeps(failed=failed):
            return ""
        name = file_stem(self.experiment, self.number)
        try:
            trace = Trace.of(world.scene, Motion.joined(world.trace), world.phases)
            trace.write(case.folder, f"{FOLDER}/{name}.npz")
        except (OSError, DescriptionError) as error:
            return f"the trace could not be written: {named(error)}"
        return ""


def kinematics(scene: Scene) -> Kinematics:
    """Of a scene's robot; its library is loaded when a policy first asks."""
    from pytest_simbench.motion.kinematics import Servo

    return Servo(scene)


def group(phase: str) -> str:
    """Phases whose resources are told together: `pick cube 3 of 15` is a `pick`.

    What counts on is left out, from `cube` or a number on; `settle start` and `settle` differ.
    """
    words = phase.split(" ")
    counted = (k for k, word in enumerate(words) if word == "cube" or word[:1].isdigit())
    return " ".join(words[: next(counted, len(words))]) or phase
