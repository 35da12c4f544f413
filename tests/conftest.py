"""What all tests share; what they share with the suites stands in `conftest.py` at the top."""

from __future__ import annotations

import contextlib
import os
import re
import signal
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

# pytester takes out again what a test imports first: of matplotlib a part would then come twice,
# and Pinocchio not a second time.
import matplotlib.backends.backend_agg
import matplotlib.figure  # noqa: F401
import pinocchio  # noqa: F401
import psutil
import pytest
from hypothesis import settings

from pytest_simbench.client import reaper
from pytest_simbench.client.environments import interpreter, missing
from pytest_simbench.data import DataMissing, read
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.handle import SimulatorHandle
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.records.record import Record
from pytest_simbench.simulator import Capability
from pytest_simbench.simulator.registry import adapter, registered
from pytest_simbench.tasks import Task
from tests.approval import Running, assert_approved_line, watched

with contextlib.suppress(ImportError):
    # dask imports it. It takes from Python's own finder what lists packages, and adds a finder of
    # its own. pytester takes this one out again when an inner run was the first to import it.
    # Then nobody finds the plugin's entry point.
    import importlib_metadata  # noqa: F401

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # So it is for what a script starts in the background, and for all that this starts in turn.
    signal.signal(signal.SIGINT, signal.default_int_handler)

settings.register_profile("simbench-tests", deadline=None)  # speed is measured in benchmarks/
settings.register_profile("simbench-quick", deadline=None, max_examples=20)
settings.load_profile("simbench-tests")

QUICK = "not engine"
"""What `-m` says for the quick tier."""

ADAPTERS = {name: entry.value for name, entry in registered().items()}
"""Every registered adapter, as workers name it."""

HERE = [
    name
    for name in ADAPTERS
    if not missing(adapter(name).info)
    and interpreter(adapter(name).info) is None
    and adapter(name).info.modules
]
"""The engines that can be imported in this process; a program of the user's own is not."""


def able_to(capability: Capability) -> list[str]:
    """Those of `ADAPTERS` that claim the capability."""
    return [name for name in ADAPTERS if capability in adapter(name).info.capabilities]


def case_of(case: Case, name: str) -> Case:
    """The same case for another engine, in the engine's own interpreter where it has one.

    Skips the test where the engine is missing.
    """
    info = adapter(name).info
    absent = missing(info)
    if absent:
        pytest.skip(absent)
    return Case.of(
        name,
        test=f"t[{name}-headless]",
        mode=case.mode,
        profile=case.profile,
        folder=case.folder,
        stall_timeout=120.0 if info.costly_start else case.stall_timeout,
    )


def performed(case: Case, task: Task, number: int = 1) -> Record:
    """The record of a repetition that goes well."""
    record, error = Repetition(Experiment(case, task), number).run()
    assert error is None, record.error
    if type(task).__module__.startswith("pytest_simbench.tasks"):
        told = " ".join(sorted([*record.metrics, *record.details]))
        assert_approved_line("told", f"{task.name}: {told}")
    return record


def measured(name: str) -> Any:
    """A set of measured data. Skips the test where it is not on this machine."""
    try:
        return read(name)
    except DataMissing as error:
        pytest.skip(str(error))


def workers() -> set[psutil.Process]:
    """Living processes that this one's workers are, or that these left behind."""
    return set(reaper.marked(reaper.new_mark().partition(".")[0]))


WITH_ENGINE = {"mujoco": "testing/test_checks.py", "pybullet": "worker/test_watching.py"}
"""Tests that cannot even be imported without this engine: their cheats derive from its adapter."""

collect_ignore = [path for engine, path in WITH_ENGINE.items() if find_spec(engine) is None]

ENGINE_ROOMS = {"sims", "testing"}
"""Folders in which nearly every test asks an engine."""

SLOW = {
    "test_a_planted_loss_is_caught_and_no_change_is_not",
    "test_equal_sides_are_told_apart_in_one_of_twenty_runs", "test_error_rates",
    "test_false_alarms_of_yes_and_no_stay_below_one_in_twenty",
    "test_false_alarms_stay_below_one_in_twenty_even_without_a_margin",
    "test_it_lands_elsewhere_if_asked_to", "test_other_seeds_and_many_tests_do_not_hide_crashes",
    "test_pictures_stay_in_their_folder", "test_planted_changes_are_found_where_they_are",
    "test_planted_values_are_found_and_intervals_cover", "test_shrinks_to_the_smallest_amount",
    "test_the_file_has_what_the_command_finds",
    "test_the_shares_are_of_all_places_also_of_those_never_filled",
    "test_whatever_is_in_it_nothing_else_is_raised",
    "test_without_a_change_one_row_in_twenty_has_one_at_most",
}  # fmt: skip
"""They take more than a second of CPU time each, and no engine. The quick tier leaves them out."""

COSTLY = {
    "ball_rolls", "belt_carries", "bounces_as_restitution_says", "can_rolls",
    "compounds_turn_by_their_moments", "every_effort_limit_counts", "fresh_processes_agree",
    "friction_is_told", "grip_holds", "links_feel_their_share_of_gravity", "meshes_rest_and_slide",
    "moves_as_prescribed", "pairs_have_their_friction", "picture_shows_something",
    "planted_faults_are_seen", "reading_changes_nothing", "rounds_rest", "state_as_loaded",
    "test_a_file_of_genesis_moves_as_in_mujoco", "test_an_honest_world_passes",
    "test_every_engine_holds_drawer_and_arm", "test_gymnasiums_checker_is_content",
    "test_hulls_of_more_than_500_faces_are_kept_whole", "test_in_every_engine_a_drawer_falls",
    "test_it_is_built_falls_and_rests_on_its_lowest_shape",
    "test_joints_move_as_in_mujoco_but_for_the_armature",
    "test_the_engine_tells_what_was_asked_for", "test_the_same_seed_gives_the_same_outcome",
    "test_the_worker_survives_a_bad_option", "test_two_cubes_are_stacked", "velocity_frames",
    "weight_is_told", "window_changes_nothing", "worlds_leave_no_memory",
}  # fmt: skip
"""Tests and laws of the kit for which Genesis compiles 10 to 200 s, and Newton up to 50: a quarter
of all tests' time. `-m "not costly"`, as CI says, leaves them out, of these two alone."""

ENGINE_FIXTURES = {"case", "handle", "machines", "pytester"}
"""Of tests that run MuJoCo, pytest with simulators, or a cluster of them."""

UNRUN = {"experiment", "handle", "job", "resumed", "scripted"}
"""Files in which a `case` is for reading: who runs one has the mark there."""


def pytest_configure(config: pytest.Config) -> None:
    """The quick tier draws a fifth of Hypothesis' examples; the whole suite draws all of them."""
    if config.getoption("markexpr") == QUICK:
        settings.load_profile("simbench-quick")
        os.environ.setdefault("SIMBENCH_FUZZ", "5")  # tests/report/test_fuzz.py


def pytest_itemcollected(item: pytest.Item) -> None:
    """Mark what the quick tier leaves out, `pytest tests -m "not engine"`, and what CI does.

    A test that needs an engine and is not known here has the mark in its file. One that has
    neither fails in the quick tier, which runs without any engine.
    """
    fixtures = set(getattr(item, "fixturenames", ()))
    rooms = set(item.path.relative_to(Path(__file__).parent).parts)
    fixtures -= {"case"} if item.path.stem[5:] in UNRUN else set()
    if rooms & ENGINE_ROOMS or item.path.name == "test_browser.py" or fixtures & ENGINE_FIXTURES:
        item.add_marker("engine")
    words = fixtures | {*re.split(r"\W+", item.name), item.path.stem[5:]}
    if words & {"genesis", "newton"} and words & COSTLY:
        item.add_marker("costly")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """The quick tier leaves out what is slow, too."""
    if config.getoption("markexpr") == QUICK:
        slow = [item for item in items if getattr(item, "originalname", item.name) in SLOW]
        config.hook.pytest_deselected(items=slow)
        items[:] = [item for item in items if item not in slow]


LEAN = "-p no:hypothesispytest"
"""Hypothesis' own plugin imports all of Hypothesis when it sums up: 0.6 CPU seconds a run. What
perturbs asks Hypothesis itself."""


@pytest.fixture(autouse=True)
def messages(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever expects an error expects the approved message, in tests that need no engine and draw
    nothing at random."""
    drawn = getattr(request.node.obj, "is_hypothesis_test", False)
    held = not (drawn or request.node.get_closest_marker("engine"))
    monkeypatch.setattr(Running, "test", request.node.nodeid if held else "")
    monkeypatch.setattr(pytest, "raises", watched(pytest.raises))


@pytest.fixture
def pytester(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    """Its runs draw nothing, but where a test asks for `drawn` too."""
    monkeypatch.setenv("PYTEST_ADDOPTS", f"{LEAN} -p tests.undrawn")
    return pytester


@pytest.fixture
def drawn(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    """Inner runs draw figures and replays, as users' runs do."""
    monkeypatch.setenv("PYTEST_ADDOPTS", LEAN)


@pytest.fixture(autouse=True)
def inner_runs(
    request: pytest.FixtureRequest,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    """A pytest that a test starts can import the tests' helpers, and is no worker of xdist.

    pytest-benchmark, for one, switches itself off where xdist's variables are set.
    """
    monkeypatch.setenv("PYTHONPATH", str(request.config.rootpath))
    for name in ("PYTEST_XDIST_WORKER", "PYTEST_XDIST_WORKER_COUNT", "PYTEST_XDIST_TESTRUNUID"):
        monkeypatch.delenv(name, raising=False)
    # matplotlib would look through all fonts in each test's new home: 5 to 10 s every time.
    monkeypatch.setenv("MPLCONFIGDIR", str(tmp_path_factory.getbasetemp() / "matplotlib"))


@pytest.fixture
def handle(case: Case) -> Iterator[SimulatorHandle]:
    with contextlib.closing(SimulatorHandle(case)) as handle:
        yield handle


@pytest.fixture
def case(tmp_path: Path) -> Case:
    """A headless MuJoCo case with short time-outs, its run folder in `tmp_path`."""
    return Case(
        test="tests::test_x[mujoco-headless]",
        simulator="mujoco",
        mode="headless",
        profile="tuned",
        adapter=ADAPTERS["mujoco"],
        folder=tmp_path,
        stall_timeout=20.0,
    )
