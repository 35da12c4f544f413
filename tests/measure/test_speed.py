"""The machine's speed can be taken out exactly, an engine's cannot."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.measure.results import ResultSet
from pytest_simbench.measure.speed import POWER, control, without_speed
from pytest_simbench.records.record import Record
from tests.records.build import METRICS, record

TIMES = {"wall": 8.0, "waited": 0.0, "cpu": 7.5, "simulated": 140.0}
CONTROL = {"control_wall": 2e-4, "control_waited": 0.0, "control_cpu": 1.9e-4}
FACTORS = st.floats(0.1, 10.0)


def made(machine: float = 1.0, engine: float = 1.0, **more: float) -> ResultSet:
    """Three repetitions on a machine and an engine that take that many times as long."""
    times = {k: v * (machine * engine if k != "simulated" else 1.0) for k, v in TIMES.items()}
    control = {k: v * machine for k, v in CONTROL.items()}
    stepping = {**times, **control, **more}
    spent = {"start": 1.0 * machine * engine, "end": 9.0 * machine * engine}
    return results(
        record(k, stepping=stepping, timeline=spent, seconds={"total": 10 * machine * engine})
        for k in range(3)
    )


def results(records: object) -> ResultSet:
    return ResultSet(list(records), METRICS)


@pytest.mark.parametrize("name", POWER)
@given(machine=FACTORS, engine=FACTORS)
def test_the_machine_is_taken_out_and_the_engine_stays(
    name: str, machine: float, engine: float
) -> None:
    before, after = made(), made(machine, engine)
    found = without_speed(name, before, after)
    assert found[0] == pytest.approx(before.by_seed(name))
    changed = engine ** -POWER[name]
    expected = {seed: value * changed for seed, value in before.by_seed(name).items()}
    assert found[1] == pytest.approx(expected)


@given(waited=st.floats(0.0, 100.0), control_waited=st.floats(0.0, 1.0))
def test_waiting_for_a_processor_does_not_count(waited: float, control_waited: float) -> None:
    busy = made(
        wall=TIMES["wall"] + waited,
        waited=waited,
        control_wall=CONTROL["control_wall"] + control_waited,
        control_waited=control_waited,
    )
    found = without_speed("rtf", made(), busy)
    assert found[1] == pytest.approx(found[0])


def test_what_does_not_depend_on_speed_is_left_alone() -> None:
    assert without_speed("ram", made(), made(2.0)) is None
    assert without_speed("placed", made(), made(2.0)) is None


def test_a_repetition_without_a_control_leaves_nothing_to_compare_with() -> None:
    old: list[Record] = [record(k, stepping=TIMES) for k in range(3)]
    assert without_speed("rtf", results(old), made()) is None
    assert without_speed("rtf", made(), results([*made().records[:2], old[2]])) is None
    assert without_speed("rtf", results([]), made()) is None


def test_each_cost_has_its_control() -> None:
    """CPU seconds that of CPU seconds, stepping that without waiting, the rest that as it was."""
    stepping = {"control_wall": 3e-4, "control_waited": 1e-4, "control_cpu": 1.9e-4}
    whole, none = record(1, stepping=stepping), record(1, stepping={})
    found = {name: control(whole, name) for name in POWER}
    assert found == pytest.approx(
        {"rtf": 2e-4, "cpu_cost": 1.9e-4, "start": 3e-4, "end": 3e-4, "total": 3e-4}
    )
    assert not any(control(none, name) for name in POWER)
    assert control(record(1, stepping={**stepping, "control_waited": 1.0}), "rtf") == 0.0
