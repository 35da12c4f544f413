"""Every quantity is read from the engine: each is changed there, behind the adapter's back, and
`read_back` then tells the change. Honest worlds pass.

What a scene can express is changed by the kit (`testing.faults`), in every engine; the rest here,
in workers, through each engine's own functions (`ENGINE_faults.py`). `test_nothing_is_left_out`
holds the two lists together against all that the adapter reads back.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import pytest

from pytest_simbench.client.errors import WorldParityError
from pytest_simbench.parity.compare import compare
from pytest_simbench.parity.quantities import expected_quantities
from pytest_simbench.scene import Box, Pose, Scene
from pytest_simbench.tasks import Jitter, Stacking, Throwing
from pytest_simbench.testing import scenes
from pytest_simbench.testing.faults import FAULTS, true_scene

from . import (
    compiled_faults,
    dart_faults,
    drake_faults,
    gazebo_faults,
    genesis_faults,
    ode_faults,
    ovphysx_faults,
    pybullet_faults,
    sapien_faults,
)
from .planted import Planting
from .worlds import Worlds


@dataclass(frozen=True)
class Engine:
    """An engine whose changes are planted.

    Attributes:
        cls: the adapter that plants its `faults`, by quantity; what stands after a comma tells one
            from others of the same.
        scene: that they are planted in.
        profile: of the settings.
        fixed: what cannot be changed in a world that stands, by its pattern, and why.
    """

    cls: type[Planting]
    scene: Scene = field(default_factory=true_scene)
    profile: str = "tuned"
    fixed: Mapping[str, str] = field(default_factory=dict)


MEAN = Scene(
    "parity",
    (
        Box("table", (0.9, 0.9, 0.3), Pose.at(0.8, 0.0, 0.15), friction=0.7),
        Box("brick", (0.1, 0.06, 0.03), Pose.at(0.5, 0.1, 0.315, yaw=0.4), 0.23, 0.7),
    ),
    robot=scenes.arm(),
    ground_friction=0.7,
    friction_rule="mean",
)
"""With PhysX's own friction rule, so that its stage has these numbers."""

STACKING = Stacking().scene(1, Jitter())
ENGINES = {
    "dart": Engine(dart_faults.FaultyDART),
    "drake": Engine(
        drake_faults.FaultyDrake,
        fixed={
            "timestep": "of a plant, which is final",
            "ground/height": "the half space is anchored in the world when the plant is built",
            "body/*/gravity": "a gravity field cannot be changed once the plant is final",
            "body/*/damping": "no floating joint's damping can be set in a context",
        },
    ),
    "gazebo": Engine(
        gazebo_faults.FaultyGazebo,
        STACKING,
        "default",
        {"gripper/coupled": "dartsim's own to break, see `test_gazebo`"},
    ),
    "genesis": Engine(genesis_faults.FaultyGenesis, STACKING),
    "mujoco": Engine(compiled_faults.FaultyMuJoCo),
    "newton": Engine(compiled_faults.FaultyNewton),
    "ode": Engine(ode_faults.FaultyODE, STACKING),
    "ovphysx": Engine(ovphysx_faults.FaultyOvPhysX, MEAN),
    "pybullet": Engine(
        pybullet_faults.FaultyPyBullet,
        fixed={
            "link/*/margin": "changeDynamics leaves the margin of a link's shapes as it is",
        },
    ),
    "sapien": Engine(sapien_faults.FaultySAPIEN),
}
HONEST = [
    (name, profile)
    for name in ENGINES
    for profile in ("default", "tuned")
    if (name, profile) != ("genesis", "default")  # it compiles for 20 s
]


@pytest.fixture
def worlds(request: pytest.FixtureRequest, worlds_of: Callable[[type[Planting]], Worlds]) -> Worlds:
    return worlds_of(ENGINES[request.param].cls)


@pytest.mark.parametrize(("worlds", "profile"), HONEST, indirect=["worlds"])
@pytest.mark.parametrize("task", [Stacking(), Throwing()], ids=lambda task: task.name)
def test_an_honest_world_passes(worlds: Worlds, task: Any, profile: str) -> None:
    assert worlds.load(task.scene(7, Jitter()), profile).time == 0.0


def rounds(engine: Engine) -> list[str]:
    """The faults of each world: one, or all of an engine whose worlds are dear to build."""
    faults = engine.cls.faults
    return [";".join(faults)] if engine.cls.info.costly_start else [*faults]


@pytest.mark.parametrize(
    ("worlds", "fault"),
    [
        pytest.param(name, fault, id=f"{name}-{fault.partition(';')[0]}")
        for name, engine in ENGINES.items()
        for fault in rounds(engine)
    ],
    indirect=["worlds"],
)
def test_a_change_in_the_engine_is_told(worlds: Worlds, fault: str) -> None:
    """Of each quantity, which is what stands before the comma."""
    info = worlds.cls.info
    engine = ENGINES[info.name]
    world = worlds.load(engine.scene, engine.profile, parity=False, fault=fault)
    expected = expected_quantities(engine.scene, worlds.cls.profiles[engine.profile])
    declared = [d for d in info.deviations if d.concerns(engine.scene)]
    wrong = compare(expected, world.process.request("read_back"), declared, info.name).wrong
    quantities = [each.partition(",")[0] for each in fault.split(";")]
    told = [q for q in quantities if re.match(f"scene .*, {info.name} ", wrong.get(q, ""))]
    assert told == quantities == [*dict.fromkeys(quantities)]


@pytest.mark.parametrize("worlds", ["mujoco", "newton", "genesis", "ode"], indirect=True)
def test_a_fault_ends_the_loading(worlds: Worlds) -> None:
    with pytest.raises(WorldParityError, match=f"ground/height: scene .*, {worlds.cls.info.name} "):
        worlds.load(ENGINES[worlds.cls.info.name].scene, fault="ground/height")


def pattern(quantity: str) -> str:
    """`body/cube/mass` as `body/*/mass`."""
    kind, _, rest = quantity.partition("/")
    return f"{kind}/*/{rest.rpartition('/')[2]}" if "/" in rest else quantity


def uncovered(
    reported: Iterable[str], planted: Iterable[str], impossible: Iterable[str] = ()
) -> set[str]:
    """Patterns of what is reported, but neither changed by the kit's faults nor by `planted`.

    No link is round, so none is asked for.
    """
    kit = {fault.quantity for fault in FAULTS.values()}
    found = {pattern(quantity) for quantity in [*kit, *planted]}
    return {pattern(q) for q in reported} - found - set(impossible) - {"link/*/rounds"}


@pytest.mark.parametrize("worlds", ENGINES, indirect=True)
def test_nothing_is_left_out(worlds: Worlds) -> None:
    """An honest world, and all that is read back of it is in one of the lists."""
    engine = ENGINES[worlds.cls.info.name]
    reported = worlds.load(engine.scene, engine.profile).process.request("read_back")
    assert uncovered(reported, engine.cls.faults, engine.fixed) == set()
