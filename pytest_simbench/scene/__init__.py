"""The declarative world: bodies, robot, gravity, friction, gains; frozen, in SI units."""

from pytest_simbench.scene.bodies import Box, Capsule, Compound, ConvexMesh, Cylinder, Sphere
from pytest_simbench.scene.body import Body, Solid, Wrench
from pytest_simbench.scene.checks import SceneError
from pytest_simbench.scene.penetration import penetration
from pytest_simbench.scene.polytope import Polytope, principal
from pytest_simbench.scene.pose import FloatArray, Pose, Quaternion, Vector3, rotation_matrix
from pytest_simbench.scene.robot import Closure, Coupling, Gripper, Joint, MotionLimits, Robot
from pytest_simbench.scene.scene import STANDARD_GRAVITY, Scene, Start
from pytest_simbench.scene.set_points import Trajectory

__all__ = [
    "STANDARD_GRAVITY",
    "Body",
    "Box",
    "Capsule",
    "Closure",
    "Compound",
    "ConvexMesh",
    "Coupling",
    "Cylinder",
    "FloatArray",
    "Gripper",
    "Joint",
    "MotionLimits",
    "Polytope",
    "Pose",
    "Quaternion",
    "Robot",
    "Scene",
    "SceneError",
    "Solid",
    "Sphere",
    "Start",
    "Trajectory",
    "Vector3",
    "Wrench",
    "penetration",
    "principal",
    "rotation_matrix",
]
