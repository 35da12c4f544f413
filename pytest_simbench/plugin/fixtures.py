"""The fixtures: `repeat`, `sim`, `simulator` and their parts. Heavy imports happen late."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import pytest

from pytest_simbench.plugin import arguments, benchmark, inputs, options
from pytest_simbench.plugin.cases import case_of, expected, on_this_machine
from pytest_simbench.plugin.registration import is_conftest
from pytest_simbench.plugin.session import REPEATED, session_of

if TYPE_CHECKING:
    from pytest_simbench.client.resources import ResourceSampler
    from pytest_simbench.client.world import World
    from pytest_simbench.experiment.case import Case
    from pytest_simbench.experiment.handle import SimulatorHandle
    from pytest_simbench.experiment.variants import Variant
    from pytest_simbench.measure.results import ResultSet
    from pytest_simbench.plugin.repeatability import Perturber
    from pytest_simbench.repeatability.replay import Replay
    from pytest_simbench.scene import Robot, Scene
    from pytest_simbench.tasks.base import Task


OWN = ("sim_", "simbench_")
"""How names begin that no other plugin has; pytest-playwright has an `output_path` too."""


def free_fixtures(plugins: pytest.PytestPluginManager) -> ModuleType:
    """A plugin with all fixtures but those whose name another plugin has.

    A conftest's fixture hides ours where it holds, as always. Ours can be had under any name by
    an import in a conftest: `from pytest_simbench.plugin.fixtures import repeat as sim_repeat`.
    """
    module = ModuleType("pytest_simbench.plugin.fixtures_here", __doc__)
    others = [plugin for plugin in plugins.get_plugins() if not is_conftest(plugin)]
    for name, thing in globals().items():
        taken = any(_is_fixture(getattr(other, name, None)) for other in others)
        if _is_fixture(thing) and (name.startswith(OWN) or not taken):
            setattr(module, name, thing)
    at_work = benchmark.has_benchmark(plugins)
    rounds = benchmark.benchmark_rounds if at_work else benchmark.no_rounds
    vars(module).update(simbench_rounds=rounds)
    return module


def _is_fixture(thing: object) -> bool:
    return type(thing).__name__ == "FixtureFunctionDefinition" or hasattr(
        thing,
        "_pytestfixturefunction",  # pytest before 8.4
    )


@pytest.fixture(scope="session")
def sim_case(request: pytest.FixtureRequest) -> Variant:
    """What the test is made for: simulator, mode, profile and time step."""
    if not hasattr(request, "param"):
        arguments.refuse(
            "a fixture of a simulator was asked for by a TestCase, a doctest or request."
            "getfixturevalue(): take it as an argument of a test function or method"
        )
    found: Variant = request.param
    return found


@pytest.fixture(scope="session")
def sim_name(sim_case: Variant) -> str:
    """Name of the simulator under test."""
    return sim_case.simulator


@pytest.fixture(scope="session")
def sim_mode(sim_case: Variant) -> str:
    """`headless` or `gui`."""
    return sim_case.mode


@pytest.fixture(scope="session")
def sim_swept(sim_case: Variant) -> bool:
    """Whether the time step is another one than the profile's own (`--sim-sweep`)."""
    return sim_case.swept


@pytest.fixture
def sim_settings() -> dict[str, Any]:
    """Settings to change, by name; override it in a module or class. `--sim-set` goes on top."""
    return {}


@pytest.fixture
def output_path(request: pytest.FixtureRequest) -> Path:
    """The run folder; it exists when the fixture is used."""
    return session_of(request.config).run.use()


@pytest.fixture
def simbench_case(
    request: pytest.FixtureRequest, sim_case: Variant, sim_settings: dict[str, Any]
) -> Case:
    """Everything that the repetitions of this test have in common."""
    return case_of(request.config, sim_case, request.node, sim_settings)


@pytest.fixture
def simbench_case_here(request: pytest.FixtureRequest, simbench_case: Case) -> Case:
    """The same for workers of this machine."""
    return on_this_machine(request.config, simbench_case)


@pytest.fixture
def repeat(
    request: pytest.FixtureRequest, simbench_case: Case, simbench_rounds: Any
) -> Iterator[Callable[[Task], ResultSet]]:
    """Runs a task `--reps` times: `result = repeat(Stacking())`; each task once in a test."""
    from pytest_simbench.plugin.repeat_fixture import RepeatFixture

    run = session_of(request.config).run
    run.expected = partial(expected, request.session)
    repeat = RepeatFixture(request.node, simbench_case, run)
    if REPEATED in request.node.stash:  # a plugin runs the test again
        request.node.stash[REPEATED].take_back()
    request.node.stash[REPEATED] = repeat
    yield repeat
    repeat.finish(simbench_rounds)


@pytest.fixture
def replay(request: pytest.FixtureRequest, simbench_case_here: Case) -> Callable[..., Replay]:
    """Runs the first seed of a task again in every way: `replay(Throwing())`.

    Takes `moments=` in place of those that the task declares. The first run's motion is kept for
    the comparison between simulators.
    """
    from pytest_simbench.experiment.experiment import Experiment
    from pytest_simbench.plugin.repeatability import replayed

    jobs = options.value(request.config, "sim_jobs")
    session = session_of(request.config)

    def replay_task(task: Task, **more: Any) -> Replay:
        experiment = Experiment(simbench_case_here, arguments.checked_task(task, "replay"))
        arguments.can_do(experiment, session.selection.every_robot)
        return replayed(experiment, session.run.displays, jobs, **more)

    return replay_task


@pytest.fixture
def perturb(
    request: pytest.FixtureRequest, simbench_case_here: Case, sim_settings: dict[str, Any]
) -> Iterator[Callable[[Task], Perturber]]:
    """Perturbs the first seed of a task: `perturb(LeaningTowers()).search({"x": 0.01})`.

    All examples run in the session's worker (one of the test's own where it has `sim_settings`).
    """
    from pytest_simbench.experiment.experiment import Experiment
    from pytest_simbench.experiment.handle import SimulatorHandle
    from pytest_simbench.plugin.repeatability import Perturber
    from pytest_simbench.repeatability.episode import Episodes

    own = SimulatorHandle(simbench_case_here)  # without a worker until an episode starts
    handle = own if sim_settings else request.getfixturevalue("simbench_handle")
    strict = options.value(request.config, "sim_strict")

    def perturb_task(task: Task) -> Perturber:
        experiment = Experiment(simbench_case_here, arguments.checked_task(task, "perturb"))
        arguments.can_do(experiment, session_of(request.config).selection.every_robot)
        return Perturber(Episodes(experiment, handle), strict)

    with closing(own):
        yield perturb_task


@pytest.fixture
def threshold(request: pytest.FixtureRequest) -> Callable[[str, float], float]:
    """`threshold("placed", 0.9)`: the suite's value, unless `--sim-threshold` changes it."""
    from pytest_simbench.measure.limits import named
    from pytest_simbench.plugin.thresholds import typed

    given = typed(request.config)
    this = session_of(request.config).run

    def choose(metric: str, default: float) -> float:
        default = arguments.checked_threshold(metric, default)
        value = given.get(metric := named(metric), default)
        this.ask(request.node.nodeid, metric, value)
        return value

    return choose


@pytest.fixture(scope="session")
def data_set(request: pytest.FixtureRequest) -> Callable[[str], Any]:
    """A measured data set by name: `Tossing(data_set("cube_tosses"))`.

    The test is skipped where the set is not on this machine, with the command that brings it.
    """
    return lambda name: inputs.read_or_skip(request.config, name)


@pytest.fixture
def scene_file(request: pytest.FixtureRequest, output_path: Path) -> inputs.SceneFiles:
    """A scene of a file: `scene_file("kitchen.xml", starts="starts.npz")`, or
    `starts="keyframes"` for those in the file itself. A log that it follows:
    `scene_file.log("run.npz", scene)`.

    Paths are relative to the test's file; without any it is the file of `--sim-scene`. What of the
    file was carried, and what not, is written into the run folder.
    """
    return inputs.SceneFiles(request, output_path, session_of(request.config).run.tell)


@pytest.fixture(scope="session")
def robot(simbench_robot: Robot) -> Robot:
    """The robot of `--robot`, the Panda by default: `Scene("s", (), robot)`."""
    return simbench_robot


@pytest.fixture(scope="session")
def simbench_robot(request: pytest.FixtureRequest) -> Robot:
    """The test's robot, whatever is named `robot` here."""
    from pytest_simbench.motion.panda import panda

    robots = session_of(request.config).selection.robots
    return robots[getattr(request, "param", next(iter(robots)))] or panda()


@pytest.fixture(scope="session")
def simulator(simbench_handle: SimulatorHandle) -> SimulatorHandle:
    """Handle of the simulator: `with simulator.episode(scene) as world`.

    One for the whole session, so that every example of Hypothesis may use it; the `sim_settings`
    of a test do not reach it.
    """
    return simbench_handle


@pytest.fixture(scope="session")
def simbench_handle(request: pytest.FixtureRequest, sim_case: Variant) -> Iterator[SimulatorHandle]:
    """The session's handle, whatever is named `simulator` here."""
    from pytest_simbench.experiment.handle import SimulatorHandle

    case = on_this_machine(request.config, case_of(request.config, sim_case))
    with closing(SimulatorHandle(case)) as handle:
        yield handle


@pytest.fixture
def sim(simbench_case_here: Case) -> Iterator[Callable[[Scene], World]]:
    """Loads a scene into a fresh world of the simulator: `world = sim(scene)`."""
    from pytest_simbench.experiment.handle import SimulatorHandle

    with closing(SimulatorHandle(simbench_case_here)) as handle:
        yield handle.world


@pytest.fixture
def resources() -> Iterator[Callable[[World], ResourceSampler]]:
    """Samples CPU and memory of a world's worker: `use = resources(world)`, later `use.stop()`."""
    from pytest_simbench.client.resources import ResourceSampler

    started: list[ResourceSampler] = []

    def sample(world: World) -> ResourceSampler:
        if world.process.pid is None:
            raise ValueError("the worker has no process on this machine to sample")
        started.append(ResourceSampler(world.process.pid))
        return started[-1]

    yield sample
    for sampler in started:
        sampler.stop()
