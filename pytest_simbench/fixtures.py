"""The fixtures: `repeat`, `sim`, `simulator` and their parts. Heavy imports happen late."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from pytest_simbench import options
from pytest_simbench.plugin import run, selection

if TYPE_CHECKING:
    from pytest_simbench.client.world import World
    from pytest_simbench.measure.resources import ResourceSampler
    from pytest_simbench.measure.results import ResultSet
    from pytest_simbench.scene import Scene
    from pytest_simbench.session.case import Case
    from pytest_simbench.session.handle import SimulatorHandle
    from pytest_simbench.tasks.base import Task


@pytest.fixture(scope="session")
def sim_case(request: pytest.FixtureRequest) -> tuple[str, str]:
    """Name and mode of the parametrised simulator."""
    name, mode = request.param
    return name, mode


@pytest.fixture(scope="session")
def sim_name(sim_case: tuple[str, str]) -> str:
    """Name of the simulator under test."""
    return sim_case[0]


@pytest.fixture(scope="session")
def sim_mode(sim_case: tuple[str, str]) -> str:
    """`headless` or `gui`."""
    return sim_case[1]


@pytest.fixture
def sim_settings() -> dict[str, Any]:
    """Settings to change, by name; override it in a module or class. `--sim-set` goes on top."""
    return {}


@pytest.fixture
def output_path(request: pytest.FixtureRequest) -> Path:
    """The run folder; it exists when the fixture is used."""
    return run(request.config).use()


def _case(config: pytest.Config, sim_case: tuple[str, str], test: str, **more: Any) -> Case:
    """What the options say of a simulator's repetitions."""
    from pytest_simbench.session.case import Case
    from pytest_simbench.session.protocol import PROTOCOLS
    from pytest_simbench.simulator.registry import adapter, registered

    name, mode = sim_case
    info = adapter(name).info
    chosen, this = selection(config), run(config)
    settings = more.pop("settings", {})
    return Case(
        test=test,
        simulator=name,
        mode=mode,
        profile=chosen.profile,
        adapter=registered()[name].value,
        folder=this.use(),
        changes={**settings, **chosen.changes.get(name, {})},
        python=chosen.python(name),
        spec=chosen.specs.get(name),
        environment={
            **chosen.environment(name).variables(),
            **(this.displays.environment() if mode == "gui" else {}),
        },
        costly_start=info.costly_start,
        compile_timeout=info.compile_timeout,
        fresh=options.value(config, "sim_fresh"),
        protocol=PROTOCOLS[options.value(config, "protocol")],
        stall_timeout=options.value(config, "sim_stall_timeout"),
        memory_limit=options.value(config, "sim_memory_limit"),
        seed=options.value(config, "sim_seed"),
        jitter=options.value(config, "jitter"),
        trace=options.value(config, "sim_trace"),
        **more,
    )


@pytest.fixture
def simbench_case(
    request: pytest.FixtureRequest, sim_case: tuple[str, str], sim_settings: dict[str, Any]
) -> Case:
    """Everything that the repetitions of this test have in common."""
    from pytest_simbench.selection import number_mark

    given = options.value(request.config, "sim_timeout")
    return _case(
        request.config,
        sim_case,
        request.node.nodeid,
        settings=sim_settings,
        timeout=given if given is not None else number_mark(request.node, "sim_timeout"),
    )


@pytest.fixture
def repeat(
    request: pytest.FixtureRequest, simbench_case: Case, benchmark: Any
) -> Iterator[Callable[[Task], ResultSet]]:
    """Runs a task `--reps` times: `result = repeat(Stacking())`."""
    from pytest_simbench.repeating import Repeating

    repeating = Repeating(request.node, simbench_case, run(request.config))
    yield repeating
    repeating.finish(benchmark)


@pytest.fixture
def threshold(request: pytest.FixtureRequest) -> Callable[[str, float], float]:
    """`threshold("placed", 0.9)`: the suite's value, unless `--sim-threshold` changes it."""
    if hasattr(request.config, "workerinput"):  # an xdist worker must not fail while collecting
        from pytest_simbench.thresholds import problem

        found = problem(request.config, request.session.items)
        if found:
            pytest.fail(found, pytrace=False)
    given = options.assignments(request.config, "sim_threshold")
    return lambda metric, default: float(given.get(metric, default))


@pytest.fixture(scope="session")
def simulator(
    request: pytest.FixtureRequest, sim_case: tuple[str, str]
) -> Iterator[SimulatorHandle]:
    """Handle of the simulator: `with simulator.episode(scene) as world`.

    One for the whole session, so that every example of Hypothesis may use it; the `sim_settings`
    of a test do not reach it.
    """
    from pytest_simbench.session.handle import SimulatorHandle

    handle = SimulatorHandle(_case(request.config, sim_case, "simulator"))
    yield handle
    handle.close()


@pytest.fixture
def sim(simbench_case: Case) -> Iterator[Callable[[Scene], World]]:
    """Loads a scene into a fresh world of the simulator: `world = sim(scene)`."""
    from pytest_simbench.session.handle import SimulatorHandle

    handle = SimulatorHandle(simbench_case)
    with handle.episodes() as start:
        yield start
    handle.close()


@pytest.fixture
def resources() -> Iterator[Callable[[World], ResourceSampler]]:
    """Samples CPU and memory of a world's worker: `use = resources(world)`, later `use.stop()`."""
    from pytest_simbench.measure.resources import ResourceSampler

    started: list[ResourceSampler] = []

    def sample(world: World) -> ResourceSampler:
        if world.process.pid is None:
            raise ValueError("the worker has no process on this machine to sample")
        started.append(ResourceSampler(world.process.pid))
        return started[-1]

    yield sample
    for sampler in started:
        sampler.stop()
