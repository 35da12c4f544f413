"""What differs between two runs is named before their results."""

from __future__ import annotations

from pytest_simbench.records.configuration import differences

from .build import record


def test_equal_runs_differ_in_nothing() -> None:
    assert differences({"t": ([record(0), record(1)], [record(5)])}) == []


def test_settings_versions_machines_and_profile_are_named() -> None:
    now = record(
        0,
        profile="default",
        settings={"timestep": 0.004, "solver": {"iterations": 50}},
        versions={"engine": "1.1"},
        host={"cpu": "other", "cores": 2},
    )
    assert differences({"stack": ([record(0)], [now])}) == [
        'profile was "tuned", is "default" (stack)',
        "settings.timestep was 0.002, is 0.004 (stack)",
        'versions.engine was "1.0", is "1.1" (stack)',
        'host.cpu was "some", is "other" (stack)',
        "settings.solver.iterations was absent, is 50 (stack)",
    ]


def test_a_difference_of_every_test_is_said_once() -> None:
    old, new = [record(0)], [record(0, contended=True)]
    found = differences({"a": (old, new), "b": (old, new), "c": (old, new)})
    assert found == ["contended was false, is true (every test)"]
    assert differences({"a": (old, new), "b": (old, old)})[0].endswith("(a)")


def test_a_run_that_is_not_the_same_throughout_shows_all_its_values() -> None:
    mixed = [record(0), record(1, jitter=1.0)]
    assert differences({"t": (mixed, [record(0)])}) == ["jitter was 0.0 or 1.0, is 0.0 (t)"]
