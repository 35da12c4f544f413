"""What Drake says of the world that was built, for the parity check."""

from __future__ import annotations

from typing import Any

import numpy as np
from pytest_simbench.sims.drake_world import World

from pytest_simbench.scene import FloatArray
from pytest_simbench.simulator import PreparedRobot, lazy_import

geometry = lazy_import("pydrake.geometry")
math = lazy_import("pydrake.math")


class ReadBack:
    """Reads the quantities of `simulator.parity` from plant, shapes and `context`."""

    def __init__(self, world: World, context: Any) -> None:
        self.world = world
        self.context = context
        shapes = world.plant.get_geometry_query_input_port().Eval(context)
        self.inspector = shapes.inspector()

    def all(self) -> dict[str, Any]:
        """Every quantity by its name."""
        world, context = self.world, self.context
        ground = self.inspector.GetPoseInFrame(world.shapes["ground"][0])
        reported: dict[str, Any] = {
            "gravity": world.plant.gravity_field().gravity_vector(),
            "timestep": world.plant.time_step(),
            "ground/height": ground.translation()[2],
            "ground/friction": self._friction("ground"),
        }
        for name, body in world.bodies.items():
            pose, size = self._place(name, body)
            reported[f"body/{name}/size"] = size
            reported[f"body/{name}/pose"] = pose
            reported[f"body/{name}/friction"] = self._friction(name)
            if body.is_floating_base_body():
                inertia = body.CalcSpatialInertiaInBodyFrame(context)
                reported[f"body/{name}/mass"] = inertia.get_mass()
                moments = inertia.CalcRotationalInertia().get_moments()
                reported[f"body/{name}/inertia"] = moments
        if world.prepared is not None:
            reported |= self._robot(world.prepared)
        return reported

    def _place(self, name: str, body: Any) -> tuple[FloatArray, FloatArray]:
        """Pose (7,) of a box, and its extents along its axes (3,), spheres included [m]."""
        plant, inspector = self.world.plant, self.inspector
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        pose = plant.EvalBodyPoseInWorld(self.context, body)
        for made in self.world.shapes[name]:
            shape, place = inspector.GetShape(made), inspector.GetPoseInFrame(made)
            if body.index() == plant.world_body().index():
                pose, place = pose @ place, math.RigidTransform()
            sphere = isinstance(shape, geometry.Sphere)
            half = np.full(3, shape.radius()) if sphere else shape.size() / 2
            low = np.minimum(low, place.translation() - half)
            high = np.maximum(high, place.translation() + half)
        turn = pose.rotation().ToQuaternion().wxyz()
        return np.concatenate([pose.translation(), turn]), high - low

    def _friction(self, name: str) -> Any:
        """The one friction coefficient of all shapes of a body; all of them if they differ."""
        values = set()
        for made in self.world.shapes[name]:
            surface = self.inspector.GetProximityProperties(made)
            friction = surface.GetProperty("material", "coulomb_friction")
            values |= {friction.static_friction(), friction.dynamic_friction()}
        return values.pop() if len(values) == 1 else sorted(values)

    def _robot(self, prepared: PreparedRobot) -> dict[str, Any]:
        world, context = self.world, self.context
        coupled = world.plant.GetConstraintActiveStatus(context, world.coupling)
        reported: dict[str, Any] = {"gripper/coupled": float(coupled)}
        for name in prepared.robot.joint_names:
            joint, drive = world.joints[name], world.drives[name]
            limits = [joint.position_lower_limits()[0], joint.position_upper_limits()[0]]
            reported[f"joint/{name}/limits"] = limits
            reported[f"joint/{name}/effort_limit"] = drive.effort_limit()
            reported[f"joint/{name}/stiffness"] = drive.get_controller_gains().p
            reported[f"joint/{name}/damping"] = drive.get_controller_gains().d
            reported[f"joint/{name}/armature"] = drive.calc_reflected_inertia(context)
            reported[f"joint/{name}/initial_position"] = joint.GetOnePosition(context)
        for link in prepared.moving_links:
            inertia = world.links[link.name].CalcSpatialInertiaInBodyFrame(context)
            central = inertia.Shift(inertia.get_com()).CalcRotationalInertia()
            reported[f"link/{link.name}/mass"] = inertia.get_mass()
            reported[f"link/{link.name}/inertia"] = np.sort(central.CalcPrincipalMomentsOfInertia())
            if link.shapes:
                reported[f"link/{link.name}/friction"] = self._friction(link.name)
        return reported
