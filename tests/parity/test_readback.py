"""An adapter can be made to remember another scene, wherever it keeps what it loaded."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from pytest_simbench.parity.quantities import expected_quantities
from pytest_simbench.parity.readback import remembering
from pytest_simbench.scene import Pose
from pytest_simbench.simulator import Capability, PreparedRobot, Settings
from pytest_simbench.testing.faults import FAULTS, mechanisms, rounds, true_scene
from tests.approval import assert_approved

TRUE = true_scene()
OTHER = replace(TRUE, gravity=(0.0, 0.0, -1.0)).with_pose("cube", Pose.at(0.3, 0.3, 1.0))


class Helper:
    def __init__(self, owner: Adapter) -> None:
        self.owner, self.prepared = owner, PreparedRobot(TRUE.robot)
        self.cube = TRUE.body("cube")


class Adapter:
    """As far as memories go."""

    def __init__(self) -> None:
        self.scene: Any = TRUE
        self.robot: Any = TRUE.robot
        self.helper = Helper(self)
        self.settings = Settings()


def test_everything_remembered_is_replaced_and_put_back_also_after_an_error() -> None:
    adapter: Any = Adapter()
    prepared = adapter.helper.prepared
    with suppress(KeyError), remembering(adapter, OTHER):
        assert adapter.scene is OTHER
        assert adapter.robot is OTHER.robot
        assert adapter.helper.cube is OTHER.body("cube")
        assert adapter.helper.prepared is not prepared
        raise KeyError("planned")
    assert adapter.scene is TRUE
    assert adapter.helper.prepared is prepared
    assert adapter.helper.cube is TRUE.body("cube")


def test_every_fault_changes_its_quantity_by_so_much() -> None:
    """In two worlds, none beside another of the same quantity."""
    told, able = [], list(Capability)
    for true, faults in [*((TRUE, group) for group in rounds(able)), *mechanisms(able)]:
        wrong = true
        for fault in faults.values():
            wrong = fault.plant(wrong)
        scene, built = (expected_quantities(world, Settings()) for world in (true, wrong))
        for name, fault in faults.items():
            right, found = scene[fault.quantity], built.get(fault.quantity, ())
            alike = np.shape(right) == np.shape(found)
            size = f"{np.abs(np.subtract(right, found)).max():.3g}" if alike else "not alike"
            told.append(f"{name}: {fault.what}: {fault.quantity} {size}")
    assert_approved("faults", "\n".join(told))


def test_rounds_leave_out_what_an_engine_cannot_be_wrong_in() -> None:
    names = {name for group in rounds(()) for name in group}
    assert set(FAULTS) - names == {
        "apart", "compound_inertia", "compound_pose", "self_collide",
    }  # fmt: skip
