"""Bodies of several shapes, and friction of pairs, in every engine that claims them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace

import pytest

from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.handle import SimulatorHandle
from pytest_simbench.parity.compare import compare
from pytest_simbench.parity.quantities import expected_quantities
from pytest_simbench.scene import (
    Box,
    Compound,
    ConvexMesh,
    Cylinder,
    Pose,
    Scene,
    Sphere,
    principal,
)
from pytest_simbench.simulator import Capability
from pytest_simbench.simulator.registry import adapter
from tests.conftest import able_to, case_of

pytestmark = pytest.mark.engine

TURNED = (0.8, 0.6, 0.0, 0.0)

SHAPES = (
    Box("foot", (0.1, 0.1, 0.02), Pose.at(0, 0, -0.05)),
    Box("wall", (0.02, 0.1, 0.1), Pose.at(0.03, 0, 0.01, yaw=0.3)),
    Cylinder("rod", 0.01, 0.06, Pose((-0.03, 0.0, 0.02), TURNED)),
    Sphere("knob", 0.015, Pose.at(0.03, 0, 0.07)),
)

MOMENTS = (1.0e-3, 1.2e-3, 1.1e-3)

THING = Compound("thing", SHAPES, Pose.at(0.1, 0.2, 0.09, yaw=0.5), 0.5, moments=MOMENTS)
ROCK, OWN = principal([(0, 0, 0), (0.06, 0, 0), (0, 0.06, 0), (0, 0, 0.06), (0.05, 0.05, 0.05)])
MESH = ConvexMesh("rock", ROCK, Pose.at(0, 0, 0.08) * OWN)
POST = Compound("post", (*SHAPES[:2], MESH), Pose.at(0.5, 0.2, 0.06))

SCENE = Scene("compounds", (THING, POST))


@pytest.fixture(params=able_to(Capability.COMPOUND))
def handle(request: pytest.FixtureRequest, case: Case) -> Iterator[SimulatorHandle]:
    with closing(SimulatorHandle(case_of(case, request.param))) as handle:
        yield handle


def wrong(world: World, handle: SimulatorHandle, scene: Scene) -> list[str]:
    """What the engine holds that is not in a scene."""
    info = adapter(handle.case.simulator).info
    settings = replace(adapter(info.name).profiles[handle.case.profile])
    reported = world.process.request("read_back")
    declared = [deviation for deviation in info.deviations if deviation.concerns(scene)]
    found = compare(expected_quantities(scene, settings), reported, declared, info.name)
    return sorted(found.wrong)


def test_it_is_built_falls_and_rests_on_its_lowest_shape(handle: SimulatorHandle) -> None:
    with handle.episode(SCENE) as world:  # with parity
        assert wrong(world, handle, SCENE) == []
        moved = SHAPES[2].moved_to(Pose((-0.03, 0.005, 0.02), TURNED))
        other = THING.changed(shapes=(*SHAPES[:2], moved, SHAPES[3]))
        assert wrong(world, handle, SCENE.with_body(other)) == ["body/thing/rounds"]
        heavier = THING.changed(moments=(1.0e-3, 1.2e-3, 1.32e-3))
        assert wrong(world, handle, SCENE.with_body(heavier)) == ["body/thing/inertia"]
        world.wait(1.0)
        assert world.pose("thing").position == pytest.approx((0.1, 0.2, 0.06), abs=2e-3)
        assert world.pose("thing").tilt() < 0.02
