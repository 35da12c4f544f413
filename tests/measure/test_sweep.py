"""Laws over time steps: lines, the cheapest steps, and the step to take, from planted records."""

from __future__ import annotations

import math
from typing import Any

import pytest

from pytest_simbench.measure.sweep import Point, Swept, choice, sweeps, tolerance_at
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.notes import Notes
from pytest_simbench.records.phenomena import PHENOMENON
from pytest_simbench.records.readings import Reading, rounding
from pytest_simbench.records.record import Failure, Record
from tests.records import build

METRICS = {"fall": (Metric("error", "error", "m", "lower"),)}
STEPS = (0.004, 0.002, 0.001, 0.0005)
MUJOCO = ("mujoco", "headless", "tuned", 1)


def law(
    step: float, error: float | None, simulator: str = "mujoco", name: str = "fall", **given: Any
) -> Record:
    """A law at a time step, which costs 1 s for 1000 steps; it failed where there is no error."""
    settings = {"timestep": step, PHENOMENON: "free motion", **given.pop("settings", {})}
    found: dict[str, Any] = {
        "test": f"test_law[{simulator}-headless-dt={1e3 * step:g}ms-{name}]",
        "task": name,
        "simulator": simulator,
        "seed": 1,
        "metrics": {"error": error, "ratio": (error or 0.0) / (10 * step)},
        "notes": Notes(reading=Reading(5.0, 4.9, 10 * step), own_timestep=0.001),
        "stepping": {"cpu": 1e-3 / step, "simulated": 1.0, "steps": 1 / step},
        "settings": settings,
        "versions": {"mujoco": "3"},
    }
    if error is None:
        message = "the worker\nwas killed"
        found |= {"status": "failed", "metrics": {}, "error": Failure("WorkerDied", message)}
        found |= {"notes": Notes(own_timestep=0.001), "versions": {}}
    return build.record(**{"repetition": 1, **found, **given})


def one(records: list[Record]) -> Swept:
    (found,) = sweeps(records, METRICS)
    return found


def test_a_line_is_a_simulators_errors_with_the_longest_step_first() -> None:
    found = one([law(h, 5 * h) for h in (0.001, 0.004, 0.0005, 0.002)])
    (line,) = found.lines
    assert (found.law, found.phenomenon, found.unit) == ("fall", "free motion", "m")
    assert line.who == MUJOCO
    assert line.points == tuple(
        Point(h, 5 * h, 10 * h, pytest.approx(1e-3 / h), rounding(4.9, round(1 / h))) for h in STEPS
    )
    assert line.order.order == pytest.approx(1)
    assert found.tolerances == {h: 10 * h for h in STEPS}
    assert found.allowed == pytest.approx(0.01)


def test_one_step_is_no_sweep_and_what_is_no_law_neither() -> None:
    assert sweeps([law(0.001, 0.1), law(0.001, 0.2, repetition=2)], METRICS) == []
    plain = [law(h, 0.1, settings={PHENOMENON: None}) for h in STEPS]
    for record in plain:
        del record.settings[PHENOMENON]
    assert sweeps(plain, METRICS) == []


def test_other_settings_profiles_and_versions_are_other_lines() -> None:
    first = [law(h, h) for h in STEPS]
    others = [
        [law(h, h**2, settings={"solver": "other"}) for h in STEPS],
        [law(h, h**2, versions={"mujoco": "4"}) for h in STEPS],
        [law(h, h**2, profile="default") for h in STEPS],
    ]
    for second in others:
        lines = one([*first, *second]).lines
        assert sorted(line.order.order for line in lines) == pytest.approx([1, 2])
        assert all(len(line.points) == len(STEPS) for line in lines)


def test_the_worst_repetition_counts_and_one_that_was_cut_short_does_not() -> None:
    records = [law(h, h, repetition=1) for h in STEPS] + [law(0.004, 0.5, repetition=2)]
    records.append(law(0.002, None, repetition=3, status="interrupted"))
    assert [p.error for p in one(records).lines[0].points] == [0.5, 0.002, 0.001, 0.0005]


def test_a_failure_is_kept_with_its_message_and_left_out_of_the_order() -> None:
    """It failed before its engine told a version, and belongs to the others all the same."""
    (line,) = one([law(0.004, None), *(law(h, h) for h in STEPS[1:])]).lines
    assert line.points[0] == Point(0.004, math.inf, None, 0.25, message="the worker was killed")
    assert (line.order.points, line.order.order) == (3, pytest.approx(1))


def test_rounding_of_single_precision_is_no_order() -> None:
    for errors in ((3e-6, 1e-6, 4e-6, 2e-6), tuple(1e-7 / h for h in STEPS)):
        (line,) = one([law(h, e) for h, e in zip(STEPS, errors, strict=True)]).lines
        assert line.order.kind == "rounding"


def test_the_cheapest_step_that_keeps_the_law_and_the_cheapest_within_an_error() -> None:
    (line,) = one([law(0.004, 1.0), law(0.002, 0.02), law(0.001, 0.008), law(0.0005, 0.001)]).lines
    kept, within = line.cheapest_kept, line.cheapest_within(0.01)
    assert (kept.step, within.step) == (0.002, 0.001)
    assert line.cheapest_within(1e-6) is None
    dear = law(0.004, 0.001, stepping={"cpu": 9.0, "simulated": 1.0, "steps": 250})
    (line,) = one([dear, law(0.002, 0.001)]).lines  # the cheapest is not the longest step
    kept = line.cheapest_kept
    assert kept.step == 0.002


@pytest.mark.parametrize(("unit", "size"), [("m", 4.9), ("%", 200.0), ("", 4.9)])
def test_rounding_is_of_what_the_law_says_or_of_all_that_percent_are_of(
    unit: str, size: float
) -> None:
    found = sweeps([law(h, 0.1) for h in STEPS], {"fall": (Metric("error", "error", unit),)})
    for point in found[0].lines[0].points:
        assert point.rounding == pytest.approx(rounding(size, round(1 / point.step)))


def test_a_tolerance_between_two_steps_and_beyond_them() -> None:
    known = {0.004: 0.16, 0.001: 0.01}
    assert tolerance_at(0.002, known) == pytest.approx(0.04)  # the second power of the step
    assert tolerance_at(0.001, known) == pytest.approx(0.01)
    assert math.isnan(tolerance_at(0.0005, known))
    assert math.isnan(tolerance_at(0.001, {}))


def test_the_step_to_take_keeps_most_laws_as_well_as_a_millisecond_may() -> None:
    fall = [law(h, 6 * h) for h in STEPS]  # within 0.01 up to 1 ms
    spin = [law(h, 3 * h, name="spin") for h in STEPS]  # up to 2 ms
    found = choice(sweeps([*fall, *spin], METRICS), MUJOCO)
    assert (found.step, found.kept, found.laws, found.cost) == (0.001, 2, 2, pytest.approx(1.0))
    assert choice(sweeps(fall, METRICS), ("ode", "headless", "tuned", 1)) is None


def test_without_the_reference_among_the_steps_nothing_is_chosen() -> None:
    assert choice(sweeps([law(0.004, 0.0), law(0.002, 0.0)], METRICS), MUJOCO) is None
