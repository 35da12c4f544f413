"""A user's scene beside a log of it: how far is what was measured from what it does?"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from pytest_simbench.client.motion import Motion
from pytest_simbench.client.world import World
from pytest_simbench.description.urdf import PreparedRobot
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import Compound, FloatArray, Pose
from pytest_simbench.tasks.base import Count, Outcome
from pytest_simbench.tasks.on_scene import OnScene
from pytest_simbench.tasks.replaying import Log

PERIOD = 2e-3
"""Between two samples of the motion [s]; the log's times lie between them. What is accelerated by
10 m/s^2 is off the line between two by 5 micrometres."""

MOST = 1000
"""Rows of a log that are held against the scene; of a longer one every second, every third, ..."""


@dataclass(frozen=True, eq=False)
class Fitting(OnScene):
    """Have a scene follow a log, and keep how far it is from what was measured at each time.

    Attributes:
        world: the scene; it starts as it is, not where the log begins.
        log: `scene_file.log(path, scene)`.
        values: of its unknowns, which `world` has already; for the record.
    """

    name: ClassVar[str] = "fitting"
    draws: ClassVar[bool] = False

    log: Log
    values: Mapping[str, float] = field(default_factory=dict)

    @property
    def metrics(self) -> tuple[Metric, ...]:
        doc = "off the log, root mean square over all times and joints or bodies"
        return tuple(
            Metric(name, f"{kind} off the log", unit=unit, better="lower", least=0, doc=doc)
            for name, kind, unit in (("off", "places", "mm"), ("turned", "angles", "deg"))
            if unit in self._units.values()
        )

    @property
    def _units(self) -> dict[str, str]:
        """By columns of the residuals: joints, and places of bodies."""
        robot = self.world.robot
        kinds = {} if robot is None else {j.name: j.kind for j in PreparedRobot(robot).joints}
        found = {name: "mm" if kinds[name] == "prismatic" else "deg" for name in self.log.joints}
        return found | {f"{name}/place": "mm" for name in self.log.start.bodies}

    def parameters(self) -> dict[str, Any]:
        own = {f"task.{name}": value for name, value in self.values.items()}
        return super().parameters() | {"task.starts": 1, "task.log": self.log.digest} | own

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        log, began = self.log, world.time
        first = Motion(np.array([began]), world.joints[None], world.bodies[None])
        with world.phase("follow"):
            if self.world.robot is None:
                rest = world.wait(log.trajectory.duration, log_period=PERIOD)
            else:
                rest = world.follow(log.trajectory, log_period=PERIOD)
        found = self.residuals(Motion.joined([first, rest]), began)
        metrics: dict[str, float | None] = {}
        for name, unit, factor in (("off", "mm", 1000.0), ("turned", "deg", 180 / np.pi)):
            own = [found[key].ravel() for key, of in self._units.items() if of == unit]
            if own:
                metrics[name] = factor * float(np.sqrt(np.mean(np.concatenate(own) ** 2)))
        return Outcome(metrics, {"residuals": {k: v.round(9).tolist() for k, v in found.items()}})

    def residuals(self, motion: Motion, began: float = 0.0) -> dict[str, FloatArray]:
        """Of a motion minus the log, by column, (rows, 1 or 3) [m or rad]. Of bodies their centres
        of mass; how contacts turn them is left out, which no engine repeats."""
        seen, time = self.log.seen, motion.time - began
        rows = slice(None, None, -(-len(seen["time"]) // MOST))
        at, found = seen["time"][rows], {}

        def sampled(columns: FloatArray) -> FloatArray:
            return np.transpose([np.interp(at, time, column) for column in columns.T])

        names = self.world.robot.joint_names if self.world.robot else ()
        for name in self.log.joints:
            joint = motion.joints[:, 0, [names.index(name)]]
            found[name] = sampled(joint) - seen[name][rows, None]
        for k, body in enumerate(self.world.free_bodies):
            if body.name in self.log.start.bodies:
                frame = body.file_frame if isinstance(body, Compound) else Pose()
                poses = map(Pose.from_array, seen[f"{body.name}/pose"][rows])
                logged = np.array([(pose * frame.inverse()).position for pose in poses])
                found[f"{body.name}/place"] = sampled(motion.bodies[:, k, :3]) - logged
        return found
