"""Changes of a loaded world in DART itself, on its bodies and joints."""

from __future__ import annotations

from typing import Any

from pytest_simbench.sims.dart.adapter import DART

from .planted import Plant, Planting


def part(s: Any, name: str) -> Any:
    if name == "ground":
        return s._ground
    return s._bodies.get(name) or s._robot.getBodyNode(name)


def bouncy(name: str) -> Plant:
    def plant(s: Any) -> None:
        shapes = [x for x in part(s, name).getShapeNodes() if x.hasDynamicsAspect()]
        shapes[-1].getDynamicsAspect().setRestitutionCoeff(0.5)

    return plant


def height(s: Any) -> None:
    import dartpy

    place = dartpy.math.Isometry3()
    place.set_translation([0, 0, 0.01])
    s._ground.getParentJoint().setTransformFromParentBodyNode(place)


def com(s: Any) -> None:
    inertia = s._bodies["cube"].getInertia()
    inertia.setLocalCOM([0.01, 0, 0])
    s._bodies["cube"].setInertia(inertia)


def uncoupled(s: Any) -> None:
    import dartpy

    finger = s._robot.getJoint("panda_finger_joint2")
    finger.setActuatorType(dartpy.dynamics.ActuatorType.PASSIVE)


def larger(s: Any) -> None:
    """Of a mesh that the process has measured in an honest world before."""
    (mesh,) = (
        x.getShape() for x in part(s, "panda_link4").getShapeNodes() if x.hasDynamicsAspect()
    )
    mesh.setScale(1.1 * mesh.getScale())


def one_of_several(s: Any) -> None:
    shapes = [x for x in part(s, "panda_leftfinger").getShapeNodes() if x.hasDynamicsAspect()]
    shapes[-1].getDynamicsAspect().setFrictionCoeff(0.3)


FAULTS: dict[str, Plant] = {
    "timestep": lambda s: s.world.setTimeStep(0.002),
    "ground/height": height,
    "body/cube/touches": lambda s: s._bodies["cube"].setCollidable(False),
    "body/cube/com": com,
    "body/cube/gravity": lambda s: s._bodies["cube"].setGravityMode(False),
    "body/cube/dynamic": lambda s: s._bodies["cube"].getSkeleton().setMobile(False),
    "link/panda_link4/restitution": bouncy("panda_link4"),
    "link/panda_link4/meshes": larger,
    "link/panda_link4/touches": lambda s: part(s, "panda_link4").setCollidable(False),
    "link/panda_link4/gravity": lambda s: part(s, "panda_link4").setGravityMode(False),
    "joint/panda_joint4/friction": lambda s: s._robot.getJoint("panda_joint4").setCoulombFriction(
        0, 0.5
    ),
    "link/panda_leftfinger/friction, one shape": one_of_several,
    "gripper/coupled": uncoupled,
}


class FaultyDART(Planting, DART):
    faults = FAULTS
