"""Settings profiles and time steps as dimensions of a run: `--sim-profile=default,tuned` and
`--sim-sweep`."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.experiment.variants import STEPS, Variant, around, variants
from pytest_simbench.records.series import step_text
from pytest_simbench.simulator.settings import LARGEST_TIMESTEP, SHORTEST_TIMESTEP


def test_what_is_usual_adds_nothing_to_an_id() -> None:
    assert Variant("mujoco", "headless", "tuned").id_with(1) == "mujoco-headless"
    assert Variant("mujoco", "headless", "default").id_with(1) == "mujoco-headless"
    assert Variant("mujoco", "headless", "tuned").id_with(2) == "mujoco-headless"
    assert Variant("mujoco", "headless", "default").id_with(2) == "mujoco-headless-default"
    swept = Variant("mujoco", "gui", "real", 1 / 1920, 1 / 240, "ur5")
    assert swept.id_with(2) == "mujoco-gui-ur5-real-dt=0.5208ms"


def test_the_profiles_own_step_is_the_test_that_there_is_anyway() -> None:
    found = variants("ode", "headless", "tuned", 0.002, (4e-3, 2e-3))
    assert [v.swept for v in found] == [True, False]
    assert found[0].changes == {"timestep": 4e-3}
    assert found[0].own_timestep == 0.002
    assert found[1] == Variant("ode", "headless", "tuned")


@given(st.floats(SHORTEST_TIMESTEP, LARGEST_TIMESTEP))
def test_steps_around_any_step_are_five_octaves_that_a_setting_takes(own: float) -> None:
    steps = around(own)
    assert len({step_text(step) for step in steps}) == STEPS
    assert steps[0] / steps[-1] == pytest.approx(2.0**5)
    assert own in steps
    assert all(SHORTEST_TIMESTEP * 0.999 <= s <= LARGEST_TIMESTEP * 1.001 for s in steps)


def test_two_longer_and_three_shorter_where_there_is_room() -> None:
    assert around(0.001) == [0.004, 0.002, 0.001, 0.0005, 0.00025, 0.000125]
    assert around(LARGEST_TIMESTEP)[0] == LARGEST_TIMESTEP
