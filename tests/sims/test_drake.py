"""What only Drake's adapter has to show: planted faults, corner spheres, its window in a browser,
and that a second scene leaves nothing of the first."""

from __future__ import annotations

import urllib.request
from collections.abc import Callable, Iterator
from typing import Any
from urllib.error import URLError

import numpy as np
import pytest
from pytest_simbench.sims.drake.adapter import Drake

from pytest_simbench.parity.compare import check
from pytest_simbench.parity.quantities import expected_quantities
from pytest_simbench.scene import Box, Pose, Scene
from pytest_simbench.simulator import ParityError
from pytest_simbench.tasks import Jitter, Stacking

SCENE = Stacking().scene(1, Jitter())
EXPECTED = expected_quantities(SCENE, Drake.profiles["tuned"])


@pytest.fixture
def loaded() -> Iterator[Drake]:
    simulator = Drake(Drake.profiles["tuned"])
    simulator.load(SCENE)
    yield simulator
    simulator.close()


def shapes_context(s: Drake) -> Any:
    return s.scene_graph.GetMyMutableContextFromRoot(s.root)


def slippery(owner: str) -> Callable[[Drake], None]:
    """Friction 0.5 on the last one of a body's shapes."""

    def plant(s: Drake) -> None:
        from pydrake.geometry import AddContactMaterial, ProximityProperties, RoleAssign
        from pydrake.multibody.plant import CoulombFriction

        surface = ProximityProperties()
        AddContactMaterial(properties=surface, friction=CoulombFriction(0.5, 0.5))
        s.scene_graph.AssignRole(
            context=shapes_context(s),
            source_id=s.plant.get_source_id(),
            geometry_id=s.world.shapes[owner][-1],
            properties=surface,
            assign=RoleAssign.kReplace,
        )

    return plant


def reshaped(owner: str, index: int, shape: Callable[[Any], Any]) -> Callable[[Drake], None]:
    def plant(s: Drake) -> None:
        from pydrake import geometry

        s.scene_graph.ChangeShape(
            context=shapes_context(s),
            source_id=s.plant.get_source_id(),
            geometry_id=s.world.shapes[owner][index],
            shape=shape(geometry),
        )

    return plant


FAULTS: dict[str, Callable[[Drake], None]] = {
    "body/cube_05/boxes": reshaped("cube_05", 0, lambda g: g.Sphere(0.0045)),
    "body/table/boxes": reshaped("table", 0, lambda g: g.Box(0.914, 0.914, 0.276)),
    "body/cube_05/friction": slippery("cube_05"),
    "link/panda_leftfinger/friction": slippery("panda_leftfinger"),
}
"""What the kit's worlds and `drake_faults` do not plant: one shape of several."""


@pytest.mark.parametrize("quantity", FAULTS)
def test_fault_is_caught(loaded: Drake, quantity: str) -> None:
    check(EXPECTED, loaded.read_back(), Drake.info.deviations, "drake")
    FAULTS[quantity](loaded)
    with pytest.raises(ParityError, match=f"(?s){quantity}: scene .*, drake "):
        check(EXPECTED, loaded.read_back(), Drake.info.deviations, "drake")


def test_a_wrong_step_is_caught(loaded: Drake) -> None:
    expected = expected_quantities(SCENE, Drake.profiles["default"])
    with pytest.raises(ParityError, match="timestep: scene .*, drake 0.002"):
        check(expected, loaded.read_back(), Drake.info.deviations, "drake")


@pytest.mark.parametrize(("profile", "spheres"), [("default", 0), ("tuned", 8)])
def test_only_tuned_adds_spheres(profile: str, spheres: int) -> None:
    simulator = Drake(Drake.profiles[profile])
    simulator.load(SCENE)
    assert len(simulator.world.shapes["cube_05"]) == 1 + spheres
    assert len(simulator.world.shapes["table"]) == 1
    simulator.close()


def test_tuned_cube_rests_on_its_four_lower_corners() -> None:
    cube = Box("cube", (0.05, 0.05, 0.05), Pose.at(0.4, 0.0, 0.025), 0.1)
    simulator = Drake(Drake.profiles["tuned"])
    simulator.load(Scene("one", (cube,)))
    for _ in range(150):
        simulator.step()
    results = simulator.plant.get_contact_results_output_port().Eval(simulator.context)
    infos = [results.point_pair_contact_info(k) for k in range(simulator.contact_count())]
    places = np.array([info.contact_point() for info in infos])
    simulator.close()
    corners = [0.4, 0.0] + 0.021 * np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)])
    near = np.linalg.norm(places[:, None, :2] - corners[None], axis=2).argmin(axis=1)
    assert sorted(near) == [0, 1, 2, 3]
    weight = sum(abs(info.contact_force()[2]) for info in infos)
    assert weight == pytest.approx(0.1 * 9.80665, rel=1e-3)


def test_window_is_a_page_that_goes_with_its_world() -> None:
    simulator = Drake(Drake.profiles["tuned"], gui=True)
    simulator.load(SCENE)
    simulator.refresh_window()
    url = simulator._meshcat.web_url()
    with urllib.request.urlopen(url, timeout=10) as answer:
        assert b"meshcat" in answer.read().lower()
    for name in ("cube_05", "panda/panda_link4"):
        assert simulator._meshcat.HasPath(f"/drake/visualizer/{name}")
    simulator.close()
    with pytest.raises(URLError):
        urllib.request.urlopen(url, timeout=10)


def test_a_second_scene_starts_anew(loaded: Drake) -> None:
    loaded.step()
    cube = Box("cube", (0.05, 0.05, 0.05), Pose.at(0.4, 0.0, 1.0), 0.1)
    scene = Scene("one", (cube,))
    loaded.load(scene)
    assert loaded.time == 0
    assert loaded.body_state().shape == (1, 13)
    assert loaded.joint_state().shape == (2, 0)
    check(
        expected_quantities(scene, loaded.settings),
        loaded.read_back(),
        Drake.info.deviations,
        "drake",
    )
