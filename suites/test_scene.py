"""Your scene in every engine and release: where do its bodies end, and is a difference more than
the scene's own noise?

    pytest --sim-scene bowl_on_ramekin.xml --sim=all
    pytest --sim-scene bowl_on_ramekin.xml --sim mujoco==3.2.7,mujoco --sim-profile file

The scene is loaded as it is written and left to itself for 2.5 s. Then once more with starts that
are moved by up to 0.01, 0.1 and 1 mm, and with steps a quarter and an eighth as long. Without these
nobody can say whether two ends differ because of an engine (docs/scenes.md).
"""

import pytest

from pytest_simbench.simulator.registry import settings_of
from pytest_simbench.simulator.settings import LARGEST_TIMESTEP
from pytest_simbench.tasks import Settling

MILLIMETRES = (0.01, 0.1, 1.0)
FINER = (4, 8)


@pytest.fixture
def sim_settings(request, sim_case, scene_file):
    """The time step of the test: the profile's own (in `file` the file's), or a part of it."""
    own = settings_of(sim_case.simulator, sim_case.profile, {}).timestep
    if sim_case.profile == "file":
        own = min(scene_file().file_timestep or own, LARGEST_TIMESTEP)
    return {"timestep": own / request.node.callspec.params.get("finer", 1)}


@pytest.mark.reps(1)
def test_scene(repeat, scene_file):
    repeat(Settling(scene_file()))


@pytest.mark.reps(1)
@pytest.mark.parametrize("finer", FINER, ids=lambda times: f"step/{times}")
def test_scene_with_finer_steps(repeat, scene_file, finer):
    repeat(Settling(scene_file()))


@pytest.mark.reps(5)
@pytest.mark.parametrize("moved", MILLIMETRES, ids=lambda moved: f"{moved:g}mm")
def test_scene_with_moved_starts(repeat, scene_file, moved):
    task = Settling(scene_file(), moved=moved / 1000)
    if not task.world.free_bodies and not task.movable:
        pytest.skip("no start can be moved: loops or couplings hold all joints")
    repeat(task)
