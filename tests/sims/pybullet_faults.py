"""Changes of a loaded world in PyBullet itself, through its client."""

from __future__ import annotations

from typing import Any

from pytest_simbench.sims.pybullet.adapter import PyBullet

from pytest_simbench.scene import Pose

from .planted import Plant, Planting


def bullet(name: str, link: str = "", **change: Any) -> Plant:
    def plant(s: Any) -> None:
        import pybullet

        body = {**s._bodies, "ground": s._ground, "robot": s._robot}[name]
        number = s._links[link] if link else -1
        pybullet.changeDynamics(body, number, physicsClientId=s.client, **change)

    return plant


def call(name: str, *arguments: Any) -> Plant:
    """A function of PyBullet called; arguments may be functions of the adapter."""

    def plant(s: Any) -> None:
        import pybullet

        given = (argument(s) if callable(argument) else argument for argument in arguments)
        getattr(pybullet, name)(*given, physicsClientId=s.client)

    return plant


HELD = (-1, -1, -1, 4, [0] * 3, [0] * 3, [0] * 3)
"""A cube's fixed joint (`JOINT_FIXED` is 4) with the world."""


def com(s: Any) -> None:
    """A cube like the other in its place, its centre of mass aside in it."""
    import pybullet

    pybullet.removeBody(s._bodies["cube"], physicsClientId=s.client)
    half = [0.025] * 3
    shape = pybullet.createCollisionShape(
        pybullet.GEOM_BOX, halfExtents=half, physicsClientId=s.client
    )
    pose = s.scene.body("cube").pose
    (w, *xyz), aside = pose.quaternion, Pose.at(-0.01, 0.0, 0.0)
    s._bodies["cube"] = pybullet.createMultiBody(
        0.1, shape, -1, (pose * aside).position, [*xyz, w],
        baseInertialFramePosition=[0.01, 0, 0], physicsClientId=s.client,
    )  # fmt: skip


def uncoupled(s: Any) -> None:
    import pybullet

    pybullet.removeConstraint(s._couplings[0], physicsClientId=s.client)
    cube = s._bodies["cube"]
    s._couplings[0] = pybullet.createConstraint(cube, *HELD, physicsClientId=s.client)


FAULTS: dict[str, Plant] = {
    "timestep": call("setTimeStep", 0.002),
    "ground/height": call(
        "resetBasePositionAndOrientation", lambda s: s._ground, [0, 0, 0.01], [0, 0, 0, 1]
    ),
    "body/wedge/margin": bullet("wedge", collisionMargin=0.005),
    "body/cube/com": com,
    "body/cube/dynamic": call("createConstraint", lambda s: s._bodies["cube"], *HELD),
    "link/panda_link4/restitution": bullet("robot", "panda_link4", restitution=0.5),
    "gripper/coupled": uncoupled,
}


class FaultyPyBullet(Planting, PyBullet):
    faults = FAULTS
