"""Every quantity is read from the engine: each is changed there, behind the adapter's back, and
`read_back` then tells the change.

What a scene can express is changed by the kit (`testing.faults`), in every engine; the rest here,
through each engine's own functions, and some of the former again. `test_nothing_is_left_out` holds
the two lists together against all that the adapter reads back.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from pytest_simbench.simulator import Simulator
from pytest_simbench.simulator.parity import compare
from pytest_simbench.simulator.quantities import expected_quantities
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.testing.faults import true_scene
from tests.conftest import HERE

from .coverage import uncovered

Plant = Callable[[Any], None]
SCENE = true_scene()


# MuJoCo: in the compiled model.


def mujoco_geom(name: str, array: str, value: Any) -> Plant:
    def plant(s: Any) -> None:
        body = s.model.body(name).id if name != "ground" else -1
        geoms = s.model.geom_bodyid == body if body >= 0 else [s.model.geom("ground").id]
        getattr(s.model, array)[geoms] = value

    return plant


def mujoco_body(name: str, array: str, value: Any) -> Plant:
    return lambda s: getattr(s.model, array).__setitem__(s.model.body(name).id, value)


def mujoco_height(s: Any) -> None:
    ground = s.model.geom("ground").id
    s.model.geom_pos[ground, 2] = 0.01
    s.model.geom_sameframe[ground] = 0


def mujoco_com(s: Any) -> None:
    cube = s.model.body("cube").id
    s.model.body_ipos[cube, 0] = 0.01
    s.model.body_sameframe[cube] = 0


def mujoco_damping(s: Any) -> None:
    start = s.model.body("cube").dofadr[0]
    s.model.dof_damping[start : start + 6] = 0.1


def mujoco_joint(array: str, value: Any) -> Plant:
    return lambda s: getattr(s.model, array).__setitem__(
        s.model.joint("panda_joint4").dofadr[0], value
    )


def mujoco_weld(s: Any) -> None:
    import mujoco

    s.model.eq_type[0] = mujoco.mjtEq.mjEQ_WELD
    s.model.eq_obj1id[0] = s.model.body("cube").id


def mujoco_shorter_table(s: Any) -> None:
    import mujoco

    s.model.geom("table").size[2] -= 0.012
    s.model.body("table").pos[2] -= 0.012
    mujoco.mj_forward(s.model, s.data)


def mujoco_gain(index: int) -> Plant:
    def plant(s: Any) -> None:
        s.model.actuator("panda_joint4").biasprm[index] *= 1.1

    return plant


def mujoco_effort_limit(s: Any) -> None:
    s.model.actuator("panda_joint4").forcerange[1] *= 2  # one end only


def mujoco_finger_shape(s: Any) -> None:
    finger = s.model.body("panda_leftfinger").id
    s.model.geom_friction[np.flatnonzero(s.model.geom_bodyid == finger)[-1], 0] = 0.3


BOUNCY = (0.02, 0.1)
"""MuJoCo's time constant and damping ratio of a contact that gives back most of the speed."""

MUJOCO: dict[str, Plant] = {
    "timestep": lambda s: setattr(s.model.opt, "timestep", 0.005),
    "ground/height": mujoco_height,
    "ground/restitution": mujoco_geom("ground", "geom_solref", BOUNCY),
    "body/cube/restitution": mujoco_geom("cube", "geom_solref", BOUNCY),
    "body/cube/margin": mujoco_geom("cube", "geom_margin", 0.002),
    "body/cube/touches": mujoco_geom("cube", "geom_conaffinity", 0),
    "body/cube/com": mujoco_com,
    "body/cube/damping": mujoco_damping,
    "body/cube/gravity": mujoco_body("cube", "body_gravcomp", 1.0),
    "body/cube/dynamic": mujoco_weld,
    "link/panda_link4/restitution": mujoco_geom("panda_link4", "geom_solref", BOUNCY),
    "link/panda_link4/margin": mujoco_geom("panda_link4", "geom_margin", 0.002),
    "link/panda_link4/touches": mujoco_geom("panda_link4", "geom_contype", 0),
    "link/panda_link4/damping": lambda s: setattr(s.model.opt, "viscosity", 0.1),
    "link/panda_link4/gravity": mujoco_body("panda_link4", "body_gravcomp", 1.0),
    "joint/panda_joint4/friction": mujoco_joint("dof_frictionloss", 0.5),
    "gripper/coupled": lambda s: s.data.eq_active.__setitem__(0, 0),
    "gripper/coupled, to another joint": lambda s: s.model.eq_obj1id.__setitem__(0, 0),
    "body/cube/mass": mujoco_body("cube", "body_mass", 1.0),
    "body/cube/inertia": lambda s: s.model.body("cube").inertia.__imul__(1.2),
    "body/cube/friction": lambda s: s.model.geom("cube").friction.__setitem__(0, 0.5),
    "gravity": lambda s: s.model.opt.gravity.__setitem__(2, -9.7),
    "body/table/boxes": mujoco_shorter_table,
    "body/table/pose": mujoco_shorter_table,
    "joint/panda_joint4/stiffness": mujoco_gain(1),
    "joint/panda_joint4/damping": mujoco_gain(2),
    "joint/panda_joint4/effort_limit": mujoco_effort_limit,
    "joint/panda_joint4/armature": mujoco_joint("dof_armature", 0.0),
    "link/panda_link4/mass": mujoco_body("panda_link4", "body_mass", 5.0),
    "link/panda_leftfinger/friction, one shape": mujoco_finger_shape,
}


# PyBullet: through its client.


def bullet(name: str, link: str = "", **change: Any) -> Plant:
    def plant(s: Any) -> None:
        import pybullet

        body = {**s._bodies, "ground": s._ground, "robot": s._robot}[name]
        number = s._links[link] if link else -1
        pybullet.changeDynamics(body, number, physicsClientId=s.client, **change)

    return plant


def bullet_timestep(s: Any) -> None:
    import pybullet

    pybullet.setTimeStep(0.002, physicsClientId=s.client)


def bullet_height(s: Any) -> None:
    import pybullet

    pybullet.resetBasePositionAndOrientation(
        s._ground, [0, 0, 0.01], [0, 0, 0, 1], physicsClientId=s.client
    )


def bullet_gravity(s: Any) -> None:
    import pybullet

    pybullet.setGravity(0, 0, -9.7, physicsClientId=s.client)


def bullet_table(s: Any) -> None:
    import pybullet

    pybullet.resetBasePositionAndOrientation(
        s._bodies["table"], [0.8, 0, 0.138], [0, 0, 0, 1], physicsClientId=s.client
    )


def bullet_held(s: Any) -> None:
    import pybullet

    pybullet.createConstraint(
        s._bodies["cube"], -1, -1, -1, pybullet.JOINT_FIXED, [0] * 3, [0] * 3, [0] * 3,
        physicsClientId=s.client,
    )  # fmt: skip


def bullet_com(s: Any) -> None:
    """A cube like the other, its centre of mass aside, in its place."""
    import pybullet

    pybullet.removeBody(s._bodies["cube"], physicsClientId=s.client)
    half = [0.025] * 3
    shape = pybullet.createCollisionShape(
        pybullet.GEOM_BOX, halfExtents=half, physicsClientId=s.client
    )
    s._bodies["cube"] = pybullet.createMultiBody(
        0.1, shape, -1, [0.6, -0.1, 0.325], baseInertialFramePosition=[0.01, 0, 0],
        physicsClientId=s.client,
    )  # fmt: skip


def bullet_uncoupled(s: Any) -> None:
    import pybullet

    pybullet.removeConstraint(s._couplings[0], physicsClientId=s.client)
    s._couplings[0] = pybullet.createConstraint(
        s._bodies["cube"], -1, -1, -1, pybullet.JOINT_FIXED, [0] * 3, [0] * 3, [0] * 3,
        physicsClientId=s.client,
    )  # fmt: skip


PYBULLET: dict[str, Plant] = {
    "timestep": bullet_timestep,
    "ground/height": bullet_height,
    "ground/restitution": bullet("ground", restitution=0.5),
    "body/cube/restitution": bullet("cube", restitution=0.5),
    "body/cube/margin": bullet("cube", collisionMargin=0.005),
    "body/cube/com": bullet_com,
    "body/cube/dynamic": bullet_held,
    "link/panda_link4/restitution": bullet("robot", "panda_link4", restitution=0.5),
    "gripper/coupled": bullet_uncoupled,
    "gravity": bullet_gravity,
    "body/table/pose": bullet_table,
    "body/cube/mass": bullet("cube", mass=1.0),
    "body/cube/inertia": bullet("cube", localInertiaDiagonal=[1e-4, 1e-4, 1e-4]),
    "body/cube/friction": bullet("cube", lateralFriction=0.5),
    "link/panda_leftfinger/friction": bullet("robot", "panda_leftfinger", lateralFriction=0.5),
    "link/panda_link4/mass": bullet("robot", "panda_link4", mass=5.0),
}


# SAPIEN: on PhysX's components.


def sapien_shape(name: str, setter: str, *values: Any) -> Plant:
    """A setter of the last shape of a body or link called."""

    def plant(s: Any) -> None:
        component = s._ground if name == "ground" else {**s._bodies, **s._links}[name]
        getattr(component.collision_shapes[-1], setter)(*values)

    return plant


def sapien_bouncy(name: str) -> Plant:
    def plant(s: Any) -> None:
        import sapien

        friction = SCENE.ground_friction
        material = sapien.physx.PhysxMaterial(friction, friction, 0.5)
        sapien_shape(name, "set_physical_material", material)(s)

    return plant


def sapien_body(name: str, attribute: str, value: Any) -> Plant:
    return lambda s: setattr({**s._bodies, **s._links}[name], attribute, value)


def sapien_com(s: Any) -> None:
    import sapien

    s._bodies["cube"].cmass_local_pose = sapien.Pose([0.01, 0, 0])


SAPIEN: dict[str, Plant] = {
    "timestep": lambda s: setattr(s._system, "timestep", 0.005),
    "ground/height": lambda s: s._ground.entity.set_pose(raised(s._ground.entity.pose)),
    "ground/restitution": sapien_bouncy("ground"),
    "body/cube/restitution": sapien_bouncy("cube"),
    "body/cube/margin": sapien_shape("cube", "set_rest_offset", 0.002),
    "body/cube/touches": sapien_shape("cube", "set_collision_groups", [0, 0, 0, 0]),
    "body/cube/com": sapien_com,
    "body/cube/damping": sapien_body("cube", "linear_damping", 0.1),
    "body/cube/gravity": sapien_body("cube", "disable_gravity", True),
    "body/cube/dynamic": sapien_body("cube", "kinematic", True),
    "link/panda_link4/restitution": sapien_bouncy("panda_link4"),
    "link/panda_link4/margin": sapien_shape("panda_link4", "set_rest_offset", 0.002),
    "link/panda_link4/touches": sapien_shape("panda_link4", "set_collision_groups", [0, 0, 0, 0]),
    "link/panda_link4/damping": sapien_body("panda_link4", "angular_damping", 0.1),
    "link/panda_link4/gravity": sapien_body("panda_link4", "disable_gravity", True),
    "joint/panda_joint4/friction": lambda s: s._joints[3].set_friction(0.5),
}


def raised(pose: Any) -> Any:
    import sapien

    return sapien.Pose(pose.p + np.array([0, 0, 0.01]), pose.q)


# DART: on its bodies and joints.


def dart_part(s: Any, name: str) -> Any:
    if name == "ground":
        return s._ground
    return s._bodies.get(name) or s._robot.getBodyNode(name)


def dart_bouncy(name: str) -> Plant:
    def plant(s: Any) -> None:
        shapes = [x for x in dart_part(s, name).getShapeNodes() if x.hasDynamicsAspect()]
        shapes[-1].getDynamicsAspect().setRestitutionCoeff(0.5)

    return plant


def dart_height(s: Any) -> None:
    import dartpy

    place = dartpy.math.Isometry3()
    place.set_translation([0, 0, 0.01])
    s._ground.getParentJoint().setTransformFromParentBodyNode(place)


def dart_com(s: Any) -> None:
    inertia = s._bodies["cube"].getInertia()
    inertia.setLocalCOM([0.01, 0, 0])
    s._bodies["cube"].setInertia(inertia)


def dart_uncoupled(s: Any) -> None:
    import dartpy

    finger = s._robot.getJoint("panda_finger_joint2")
    finger.setActuatorType(dartpy.dynamics.ActuatorType.PASSIVE)


DART: dict[str, Plant] = {
    "timestep": lambda s: s.world.setTimeStep(0.002),
    "ground/height": dart_height,
    "ground/restitution": dart_bouncy("ground"),
    "body/cube/restitution": dart_bouncy("cube"),
    "body/cube/touches": lambda s: s._bodies["cube"].setCollidable(False),
    "body/cube/com": dart_com,
    "body/cube/damping": lambda s: s._bodies["cube"].getParentJoint().setDampingCoefficient(4, 0.1),
    "body/cube/gravity": lambda s: s._bodies["cube"].setGravityMode(False),
    "body/cube/dynamic": lambda s: s._bodies["cube"].getSkeleton().setMobile(False),
    "link/panda_link4/restitution": dart_bouncy("panda_link4"),
    "link/panda_link4/touches": lambda s: dart_part(s, "panda_link4").setCollidable(False),
    "link/panda_link4/gravity": lambda s: dart_part(s, "panda_link4").setGravityMode(False),
    "joint/panda_joint4/friction": lambda s: s._robot.getJoint("panda_joint4").setCoulombFriction(
        0, 0.5
    ),
    "gripper/coupled": dart_uncoupled,
}


# Drake: in the context that is simulated, its gravity field and its collision filters.


def drake_com(s: Any) -> None:
    from pydrake.multibody.tree import SpatialInertia

    off = SpatialInertia.SolidBoxWithMass(0.1, 0.05, 0.05, 0.05).Shift([-0.01, 0, 0])
    s.world.bodies["cube"].SetSpatialInertiaInBodyFrame(s.context, off)


def drake_ghost(name: str) -> Plant:
    def plant(s: Any) -> None:
        from pydrake.geometry import CollisionFilterDeclaration, GeometrySet

        context = s.scene_graph.GetMyMutableContextFromRoot(s.root)
        every = GeometrySet([made for group in s.world.shapes.values() for made in group])
        apart = CollisionFilterDeclaration().ExcludeBetween(
            GeometrySet(s.world.shapes[name]), every
        )
        s.scene_graph.collision_filter_manager(context).Apply(apart)

    return plant


def drake_margin(name: str) -> Plant:
    def plant(s: Any) -> None:
        from pydrake.geometry import ProximityProperties, RoleAssign

        shape = s.world.shapes[name][-1]
        inspector = s.scene_graph.model_inspector()
        surface = ProximityProperties(inspector.GetProximityProperties(shape))
        surface.UpdateProperty("hydroelastic", "margin", 0.002)
        s.scene_graph.AssignRole(
            context=s.scene_graph.GetMyMutableContextFromRoot(s.root),
            source_id=s.plant.get_source_id(),
            geometry_id=shape,
            properties=surface,
            assign=RoleAssign.kReplace,
        )

    return plant


def drake_coupling(s: Any) -> None:
    s.plant.SetConstraintActiveStatus(s.context, s.world.couplings[0], False)


DRAKE: dict[str, Plant] = {
    "body/cube/com": drake_com,
    "body/cube/margin": drake_margin("cube"),
    "body/cube/touches": drake_ghost("cube"),
    "body/cube/dynamic": lambda s: s.world.bodies["cube"].Lock(s.context),
    "link/panda_link4/margin": drake_margin("panda_link4"),
    "link/panda_link4/touches": drake_ghost("panda_link4"),
    "gripper/coupled": drake_coupling,
}

FAULTS = {"mujoco": MUJOCO, "pybullet": PYBULLET, "sapien": SAPIEN, "dart": DART, "drake": DRAKE}

FIXED_AT_LOAD = {
    "pybullet": {
        "link/*/margin": "changeDynamics leaves the margin of a link's shapes as it is",
        "joint/*/friction": "getJointInfo tells what was loaded, whatever changeDynamics did since",
    },
    "drake": {
        "timestep": "of a plant, which is final",
        "ground/height": "the half space is anchored in the world when the plant is built",
        "body/*/gravity": "a gravity field cannot be changed once the plant is final",
        "link/*/gravity": "a gravity field cannot be changed once the plant is final",
        "body/*/damping": "no floating joint's damping can be set in a context",
    },
}
"""What cannot be changed in an engine once the world stands, by its pattern, and why."""


@pytest.fixture
def loaded(request: pytest.FixtureRequest) -> Iterator[Simulator]:
    cls = adapter(request.param)
    simulator = cls(cls.profiles["tuned"])
    simulator.load(SCENE)
    yield simulator
    simulator.close()


@pytest.mark.parametrize(
    ("loaded", "quantity"),
    [
        pytest.param(name, quantity, id=f"{name}-{quantity}")
        for name in HERE
        for quantity in FAULTS[name]
    ],
    indirect=["loaded"],
)
def test_a_change_in_the_engine_is_told(loaded: Simulator, quantity: str) -> None:
    """Of the quantity before the comma."""
    info, expected = loaded.info, expected_quantities(SCENE, loaded.settings)
    assert not compare(expected, loaded.read_back(), info.deviations, info.name).wrong
    FAULTS[info.name][quantity](loaded)
    wrong = compare(expected, loaded.read_back(), info.deviations, info.name).wrong
    assert re.match(f"scene .*, {info.name} ", wrong[quantity.partition(",")[0]])


@pytest.mark.parametrize("loaded", HERE, indirect=True)
def test_nothing_is_left_out(loaded: Simulator) -> None:
    name = loaded.info.name
    assert uncovered(loaded.read_back(), FAULTS[name], FIXED_AT_LOAD.get(name, {})) == set()
