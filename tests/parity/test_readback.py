"""An adapter can be made to remember another scene, wherever it keeps what it loaded."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pytest_simbench.parity.quantities import expected_quantities
from pytest_simbench.parity.readback import ReadBack, felt, remembering
from pytest_simbench.scene import Coupling, Pose
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
        self.first, self.helper = Helper(self), Helper(self)
        self.settings, self.engine = Settings(), ModuleType("engine")
        vars(self.engine)["scene"] = TRUE


def test_everything_remembered_is_replaced_and_put_back_also_after_an_error() -> None:
    adapter: Any = Adapter()
    prepared = adapter.helper.prepared
    with suppress(KeyError), remembering(adapter, OTHER):
        assert adapter.scene is OTHER
        assert adapter.robot is OTHER.robot
        assert adapter.helper.cube is adapter.first.cube is OTHER.body("cube")
        assert adapter.helper.prepared is not prepared
        assert adapter.engine.scene is TRUE  # that is none of its own
        raise KeyError("planned")
    assert adapter.scene is TRUE
    assert adapter.helper.prepared is prepared
    assert adapter.helper.cube is TRUE.body("cube")


class Told(ReadBack):
    """Of an engine that tells which part it was asked about."""

    def world(self) -> dict[str, Any]:
        return {"ground/height": 0.5}

    def pose(self, part: Any) -> Any:
        return f"pose of {part}"

    def shapes(self, part: Any) -> Any:
        return [] if part == "B" else [("boxes", k * np.ones(26)) for k in (2.0, 1.0)]

    def asked(self, part: Any) -> Any:
        return [np.ones(26), 3 * np.ones(26)] if part == "P" else None

    def surface(self, part: Any) -> dict[str, Any]:
        return {"margin": f"margin of {part}"}

    def inertial(self, part: Any) -> dict[str, Any]:
        return {"mass": f"mass of {part}"}

    def body(self, part: Any, name: str) -> dict[str, Any]:
        return {"mass": f"mass of {part}, {name}"}

    def joint(self, name: str) -> dict[str, Any]:
        return {"armature": f"armature of {name}"}

    def closures(self) -> Any:
        return [("points", True), ("others", False)]

    def coupling(self, pair: Coupling) -> Any:
        return None if pair.ratio == 7.0 else np.array([pair.ratio, pair.offset])

    def collide(self, first: Any, second: Any) -> Any:
        return [[True, {"G", "X"}.isdisjoint({first, second})], [True, True]]


def told(*fingers: Coupling) -> Told:
    """Of two bodies and of a robot of two links."""
    links = {name: SimpleNamespace(name=name, shapes=[1]) for name in ("base", "hand", "tip")}
    pairs = [Coupling("k", "j", 2.0, 0.25), Coupling("m", "j", 7.0)]
    robot = SimpleNamespace(
        joint_names=["j"], couplings=pairs, gripper=SimpleNamespace(couplings=fingers)
    )
    bodies = [SimpleNamespace(name=name, mass=1.0) for name in ("p", "b")]
    adapter = SimpleNamespace(
        scene=SimpleNamespace(bodies=bodies),
        prepared=SimpleNamespace(links=links, root="base", robot=robot),
    )
    parts = {"base": "X", "hand": "Y", "tip": "Z"}
    return Told(adapter, "G", {"p": "P", "b": "B"}, parts)


def test_all_that_an_engine_tells_has_its_name() -> None:
    """The ground collides with each part in a share of its shapes, and so does the base: this
    counts between links alone."""
    fingers = Coupling("f", "g"), Coupling("h", "g")
    found = {k: np.transpose(v).tolist() for k, v in told(*fingers).all().items() if np.size(v)}
    boxes = {"P": [2.0, 1.0], "X": [1.0, 2.0], "Y": [1.0, 2.0], "Z": [1.0, 2.0]}
    names = {"body/p": "P", "body/b": "B", "link/base": "X", "link/hand": "Y", "link/tip": "Z"}
    weights = {"body/p": "P, p", "body/b": "B, b", "link/hand": "Y", "link/tip": "Z"}
    assert found == {
        "ground/height": 0.5,
        **{f"{name}/pose": f"pose of {part}" for name, part in names.items()},
        **{f"{name}/boxes": [boxes[k]] * 26 for name, k in names.items() if k in boxes},
        **{f"{name}/margin": f"margin of {part}" for name, part in names.items() if part != "B"},
        **{f"{name}/mass": f"mass of {part}" for name, part in weights.items()},
        "joint/j/armature": "armature of j", "coupling/k": [2.0, 0.25], "gripper/coupled": 1.0,
        "closure/0/points": "points", "closure/0/rigid": 1.0,
        "closure/1/points": "others", "closure/1/rigid": 0.0,
        "body/p/touches": [0.0, 1.0, 2 / 3], "body/b/touches": [0.0, 1.0, 2 / 3],
        "link/base/touches": [0.0, 0.0, 1.0], "link/hand/touches": [0.0, 1.0, 1.0],
        "link/tip/touches": [0.0, 1.0, 1.0],
    }  # fmt: skip
    assert told(Coupling("f", "g"), Coupling("h", "g", -1.0)).all()["gripper/coupled"] == 0.0
    assert "gripper/coupled" not in told(Coupling("f", "g"), Coupling("h", "g", 7.0)).all()


@pytest.mark.parametrize(("gravity", "share"), [((1.0, 2.0, -2.0), 16 / 18), ((0.0,) * 3, 0.0)])
def test_what_a_constant_force_adds_to_gravity(gravity: Any, share: float) -> None:
    assert felt(np.array([4.0, 5.0, -1.0]), 2.0, gravity) == pytest.approx(share)


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
