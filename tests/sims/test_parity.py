"""The parity check catches a world that differs from the scene, on real engines."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from pytest_simbench.sims.mujoco.adapter import MuJoCo
from pytest_simbench.sims.pybullet.adapter import PyBullet

from pytest_simbench.simulator import ParityError, Simulator
from pytest_simbench.simulator.parity import check
from pytest_simbench.simulator.quantities import expected_quantities
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.tasks import Jitter, Stacking, Throwing
from tests.conftest import HERE

SCENE = Stacking().scene(1, Jitter())


def compared(simulator: Simulator) -> list[str]:
    expected = expected_quantities(SCENE, simulator.settings)
    info = simulator.info
    return check(expected, simulator.read_back(), info.deviations, info.name)


@pytest.fixture(params=HERE)
def loaded(request: pytest.FixtureRequest) -> Iterator[Simulator]:
    cls = adapter(request.param)
    simulator = cls(cls.profiles["tuned"])
    simulator.load(SCENE)
    yield simulator
    simulator.close()


@pytest.mark.parametrize("profile", ["default", "tuned"])
@pytest.mark.parametrize("task", [Stacking(), Throwing()], ids=lambda task: task.name)
@pytest.mark.parametrize("name", HERE)
def test_an_honest_world_passes(name: str, task: Any, profile: str) -> None:
    cls = adapter(name)
    simulator = cls(cls.profiles[profile])
    scene = task.scene(7, Jitter())
    simulator.load(scene)
    try:
        expected = expected_quantities(scene, simulator.settings)
        check(expected, simulator.read_back(), cls.info.deviations, cls.info.name)
    finally:
        simulator.close()


def mujoco_joint(model: Any, name: str = "panda_joint4") -> int:
    return int(model.joint(name).dofadr[0])


def scaled_inertia(s: Any) -> None:
    s.model.body("cube_05").inertia[:] *= 1.2


def shorter_table(s: Any) -> None:
    import mujoco

    s.model.geom("table").size[2] -= 0.012
    s.model.body("table").pos[2] -= 0.012
    mujoco.mj_forward(s.model, s.data)


def gain(index: int) -> Callable[[Any], None]:
    def plant(s: Any) -> None:
        s.model.actuator("panda_joint4").biasprm[index] *= 1.1

    return plant


def effort_limit(s: Any) -> None:
    s.model.actuator("panda_joint4").forcerange[1] *= 2  # one end only


def rotor(s: Any) -> None:
    s.model.joint("panda_joint4").armature[:] = 0.0


def one_finger_shape(s: Any) -> None:
    finger = s.model.body("panda_leftfinger").id
    s.model.geom_friction[np.flatnonzero(s.model.geom_bodyid == finger)[-1], 0] = 0.3


MUJOCO_FAULTS: dict[str, Callable[[Any], None]] = {
    "body/cube_05/mass": lambda s: s.model.body("cube_05").mass.__setitem__(0, 1.0),
    "body/cube_05/inertia": scaled_inertia,
    "body/cube_05/friction": lambda s: s.model.geom("cube_05").friction.__setitem__(0, 0.5),
    "gravity": lambda s: s.model.opt.gravity.__setitem__(2, -9.7),
    "timestep": lambda s: setattr(s.model.opt, "timestep", 0.005),
    "body/table/boxes": shorter_table,
    "body/table/pose": shorter_table,
    "joint/panda_joint4/stiffness": gain(1),
    "joint/panda_joint4/damping": gain(2),
    "joint/panda_joint4/effort_limit": effort_limit,
    "joint/panda_joint4/armature": rotor,
    "link/panda_link4/mass": lambda s: s.model.body("panda_link4").mass.__setitem__(0, 5.0),
    "link/panda_leftfinger/friction": one_finger_shape,
    "gripper/coupled": lambda s: s.model.eq_obj1id.__setitem__(0, 0),
}


@pytest.mark.parametrize("quantity", MUJOCO_FAULTS)
def test_mujoco_fault_is_caught(quantity: str) -> None:
    simulator = MuJoCo(MuJoCo.profiles["tuned"])
    simulator.load(SCENE)
    compared(simulator)
    MUJOCO_FAULTS[quantity](simulator)
    with pytest.raises(ParityError, match=f"{quantity}: scene .*, mujoco "):
        compared(simulator)


def bullet(name: str, link: int = -1, **change: Any) -> Callable[[Any], None]:
    def plant(s: Any) -> None:
        import pybullet

        body = s._robot if name == "robot" else s._bodies[name]
        pybullet.changeDynamics(body, link, physicsClientId=s.client, **change)

    return plant


def bullet_gravity(s: Any) -> None:
    import pybullet

    pybullet.setGravity(0, 0, -9.7, physicsClientId=s.client)


def bullet_timestep(s: Any) -> None:
    import pybullet

    pybullet.setTimeStep(0.002, physicsClientId=s.client)


def bullet_table(s: Any) -> None:
    import pybullet

    pybullet.resetBasePositionAndOrientation(
        s._bodies["table"], [0.6, 0, 0.138], [0, 0, 0, 1], physicsClientId=s.client
    )


def bullet_coupling(s: Any) -> None:
    import pybullet

    pybullet.removeConstraint(s._coupling, physicsClientId=s.client)
    s._coupling = pybullet.createConstraint(
        s._bodies["cube_01"], -1, -1, -1, pybullet.JOINT_FIXED, [0] * 3, [0] * 3, [0] * 3,
        physicsClientId=s.client,
    )  # fmt: skip


BULLET_FAULTS: dict[str, Callable[[Any], None]] = {
    "body/cube_05/mass": bullet("cube_05", mass=1.0),
    "body/cube_05/inertia": bullet("cube_05", localInertiaDiagonal=[1e-4, 1e-4, 1e-4]),
    "body/cube_05/friction": bullet("cube_05", lateralFriction=0.5),
    "link/panda_leftfinger/friction": bullet("robot", 7, lateralFriction=0.5),
    "link/panda_link4/mass": bullet("robot", 3, mass=5.0),
    "gravity": bullet_gravity,
    "timestep": bullet_timestep,
    "body/table/pose": bullet_table,
    "gripper/coupled": bullet_coupling,
}


@pytest.mark.parametrize("quantity", BULLET_FAULTS)
def test_pybullet_fault_is_caught(quantity: str) -> None:
    simulator = PyBullet(PyBullet.profiles["tuned"])
    simulator.load(SCENE)
    try:
        compared(simulator)
        BULLET_FAULTS[quantity](simulator)
        with pytest.raises(ParityError, match=f"{quantity}: scene .*, pybullet "):
            compared(simulator)
    finally:
        simulator.close()


def test_what_is_not_reported_must_be_declared(loaded: Simulator) -> None:
    reported = loaded.read_back()
    del reported["gravity"]
    expected = expected_quantities(SCENE, loaded.settings)
    with pytest.raises(ParityError, match="gravity: .* reports nothing"):
        check(expected, reported, loaded.info.deviations, loaded.info.name)


def test_a_fallen_cube_is_a_difference(loaded: Simulator) -> None:
    reported = loaded.read_back()
    pose = np.array(reported["body/cube_05/pose"], dtype=float)
    pose[2] += 0.01
    reported["body/cube_05/pose"] = pose
    expected = expected_quantities(SCENE, loaded.settings)
    with pytest.raises(ParityError, match="body/cube_05/pose"):
        check(expected, reported, loaded.info.deviations, loaded.info.name)
