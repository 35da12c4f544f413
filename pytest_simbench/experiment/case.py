"""A case: one simulator in one mode with its settings, and how its repetitions are to be run."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pytest_simbench.client.display import Displays
from pytest_simbench.client.environments import Environment, interpreter
from pytest_simbench.client.launch import Launch
from pytest_simbench.ground.names import file_name
from pytest_simbench.records.paths import write_whole
from pytest_simbench.records.series import short
from pytest_simbench.records.tuned_on import FIRST_SEED, Seen
from pytest_simbench.scene import Robot
from pytest_simbench.simulator import Capability
from pytest_simbench.simulator.profile_file import ENDING, ProfileFile, read_profile
from pytest_simbench.simulator.registry import adapter, address, seeds_seen
from pytest_simbench.tasks.base import Task


@dataclass(frozen=True)
class Protocol:
    """How repetitions are run.

    Attributes:
        name: as given to `--protocol`.
        real_time: step in step with the wall clock.
        before: how long the idle worker is recorded before its simulator starts [s].
        repetitions: default of `--reps`.
        smallest: run the smallest version of each task.
        study: run each task by the reference study's own rules.
    """

    name: str
    real_time: bool = False
    before: float = 0.0
    repetitions: int = 20
    smallest: bool = False
    study: bool = False

    def version_of(self, task: Task) -> Task:
        """What is run when a test asks for `task`; `Experiment.task` asks, and nobody else."""
        if self.smallest:
            return task.smoke()
        return task.study() if self.study else task


PROTOCOLS = {
    protocol.name: protocol
    for protocol in (
        Protocol("fast"),
        Protocol("paper", real_time=True, before=5.0, study=True),
        Protocol("smoke", repetitions=1, smallest=True),
    )
}
"""The study's time-outs (900 s, 600 s) are the tasks' own and hold in every protocol."""


@dataclass(frozen=True)
class Case:
    """What a test's repetitions have in common.

    Attributes:
        test, function, variant: of the test, see `records.record`.
        simulator, mode, profile: which simulator, `headless` or `gui`, which settings profile.
        adapter: `module:Class` of the simulator's adapter.
        changes: single settings changed by the user, by name.
        python, spec: interpreter or execnet specification of the worker.
        display: adds to the environment what a window needs, for each worker anew.
        timeout: of a repetition from launch [s]; None for the task's own.
        stall_timeout: longest silence of a worker [s].
        memory_limit: of a worker and its children [MB]; None for no limit.
        seed: base seed; repetition k has seed + k - 1.
        jitter: scale of the start jitter; 1 is 1 mm and 1 degree.
        trace: whose motion is kept: of the first repetition (`first`), also of failed ones
            (`first-and-failed`), of these alone (`retain-on-failure`), of all (`on`), of none
            (`off`). Failed ones are known only afterwards, so all are sampled for them, at 10 Hz.
        video: which repetitions are filmed: one more, of the first seed (`first`; see
            `photographer`), all (`on`), all but only failed ones are kept (`retain-on-failure`),
            none (`off`).
        deterministic: the simulator claims that it repeats itself.
        costly_start: the engine compiles when it starts; one worker serves several repetitions.
        compile_timeout: of the compiling [s].
        fresh: start a new worker for each repetition all the same.
        contended: repetitions run side by side, so their times are not comparable.
        attempt: of the same repetitions in this process, see `records.record`.
        robot: that does the tasks; None for the tasks' own.
        file: the file that the profile is of; None for one of the adapter's.
        needs: options with the user's own files that the test is made of, as they are typed.
        own_timestep: of the profile [s], where `changes` has another one for a sweep over steps;
            its records tell it (`notes`), and so that they belong to a sweep.
    """

    test: str
    simulator: str
    mode: str
    profile: str
    adapter: str
    folder: Path
    function: str = ""
    variant: str = ""
    changes: Mapping[str, Any] = field(default_factory=dict)
    python: str | None = None
    spec: str | None = None
    environment: Mapping[str, str] = field(default_factory=dict)
    display: Displays | None = None
    protocol: Protocol = PROTOCOLS["fast"]
    timeout: float | None = None
    stall_timeout: float = 60.0
    memory_limit: float | None = None
    seed: int = FIRST_SEED
    jitter: float = 1.0
    trace: str = "off"
    video: str = "off"
    deterministic: bool = False
    costly_start: bool = False
    compile_timeout: float = 0.0
    fresh: bool = False
    contended: bool = False
    attempt: int = 1
    robot: Robot | None = None
    own_timestep: float | None = None
    file: ProfileFile | None = None
    needs: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        simulator: str,
        *,
        profile: str | ProfileFile,
        changes: Mapping[str, Any] | None = None,
        python: str | None = None,
        **more: Any,
    ) -> Case:
        """A case of a registered simulator, as it is run on this machine.

        Args:
            profile: the name of one of its profiles, or a TOML file with one.
            changes: single settings, on top of that.
            python: interpreter of the worker; None for the engine's own, or this one.
            more: further attributes; at least `test`, `mode` and `folder`.

        Raises:
            SimulatorError: no such simulator, its adapter is broken, or the file is no profile of
                it.
        """
        info = adapter(simulator).info
        changes = dict(changes or {})
        if isinstance(profile, str) and profile.endswith(ENDING):
            profile = read_profile(profile)
        if isinstance(profile, ProfileFile):
            profile.settings(simulator)
            more["file"], changes = profile, {**profile.changes, **changes}
        return cls(
            simulator=simulator,
            profile=profile.label if isinstance(profile, ProfileFile) else profile,
            changes=changes,
            adapter=address(simulator) or "",
            python=python or interpreter(info),
            environment=Environment.of(info).variables(),
            deterministic=Capability.DETERMINISTIC in info.capabilities,
            costly_start=info.costly_start,
            compile_timeout=info.compile_timeout,
            **more,
        )

    @property
    def base(self) -> str:
        """The adapter's profile that the settings begin with."""
        return self.file.base if self.file else self.profile

    @property
    def chosen_on(self) -> tuple[Seen, ...]:
        """What the profile was chosen on."""
        return self.file.seen(self.adapter) if self.file else seeds_seen(self.adapter, self.profile)

    @property
    def short_name(self) -> str:
        """The test's name without its file, fit for a file name; no other test has it."""
        return file_name(short(self.test), self.test)

    def launch(self, name: str) -> Launch:
        """How to start a worker of this case; its log is `logs/NAME.log` in the run folder.

        Raises:
            DisplayError: there is no display for its window.
        """
        log = self.folder / "logs" / f"{name}.log"
        try:
            write_whole(self.folder, f"logs/{name}.log", b"")  # a new one, no link: others append
        except OSError:  # a full disk must not stop the worker
            log = Path(os.devnull)
        return Launch(
            adapter=self.adapter,
            python=self.python,
            spec=self.spec,
            environment={
                **self.environment,
                **(self.display.environment() if self.display else {}),
            },
            log=log,
            stall_timeout=self.stall_timeout,
            compile_timeout=self.compile_timeout if self.costly_start else 0.0,
        )
